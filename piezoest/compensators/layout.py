"""Where things stand in a compensator's flat state and configuration."""

from __future__ import annotations

from piezoest.compensators import corridor
from piezoest.equations import recent_path, turning_points

# State: last voltage, its w_h, what the last change of model still owes [µm], counters, the
# voltage's recent path, its turning points not wiped out, and the corridor; play states and creep states
# follow where the model has any.
VOLTAGE, W_H, OWED, SAMPLES, SATURATED, SLEWED, MISSED, LIMITED_NOW, PATH = range(9)
MEMORY = PATH + recent_path.SIZE
CORRIDOR = MEMORY + turning_points.SIZE
STATE = CORRIDOR + corridor.SIZE
# Configuration; what else a Prandtl-Ishlinskii model needs follows.
A, B, C, OFFSET, MINIMUM, MAXIMUM, LARGEST_STEP, DECAY, INTEGRATED, BY_PATH, CONFIG = range(11)
