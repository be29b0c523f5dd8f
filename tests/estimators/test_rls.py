"""HysteresisRLS: parity with the textbook, convergence, offsets, delays, gaps, dwells."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.estimators.shared import TRUE, recorded
from tests.reference import hysteresis_rls as reference

FS = 50_000.0


def test_equals_the_textbook_with_gaps() -> None:
    u, x = recorded(FS, 0.75)
    x[2000] = x[5001] = x[5002] = np.nan
    estimator = pz.HysteresisRLS(FS, memory=0.1, policies=())
    theta = estimator.run(u, x).theta
    start = np.array([0.02, 0.12, 0.0036])
    given = {"uncertainty": 0.5, "noise": 1.5e-3, "memory": 0.1, "cutoff": 2500.0}
    expected = reference.coleman_hodgdon(u, x, FS, start, **given)
    np.testing.assert_allclose(theta, expected, rtol=1e-7)


@pytest.mark.parametrize(
    "estimator",
    [pz.HysteresisRLS(FS, memory=0.4, offset=True),
     pz.HysteresisEKF(FS, noise=1e-3, drift=0.0, mismatch=0.0, offset=True)],
)  # fmt: skip
@pytest.mark.slow_but_first
def test_finds_the_centre_of_the_loop(estimator: Any) -> None:
    """A unipolar voltage and a biased gauge: centre (60 V, -120 µm)."""
    u, x = recorded(FS, 5.0)
    estimator.run(u + 60.0, x - 120.0)
    np.testing.assert_allclose(estimator.theta[:3], TRUE.theta, rtol=0.03)
    model = estimator.model
    assert model.offset == pytest.approx(-120.0 - TRUE.c * 60.0, abs=0.15)
    assert np.max(np.abs(model.simulate(u + 60.0) - (x - 120.0))[u.size // 2 :]) < 0.02
    plain = pz.HysteresisRLS(FS, memory=0.4)
    plain.run(u + 60.0, x - 120.0)
    assert not np.allclose(plain.theta, TRUE.theta, rtol=0.2)


def test_high_pass_removes_a_bias_of_the_sensor() -> None:
    u = pz.signals.triangle(33.0, 5.0, 25, FS, smoothing=0.0).values
    x = TRUE.simulate(u)
    biased, passed = pz.HysteresisRLS(FS, memory=0.4), pz.HysteresisRLS(FS, memory=0.4, high_pass=0.5)
    biased.run(u, x + 2.0)
    passed.run(u, x + 2.0)
    worst = [np.abs(each.theta / TRUE.theta - 1.0).max() for each in (passed, biased)]
    assert worst[0] < 1e-3 < 0.5 < worst[1]


@pytest.mark.parametrize("delay", [0.5, 2.5, 3.0])
@pytest.mark.slow_but_first
def test_delay(delay: float) -> None:
    u, x = recorded(FS, 5.0, 0.0)
    late = np.interp(np.arange(x.size) - delay, np.arange(x.size), x)
    estimator = pz.HysteresisRLS(FS, memory=0.4, delay=delay)
    estimator.run(u, late)
    np.testing.assert_allclose(estimator.theta, TRUE.theta, rtol=2e-3)
    untold = pz.HysteresisRLS(FS, memory=0.4)
    untold.run(u, late)
    errors = [np.abs(each.theta / TRUE.theta - 1.0).max() for each in (estimator, untold)]
    assert errors[0] < 0.5 * errors[1]


def test_long_gap_starts_anew() -> None:
    u, x = recorded(FS, 10.0, 0.0)
    x[30_000:52_345] = np.nan
    estimator = pz.HysteresisRLS(FS, memory=0.4)
    estimator.run(u, x)
    np.testing.assert_allclose(estimator.theta, TRUE.theta, rtol=1e-3)
