"""An equation is one function: NumPy, Numba and CasADi give the same numbers, results and states alike."""

from typing import Any

import numpy as np
import pytest
from numba import njit

from piezoest import symbolic
from piezoest.equations import coleman_hodgdon as ch
from piezoest.equations import play
from piezoest.equations.creep import creep_step
from piezoest.equations.mechanics import mechanics_coefficients, mechanics_step

THRESHOLDS, WEIGHTS = np.array([0.5, 2.0, 5.0, 11.0]), np.array([0.03, -0.01, 0.02, 0.04])
GAINS, DECAYS = np.array([0.01, 0.02, 0.005]), np.array([0.9, 0.99, 0.999])
RESONANCE = np.array(mechanics_coefficients(780.0, 0.02, 2e-5))
PLAYS = (np.array([-0.2, 3.0, 0.0, -4.0]), 9.0, 0.1, THRESHOLDS, WEIGHTS)


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        (ch.rate, (0.8, 20.0, -3.0, 0.02, 0.15, 0.004)),
        (ch.hysteresis_rate, (0.8, -3.0, 0.02, 0.05)),
        (ch.hysteresis_step, (0.8, -3.0, 0.02, 0.05)),
        (ch.hysteresis_step, (0.8, 0.0, 0.02, 0.05)),
        (ch.branch, (12.0, 10.0, 1.2, 0.02, 0.15, 0.004)),
        (ch.inverse_rate, (0.8, -3.0, 0.02, 0.05, 0.2)),
        (ch.inverse_increment, (0.8, 1.5, 0.02, 0.05, 0.2)),
        (ch.inverse_increment, (-0.8, 0.0, 0.02, 0.05, 0.2)),
        (ch.relative_decay, (1e-3,)),
        (ch.loop_parameters, (0.021, 0.147, 0.00429)),
        (creep_step, (np.array([0.1, -0.2, 0.3]), -3.0, GAINS, DECAYS)),
        (mechanics_step, (np.array([4.0, -30.0]), 2.5, RESONANCE)),
        (play.prandtl_ishlinskii_step, PLAYS),
        (play.prandtl_ishlinskii_inverse, PLAYS),
    ],
)
def test_numpy_numba_and_casadi_agree(function: Any, arguments: tuple[Any, ...]) -> None:
    def copies() -> list[Any]:
        return [np.copy(each) if np.ndim(each) else each for each in arguments]

    def with_state(*given: Any) -> tuple[Any, ...]:
        results = function(*given)
        state = given[0] if isinstance(given[0], list) else ()
        return (*results, *state) if isinstance(results, tuple) else (results, *state)

    plain, machine = copies(), copies()
    expected = np.atleast_1d(function(*plain))
    np.testing.assert_allclose(np.atleast_1d(njit(function)(*machine)), expected, rtol=1e-14)
    np.testing.assert_array_equal(machine[0], plain[0])
    traced = symbolic.trace(with_state, *(np.size(each) if np.ndim(each) else 0 for each in arguments))
    expected = np.append(expected, plain[0]) if np.ndim(plain[0]) else expected
    np.testing.assert_allclose(traced(*arguments).full()[:, 0], expected, rtol=1e-13, atol=1e-16)
