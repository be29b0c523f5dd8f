"""The CasADi face: the same numbers as NumPy and Numba, and derivatives that are derivatives."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import symbolic
from piezoest.fitting.coordinates import coordinates

TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429, 0.3)
RATE = 2000.0


def voltage(samples: int = 1777) -> Any:
    """Long enough for blocks, parts of blocks and single samples; with a dwell in it."""
    u = pz.signals.triangle(33.0, 5.0, 5.0, RATE).values.copy()
    u[30:45] = u[30]
    return u[:samples]


def parameters(*gains: float) -> Any:
    return np.array([TRUE.a, TRUE.b, TRUE.c, TRUE.offset, *gains])


@pytest.mark.parametrize("samples", [1, 49, 50, 1000, 1777])
@pytest.mark.parametrize("sensitive", [True, False])
def test_simulation_is_that_of_the_model(samples: int, sensitive: bool) -> None:
    u = voltage(samples)
    run = symbolic.simulation(pz.ColemanHodgdon, 3).run(
        u, parameters(), np.array([-0.4]), np.empty(0), sensitive=sensitive
    )
    x = TRUE.simulate(u, initial_state=-0.4, allow_jumps=True)
    np.testing.assert_allclose(run.x, x, rtol=0.0, atol=1e-12)
    assert run.end[0] == pytest.approx(x[-1] - TRUE.c * u[-1] - TRUE.offset, abs=1e-12)


def test_sensitivities_are_derivatives() -> None:
    u, decays = voltage(1234), pz.Creep([0.0], [0.05]).decays(RATE)
    p, s = parameters(0.02), np.array([-0.4, 0.1])
    simulation = symbolic.simulation(pz.ColemanHodgdon, 3, 1)
    run = simulation.run(u, p, s, decays)
    point = np.concatenate([p, s])
    for i in range(point.size):
        h = 1e-6 * abs(point[i])
        x, end = [], []
        for sign in (1.0, -1.0):
            moved = point.copy()
            moved[i] += sign * h
            other = simulation.run(u, moved[: p.size], moved[p.size :], decays, sensitive=False)
            x.append(other.x)
            end.append(other.end)
        scale = np.abs(run.jacobian[:, i]).max()
        assert run.jacobian[:, i] == pytest.approx((x[0] - x[1]) / (2.0 * h), abs=1e-6 * scale)
        assert run.end_jacobian[:, i] == pytest.approx((end[0] - end[1]) / (2.0 * h), abs=1e-6 * scale)


@pytest.mark.parametrize(
    "held", [(), ("alpha",), ("beta",), ("gamma",), ("beta", "gamma"), ("alpha", "gamma"), ("alpha", "beta")]
)
def test_coordinates_of_a_model_are_the_model(held: tuple[str, ...]) -> None:
    varied = coordinates(pz.ColemanHodgdon, tuple(sorted(held)), 1)
    values = np.array([getattr(TRUE, name) for name in sorted(held)])
    q = varied.of(TRUE, {"initial_state": -0.4, "creep_gains[0]": 0.02})
    v, by_q, theta, theta_by_q = varied(q, values)
    np.testing.assert_allclose(v, [TRUE.a, TRUE.b, TRUE.c, 0.3, 0.02, -0.4, 0.0], rtol=1e-12)
    np.testing.assert_allclose(theta, [*TRUE.theta, 0.3, -0.4, 0.02], rtol=1e-12)
    assert len(varied.free) == 6 - len(held)
    for i in range(q.size):
        moved = q.copy()
        moved[i] += (h := 1e-6 * abs(q[i]))
        other = varied(moved, values)
        np.testing.assert_allclose(by_q[:, i], (other[0] - v) / h, rtol=1e-4, atol=1e-8)
        np.testing.assert_allclose(theta_by_q[:, i], (other[2] - theta) / h, rtol=1e-4, atol=1e-8)


@pytest.mark.parametrize(
    ("H", "lower"),
    [
        (np.diag([1.0, -1.0]), np.zeros(2)),
        (np.eye(2), np.array([0.0, np.nan])),
        (np.full((2, 2), np.nan), np.zeros(2)),
    ],
)
def test_a_program_without_an_optimum_is_refused(H: Any, lower: Any) -> None:
    with pytest.raises(np.linalg.LinAlgError, match="no solver ends"):
        symbolic.quadratic_program(H, np.ones(2), lower)
