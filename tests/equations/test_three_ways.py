"""An equation is one function: NumPy, Numba and CasADi give the same numbers, results and states alike."""

from types import SimpleNamespace
from typing import Any

import casadi
import numpy as np
import pytest
from numba import njit

import piezoest as pz
from piezoest import symbolic
from piezoest.compile import Record, compiled
from piezoest.equations import coleman_hodgdon as ch
from piezoest.equations import kalman, play
from piezoest.equations import least_squares as ls
from piezoest.equations.creep import creep_step
from piezoest.equations.mechanics import mechanics_coefficients, mechanics_step
from piezoest.layout import NUMBER, Named, Numbers, leaves, new, numbers, record
from piezoest.layout import Record as Layout

THRESHOLDS, WEIGHTS = np.array([0.5, 2.0, 5.0, 11.0]), np.array([0.03, -0.01, 0.02, 0.04])
GAINS, DECAYS = np.array([0.01, 0.02, 0.005]), np.array([0.9, 0.99, 0.999])
RESONANCE = np.array(mechanics_coefficients(780.0, 0.02, 2e-5))
PLAYS = (np.array([-0.2, 3.0, 0.0, -4.0]), 9.0, 0.1, THRESHOLDS, WEIGHTS)


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
    ],
)
def test_functions_of_numbers(function: Any, arguments: tuple[Any, ...]) -> None:
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


RATES = record(theta=numbers(4), P=numbers(4, 4))
MORE: Any = {name: numbers(4) for name in ("theta", "h", "gain", "product")}
CASE = record(z=NUMBER, y=NUMBER, P=numbers(4, 4), rates=RATES, **MORE)
ROOT = np.random.default_rng(0).normal(size=(4, 4))


@compiled
def predicted(case: Record) -> None:
    kalman.predict_covariance(case.P, case.h, 4, case.gain)


@compiled
def updated(case: Record) -> None:
    case.y = kalman.innovation_variance(case.P, case.h, 0.04, case.product)
    kalman.correct(case.theta, case.P, case.h, case.z, 0.04, case.y, case.gain, case.product)


@compiled
def projected(case: Record) -> None:
    case.y = kalman.project(case.theta, case.P, case.h, case.z)


@compiled
def widened(case: Record) -> None:
    case.y = kalman.bilinear_variance(case.P, case.z, 0.02)


@compiled
def discrete(case: Record) -> None:
    y, q = ls.innovation(case.theta, case.P, case.h, case.z, case.product)
    case.y = ls.discrete_correction(case.theta, case.P, y, q, 0.98, 0.04, 50.0, case.product)


@compiled
def directional(case: Record) -> None:
    y, q = ls.innovation(case.theta, case.P, case.h, case.z, case.product)
    case.y = ls.directional_correction(case.theta, case.P, y, q, 0.98, 0.04, 50.0, case.product)


@compiled
def continuous(case: Record) -> None:
    _, case.y = ls.continuous_step(case.theta, case.P, case.h, case.z, 0.02, 0.7, 1.0, case.rates)
    ls.continuous_correction(case.theta, case.P, 0.02, 50.0, case.rates)


def symbols(layout: Layout, made: list[Any]) -> Any:
    """Names that hold symbols, or arrays of them, all of which are also added to a list."""
    fields: dict[str, Any] = {}
    for name, field in layout.fields:
        if isinstance(field, Layout):
            fields[name] = symbols(field, made)
        else:
            shape = field.counts if isinstance(field, Numbers) else (1,)
            own = [casadi.SX.sym(name) for _ in range(int(np.prod(shape)))]
            made += own
            fields[name] = np.array(own, dtype=object).reshape(shape) if shape != (1,) else own[0]
    return SimpleNamespace(**fields)


def listed(layout: Layout, values: Any) -> list[Any]:
    """All values of a record, in the order of its fields."""
    found: list[Any] = []
    for name, field in layout.fields:
        value = getattr(values, name)
        if isinstance(field, Layout):
            found += listed(field, value)
        else:
            found += value.ravel().tolist() if isinstance(value, np.ndarray) else [value]
    return found


def flat(array: Any) -> Any:
    return np.concatenate([np.ravel(values) for _, _, (values,) in leaves(CASE, array)])


@pytest.mark.parametrize(
    ("function", "z"),
    [(predicted, 0.0), (updated, 0.7), (projected, 0.5), (projected, -0.5), (widened, -2.0), (discrete, 0.7),
     (directional, 0.7), (continuous, 0.7)],
)  # fmt: skip
def test_functions_that_write_into_arrays(function: Any, z: float) -> None:
    casadi.GlobalOptions.setNumpyMode(1)
    given: dict[str, Any] = {"z": z, "theta": [0.4, 0.021, 0.057, 0.204], "gain": [0.1, 0.2, 0.3, 0.4]}
    given["h"] = [0.0, 0.0, -2.0, 1.0] if function is projected else [0.9, -0.2, 0.3, 0.5]
    plain, machine = (new(CASE, **given, P=ROOT @ ROOT.T + 0.1 * np.eye(4)) for _ in range(2))
    inputs: list[Any] = []
    traced = symbols(CASE, inputs)
    function.function(traced)
    run = casadi.Function("f", [casadi.vertcat(*inputs)], [casadi.vertcat(*listed(CASE, traced))])
    symbolic_ = run(flat(plain)).full().ravel()
    function.function(Named(plain, CASE))
    function.of(CASE)(machine)
    for found in (flat(machine), symbolic_):
        np.testing.assert_allclose(found, flat(plain), rtol=1e-13, atol=1e-15)


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
