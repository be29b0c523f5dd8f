"""Where things stand in a compensator's flat state and configuration."""

from __future__ import annotations

from piezoest.equations import turning_points

# State: last voltage, its w_h, what the last change of model still owes [µm], counters, the
# voltage's turning points; play states and creep states follow where the model has any.
VOLTAGE, W_H, OWED, SAMPLES, SATURATED, SLEWED, MISSED, LIMITED_NOW, MEMORY = range(9)
STATE = MEMORY + turning_points.SIZE
# Configuration; what else a Prandtl-Ishlinskii model needs follows.
A, B, C, OFFSET, MINIMUM, MAXIMUM, LARGEST_STEP, DECAY, INTEGRATED, KEEP_AMPLITUDE, CONFIG = range(11)
