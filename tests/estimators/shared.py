"""The stage that tests of estimators learn, its record, a start that is off, and what must always hold."""

from typing import Any

import numpy as np

import piezoest as pz

TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)


def recorded(
    rate: float, periods: float, noise: float = 1e-3, seed: int = 0, model: Any = TRUE, **given: Any
) -> tuple[Any, Any]:
    """Voltage, a triangle at 5 Hz, and displacement with white noise [µm]."""
    u = pz.signals.triangle(given.pop("volts", 33.0), 5.0, periods, rate).values
    return u, model.simulate(u, **given) + noise * np.random.default_rng(seed).standard_normal(u.size)


def assert_finite(estimator: Any) -> None:
    """Nothing visible is NaN or infinite, and the model can be inverted."""
    for name in ("theta", "P", "y", "S", "K", "standard_errors"):
        values = np.asarray(getattr(estimator, name))
        assert np.all(np.isfinite(values)), (name, values)
    model = estimator.model
    assert np.all(np.isfinite([*model.theta, model.offset])), model
    assert model.is_admissible, model
