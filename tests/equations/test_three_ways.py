"""An equation is one function: NumPy, Numba and CasADi give the same numbers, results and states alike."""

import copy
from types import SimpleNamespace
from typing import Any

import casadi
import numpy as np
import pytest
from numba import njit

import piezoest as pz
from piezoest import symbolic
from piezoest.equations import coleman_hodgdon as ch
from piezoest.equations import kalman, play
from piezoest.equations import least_squares as ls
from piezoest.equations.creep import creep_step
from piezoest.equations.mechanics import mechanics_coefficients, mechanics_step

THRESHOLDS, WEIGHTS = np.array([0.5, 2.0, 5.0, 11.0]), np.array([0.03, -0.01, 0.02, 0.04])
GAINS, DECAYS = np.array([0.01, 0.02, 0.005]), np.array([0.9, 0.99, 0.999])
RESONANCE = np.array(mechanics_coefficients(780.0, 0.02, 2e-5))
PLAYS = (np.array([-0.2, 3.0, 0.0, -4.0]), 9.0, 0.1, THRESHOLDS, WEIGHTS)
ROOT = np.random.default_rng(0).normal(size=(4, 4))
P, THETA = ROOT @ ROOT.T + 0.1 * np.eye(4), np.array([0.4, 0.021, 0.057, 0.204])
PHI, FACE = np.array([0.9, -0.2, 0.3, 0.5]), np.array([0.0, 0.0, -2.0, 1.0])
GAIN, ROOM = np.array([0.1, 0.2, 0.3, 0.4]), np.zeros(4)


def predicted(P: Any, row: Any, noise: Any) -> None:
    kalman.predict_covariance(P, row, 4, noise)


def continuous(theta: Any, P: Any, phi: Any, theta_rate: Any, P_rate: Any) -> Any:
    rates = SimpleNamespace(theta=theta_rate, P=P_rate)
    y, S = ls.continuous_step(theta, P, phi, 0.7, 0.02, 0.7, 1.0, rates)
    ls.continuous_correction(theta, P, 0.02, 50.0, rates)
    return y, S


# They make arrays, and are compiled for records only: test_least_squares.py and test_ekf.py test that.
FOR_RECORDS = (predicted, kalman.correct, kalman.project, continuous)


def flat(results: Any, arguments: Any) -> list[Any]:
    """What a function returns, and what its arrays then hold."""
    found = list(results) if isinstance(results, tuple) else [results] * (results is not None)
    return found + [number for each in arguments if isinstance(each, np.ndarray) for number in each.ravel()]


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        (ch.rate, (0.8, 20.0, -3.0, 0.02, 0.15, 0.004)),
        (ch.hysteresis_step, (0.8, -3.0, 0.02, 0.05)),
        (ch.hysteresis_step, (0.8, 0.0, 0.02, 0.05)),
        (ch.inverse_rate, (0.8, -3.0, 0.02, 0.05, 0.2)),
        (ch.inverse_increment, (0.8, 1.5, 0.02, 0.05, 0.2)),
        (ch.inverse_increment, (-0.8, 0.0, 0.02, 0.05, 0.2)),
        (ch.relative_decay, (1e-3,)),
        (ch.loop_parameters, (0.021, 0.147, 0.00429)),
        (creep_step, (np.array([0.1, -0.2, 0.3]), -3.0, GAINS, DECAYS)),
        (mechanics_step, (np.array([4.0, -30.0]), 2.5, RESONANCE)),
        (play.prandtl_ishlinskii_step, PLAYS),
        (play.prandtl_ishlinskii_inverse, PLAYS),
        (predicted, (P, PHI, GAIN)),
        (kalman.innovation_variance, (P, PHI, 0.04, ROOM)),
        (kalman.correct, (THETA, P, PHI, 0.7, 0.04, 3.0, ROOM, GAIN)),
        (kalman.project, (THETA, P, FACE, 0.5)),
        (kalman.project, (THETA, P, FACE, -0.5)),
        (kalman.bilinear_variance, (P, -2.0, 0.02)),
        (ls.innovation, (THETA, P, PHI, 0.7, ROOM)),
        (ls.discrete_correction, (THETA, P, 0.7, 3.0, 0.98, 0.04, 50.0, GAIN)),
        (ls.directional_correction, (THETA, P, 0.7, 3.0, 0.98, 0.04, 50.0, GAIN)),
        (continuous, (THETA, P, PHI, ROOM, np.zeros((4, 4)))),
    ],
)
def test_functions_agree(function: Any, arguments: tuple[Any, ...]) -> None:
    plain, machine, traced = copy.deepcopy(arguments), copy.deepcopy(arguments), []
    expected = flat(function(*plain), plain)
    if function not in FOR_RECORDS:
        np.testing.assert_allclose(flat(njit(function)(*machine), machine), expected, rtol=1e-14)
        np.testing.assert_array_equal(flat(None, machine), flat(None, plain))
    symbols = [casadi.SX.sym("v", np.size(each)) for each in arguments]
    for made, each in zip(symbols, arguments, strict=True):
        parts = np.array(casadi.vertsplit(made), dtype=object)
        traced.append(parts.reshape(each.shape) if isinstance(each, np.ndarray) else made)
    outputs = casadi.vertcat(*flat(function(*traced), traced))
    run = casadi.Function("f", [casadi.vertcat(*symbols)], [outputs])
    by_symbols = run(np.concatenate([np.ravel(each) for each in arguments])).full()[:, 0]
    np.testing.assert_allclose(by_symbols, expected, rtol=1e-13, atol=1e-16)


@pytest.mark.parametrize("samples", [1, 50, 1777])
@pytest.mark.parametrize("sensitive", [True, False])
def test_simulation_is_that_of_the_model(samples: int, sensitive: bool) -> None:
    """Of blocks, parts of blocks and single samples, with a dwell."""
    model = pz.ColemanHodgdon(0.021, 0.147, 0.00429, 0.3)
    u = pz.signals.triangle(33.0, 5.0, 5.0, 2000.0).values[:samples].copy()
    u[30:45] = u[30:31]
    p, s = np.array([model.a, model.b, model.c, model.offset]), np.array([-0.4])
    run = symbolic.simulation(pz.ColemanHodgdon, 3).run(u, p, s, np.empty(0), sensitive=sensitive)
    x = model.simulate(u, initial_state=-0.4, allow_jumps=True)
    np.testing.assert_allclose(run.x, x, rtol=0.0, atol=1e-12)
    assert run.end[0] == pytest.approx(x[-1] - model.c * u[-1] - model.offset, abs=1e-12)


@pytest.mark.parametrize("H", [np.diag([1.0, -1.0]), np.full((2, 2), np.nan)])
def test_a_program_without_an_optimum_is_refused(H: Any) -> None:
    with pytest.raises(np.linalg.LinAlgError, match="no solver ends"):
        symbolic.quadratic_program(H, np.ones(2), np.zeros(2))
