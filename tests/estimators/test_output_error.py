"""OutputErrorRLS: exact on its own plant from any start, noise, rest."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import piezoest as pz
from tests.estimators.shared import TRUE, recorded

FloatArray = NDArray[np.float64]

RATE = 2000.0


def voltage(periods: float = 8.0) -> FloatArray:
    return pz.signals.triangle(33.0, 5.0, periods, RATE).values


def loop_error(model: pz.ColemanHodgdon, u: FloatArray, offset: float = 0.0) -> float:
    return float(np.abs(model.simulate(u) - TRUE.simulate(u) - offset)[-400:].max())


@pytest.mark.parametrize("factors", [(1.0, 1.0, 1.0), (0.6, 1.0, 0.7), (1.5, 0.8, 1.3)])
def test_recovers_the_loop_from_any_start(factors: tuple[float, float, float]) -> None:
    # The loop is within 1.2 % of its amplitude after two periods; telling decay and slopes apart takes time.
    u = voltage(80.0)
    start = pz.ColemanHodgdon(*(TRUE.theta * factors).tolist()).nearest_admissible(1e-3)
    estimator = pz.OutputErrorRLS(RATE, initial_model=start, noise=1e-6)
    x = TRUE.simulate(u)
    estimator.run(u[: u.size // 40], x[: u.size // 40])
    assert loop_error(estimator.model, u) < 0.06
    estimator.run(u[u.size // 40 :], x[u.size // 40 :])
    np.testing.assert_allclose(estimator.theta[:3], TRUE.theta, rtol=0.02)
    assert loop_error(estimator.model, u) < 1e-3


def test_finds_an_offset() -> None:
    u = voltage(20.0)
    estimator = pz.OutputErrorRLS(RATE)
    x = TRUE.simulate(u) + 0.8
    # A start that fits, then a level that shifts as after a larger loop.
    estimator.run(u[:4000], x[:4000])
    estimator.run(u[4000:], x[4000:] + 0.3 * np.minimum(np.arange(u.size - 4000) / 100.0, 1.0))
    assert loop_error(estimator.model, u, 1.1) < 0.02


@pytest.mark.parametrize("noise", [1e-3, 3e-2])
def test_noise_makes_no_wrong_loop(noise: float) -> None:
    u, x = recorded(RATE, 40.0, noise)
    estimator = pz.OutputErrorRLS(RATE)
    theta = estimator.run(u, x).theta[u.size // 2 :].mean(axis=0)
    # Noise leaves the decay itself uncertain, not the slope of a first branch.
    assert theta[1] == pytest.approx(TRUE.beta, rel=0.05)
    assert loop_error(estimator.model, u) < 5e-3 + 2.0 * noise


def test_rest_moves_nothing() -> None:
    u = voltage(6.0)
    x = TRUE.simulate(u)
    estimator = pz.OutputErrorRLS(RATE)
    estimator.run(u, x)
    before, held = estimator.theta, estimator.status.held
    creep = 0.1 * np.linspace(0.0, 1.0, 20_000)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(creep.size)
    estimator.run(np.full(creep.size, u[-1]), x[-1] + creep + noise)
    np.testing.assert_array_equal(estimator.theta, before)
    assert (estimator.status.held, estimator.status.last) == (held + creep.size, "held")


def test_settles_within_two_periods_from_a_bad_start() -> None:
    fs, start = 10_000.0, pz.ColemanHodgdon(0.014, 0.2, 0.0054).nearest_admissible(1e-3)
    compensator = pz.InverseCompensator(start, transfer_samples=100)
    parts: Any = {"compensator": compensator, "estimator": pz.OutputErrorRLS(fs, initial_model=start)}
    reference, stage = pz.signals.triangle(5.0, 5.0, 8.0, fs), pz.PaperStage(sample_rate=fs, seed=0)
    record = pz.track(reference, stage=stage, **parts, update_interval=10)
    assert np.abs(record.error)[4000:].max() < 0.06
