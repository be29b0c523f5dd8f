"""The CasADi face: simulations, with or without sensitivities, are those of the model."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import symbolic

TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429, 0.3)
RATE = 2000.0


def voltage(samples: int = 1777) -> Any:
    """Long enough for blocks, parts of blocks and single samples; with a dwell in it."""
    u = pz.signals.triangle(33.0, 5.0, 5.0, RATE).values.copy()
    u[30:45] = u[30]
    return u[:samples]


@pytest.mark.parametrize("samples", [1, 50, 1777])
@pytest.mark.parametrize("sensitive", [True, False])
def test_simulation_is_that_of_the_model(samples: int, sensitive: bool) -> None:
    u = voltage(samples)
    run = symbolic.simulation(pz.ColemanHodgdon, 3).run(
        u, np.array([TRUE.a, TRUE.b, TRUE.c, TRUE.offset]), np.array([-0.4]), np.empty(0), sensitive=sensitive
    )
    x = TRUE.simulate(u, initial_state=-0.4, allow_jumps=True)
    np.testing.assert_allclose(run.x, x, rtol=0.0, atol=1e-12)
    assert run.end[0] == pytest.approx(x[-1] - TRUE.c * u[-1] - TRUE.offset, abs=1e-12)


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
