"""OutputErrorRLS: exact on its own plant from any start, noise, rest."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.estimators.shared import TRUE, recorded

RATE = 2000.0


def loop_error(estimator: Any, offset: float = 0.0) -> float:
    u, x = recorded(RATE, 8.0, 0.0)
    return float(np.abs(estimator.model.simulate(u) - x - offset)[-400:].max())


@pytest.mark.parametrize("factors", [(1.0, 1.0, 1.0), (0.6, 1.0, 0.7), (1.5, 0.8, 1.3)])
def test_recovers_the_loop_from_any_start(factors: tuple[float, float, float]) -> None:
    # The loop is within 1.2 % of its amplitude after two periods; telling decay and slopes apart takes time.
    u, x = recorded(RATE, 80.0, 0.0)
    start = pz.ColemanHodgdon(*(TRUE.theta * factors).tolist()).nearest_admissible(1e-3)
    estimator = pz.OutputErrorRLS(RATE, initial_model=start, noise=1e-6)
    estimator.run(u[:800], x[:800])
    assert loop_error(estimator) < 0.06
    estimator.run(u[800:], x[800:])
    np.testing.assert_allclose(estimator.theta[:3], TRUE.theta, rtol=0.02)
    assert loop_error(estimator) < 1e-3


def test_finds_an_offset() -> None:
    u, x = recorded(RATE, 20.0, 0.0)
    estimator = pz.OutputErrorRLS(RATE)
    # A start that fits, then a level that shifts as after a larger loop.
    estimator.run(u, x + 0.8 + 0.3 * np.clip((np.arange(u.size) - 4000) / 100.0, 0.0, 1.0))
    assert loop_error(estimator, 1.1) < 0.02


@pytest.mark.parametrize("noise", [1e-3, 3e-2])
def test_noise_makes_no_wrong_loop(noise: float) -> None:
    u, x = recorded(RATE, 40.0, noise)
    estimator = pz.OutputErrorRLS(RATE)
    theta = estimator.run(u, x).theta[u.size // 2 :].mean(axis=0)
    # Noise leaves the decay itself uncertain, not the slope of a first branch.
    assert theta[1] == pytest.approx(TRUE.beta, rel=0.05)
    assert loop_error(estimator) < 5e-3 + 2.0 * noise


def test_rest_moves_nothing() -> None:
    u, x = recorded(RATE, 6.0, 0.0)
    estimator = pz.OutputErrorRLS(RATE)
    estimator.run(u, x)
    before, held = estimator.theta, estimator.status.held
    creep = 0.1 * np.linspace(0.0, 1.0, 20_000)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(creep.size)
    estimator.run(np.full(creep.size, u[-1]), x[-1] + creep + noise)
    np.testing.assert_array_equal(estimator.theta, before)
    assert (estimator.status.held, estimator.status.last) == (held + creep.size, "held")
