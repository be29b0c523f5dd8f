"""A bank of estimators is so many single ones; streaming keeps nothing."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.estimators.shared import TRUE

RATE = 50_000.0


def records(K: int, N: int) -> tuple[Any, Any]:
    """Voltages and displacements of N stages; some miss one or the other now and then, or for long."""
    rng, t = np.random.default_rng(0), np.arange(K)[:, None] / RATE
    u = np.ascontiguousarray(20.0 * np.sin(2 * np.pi * (40.0 + np.arange(N)) * t))
    x = np.column_stack([TRUE.simulate(u[:, c].copy()) for c in range(N)])
    x += 1e-3 * rng.standard_normal(x.shape)
    x[rng.random(K) < 0.05, 1] = np.nan
    u[rng.random(K) < 0.02, 2 % N] = np.inf
    x[K // 3 : K // 2, 3 % N] = np.nan
    return u, x


@pytest.mark.parametrize(
    "estimator",
    [
        pz.HysteresisRLS(RATE),
        pz.HysteresisRLS(RATE, memory=0.4, errors=False, delay=0.5),
        pz.HysteresisEKF(RATE, offset=True, delay=1.5),
        pz.OutputErrorRLS(RATE, members=9),
        pz.PrandtlIshlinskiiRLS(RATE, thresholds=4, delay=0.5),
    ],
)
@pytest.mark.slow_but_first
def test_each_channel_is_a_single_estimator(estimator: Any) -> None:
    N, threads = 5, 1 if isinstance(estimator, pz.HysteresisEKF) else 3
    u, x = records(1500, N)
    bank = pz.EstimatorBank(estimator, N, threads=threads)
    theta = bank.run(u[:-3], x[:-3], every=7)
    after_run = [bank.channel(c).to_dict() for c in range(N)]
    for k in (-3, -2, -1):
        bank.step(u[k], x[k])
    for c in range(N):
        single = estimator.copy()
        trace = single.run(u[:-3, c].copy(), x[:-3, c].copy(), every=7)
        np.testing.assert_array_equal(theta[:, c], trace.theta)
        assert after_run[c] == single.to_dict()
        single.run(u[-3:, c].copy(), x[-3:, c].copy())
        np.testing.assert_array_equal(bank.theta[c], single.theta)
        assert (bank.models[c], bank.status[c]) == (single.model, single.status)
        assert bank.channel(c).to_dict() == single.to_dict()
    bank.reset()
    np.testing.assert_array_equal(bank.theta[0], estimator.theta)


def test_a_channel_without_a_number_is_missing_and_stops_no_other() -> None:
    plain, listed, masked = (pz.EstimatorBank(pz.HysteresisRLS(RATE), 3) for _ in range(3))
    for k in range(12):
        u, x = [0.1 * k, 0.2 * k, 0.3 * k], [0.01 * k, 0.02 * k, 0.03 * k]
        plain.step([u[0], np.nan, u[2]], [np.nan, x[1], x[2]])
        odd: Any = ("error", np.ma.masked, 1j, 10**400, [], None)[k % 6]
        listed.step([u[0], odd, np.array([u[2]])], np.array([None, x[1], (x[2],)], object))
        hidden: Any = np.ma.array(x, mask=[True, False, False])
        masked.step(np.ma.array(u, mask=[False, True, False]), hidden)
    assert plain.status[0].missing == 12
    for bank in (listed, masked):
        assert bank.status == plain.status
        np.testing.assert_array_equal(bank.theta, plain.theta)
    u, x = records(30, 3)
    gaps = np.zeros(u.shape, bool)
    gaps[5, 1] = gaps[9] = True
    plain.run(u, np.where(gaps, np.nan, x))
    masked.run(u, np.ma.array(np.where(gaps, 1e3, x), mask=gaps))
    np.testing.assert_array_equal(masked.theta, plain.theta)
