"""Columns times coefficients are what the model simulates, in one piece and in many."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.fitting import search
from piezoest.fitting.design import CHUNK, NO_CREEP, Along, Basis, Design
from piezoest.fitting.loop_columns import LoopColumns
from piezoest.fitting.play_columns import PlayColumns, Start, moving_of, starts
from piezoest.fitting.regression import Log
from piezoest.models import Creep
from tests.fitting.stages import RATE, noise, play_matrix, stage, voltage

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
    # Some plays have no slope anywhere.
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


def test_a_loop_on_another_record_comes_from_rest() -> None:
    u = walk(0, centre=30.0)
    basis = LoopColumns(0.03).afresh(float(u[0]))
    # Nothing of the start that was fitted is left: its coefficient counts for nothing.
    w = np.array([0.1, 0.05, 99.0, 0.0, 0.0])
    x = Design(basis, RATE, u.size).output(u, w)
    rise = np.linspace(0.0, u[0], 50)
    model = basis.model(w, 0.0, None, RATE)
    expected = model.simulate(np.concatenate([rise, u]), initial_state=0.0)[rise.size :]
    np.testing.assert_allclose(x, expected, atol=1e-9)


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


def test_drift_jumps_and_offset_are_columns() -> None:
    u = walk(3, 1000)
    design = Design(columns_of(u, count=1), RATE, 800, jumps=np.array([300.0, 700.0]))
    rows = Along(design).rows(u)
    np.testing.assert_array_equal(rows[:, 0], u)
    np.testing.assert_array_equal(rows[:, design.offset], 1.0)
    drift = rows[:, design.offset + 1]
    np.testing.assert_allclose(drift[[0, 400, 800]], [0.0, 0.5, 1.0])
    # Behind the record that was fitted it goes on, slower and slower.
    rates = np.diff(drift)[[799, 800, 998]]
    assert rates[0] > rates[1] > rates[2] > 0.0
    assert [int(np.argmax(rows[:, design.offset + 2 + j])) for j in range(2)] == [300, 700]


def test_a_creep_gain_is_the_derivative_of_the_output() -> None:
    u = walk(4)
    basis = columns_of(u)
    w = np.append(slopes(basis, 4), np.zeros(6))

    def output(gains: FloatArray) -> FloatArray:
        return Design(basis, RATE, u.size, replace(CREEP, gains=gains)).output(u, w)

    design = Design(basis, RATE, u.size, CREEP)
    rows = np.vstack([each for _, each in design.blocks(u, w[: basis.size])])
    for j in range(2):
        step = 1e-3 * np.eye(2)[j]
        expected = (output(CREEP.gains + step) - output(CREEP.gains - step)) / 2e-3
        np.testing.assert_allclose(rows[:, design.gains][:, j], expected, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_start_is_one_that_a_model_accepts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u = voltage(rng, 30.0, 30.0 * (seed % 2))
    for start in starts(u):
        basis = columns_of(u, start=start)
        w = slopes(basis, seed)
        model: Any = basis.model(w, 0.0, None, RATE)
        x = model.simulate(u[:100], initial_state=basis.initial_state(w, model))
        expected = Design(basis, RATE, u.size).output(u, np.append(w, [0.0, 0.0]))[:100]
        np.testing.assert_allclose(x, expected, atol=1e-9)


def test_wider_plays_change_nothing_within_the_record() -> None:
    for seed in SEEDS:
        u = walk(seed)
        u -= 0.5 * (u.min() + u.max()) - 0.5
        basis = columns_of(u, bends=2, count=20, start=Start(float(u[0]), 0.0))
        w = slopes(basis, seed)
        wider, more, added = basis.beyond(w)
        assert wider.thresholds.size > basis.thresholds.size
        x = Design(basis, RATE, u.size).output(u, np.append(w, [0.0, 0.0]))
        y = Design(wider, RATE, u.size).output(u, np.append(more, [-added, 0.0]))
        np.testing.assert_allclose(y, x, atol=1e-9)
        model: Any = wider.model(more, -added, None, RATE)
        state = wider.initial_state(more, model)
        np.testing.assert_allclose(model.simulate(u, initial_state=state), x, atol=1e-9)
        further = wider.visited[1] + np.ptp(u)
        assert model.simulate(np.append(u, further), initial_state=state)[-1] > x.max()


def test_a_model_goes_on_where_a_voltage_can_leave_its_plays() -> None:
    u = 30.0 * np.cos(np.linspace(0.0, 20.0, 1000))

    def goes_on(basis: PlayColumns) -> bool:
        return basis.beyond(np.ones(20))[0] is not basis

    assert goes_on(columns_of(u, count=20, start=Start(30.0, 0.0)))
    assert not goes_on(columns_of(u, count=20, start=Start(30.0, 30.0)))
    assert not goes_on(columns_of(u + 10.0, count=20, start=Start(40.0, 10.0)))


def test_a_play_has_the_slope_of_the_next_segment_where_it_never_was() -> None:
    """A voltage that goes further brings it there."""
    u = 30.0 * np.sin(np.linspace(0.0, 60.0, 3000))
    x = stage(np.random.default_rng(2), 30.0).simulate(u) + noise(5e-3, 0, 3000)
    log = Log(u, x, np.ones(3000, bool), RATE, np.empty(0))
    basis = search.plays(log, Start(0.0, 0.0), bends=2)
    never = basis.moving == 0.0
    assert list(np.any(never, axis=1)) == [True, False, True]
    slopes = search.regression(log, basis).best().w[: basis.size].reshape(3, -1)
    widest = slopes[:, -1]
    assert widest[1] > 0.0
    np.testing.assert_allclose(widest, widest[1], rtol=0.2)


def test_the_less_a_play_goes_in_a_segment_the_more_it_follows_the_next_one() -> None:
    u = 30.0 * np.sin(np.linspace(0.0, 60.0, 3000))
    basis = columns_of(u, bends=1)
    unlike = np.eye(basis.size)[basis.thresholds.size :]
    costs = np.diag(unlike @ basis.prior() @ unlike.T)
    assert basis.moving[1, 1] > 2.0 * basis.moving[1, -1] > 0.0
    assert costs[-1] > 4.0 * costs[0]


def test_a_model_of_plays_without_slope_is_a_line() -> None:
    u = walk(5)
    model = columns_of(u, count=1).model(np.array([0.3]), 1.0, None, RATE)
    assert model == pz.LinearGain(0.3, 1.0)
    assert columns_of(u, count=1).initial_state(np.array([0.3]), model) is None


def test_how_far_plays_move() -> None:
    u = np.array([0.0, 10.0, -10.0])
    thresholds, start = np.array([0.0, 5.0, 20.0]), Start(0.0, 0.0)
    moving = moving_of(u, thresholds, np.empty(0), start)
    np.testing.assert_allclose(moving, [[1.0, 15.0 / 30.0, 0.0]])
    # Below 4 V the play of 5 V goes from 0 to 4, from 4 to -5.
    parts = moving_of(u, thresholds, np.array([4.0]), start)
    np.testing.assert_allclose(parts, 2.0 * np.array([[18.0, 13.0, 0.0], [12.0, 2.0, 0.0]]) / 30.0)


@pytest.mark.parametrize("basis", ["plays", "loop"])
def test_a_thinned_log_has_the_rows_of_the_whole_one(basis: str) -> None:
    """Between turns of the voltage, and in rests, nothing is remembered."""
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
