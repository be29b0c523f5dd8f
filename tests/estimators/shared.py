"""The stage that tests of estimators learn, and its record."""

from typing import Any

import numpy as np

import piezoest as pz

TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)


def recorded(
    rate: float, periods: float, noise: float = 1e-3, seed: int = 0, model: Any = TRUE, **given: Any
) -> tuple[Any, Any]:
    """Voltage, a triangle at 5 Hz, and displacement with white noise [µm]."""
    u = pz.signals.triangle(given.pop("volts", 33.0), 5.0, periods, rate).values
    return u, model.simulate(u, **given) + noise * np.random.default_rng(seed).standard_normal(u.size)
