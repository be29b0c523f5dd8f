"""Columns times coefficients are what the model simulates, in one piece and in many."""

from typing import Any

import numpy as np
import pytest

from piezoest._checks import FloatArray
from piezoest.fitting import search
from piezoest.fitting.design import CHUNK, NO_CREEP, Along, Basis, Design
from piezoest.fitting.loop_columns import LoopColumns
from piezoest.fitting.play_columns import PlayColumns, Start, moving_of
from piezoest.fitting.regression import Log
from piezoest.models import Creep
from tests.fitting.stages import RATE, play_matrix

CREEP = Creep([0.05, 0.02], [0.02, 0.6])
SEEDS = range(6)


def walk(seed: int, size: int = 2500, centre: float = 0.0) -> FloatArray:
    """Voltage [V] that turns at every size."""
    rng = np.random.default_rng([seed, 3])
    steps = np.cumsum(rng.standard_normal(size // 50 + 2))
    u = np.interp(np.arange(size) / 50.0, np.arange(steps.size), 8.0 * (steps - steps.mean()))
    return np.asarray(u + centre)


def columns_of(u: FloatArray, bends: int = 0, count: int = 8, start: Start | None = None) -> PlayColumns:
    low, high = float(u.min()), float(u.max())
    thresholds = 0.45 * (high - low) * np.arange(count) / count
    inner = low + (high - low) * np.arange(1, bends + 1) / (bends + 1)
    start = Start(float(u[0]), 0.5 * (low + high)) if start is None else start
    return PlayColumns(thresholds, inner, start, (low, high), moving_of(u, thresholds, inner, start))


def slopes(basis: PlayColumns, seed: int) -> FloatArray:
    rng = np.random.default_rng([seed, 4])
    w = rng.uniform(0.0, 1.0, (basis.bends.size + 1, basis.thresholds.size)) / basis.thresholds.size
    w[:, 1:] *= rng.random(basis.thresholds.size - 1) < 0.7
    w[:, 0] += 0.2
    return w.ravel()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("bends", "creep"), [(0, False), (2, False), (0, True), (3, True)])
def test_plays_simulate_what_their_columns_give(seed: int, bends: int, creep: bool) -> None:
    u = walk(seed, centre=20.0 * (seed % 3))
    basis = columns_of(u, bends)
    design = Design(basis, RATE, u.size, CREEP if creep else NO_CREEP)
    w = np.zeros(design.columns)
    own = w[: basis.size] = slopes(basis, seed)
    w[design.crept], w[design.offset] = 0.3 if creep else 0.0, 2.0
    model: Any = basis.model(own, 2.0, design.creep if creep else None, RATE)
    assert model.is_admissible
    state = basis.initial_state(own, model)
    assert state is not None
    if creep:
        state = np.append(state, 0.3 / CREEP.gains)
    np.testing.assert_allclose(model.simulate(u, initial_state=state), design.output(u, w), atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_loop_simulates_what_its_columns_give(seed: int) -> None:
    u, rng = walk(seed), np.random.default_rng(seed)
    basis = LoopColumns(float(rng.uniform(0.005, 0.1)))
    w = np.array([*rng.uniform(0.05, 0.2, 2), rng.uniform(-1.0, 1.0), 3.0, 0.0])
    model = basis.model(w, 3.0, None, RATE)
    assert (model.alpha, model.beta) == pytest.approx((basis.alpha, w[0] + w[1]))
    state = basis.initial_state(w, model)
    x = Design(basis, RATE, u.size).output(u, w)
    np.testing.assert_allclose(model.simulate(u, initial_state=state), x, atol=1e-9)


def bases(u: FloatArray) -> list[Basis]:
    return [columns_of(u), columns_of(u, bends=2), LoopColumns(0.02)]


@pytest.mark.parametrize("kind", range(3))
def test_a_record_in_parts_gives_the_same_rows(kind: int) -> None:
    u = walk(1, CHUNK + 700)
    creep = NO_CREEP if kind == 2 else CREEP
    design = Design(bases(u)[kind], RATE, u.size, creep, np.array([900.0, CHUNK + 5.0]))
    w = np.linspace(0.1, 1.0, design.columns)
    whole = np.vstack([rows for _, rows in design.blocks(u, w[: design.basis.size])])
    along = Along(design, w[: design.basis.size])
    parts = [along.rows(u[a:b]) for a, b in [(0, 1), (1, 2), (2, 900), (900, 901), (901, u.size)]]
    np.testing.assert_allclose(np.vstack(parts), whole, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(whole @ w, design.output(u, w), rtol=1e-12)


def test_segments_add_up_to_plays() -> None:
    u = walk(2)
    bent = columns_of(u, bends=3)
    plain, T = bent.merged()
    rows = bent.rows(u, bent.begin())
    np.testing.assert_allclose(rows @ T, plain.rows(u, plain.begin()), atol=1e-12)
    expected = play_matrix(u, bent.thresholds, bent.start.states(bent.thresholds))
    np.testing.assert_allclose(plain.rows(u, plain.begin()), expected, atol=1e-12)


@pytest.mark.parametrize("basis", ["plays", "loop"])
def test_a_thinned_log_has_the_rows_of_the_whole_one(basis: str) -> None:
    rng = np.random.default_rng(3)
    u = np.repeat(np.cumsum(rng.standard_normal(400)), rng.integers(1, 30, 400))
    u = np.interp(np.arange(0.0, u.size, 0.25), np.arange(u.size), u)
    log = Log(u, u + rng.standard_normal(u.size), rng.random(u.size) < 0.9, RATE, np.array([u.size // 2]))
    few = log.thinned(500)
    assert few.u.size < 0.3 * u.size
    assert 500 <= np.count_nonzero(few.counts) < 1000
    columns: Basis = LoopColumns(0.3) if basis == "loop" else search.plays(log, Start(3.0, 0.0), bends=2)
    place = np.flatnonzero(np.isin(log.x, few.x[few.counts]))
    rows = columns.rows(log.u, columns.begin())[place]
    np.testing.assert_allclose(columns.rows(few.u, columns.begin())[few.counts], rows, atol=1e-9)
    assert np.count_nonzero(place < log.jumps[0]) == np.count_nonzero(few.counts[: int(few.jumps[0])])
