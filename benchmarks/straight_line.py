"""The straight line alone, as a controller of `piezoest bench safety`.

It has a file of its own: when that changes, its finished runs count no more.

cd benchmarks; piezoest bench safety --controller straight_line:straight_line --show SEED
"""

from __future__ import annotations

import piezoest as pz


def straight_line(sample_rate: float, limits: pz.VoltageLimits) -> pz.AdaptiveFeedforward:
    """A controller that learns a line, and no hysteresis."""
    return pz.AdaptiveFeedforward(sample_rate, limits=limits, estimators=())
