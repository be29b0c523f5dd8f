"""From voltage and displacement to a model."""
