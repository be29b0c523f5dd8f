"""Do estimators know what they do not know? Their errors against their own standard errors.

For a consistent filter the errors lie within three standard errors, the normalised estimation error squared
(NEES) has the mean n, the normalised innovation squared (NIS) the mean 1. Y. Bar-Shalom, X. R. Li,
T. Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), sec. 5.4.
"""

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import piezoest as pz
from tests.estimators.shared import TRUE

FS, NOISE = 5000.0, 1e-3
SURE: dict[str, Any] = {"noise": NOISE, "drift": 0.0, "mismatch": 0.0}


class Outcome:
    """Of so many runs: mean errors said, scatter and bias of theta; of each run NEES and NIS."""

    def __init__(self, kind: Any, runs: int, rate: float = FS, **options: Any) -> None:
        u = pz.signals.triangle(33.0, 5.0, 10.0, rate).values
        x, settled, rows = TRUE.simulate(u), u.size // 4, []
        for seed in range(runs):
            estimator, noise = kind(rate, **options), np.random.default_rng(seed).standard_normal(u.size)
            trace = estimator.run(u, x + NOISE * noise, record=("y", "S"))
            error = estimator.theta[:3] - TRUE.theta
            nees = error @ np.linalg.solve(estimator.P[:3, :3], error)
            nis = np.mean(trace.y[settled:] ** 2 / trace.S[settled:])
            rows.append((error, estimator.standard_errors[:3], nees, nis))
        errors, said, self.nees, self.nis = (np.array(column) for column in zip(*rows, strict=True))
        self.said, self.scatter = said.mean(axis=0), errors.std(axis=0)
        self.bias = np.abs(errors.mean(axis=0))
        # Every parameter lies within three standard errors, but for one run in twenty.
        assert np.mean(np.all(np.abs(errors) < 3.0 * said, axis=1)) >= 0.95

    def assert_chi_squared(self) -> None:
        """The mean of so many chi-squared numbers lies within its 95 % band."""
        low, high = chi2.ppf([0.025, 0.975], 3 * self.nees.size) / self.nees.size
        assert low < np.mean(self.nees) < high


def test_ekf_of_a_true_plant() -> None:
    found = Outcome(pz.HysteresisEKF, 200, **SURE)
    found.assert_chi_squared()
    assert abs(np.mean(found.nis) - 1.0) < 1.96 * np.sqrt(2.0 / 7500 / 200)
    # The errors are those that it says, not only within them, and are not biased.
    np.testing.assert_allclose(found.said, found.scatter, rtol=0.1)
    assert np.all(found.bias < 3.0 * found.scatter / np.sqrt(200))


# Where linearisation alone would claim errors too small by a factor of a thousand.
FAR = [(0.5, 0.5, 1.5), (1.5, 0.5, 0.5), (0.5, 0.5, 0.5), (1.5, 1.5, 1.5)]
STARTS = [pz.ColemanHodgdon.from_loop(*(np.array(each) * [TRUE.a, TRUE.b, TRUE.c])) for each in FAR]


@pytest.mark.parametrize(
    ("kind", "rate", "options"),
    [
        *((pz.HysteresisEKF, FS, {"initial_model": start, **SURE}) for start in STARTS),
        (pz.BatchFit, 250.0, {}),
        pytest.param(pz.FilterPyEKF, 250.0, SURE, marks=pytest.mark.slow),
        pytest.param(pz.FilterPyUKF, 250.0, SURE, marks=pytest.mark.slow),
    ],
)
def test_from_a_far_start_of_a_whole_record_and_on_filterpy(kind: Any, rate: float, options: Any) -> None:
    Outcome(kind, 40, rate, **options).assert_chi_squared()


def test_moving_horizon() -> None:
    found = Outcome(pz.MovingHorizon, 50, 500.0, noise=NOISE, hop=0.35)
    np.testing.assert_allclose(found.said, found.scatter, rtol=0.2)
    assert np.all(found.bias < 0.5 * found.scatter)


def test_rls_with_a_memory() -> None:
    """Differenced, low-passed noise is coloured: P alone says errors 30 times too large."""
    found = Outcome(pz.HysteresisRLS, 200, memory=0.4, noise=NOISE)
    np.testing.assert_allclose(found.said, found.scatter, rtol=0.1)
    assert np.all(found.bias < 0.3 * found.scatter)
    assert np.mean(found.nis) == pytest.approx(1.0, abs=0.01)
