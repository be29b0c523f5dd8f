"""Erasing what hysteresis remembers, and writes of which nobody knows the outcome."""

import copy
from typing import Any

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

import piezoest as pz
from piezoest.controller import shown
from tests.controller.shared import LIMITS, LOOP, drive, last_error, read_back

FS = 5000.0
PLAYS = pz.PrandtlIshlinskii(0.1, [2.0, 6.0, 12.0, 20.0, 30.0], [0.02, 0.02, 0.015, 0.01, 0.01])
SINE = pz.signals.sine(3.0, 10.0, 1, FS).values
TWENTY = np.tile(SINE, 20)


def controller(limits: pz.VoltageLimits = LIMITS, estimators: Any = (), **options: Any) -> Any:
    return pz.AdaptiveFeedforward(FS, limits=limits, estimators=estimators, **options)


SWEEPS: dict[str, tuple[pz.VoltageLimits, dict[str, Any], tuple[float, float]]] = {
    "all of it": (LIMITS, {"frequency": 20.0}, (0.0, 60.0)),
    "about the rest": (pz.VoltageLimits(-20.0, 100.0), {"amplitude": 20.0, "frequency": 20.0}, (0.0, 20.0)),
    "the middle": (pz.VoltageLimits(-20.0, 100.0), {"amplitude": 30.0, "frequency": 20.0}, (40.0, 30.0)),
    "one sign": (pz.VoltageLimits(0.0, 100.0), {"frequency": 20.0, "cycles": 3}, (50.0, 50.0)),
    "slow": (pz.VoltageLimits(-60.0, 60.0, 2000.0, FS), {"amplitude": 40.0, "frequency": 60.0}, (0.0, 40.0)),
}


@pytest.mark.parametrize("name", SWEEPS)
def test_the_voltage_swings_less_and_less(name: str) -> None:
    limits, options, (middle, amplitude) = SWEEPS[name]
    driver, stage = controller(limits), pz.SimulatedStage(FS, LOOP)
    drive(driver, stage, np.tile(SINE, 3) + 0.15 * middle)
    before = driver.voltage
    driver.home(**options)
    u, _, doing = drive(driver, stage, np.full(30_000, 0.15 * middle + 1.0))
    swept = u[: doing.index("approaching")]
    assert set(doing[: swept.size]) == {"homing"}
    assert doing[-1] == "running"
    assert np.abs(swept - middle).max() == pytest.approx(max(amplitude, abs(before - middle)), rel=0.01)
    assert abs(swept[-1] - middle) < 0.001 * amplitude
    # It begins and ends gently, and keeps the slew rate.
    steps = np.abs(np.diff(swept, prepend=before))
    assert max(steps[0], steps[-1]) < 0.05 * steps.max()
    assert steps.max() <= limits.largest_step
    extremes = np.abs(swept[1:-1] - middle)[np.diff(np.sign(np.diff(swept))) != 0.0]
    assert np.all(np.diff(extremes[extremes > 0.01 * amplitude][-2 * options.get("cycles", 10) + 2 :]) < 0.0)
    # Nothing was in the way of the sweep itself.
    again = controller(limits)
    again.home(**options)
    drive(again, pz.SimulatedStage(FS, LOOP), np.zeros(swept.size))
    assert (again.status.slewed, again.status.saturated) == (0, 0)


# To an extreme and back.
AWAY = np.concatenate([np.linspace(0.0, 50.0, 200), np.linspace(50.0, 0.0, 200)])


def test_it_erases_what_the_stage_remembers() -> None:
    displacements = []
    for way in (AWAY, -AWAY):
        driver, stage = controller(), pz.SimulatedStage(FS, PLAYS)
        stage.run(way)
        assert abs(stage.step(0.0)) > 0.5
        driver.home(frequency=20.0)
        while driver.status.stage == "homing":
            driver.learn(driver.step(0.0), stage.step(driver.voltage))
        displacements.append(stage.step(0.0))
    assert np.abs(displacements).max() < 0.1


def test_the_models_know_the_stage_again() -> None:
    driver, stage = controller(estimators=None), pz.SimulatedStage(FS, PLAYS)
    drive(driver, stage, np.tile(SINE, 60))
    assert driver.status.driving != "line"
    driver, stage = read_back(driver), pz.SimulatedStage(FS, PLAYS)
    stage.run(-AWAY)
    driver.learn(0.0, None)
    driver.home(frequency=20.0)
    assert driver.status.driving == "line"
    drive(driver, stage, np.zeros(2624))
    _, x, doing = drive(driver, stage, TWENTY)
    assert doing[-1] == "running"
    assert driver.status.driving != "line"
    assert last_error(TWENTY, x) < 0.05
    assert driver.events == ()


@pytest.mark.parametrize(
    ("gain", "before", "stages"),
    [(None, 0, ["homing", "seeking"]), (0.2, 0, ["homing", "seeking"]), (None, 10, ["homing"])],
)
def test_it_needs_no_gain_and_no_readings(gain: float | None, before: int, stages: list[str]) -> None:
    driver, stage = controller(gain=gain), pz.SimulatedStage(FS, LOOP)
    drive(driver, stage, np.tile(SINE, before))
    driver.home(30.0, 20.0, 3)
    run = drive(driver, stage, TWENTY, lambda _, x: None if driver.status.stage == "homing" else x)
    assert list(dict.fromkeys(run.doing)) == [*stages, "approaching", "running"]
    assert last_error(TWENTY, run.x) < 0.5


@pytest.mark.parametrize("after", [0, 100, 400, 900])
def test_it_goes_on_in_copies_files_and_blocks(after: int) -> None:
    driver, stage, r = controller(), pz.SimulatedStage(FS, LOOP), np.tile(SINE, 3)
    drive(driver, stage, np.tile(SINE, 4))
    driver.home(20.0, 40.0, 5)
    drive(driver, stage, np.zeros(after))
    others, blocks = (driver.copy(), read_back(driver)), driver.copy()
    stages = [copy.deepcopy(stage) for _ in range(3)]
    u = drive(driver, stage, r).u
    for other, own in zip(others, stages[:2], strict=True):
        np.testing.assert_array_equal(drive(other, own, r).u, u)
        assert other.to_dict() == driver.to_dict()
    left = max(0, 700 - after)  # the way there and five cycles of 125 samples, about
    for start in range(0, left - left % 25, 25):
        planned = blocks.run(r[start : start + 25])
        np.testing.assert_allclose(planned, u[start : start + 25], atol=1e-12)
        blocks.learn(planned, stages[2].run(planned))


def test_the_next_day_it_goes_from_where_the_stage_rests() -> None:
    driver, stage = controller(estimators=None), pz.SimulatedStage(FS, PLAYS)
    r = TWENTY + 4.0
    drive(driver, stage, r)
    assert driver.voltage > 20.0
    driver, rest = read_back(driver), -5.0
    x = stage.run(np.linspace(driver.voltage, rest, 500))[-1]
    driver.resume(rest, float(x))
    assert (driver.status.stage, driver.status.driving, driver.voltage) == ("approaching", "line", rest)
    u, x, doing = drive(driver, stage, r)
    assert np.abs(np.diff(u, prepend=rest)).max() < 2.0
    assert list(dict.fromkeys(doing)) == ["approaching", "running"]
    assert driver.status.driving != "line"
    assert last_error(r, x) < 0.05
    assert driver.events == ()


def test_a_controller_that_knows_nothing_resumes_as_if_reset() -> None:
    one, other = controller(), controller()
    drive(one, pz.SimulatedStage(FS, LOOP), SINE[:3])
    one.resume(5.0, 1.0)
    other.reset(5.0, 1.0)
    first, second = (drive(each, pz.SimulatedStage(FS, LOOP), np.tile(SINE, 2)).u for each in (one, other))
    np.testing.assert_array_equal(first, second)


@pytest.fixture(scope="module")
def once() -> tuple[Any, Any]:
    driver, stage = controller(estimators=(pz.OutputErrorRLS,)), pz.SimulatedStage(FS, LOOP)
    drive(driver, stage, TWENTY)
    assert driver.status.driving != "line"
    return driver, stage


@pytest.fixture
def learnt(once: Any) -> Any:
    """A controller that has learnt its stage, and that stage."""
    return copy.deepcopy(once)


def test_it_resumes_from_a_fault_without_it(learnt: Any) -> None:
    driver, stage = learnt
    drive(driver, stage, np.tile(SINE, 2), lambda k, x: 1.0)
    assert driver.status.fault != ""
    driver.resume(0.0, float(stage.run(np.linspace(driver.voltage, 0.0, 100))[-1]))
    assert driver.status.fault == ""


def test_a_write_that_is_lost_within_a_block_does_not_widen_the_corridor(learnt: Any) -> None:
    driver, stage = learnt
    before = float(driver.state["widest"])
    u = driver.run(SINE[:60])
    x = stage.run(u)
    u[10] = np.nan
    driver.learn(u, x)
    assert driver.state["widest"] < 1.5 * before


@pytest.mark.parametrize(
    "wrong", [(70.0, 0.0), (np.nan, 0.0), (None, 0.0), (0.0, None), (0.0, np.inf), (0.0, 1e30)]
)
def test_a_rest_that_cannot_be_is_refused(learnt: Any, wrong: Any) -> None:
    driver, _ = learnt
    before = driver.to_dict()
    with pytest.raises(ValueError, match=r"(voltage|displacement) must"):
        driver.resume(*wrong)
    assert driver.to_dict() == before


def test_a_write_that_may_be_lost_makes_the_line_drive(learnt: Any) -> None:
    driver, stage = learnt
    before = len(driver.events)
    # Several in a row: the planned voltage and the last one that is known part.
    planned = drive(driver, stage, SINE[:40], told=lambda u: None).u
    assert driver.status.driving == "line"
    assert len(driver.events) == before + 1
    assert driver.events[-1].action == "went on"
    assert driver.events[-1].reason.startswith("unknown voltage: ")
    assert driver.candidates[1].missed is None
    assert np.abs(np.diff(planned)).max() < 2.0 * np.abs(np.diff(drive(driver, stage, SINE).u)).max()
    x = drive(driver, stage, TWENTY).x
    assert driver.status.driving != "line"
    assert last_error(TWENTY, x, 500) < 0.05


def test_one_that_changes_nothing_does_not_matter(learnt: Any) -> None:
    driver, stage = learnt
    r = np.concatenate([np.tile(SINE, 2), SINE[:125], np.full(50, SINE[124])])  # at rest at the top
    drive(driver, stage, r)
    before, known = driver.events, driver.copy()
    u = driver.step(SINE[124])
    driver.learn(None, stage.step(u))
    known.learn(known.step(SINE[124]), np.nan)
    assert driver.status.driving != "line"
    assert driver.events == before
    assert driver.step(SINE[124]) == pytest.approx(known.step(SINE[124]), abs=0.01)


@pytest.mark.parametrize("said", ["unknown", "nothing"])
def test_for_long_without_news_of_the_voltage_it_follows_the_line(learnt: Any, said: str) -> None:
    (driver, stage), (_, other) = learnt, copy.deepcopy(learnt)
    straight = controller(gain=driver.candidates[0].model.gain)
    line, r = last_error(TWENTY, drive(straight, other, TWENTY).x), np.tile(SINE, 6)
    left_out = () if said == "unknown" else range(r.size)
    u, x, _ = drive(driver, stage, r, left_out=left_out, told=lambda u: None)
    assert np.abs(r - x).max() < 1.2 * line
    assert np.abs(np.diff(u)).max() < 2.5 * np.abs(np.diff(drive(driver, stage, r).u)).max()


def test_steps_without_a_write_go_on_along_the_line(learnt: Any) -> None:
    driver, stage = learnt
    drive(driver, stage, SINE[:60])
    first = driver.step(SINE[60])
    assert driver.step(SINE[60]) == first  # nobody knows of the first one
    gone = (SINE[63] - SINE[60]) / driver.candidates[0].model.gain
    assert driver.step(SINE[63]) == pytest.approx(first + gone, abs=1e-9)


def test_nothing_is_lost_before_it_runs() -> None:
    driver = controller()
    drive(driver, pz.SimulatedStage(FS, LOOP), np.ones(20), told=lambda u: None)
    assert driver.status.stage == "seeking"
    assert driver.events == ()


VALUE: Any = st.one_of(
    st.floats(-10.0, 10.0),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([None, "x", 1e300, np.ma.masked, 1j]),
)
CALL = st.one_of(
    st.tuples(st.just("step"), VALUE),
    st.tuples(st.just("learn"), st.one_of(VALUE, st.just("planned")), VALUE),
    st.tuples(st.just("ring"), st.integers(1, 120)),
    st.tuples(st.just("home"), st.floats(0.01, 60.0), st.floats(1.0, 300.0), st.integers(1, 5)),
    st.tuples(st.just("reset"), st.floats(-20.0, 100.0), st.one_of(st.none(), st.floats(-50.0, 50.0))),
    st.tuples(st.just("resume"), st.floats(-20.0, 100.0), st.floats(-50.0, 50.0)),
    st.tuples(st.just("block"), st.integers(1, 60), st.booleans()),
    st.tuples(st.just("file")),
)


@hypothesis.given(
    calls=st.lists(CALL, min_size=1, max_size=30),
    before=st.sampled_from([0, 50, 400]),
    known=st.sampled_from(
        [{}, {"gain": 0.2}, {"gain": -5.0}, {"stroke": 1e-3, "feedback": 20.0}, {"estimators": None}]
    ),
    slew_rate=st.sampled_from([None, 1e3]),
)
@hypothesis.example(calls=[("resume", 1.0, -6e-170)], before=50, known={}, slew_rate=None)
@hypothesis.settings(derandomize=True, deadline=None, max_examples=150)
def test_whatever_is_called_the_voltage_is_finite_and_within_limits(
    calls: list[Any], before: int, known: dict[str, Any], slew_rate: float | None
) -> None:
    limits = pz.VoltageLimits(-20.0, 100.0, slew_rate, None if slew_rate is None else FS)
    driver, stage = controller(limits, **{"feedback": 5.0, **known}), pz.SimulatedStage(FS, LOOP)
    voltages = [0.0]

    def ring(count: int) -> None:
        voltages.extend(drive(driver, stage, np.tile(SINE, 2)[:count]).u)

    ring(before)
    for name, *values in calls:
        if name == "step":
            voltages.append(driver.step(values[0]))
        elif name == "learn":
            driver.step(0.0)
            driver.learn(driver.voltage if values[0] == "planned" else values[0], values[1])
        elif name == "ring":
            ring(values[0])
        elif name == "block":
            u = driver.run(SINE[: values[0]])
            voltages.extend(u.tolist())
            if values[1]:
                driver.learn(u, 0.15 * u)
            else:
                driver.step(0.0)
        elif name == "file":
            driver = read_back(driver)
        else:
            getattr(driver, name)(*values)
    ring(20)
    assert np.all(np.isfinite(voltages))
    assert -20.0 <= min(voltages) <= max(voltages) <= 100.0
    assert driver.status.stage in shown.STAGES
    assert read_back(driver).to_dict() == driver.to_dict()
    assert all(each.missed is None or each.missed >= 0.0 for each in driver.candidates)
