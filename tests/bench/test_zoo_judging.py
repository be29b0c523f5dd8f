"""How runs of the zoo are judged: against a line, by names of faults, over maps, after a rest."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.bench.metrics import SETTLED
from piezoest.bench.zoo import dwelling, play, settling, tasks
from piezoest.bench.zoo.contenders import CANDIDATES, DEFAULT
from piezoest.bench.zoo.contest import FLOOR, summarise_contest
from piezoest.bench.zoo.dwelling import BEFORE, SHAPES, Dwell, dwell_rig, dwells, summarise_dwells
from piezoest.bench.zoo.faults import ANY, FAULTS, truthful
from piezoest.bench.zoo.judging import named, recovery
from piezoest.bench.zoo.line import fit_line, run_learnt_line, run_line
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Traces
from piezoest.bench.zoo.settling import SEGMENTS
from piezoest.controller.faults import MEANINGS
from piezoest.controller.shown import Event
from tests.bench.shared import Line, bench, rig_with

CHANGES = [name for name, _, _ in SEGMENTS]


def learnt(rig: Rig) -> tuple[Traces, int]:
    return run_learnt_line(rig, fit_line(rig))


def bend(run: Traces, part: slice) -> float:
    """By how much the voltages of a part are off one straight line of the reference [V]."""
    r, u = run.reference[part], run.voltage[part]
    return float(np.max(np.abs(u - np.polyval(np.polyfit(r, u, 1), r))))


@pytest.mark.parametrize("given", [{}, {"block": 1}, {"delay": 5, "block": 1}, {"limits": "0..150"}])
def test_a_learnt_line_becomes_about_as_good_as_in_hindsight(given: dict[str, Any]) -> None:
    rig = rig_with(**{"amplitude": 5.0, **given})
    run, knows = learnt(rig)
    best = np.abs(run_line(rig, fit_line(rig)).error[-100:]).max()
    assert np.abs(run.error[-100:]).max() < 1.15 * best
    assert knows == rig.block
    np.testing.assert_array_equal(run.voltage[:knows], rig.limits.rest)
    assert np.ptp(run.voltage[: knows + 20]) > 0.0


@pytest.mark.parametrize("kind", ["sensor-constant", "sensor-noise", "stage-stuck", "gap", "sensor-factor"])
def test_a_learnt_line_is_held_while_nothing_true_is_read_and_foresees_nothing(kind: str) -> None:
    rig = rig_with(kind, "permanent")
    run, start = learnt(rig)[0], rig.fault.start
    # The legs before the fault are still learnt from, half of one at least.
    assert bend(run, slice(start + 3 * rig.plain.cycle // 2, None)) < 1e-9
    assert bend(run, slice(start - 300, start)) > 1e-3
    np.testing.assert_array_equal(run.voltage[:start], learnt(rig_with())[0].voltage[:start])


@pytest.mark.parametrize("kind", ["sensor-constant", "sensor-noise", "gap"])
def test_without_a_true_reading_a_learnt_line_rests(kind: str) -> None:
    rig = rig_with(kind, "from-start", limits="0..150")
    run, knows = learnt(rig)
    assert knows == run.voltage.size
    np.testing.assert_array_equal(run.voltage, 0.0)
    # Nobody knows where to go: resting at a limit is no offence, and all of such a run is judged.
    row = play(rig, lambda fs, limits: Line(1e9, 0.0, limits))
    assert not row["rests_at_rail"]
    assert row["ratio"] == pytest.approx(1.0 / 1.5, rel=1e-3)


def test_a_learnt_line_leaves_single_wrong_readings_out() -> None:
    spikes, sound = learnt(rig_with("spikes", "from-start"))[0], learnt(rig_with())[0]
    assert np.max(np.abs(spikes.voltage - sound.voltage)) < 0.5
    rig = rig_with("sensor-saturated", "from-start")
    x: FloatArray = np.array([1.0, np.nan, 6.0, 6.0])
    told = truthful(rig, 0, x, np.array([1.0, 2.0, 6.0, 8.0]), 0.1)
    assert told.tolist() == [True, False, True, False]


def after(rig: Rig, *said: tuple[float, str]) -> dict[str, Any]:
    """What is found where faults are named some periods after the beginning of the fault."""
    start = rig.fault.start / rig.sample_rate
    events = [Event(start + periods / 10.0, "fell back", f"{name}: so it is") for periods, name in said]
    return named(rig, SimpleNamespace(events=events, status=SimpleNamespace(driving="line")))


def test_the_right_name_counts_and_how_soon() -> None:
    rig = rig_with("sensor-factor", "permanent")
    found = after(rig, (-2.0, "scaled"), (0.5, "saturated"), (1.5, "reversed"), (2.5, "scaled"))
    assert (found["named_right"], found["named_periods"]) == (True, pytest.approx(1.5))
    assert (found["named"], found["driver"]) == ("scaled; saturated; reversed", "line")
    wrong = after(rig, (-2.0, "scaled"), (1.0, "no response"))
    assert (wrong["named_right"], wrong["named_periods"]) == (False, None)
    assert after(rig_with("hum", "permanent"), (1.0, "scaled"))["named_right"] is None
    # Of what was there from the start, silence alone.
    begins = {kind for kind, each in FAULTS.items() if "from-start" in each.modes}
    asked = {kind for kind in begins if rig_with(kind, "from-start").fault.names}
    assert asked == {"amplifier-frozen", "stage-stuck", "sensor-constant", "sensor-noise"}
    assert {name for kind in FAULTS.values() for name in kind.names} == set(ANY) <= set(MEANINGS)


def errors(rig: Rig, *cycles: float) -> FloatArray:
    """0.1 µm, and others in the cycles after the fault."""
    error = np.full(rig.plain.values.size, 0.1)
    for k, value in enumerate(cycles):
        begin = rig.fault.stop + k * rig.plain.cycle
        error[begin + 5 : begin + 8] = value
    return error


def test_the_first_cycle_that_is_as_good_as_before_counts() -> None:
    rig, early = (rig_with(kind, "transient") for kind in ("gap", "glitch"))
    assert recovery(rig, errors(rig), 0.01) == {"recovery": True, "recovered": 1}
    assert recovery(rig, errors(rig, 0.5, 0.13, 0.119), 0.01)["recovered"] == 3
    assert recovery(rig, errors(rig, 0.5, 0.13), 0.2)["recovered"] == 2
    assert recovery(early, errors(early, 0.5), 0.01)["recovered"] == 2
    assert recovery(rig, errors(rig, *[0.5] * 20), 0.01) == {"recovery": True, "recovered": None}
    for other in (rig_with("gap", "permanent"), rig_with("gap", "transient", reference="chirp")):
        assert recovery(other, errors(other), 0.01) == {"recovery": False, "recovered": None}


def on_map(seed: int, *periods: int | None, amplitude: float = 1.0, asked: bool = True) -> dict[str, Any]:
    segments = [{"change": name, "periods": each} for name, each in zip(CHANGES, periods, strict=True)]
    return {"family": "paper", "amplitude": amplitude, "frequency": 3.0, "seed": seed, "asked": asked,
            "failure": None, "segments": segments}  # fmt: skip


def test_shares_count_what_is_asked_for() -> None:
    rows = [on_map(seed, 2, 2, 3, None, 0 if seed else 3) for seed in range(20)]
    rows += [on_map(0, *[None] * 5, amplitude=2.0), on_map(1, *[0] * 5, amplitude=2.0, asked=False)]
    found = settling.summarise_cells(rows)
    assert found["cells"] == {"asked": 2, "kept": dict(zip(CHANGES, (1, 1, 0, 0, 1), strict=True))}
    assert found["others"] == 1
    first = found["by_place"][0]
    assert [first[name] for name in ("runs", "cold-start", "gain-step")] == [20, 1.0, 0.95]
    assert (first["cold-start periods"], first["switch-back periods"]) == (2.0, None)


def settled(seed: int, controller: str, error: float | None) -> dict[str, Any]:
    return {"family": "paper", "reference": "sine", "seed": seed, "controller": controller, "settled": error,
            "amplitude": 10.0, "failure": None if error else "none"}  # fmt: skip


def test_the_best_single_estimator_is_chosen_for_each_cell() -> None:
    first, second, third = CANDIDATES
    of = {DEFAULT: (0.2, 0.3, 0.4), first: (0.1, 0.5, 0.9), second: (0.1, 0.2, 0.3), third: (1e-4, 0.4, None)}
    rows = [settled(k, name, error) for name, each in of.items() for k, error in enumerate(each)]
    found = summarise_contest(rows, DEFAULT)
    (cell,) = found["cells"]
    assert (cell["best"], cell["settled"]) == (second, pytest.approx(0.03))
    assert cell["ratio"] == pytest.approx(1.5)
    assert (found["kept"], found["failures"], found["seeds"]) == (0, 1, 3)
    # Below the floor all are alike.
    tiny = [settled(0, name, error) for name, error in ((DEFAULT, 2e-3), (first, 1e-5))]
    (cell,) = summarise_contest(tiny, DEFAULT)["cells"]
    assert (cell["ratio"], cell["settled"]) == (1.0, FLOOR)


def line(dwell: Dwell, jump: float = 0.0) -> Any:
    """A line in hindsight, which may forget where it was when the reference rests."""
    rig, rest, _ = dwell_rig(dwell)
    fitted = fit_line(rig)

    class Forgetful(Line):
        seen = 0

        def run(self, r: Any) -> Any:
            self.seen += r.size
            return super().run(r) + (jump if self.seen > rest.start + 2 * rig.block else 0.0)

    return lambda sample_rate, limits, feedback=0.0: Forgetful(fitted.gain, fitted.centre, limits)


def test_a_line_goes_on_as_before_and_a_jump_is_seen() -> None:
    dwell = next(each for each in dwells(range(40), 1.0) if dwell_rig(each)[0].block > 1)
    rig, rest, drawn = dwell_rig(dwell)
    assert rest.stop - rest.start == rig.sample_rate
    assert np.abs(rig.reference[rest] - rig.reference[rest.start - 1]).max() <= 6.0 * drawn["setpoint_noise"]
    row = dwell.play(line(dwell))
    assert (row["failure"], row["kept"]) == (None, True)
    assert row["excursion"] < 0.05
    far = dwell.play(line(dwell, 0.2 * rig.reach.half))
    assert not far["kept"]
    assert far["excursion"] > row["excursion"]
    found = summarise_dwells([row, {**far, "seed": -1}, {**row, "failure": "ValueError: no"}])
    assert (found["runs"], found["failures"], found["kept"], found["rigs"]) == (3, 1, 1, 2)
    (group,) = found["groups"]
    assert (group["runs"], group["kept"], group["feedback"]) == (3, 1, False)
    assert group["largest"] == far["first"] / far["allowed"]
    assert [each["seed"] for each in found["worst"]] == [-1]


def test_the_command_plays_rests(tmp_path: Path) -> None:
    """By a controller that takes no feedback, so half of the runs fail."""
    words = ["safety", "--dwell", 1, "-c", "parts", "--jobs", 1, "--table", "csv", "--output", tmp_path]
    result = bench(*words, columns=160)
    assert result.exit_code == 0, result.output
    assert "After a rest of 60 s" in result.output
    document = json.loads((tmp_path / "dwell.json").read_text(encoding="utf-8"))
    assert (document["runs"], document["failures"]) == (2, 1)
    heads = (tmp_path / "dwell.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert heads[:3] == ["key", "controller", "seed"]
    assert {"duration", "setpoint_noise", "feedback", "failure", *dwelling.PERIODS, "kept"} <= {*heads}


@pytest.mark.parametrize("seed", range(3))
def test_an_inverse_without_error_settles_in_all_places(seed: int) -> None:
    """Resonance and steps of the voltage leave room: what is asked for can be reached."""
    for cell in settling.cells([seed], ["paper"]):
        rig = settling.cell_rig(cell)
        if not settling.asked(rig):
            continue
        straight = pz.LinearGain(rig.gain)
        stage = replace(rig, model=straight).stage(healthy=True)
        error = np.abs(rig.reference - stage.run(rig.reference / rig.gain)).reshape(-1, rig.plain.cycle)
        first = 0
        for _, factor, periods in SEGMENTS:
            allowed = max(SETTLED * factor * cell.amplitude, settling.NOISES * rig.noise)
            assert error[first + 1 : first + periods].max() < 0.6 * allowed, (cell, factor)
            first += periods


@pytest.mark.parametrize("seed", range(8))
def test_it_rests_where_the_wave_is(seed: int) -> None:
    rig, rest, drawn = dwell_rig(Dwell(seed, True, 2.0))
    r, cycle = rig.reference, rig.plain.cycle
    assert rest.stop - rest.start == round(2.0 * rig.sample_rate)
    assert np.abs(r[rest] - r[rest.start - 1]).max() <= 6.0 * drawn["setpoint_noise"]
    # Without the rest the wave goes on, and each period but the first is like the one before.
    whole = np.concatenate((r[: rest.start], r[rest.stop :]))[rig.plain.begins :]
    np.testing.assert_allclose(whole[2 * cycle :], whole[cycle:-cycle], atol=1e-9 * abs(r).max())
    assert whole.size - (rest.start - rig.plain.begins) >= 3 * cycle
    assert rest.start - rig.plain.begins >= BEFORE * cycle
    assert rig.plain.kind in SHAPES
    assert drawn["feedback"] > 0.0
    assert dwell_rig(Dwell(seed, False, 2.0))[2]["feedback"] == 0.0


def test_what_breaks_is_a_row() -> None:
    (task,) = tasks.tasks("parts", [Dwell(3, True, 1.0)])
    row, died = tasks.carry_out(task), tasks.died(task)
    assert "unexpected keyword argument 'feedback'" in row["failure"]
    assert died["failure"] == "the process died"
    found = summarise_dwells([row, died])
    assert found["failures"] == 2
    assert found["groups"][0]["first"] is None


def test_it_knows_nothing_of_what_is_still_to_come() -> None:
    for kind in ("gain-step", "sensor-constant", "zero-off"):
        rig = rig_with(kind, "permanent")
        before = rig.fault.start
        np.testing.assert_array_equal(learnt(rig)[0].voltage[:before], learnt(rig_with())[0].voltage[:before])
