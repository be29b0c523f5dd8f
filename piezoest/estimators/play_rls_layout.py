"""Where `PrandtlIshlinskiiRLS` keeps what, in one vector of state and one of configuration."""

from __future__ import annotations

from typing import Any

from piezoest.equations.turning_points import SIZE as MEMORY_SIZE
from piezoest.estimators import believing, swing

# State: counters, what the last sample was, the window at hand.
SAMPLES, MISSED, OUTLIERS, UPDATES, HELD, RESETS, LAST, FROZEN, PRIMED = range(9)
INNOVATION, VARIANCE, U_LAST, ELAPSED, COUNT, TRAVEL, X_SUM, OFFSET = range(9, 17)
X_LAST, GAP, GAP_TRAVEL = range(17, 20)
# The grid: its middle and half-width [V], the range seen, turns of the voltage.
CENTRE, RANGE, LOW, HIGH, TURNS, BELIEF = range(20, 26)
SWING = BELIEF + believing.STATE
MEMORY = SWING + swing.STATE
ARRAYS = MEMORY + MEMORY_SIZE  # where the arrays begin, see `lay_out`

# Configuration: sizes, scales, tuning; then where the arrays of the state begin.
N, PLAYS, BENDS, TERMS, GAIN, NOISE, FRACTION, FIRST_HALF, FIXED, LONGEST_GAP = range(10)
SLACK, LEVEL_TRAVEL, LEVEL_TIME, COMMON_WALK, SINGLE_WALK, WINDOWS, LEAST, INERT = range(10, 18)
AT = 18  # first of each array of the state
Y, Z, PHI, SUM, WAY, SEGMENTS, THETA, P, WORK, OLD, THRESHOLDS, EDGES = range(AT, AT + 12)
USED, FORCE, MOTION = range(AT + 12, AT + 15)
# By slope, beside its play in Y: the play's threshold, the ends of its segment, what zero has of it.
REACH, LOWER, UPPER, ZERO, LINE = range(AT + 15, AT + 20)
# The first of each array of the configuration: relative thresholds and bends, creep decays, prior,
# and the mechanics' coefficients.
RELATIVE, RELATIVE_BENDS, DECAYS, PRIOR, SPREAD, MECHANICS = range(AT + 20, AT + 26)
CONFIG = AT + 26


def lay_out(config: Any, n: int, k: int, m: int, line: int) -> int:
    """Write sizes and places into the configuration; return the length of the state."""
    slopes = (n + 1) * (k + 1)
    total = slopes + m + 1
    config[N], config[PLAYS], config[BENDS], config[TERMS] = total, n, k, m
    sizes = {Z: m, P: total * total, THRESHOLDS: n, EDGES: k + 2, MOTION: 2, LINE: line}
    sizes |= dict.fromkeys((PHI, SUM, THETA, WORK, USED, FORCE), total)
    place = ARRAYS
    for name in range(Y, LINE + 1):
        config[name] = place
        place += sizes.get(name, slopes)
    place_in_config = CONFIG
    for name, size in zip(range(RELATIVE, MECHANICS + 1), (n, k, m, total * total, total, 6), strict=True):
        config[name] = place_in_config
        place_in_config += size
    return place
