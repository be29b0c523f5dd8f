"""The benchmark suite: `piezoest bench`."""
