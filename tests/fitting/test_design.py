"""Columns of a design: in parts, and where the record says nothing of them."""

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.fitting.design import CHUNK, NO_CREEP, Along, Basis, Design
from piezoest.fitting.loop_columns import LoopColumns
from piezoest.fitting.play_columns import Start
from piezoest.fitting.regression import Log
from piezoest.fitting.search import plays, regression
from tests.fitting.stages import RATE, noise, stage


def log_of(u: FloatArray, x: FloatArray) -> Log:
    return Log(u, x, np.ones(u.size, bool), RATE, np.empty(0))


@pytest.mark.parametrize("kind", ["plays", "bent plays", "loop"])
def test_a_record_in_parts_gives_the_same_rows(kind: str) -> None:
    steps = 8.0 * np.cumsum(np.random.default_rng(1).standard_normal(200))
    u = np.interp(np.arange(CHUNK + 700) / 50.0, np.arange(200), steps)
    basis: Basis = LoopColumns(0.02)
    if kind != "loop":
        basis = plays(log_of(u, u), Start(u[0], 0.0), 8, bends=2 if kind == "bent plays" else 0)
    creep = NO_CREEP if kind == "loop" else pz.Creep([0.05, 0.02], [0.02, 0.6])
    design = Design(basis, RATE, 5000, creep, np.array([900.0, CHUNK + 5.0]))
    w = np.linspace(0.1, 1.0, design.columns)
    whole = np.vstack([rows for _, rows in design.blocks(u, w[: basis.size])])
    along = Along(design, w[: basis.size])
    parts = [along.rows(u[a:b]) for a, b in [(0, 1), (1, 2), (2, 900), (900, 901), (901, u.size)]]
    np.testing.assert_allclose(np.vstack(parts), whole, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(whole @ w, design.output(u, w), rtol=1e-12)
    # Behind the record that was fitted a drift goes on, slower and slower.
    drift = whole[:, design.offset + 1]
    np.testing.assert_allclose(drift[[0, 2500, 5000]], [0.0, 0.5, 1.0])
    rates = np.diff(drift)[[4999, 5000, 6000]]
    assert rates[0] > rates[1] > rates[2] > 0.0


@pytest.mark.parametrize(
    ("middle", "centre", "wider"), [(0.0, 0.0, True), (0.0, 30.0, False), (10.0, 10.0, False)]
)
def test_plays_go_on_where_a_voltage_can_leave_them(middle: float, centre: float, wider: bool) -> None:
    u = middle + 30.0 * np.cos(np.linspace(0.0, 20.0, 1000))
    basis = plays(log_of(u, u), Start(float(u[0]), centre), 20)
    assert (basis.beyond(np.ones(20))[0] is not basis) == wider


def test_a_play_has_the_slope_of_the_next_segment_where_it_never_was() -> None:
    """A voltage that goes further brings it there."""
    u = 30.0 * np.sin(np.linspace(0.0, 60.0, 3000))
    log = log_of(u, stage(np.random.default_rng(2), 30.0).simulate(u) + noise(5e-3, 0, 3000))
    basis = plays(log, Start(0.0, 0.0), bends=2)
    assert list(np.any(basis.moving == 0.0, axis=1)) == [True, False, True]
    widest = regression(log, basis).best().w[: basis.size].reshape(3, -1)[:, -1]
    assert widest[1] > 0.0
    np.testing.assert_allclose(widest, widest[1], rtol=0.2)
