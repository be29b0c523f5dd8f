"""Rigs and logs of the zoo: families of hysteresis, what goes wrong with them, and simulated recordings."""

import itertools
from typing import Any

import numpy as np
import pytest

from piezoest._checks import FloatArray
from piezoest.bench.zoo import draw, logs
from piezoest.bench.zoo.backlash import Backlash
from piezoest.bench.zoo.bouc_wen import BoucWen
from piezoest.bench.zoo.duhem import Duhem
from piezoest.bench.zoo.families import FAMILIES, POINTS, Reach, draw_family
from piezoest.bench.zoo.faults import FAULTS, START, TRANSIENT
from piezoest.bench.zoo.logs import ADDED, SAMPLE_RATES, SAMPLES, Log
from piezoest.bench.zoo.relays import Relays
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.voltages import SHAPES, draw_voltage
from piezoest.models import ColemanHodgdon
from tests.bench import shared

REACH = Reach(-100.0, 100.0)
SHORT = {**shared.SHORT, "frequency": 20.0, "amplitude": 5.0, "waves": 20}
MODES = [(kind, mode) for kind, each in FAULTS.items() for mode in each.modes]


def path(*places: float, points: int = 60) -> FloatArray:
    """Voltages from 0 V by way of places between -1 and 1 of the reach."""
    volts = [0.0, *(REACH.half * np.array(places))]
    pairs = itertools.pairwise(volts)
    return np.concatenate([np.linspace(a, b, points, endpoint=False) for a, b in pairs] + [volts[-1:]])


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("reach", [REACH, Reach(0.0, 150.0)])
def test_loops_have_the_width_and_the_slope_that_are_asked_for(family: str, reach: Reach) -> None:
    for width in (0.08, 0.25):
        model = draw_family(family, np.random.default_rng(3), reach, width=width, gain=0.2)
        x = model.simulate(reach.cycle())
        falling, rising = x[-2 * POINTS : -POINTS][::-1], x[-POINTS:]
        assert np.max(falling - rising) / np.ptp(rising) == pytest.approx(width, rel=1e-6)
        assert np.ptp(x[-400:]) == pytest.approx(0.2 * 2.0 * reach.half, rel=0.01)
        assert model.simulate(np.zeros(3)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("family", FAMILIES)
def test_of_a_voltage_the_path_counts_not_the_time(family: str) -> None:
    model = draw_family(family, np.random.default_rng(1), REACH, width=0.2, gain=0.1)
    coarse = path(0.9, -0.5, 0.3, -0.95, 0.1)
    x = model.simulate(coarse)
    fine = np.interp(np.arange(0.0, coarse.size - 0.9, 0.125), np.arange(coarse.size), coarse)
    np.testing.assert_allclose(model.simulate(fine)[::8], x, atol=2e-5)
    np.testing.assert_array_equal(model.simulate(np.repeat(coarse, 3))[::3], x)
    du, dx = np.diff(coarse), np.diff(x)
    assert np.all(dx[du != 0.0] / du[du != 0.0] > 0.0)  # the slope never turns round


def test_two_families_contain_coleman_and_hodgdon() -> None:
    u = path(0.8, -0.6, 0.2, -0.9, 0.9)
    expected = ColemanHodgdon.from_loop(1.0 / 40.0, 0.3 * 0.2, 0.2).simulate(u)
    same = BoucWen(gain=0.2, share=0.3, width=40.0, power=1.0, fullness=1.0)
    np.testing.assert_allclose(same.simulate(u), expected, atol=1e-7)
    duhem = Duhem(
        gain=0.2, share=0.3, scale=100.0, centre=0.0, rate_up=0.025, rate_down=0.025, top=40.0, bottom=40.0
    )
    np.testing.assert_allclose(duhem.simulate(u), expected, atol=1e-12)


def lines_of(model: Relays) -> FloatArray:
    return np.linspace(model.low, model.high, model.levels + 1)


def slow_relays(model: Relays, u: FloatArray) -> FloatArray:
    """Every relay by itself, for voltages on the lines of the grid: a cell switches between two of them."""
    v = lines_of(model)
    up, down = np.meshgrid(v[1:], v[:-1], indexing="ij")
    state = np.zeros_like(up, dtype=bool)
    sums = []
    for voltage in (0.0, *u):
        state = np.where(up <= voltage, True, np.where(down >= voltage, False, state))
        sums.append(model.weights[state].sum())
    return model.gain * (u + model.share * (np.array(sums[1:]) - sums[0]))


def test_relays_are_relays() -> None:
    rng = np.random.default_rng(5)
    for low, high in ((-100.0, 130.0), (-10.0, 220.0)):  # with a line at 0 V, where all begins
        middle = 0.5 * (low + high)
        model = Relays(
            gain=0.1, share=0.7, low=low, high=high, half_width=20.0, half_width_spread=15.0, place=middle,
            place_spread=40.0, levels=23,
        )  # fmt: skip
        u = rng.choice(lines_of(model), 500)
        np.testing.assert_allclose(model.simulate(u), slow_relays(model, u), atol=1e-11)
        fine = model.simulate(np.linspace(low, high, 100_001))
        assert np.diff(fine).max() < 20.0 * (high - low) * 0.1 / 100_000  # no step anywhere


def test_backlash_has_play_and_a_place_where_it_does_not_pull() -> None:
    model = Backlash(gain=0.1, share=2.0, width=10.0, dead=5.0, place=30.0)
    u = np.array([0.0, 30.0, 35.0, 45.0, 60.0, 45.0, 40.0, 30.0, 10.0])
    y = np.array([0.0, 20.0, 25.0, 35.0, 50.0, 50.0, 50.0, 40.0, 20.0])
    pulled = np.where(y > 35.0, y - 5.0, np.where(y < 25.0, y + 5.0, 30.0)) - 5.0
    np.testing.assert_allclose(model.simulate(u), 0.1 * (u + 2.0 * pulled), atol=1e-12)


@pytest.mark.parametrize("family", ["backlash", "relays", "paper", "preisach"])
def test_a_large_swing_deletes_small_ones(family: str) -> None:
    model = draw_family(family, np.random.default_rng(2), REACH, width=0.2, gain=0.1)
    plain = model.simulate(path(0.9, -0.9, 0.2))[-1]
    with_loops = model.simulate(path(0.5, 0.1, 0.9, -0.2, 0.4, -0.9, -0.3, -0.5, 0.2))[-1]
    assert with_loops == pytest.approx(plain, abs=1e-11)


def seen(rig: Rig, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    stage = rig.stage()
    x = stage.run(u)
    return x, np.asarray(stage.displacement)


def drive(rig: Rig) -> FloatArray:
    return np.clip(rig.reference / 0.15, -99.0, 99.0)


@pytest.mark.parametrize(("kind", "mode"), MODES)
@pytest.mark.slow_but_first
def test_of_a_faulty_stage_step_run_and_pieces_give_the_same_bits(kind: str, mode: str) -> None:
    given = {**SHORT, "hum": 0.1, "drift": 0.3, "delay": 2, "resolution": 1e-3}
    rig = draw(11, fault=kind, mode=mode, **given)
    u = drive(rig)
    both = np.column_stack(seen(rig, u))
    single, piece = rig.stage(), rig.stage()
    steps = [(single.step(float(v)), float(np.ravel(single.displacement)[0])) for v in u]
    np.testing.assert_array_equal(steps, both)
    pieces = [(piece.run(u[k : k + 37]), piece.displacement) for k in range(0, u.size, 37)]
    np.testing.assert_array_equal(np.hstack([np.atleast_2d(each) for each in pieces]).T, both)


@pytest.mark.parametrize(("kind", "mode"), MODES)
def test_a_fault_is_there_when_it_should_be_and_only_then(kind: str, mode: str) -> None:
    rig, sound = draw(11, fault=kind, mode=mode, **SHORT), draw(11, fault="none", **SHORT)
    u, fault = drive(sound), rig.fault
    assert fault.mode == mode
    assert 0 <= fault.start < fault.stop <= u.size
    both, sounds = np.array(seen(rig, u)), np.array(seen(sound, u))
    np.testing.assert_array_equal(both[:, : fault.start], sounds[:, : fault.start])
    assert not (np.array_equal(both, sounds) and np.array_equal(rig.reference, sound.reference))
    if mode == TRANSIENT and kind not in ("drift", "dwell"):
        after = fault.stop + 300
        np.testing.assert_allclose(both[0, after:], sounds[0, after:], atol=1e-3)
        np.testing.assert_allclose(both[1, -60:], sounds[1, -60:], atol=1e-3)


def one(kind: str, mode: str | None = "permanent", **given: Any) -> tuple[Rig, FloatArray, FloatArray, Any]:
    rig = draw(11, fault=kind, mode=mode, **{**SHORT, "noise": 0.0, **given})
    x, true = seen(rig, drive(rig))
    return rig, x, true, rig.fault.within(x.size)


def test_what_each_fault_is() -> None:
    for kind in ("amplifier-frozen", "stage-stuck"):
        rig, x, true, within = one(kind, noise=1e-3)
        assert np.ptp(true[within]) == 0.0
        assert np.ptp(true[~within]) > 5.0
        assert 0.0 < np.std(x[within]) < 3e-3
    _, x, true, within = one("sensor-constant")
    assert np.ptp(x[within]) == 0.0 < 5.0 < np.ptp(true[within])
    _, x, _, within = one("sensor-noise")
    assert 0.0 < np.std(x[within]) < 0.1
    _, x, _, within = one("sensor-saturated")
    assert np.max(np.abs(x[within])) == pytest.approx(0.6 * 5.0)
    rig, x, true, within = one("sensor-factor")
    np.testing.assert_allclose(x[within], rig.fault.size * true[within])
    rig, x, true, within = one("zero-off")
    np.testing.assert_allclose(x - true, rig.fault.size * within)
    _, x, true, within = one("spikes")
    assert 0.0 < np.mean(x[within] != true[within]) < 0.05
    rig, x, _, within = one("dropouts")
    assert np.mean(np.isnan(x[within])) == pytest.approx(rig.fault.size, abs=0.1)
    _, x, _, within = one("gap", "transient")
    np.testing.assert_array_equal(np.isnan(x), within)
    rig, x, true, within = one("hum")
    assert np.std((x - true)[within]) == pytest.approx(rig.fault.size / np.sqrt(2.0), rel=0.05)
    rig, x, true, within = one("glitch", "transient")
    assert x[0] - true[0] == pytest.approx(rig.fault.size)
    np.testing.assert_array_equal(x[1:], true[1:])


def test_faults_of_the_stage_and_of_the_reference() -> None:
    sound, _, true_sound, _ = one("none", None)
    rig, _, _, within = one("gain-step")
    true = seen(rig, drive(sound))[1]
    np.testing.assert_allclose(true[within], rig.fault.size * true_sound[within])
    rig = one("drift")[0]
    assert seen(rig, drive(sound))[1][-1] - true_sound[-1] == pytest.approx(rig.fault.size, rel=0.01)
    rig, _, _, within = one("zero-off-shifted")
    np.testing.assert_allclose(rig.reference - sound.reference, rig.fault.size * within)
    drop, dwell = one("amplitude-drop")[0], one("dwell", None)[0]
    for rig in (drop, dwell):
        assert np.max(np.abs(np.diff(rig.reference))) < 1.1 * np.max(np.abs(np.diff(sound.reference)))
    assert np.max(np.abs(drop.reference[-100:])) < 0.45 * 5.0
    assert np.std(dwell.reference[dwell.fault.start : dwell.fault.stop]) == pytest.approx(1e-4, rel=0.3)


def test_whose_coordinates_count() -> None:
    """A gauge that was never right is right; one that goes wrong is wrong."""
    always, later = (draw(11, fault="sensor-factor", mode=mode, **SHORT) for mode in (START, "permanent"))
    assert always.coordinates[0] == always.fault.size
    assert later.coordinates[0] == 1.0
    for mode, moved in ((START, True), ("permanent", True), (TRANSIENT, False)):
        assert draw(11, fault="zero-off", mode=mode, **SHORT).coordinates[1].any() == moved
    assert draw(11, fault="zero-off-shifted", mode=TRANSIENT, **SHORT).coordinates[1].any()


def test_what_is_unknown_is_refused() -> None:
    for given, words in (
        ({"fault": "gremlins"}, "fault must be none or one of"),
        ({"fault": "dwell", "mode": "permanent"}, "dwell is transient"),
        ({"colour": "red"}, "colour: choose one of"),
        ({"family": "magic"}, "bouc-wen, duhem"),
    ):
        with pytest.raises(ValueError, match=words):
            draw(0, **given)
    with pytest.raises(ValueError, match="family must be one of"):
        logs.draw(0, family="unheard-of")


def check(log: Log) -> None:
    """A reading is truth, jumps, noise and spikes."""
    assert log.u.shape == log.x.shape == log.truth.shape == log.jumps.shape == log.spikes.shape
    assert np.isfinite(log.truth).all()
    rest = log.x - log.truth - log.jumps
    assert np.nanstd(rest[~log.spikes]) == pytest.approx(log.noise, rel=0.05)
    assert log.stroke == pytest.approx(np.ptp(log.truth))
    missing = np.isnan(log.x)
    assert missing.mean() == pytest.approx(log.added.get("dropouts", 0.0))
    assert np.array_equal(np.isnan(log.u), missing) if "rows" in log.added else np.isfinite(log.u).all()
    far = np.abs(rest[log.spikes & ~missing])
    assert far.size == 0 or np.median(far) > 0.05 * log.stroke
    assert ("jumps" in log.added) == np.any(np.diff(log.jumps))


def test_a_log_is_a_function_of_its_seed_and_its_parts_add_up() -> None:
    drawn, again = ([logs.draw(seed) for seed in range(12)] for _ in range(2))
    for log, same in zip(drawn, again, strict=True):
        check(log)
        for name in ("u", "x", "truth", "jumps", "spikes"):
            np.testing.assert_array_equal(getattr(log, name), getattr(same, name))
        assert log.added == same.added
    assert len({log.u.size for log in drawn}) == 12
    assert logs.draw(1, family="duhem").family == "duhem"


@pytest.mark.slow
def test_everything_is_drawn() -> None:
    drawn = [logs.draw(seed) for seed in range(60)]
    for log in drawn[12:]:
        check(log)
    assert {log.family for log in drawn} == set(FAMILIES)
    assert {log.voltage for log in drawn} == set(SHAPES)
    assert {log.sample_rate for log in drawn} == set(SAMPLE_RATES)
    assert {name for log in drawn for name in log.added} == set(ADDED)
    assert {np.unique(log.jumps).size - 1 for log in drawn} == {0, 1, 2}
    sizes = [log.u.size for log in drawn]
    assert SAMPLES[0] <= min(sizes) < 5_000
    assert 30_000 < max(sizes) <= SAMPLES[1]
    assert min(np.nanmin(log.u) for log in drawn) < -50.0
    assert sum(np.nanmin(log.u) >= 0.0 for log in drawn) > 10


def test_the_delay_is_what_the_log_says() -> None:
    """A clean stage that was not moved before does what its own model does with a voltage as late."""
    drawn = [logs.draw(seed, clean=True) for seed in range(24)]
    assert not {"creep", "drift", "jumps", "spikes"} & {name for log in drawn for name in log.added}
    found = [log for log in drawn if not {"cycled", "rows"} & set(log.added)]
    assert len({log.added.get("delay", 0.0) for log in found}) > 3
    delays = np.arange(0.0, 5.1, 0.125)
    for log in found:
        index, errors = np.arange(log.u.size), []
        for delay in delays:
            late = np.interp(index - delay, index, log.u)
            x = log.model.simulate(np.concatenate((np.linspace(0.0, log.u[0], 500), late)))[500:]
            errors.append(np.std((log.truth - x)[10:]))
        assert delays[np.argmin(errors)] == pytest.approx(log.added.get("delay", 0.0), abs=0.26)
        assert min(errors) < 2e-3 * log.stroke


def test_of_too_many_loops_the_smallest_are_forgotten() -> None:
    model = draw_family("relays", np.random.default_rng(6), REACH, width=0.2, gain=0.1)
    turns = 60.0 * 0.97 ** np.arange(200) * (-1.0) ** np.arange(200)
    x = model.simulate(np.concatenate((turns, [90.0, -20.0])))
    assert np.abs(np.diff(x[150:200])).max() < 0.15  # near the middle, as the voltage is
    np.testing.assert_allclose(x[-2:], model.simulate(np.array([90.0, -20.0])), atol=1e-9)


@pytest.mark.parametrize("kind", SHAPES)
def test_voltages_move_steadily_over_their_whole_range(kind: str) -> None:
    for seed in range(10):
        shape = draw_voltage(kind, 40_000, 20.0, np.random.default_rng(seed))
        assert shape.shape == (40_000,)
        assert (shape.min(), shape.max()) == pytest.approx((-1.0, 1.0))
        # The fastest are the ramps of a staircase, in a 20th of a step.
        assert np.abs(np.diff(shape)).max() < 0.05
        # They turn in either half.
        for half in np.split(shape, 2):
            moves = np.sign(np.diff(half))
            assert np.sum(np.abs(np.diff(moves[moves != 0.0])) > 0.0) >= 2
