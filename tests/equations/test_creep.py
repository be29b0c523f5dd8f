"""Creep as first-order terms."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
import pytest
from numba import njit
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from piezoest.equations.creep import creep_step

GAINS = np.array([0.01, 0.02, 0.005])
TIME_CONSTANTS = np.array([0.01, 0.1, 1.0])
SAMPLE_RATE = 1000.0
DECAYS = np.exp(-1.0 / (SAMPLE_RATE * TIME_CONSTANTS))


def record(w: Any) -> Any:
    z = np.zeros(3)
    return np.array([creep_step(z, value, GAINS, DECAYS) for value in w])


def test_is_the_held_first_order_filter() -> None:
    w = np.random.default_rng(0).standard_normal(400)
    expected = sum(lfilter([g * (1.0 - d)], [1.0, -d], w) for g, d in zip(GAINS, DECAYS, strict=True))
    np.testing.assert_allclose(record(w), expected, atol=1e-14)


def test_solves_the_differential_equation() -> None:
    w = np.array([1.0, 3.0, -2.0, 0.5])
    z = np.zeros(3)
    for value in w:
        solution = solve_ivp(
            lambda t, z, value=value: (GAINS * value - z) / TIME_CONSTANTS,
            (0.0, 1.0 / SAMPLE_RATE), z, rtol=1e-12, atol=1e-15,
        )  # fmt: skip
        z = solution.y[:, -1]
    assert record(w)[-1] == pytest.approx(z.sum(), abs=1e-12)


def test_step_response_rises_with_the_logarithm_of_time() -> None:
    """Equal gains, a decade apart: equal rises in the decades between the time constants."""
    z, gains = np.zeros(5), np.full(5, 0.01)
    decays = np.exp(-1.0 / (SAMPLE_RATE * np.geomspace(0.01, 100.0, 5)))
    x = np.array([creep_step(z, 1.0, gains, decays) for _ in range(30_000)])
    first, second = x[3000] - x[300], x[29_999] - x[3000]
    assert first == pytest.approx(0.01, rel=0.05)
    assert second == pytest.approx(0.01, rel=0.05)


def test_numpy_numba_and_casadi_agree() -> None:
    casadi.GlobalOptions.setNumpyMode(1)
    z, w = casadi.SX.sym("z", 3), casadi.SX.sym("w")
    after = np.array(casadi.vertsplit(z), dtype=object)
    x = creep_step(after, w, GAINS, DECAYS)
    symbolic = casadi.Function("f", [z, w], [x, casadi.vertcat(*after)])
    plain, jitted, traced = np.zeros(3), np.zeros(3), np.zeros(3)
    compiled = njit(creep_step)
    for value in (1.0, -3.0, 2.5):
        expected = creep_step(plain, value, GAINS, DECAYS)
        assert compiled(jitted, value, GAINS, DECAYS) == expected
        by_casadi, state = symbolic(traced, value)
        traced = np.array(state).ravel()
        assert float(by_casadi) == pytest.approx(expected, rel=1e-14)
