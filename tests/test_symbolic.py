"""The CasADi face: the same numbers as NumPy and Numba, and derivatives that are derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import symbolic
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators.coordinates import coordinates

TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429, 0.3)
RATE = 2000.0


def voltage(samples: int = 1777) -> Any:
    """Long enough for blocks, parts of blocks and single samples; with a dwell in it."""
    u = pz.signals.triangle(33.0, 5.0, 5.0, RATE).values.copy()
    u[30:45] = u[30]
    return u[:samples]


def parameters(*gains: float) -> Any:
    return np.array([TRUE.a, TRUE.b, TRUE.c, TRUE.offset, *gains])


def test_derivative_of_an_equation() -> None:
    point = np.array([0.7, -0.3, 0.021, 0.057])
    exact = symbolic.jacobian(equations.hysteresis_step, 0, 0, 0, 0)(*point)
    for i in range(4):
        h = 1e-6 * abs(point[i])
        above, below = point.copy(), point.copy()
        above[i], below[i] = point[i] + h, point[i] - h
        numeric = (equations.hysteresis_step(*above) - equations.hysteresis_step(*below)) / (2.0 * h)
        assert exact[0, i] == pytest.approx(numeric, rel=1e-7)


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


def test_simulation_with_creep() -> None:
    creep = pz.Creep([0.02, 0.03], [0.05, 0.5])
    u = voltage()
    run = symbolic.simulation(pz.ColemanHodgdon, 3, 2).run(
        u, parameters(*creep.gains), np.array([-0.4, 0.0, 0.0]), creep.decays(RATE)
    )
    w = TRUE.simulate(u, initial_state=-0.4, allow_jumps=True) - TRUE.offset
    expected = w + creep.simulate(w, sample_rate=RATE) + TRUE.offset
    np.testing.assert_allclose(run.x, expected, rtol=0.0, atol=1e-12)


def test_simulation_in_two_parts_is_one() -> None:
    u, s = voltage(), np.array([-0.4])
    simulation = symbolic.simulation(pz.ColemanHodgdon, 3)
    whole = simulation.run(u, parameters(), s, np.empty(0))
    first = simulation.run(u[:777], parameters(), s, np.empty(0))
    second = simulation.run(u[777:], parameters(), first.end, np.empty(0), before=u[776])
    np.testing.assert_array_equal(np.concatenate([first.x, second.x]), whole.x)
    n = simulation.n_p
    chained = second.jacobian[:, n:] @ first.end_jacobian
    chained[:, :n] += second.jacobian[:, :n]
    np.testing.assert_allclose(chained, whole.jacobian[777:], rtol=0.0, atol=1e-9)


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


def test_bounds_are_the_admissible_set() -> None:
    varied = coordinates(pz.ColemanHodgdon, ())
    lower, upper = varied.bounds(varied.of(TRUE))
    i = varied.free.index("ratio")
    for ratio, inside in ((lower[i], True), (upper[i], True), (0.99, False), (2.01, False)):
        q = np.array([0.021, 0.147, ratio, 0.0, 0.0])
        _, _, theta, _ = varied(q, np.empty(0))
        assert pz.ColemanHodgdon.from_theta(theta[:3]).is_admissible == inside
    outside = pz.ColemanHodgdon(0.021, 0.147, 0.0063 * 1.2)
    q = varied.of(outside)
    assert np.all((lower <= q) & (q <= upper))


def test_ipopt_says_how_it_fared() -> None:
    def circle(z: Any) -> symbolic.Evaluation:
        """Nearest point of the line z_0 + z_1 = 2 to the origin."""
        return symbolic.Evaluation(
            0.5 * float(z @ z), z, np.array([z.sum() - 2.0]), np.ones((1, 2)), np.eye(2)
        )

    wide = np.full(2, np.inf)
    found = symbolic.ipopt(circle, np.array([5.0, -3.0]), -wide, wide, 1, 50, 1e-9)
    assert found.success
    assert found.message == "IPOPT: Solve_Succeeded"
    np.testing.assert_allclose(found.z, 1.0, atol=1e-8)
    bounded = symbolic.ipopt(circle, np.array([1.5, 0.0]), np.array([1.4, -9.0]), wide, 1, 50, 1e-9)
    np.testing.assert_allclose(bounded.z, [1.4, 0.6], atol=1e-7)
    stopped = symbolic.ipopt(circle, np.array([5.0, -3.0]), -wide, wide, 1, 0, 1e-9)
    assert not stopped.success
    assert stopped.message == "IPOPT: Maximum_Iterations_Exceeded"
