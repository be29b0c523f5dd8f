"""Adaptive feed-forward as one object: what it promises whatever comes in, and what it shows."""

import copy
import functools
import logging
import pickle
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.controller import shown, team
from tests.controller.shared import LIMITS, LOOP, drive, last_error, read_back

FS = 5000.0
NO_NUMBERS: tuple[Any, ...] = (np.nan, None, np.inf, -np.inf, 1e300, "x", np.ma.masked, [], (1.0, "x"), 1j)


def controller(estimators: Any = (), limits: pz.VoltageLimits = LIMITS, **options: Any) -> Any:
    return pz.AdaptiveFeedforward(FS, limits=limits, estimators=estimators, **options)


def triangle(periods: int = 6, amplitude: float = 5.0) -> FloatArray:
    return pz.signals.triangle(amplitude, 10.0, periods, FS).values


def same(first: Any, second: Any) -> bool:
    """Whether two controllers are the same to the last bit, but for their work space."""
    return bool(first.to_dict() == second.to_dict())


def test_what_is_no_number_is_missing() -> None:
    driver = controller()
    drive(driver, pz.SimulatedStage(FS, LOOP), triangle(2))
    other = driver.copy()
    for bad in NO_NUMBERS:
        u = driver.step(bad)
        assert u == other.step(None)
        driver.learn(u, bad)
        other.learn(u, None)
    assert driver.state.tobytes() == other.state.tobytes()
    assert driver.status.missing == len(NO_NUMBERS)


@pytest.mark.parametrize("estimators", [(), None], ids=["line", "default"])
def test_blocks_of_one_are_samples(estimators: Any) -> None:
    single, blocks, r = controller(estimators), controller(estimators), triangle(3)
    r[700:703] = np.nan
    u, x, _ = drive(single, pz.SimulatedStage(FS, LOOP), r)
    for k in range(r.size):
        planned = blocks.run(r[k : k + 1])
        assert planned[0] == u[k]
        blocks.learn(planned, x[k : k + 1])
    assert same(single, blocks)
    assert single.status.missing == 3


def test_a_block_wants_its_own_length() -> None:
    driver = controller()
    with pytest.raises(ValueError, match=r"call run\(r\)"):
        driver.learn(np.zeros(3), np.zeros(3))
    u = driver.run(np.zeros(5))
    with pytest.raises(ValueError, match=r"must have 5 samples, .* got 4 and 4"):
        driver.learn(u[:4], u[:4])
    with pytest.raises(ValueError, match=r"u must have shape \(N,\)"):
        driver.learn(0.0, 0.0)
    driver.learn(u.tolist(), [0.0, None, np.nan, np.inf, 0.0])
    assert driver.status.samples == 5
    with pytest.raises(ValueError, match=r"call run\(r\)"):
        driver.learn(u, u)
    with pytest.raises(ValueError, match="r must have shape"):
        driver.run(np.zeros((2, 2)))
    driver.run(np.zeros(5))  # never written
    driver.learn(driver.step(0.0), 0.0)
    assert driver.status.samples == 6


def test_the_block_is_its_own() -> None:
    driver, other, r = controller(), controller(), triangle(1)
    given = r.copy()
    u = driver.run(given)
    given[:] = np.nan
    other.learn(other.run(r), u)
    driver.learn(u, u)
    assert same(driver, other)


COPIES: tuple[Any, ...] = (
    lambda driver: driver.copy(), copy.copy, copy.deepcopy, read_back,
    lambda driver: pickle.loads(pickle.dumps(driver)),
)  # fmt: skip
KNOWN = pz.models.LearntOn((-60.0, 60.0), (-3.0, 3.0), 1.0)
# What a user may say of the stage is kept, too.
OPTIONS: dict[str, dict[str, Any]] = {
    "line": {},
    "default": {"estimators": None},
    "feedback": {"feedback": 3.0},
    "resonance": {"resonance": 100.0},
    "gain": {"gain": 0.17},
    "model": {"model": pz.models.LearntModel(LOOP, KNOWN)},
    "slow": {"limits": pz.VoltageLimits(-20.0, 100.0, 1e3, FS), "corridor": 0.3},
}


@pytest.mark.parametrize("after", [0, 30, 2500])
@pytest.mark.parametrize("name", OPTIONS)
def test_a_copy_goes_on_bit_for_bit(name: str, after: int) -> None:
    driver, stage, r = controller(**OPTIONS[name]), pz.SimulatedStage(FS, LOOP), triangle()
    drive(driver, stage, r[:after])
    others = [again(driver) for again in COPIES]
    stages = [copy.deepcopy(stage) for _ in others]
    before = [(other.state.tobytes(), other.settings.tobytes()) for other in others]
    u = drive(driver, stage, r[after : after + 500]).u
    assert [(other.state.tobytes(), other.settings.tobytes()) for other in others] == before
    for other, own in zip(others, stages, strict=True):
        np.testing.assert_array_equal(drive(other, own, r[after : after + 500]).u, u)
        assert same(driver, other)
    driver.run(r[:9])  # a block that waits for its readings
    others = [again(driver) for again in COPIES]
    for each in (driver, *others):
        each.learn(0.1 * r[:9], r[:9])
    assert all(same(driver, other) for other in others)
    driver.reset()
    assert same(driver, controller(**OPTIONS[name]))


@functools.cache
def saved(estimators: Any) -> dict[str, Any]:
    driver = controller(estimators)
    drive(driver, pz.SimulatedStage(FS, LOOP), triangle(6 if estimators is None else 1))
    return dict(driver.to_dict())


MODEL = ("state", "candidates", "model", "estimator")
OTHER = ("state", "candidates", "others", "others", "model", "estimator")


@pytest.mark.parametrize(
    ("estimators", "path", "value", "message"),
    [
        ((), ("controller",), "HysteresisRLS", "not of a AdaptiveFeedforward"),
        ((), ("controller",), None, "data is of a None"),
        ((), ("gain",), np.nan, "gain must"),
        ((), ("learnt_on",), 3, "learnt_on must"),
        ((), ("format",), 2, "format 2"),
        ((), ("more",), 1, "unknown fields"),
        ((), ("limits", "more"), 1.0, "limits has unknown"),
        ((), ("estimators",), None, "estimators must be a list"),
        ((), ("estimators",), [{}] * 5, "at most 4"),
        ((), ("estimators",), [{}], "estimator None is unknown"),
        ((), ("state",), {}, "state has no"),
        ((), ("state", "line", "gain"), np.nan, "finite"),
        ((), ("state", "driving"), 7.0, "driving must be a whole number"),
        ((), ("state", "start"), {"stage": 0.0, "samples": 9.0}, "readings at rest"),
        ((), ("models",), None, "models must be a list"),
        ((), ("models",), [{}], "models must be 0"),
        ((), ("planned",), "x", "planned must"),
        ((), ("events",), None, "events must be a list"),
        ((), ("events",), [[1.0, 2.0, 3.0]], "events must be .time"),
        (None, (*MODEL, "samples"), -1.0, "must"),
        (None, (*OTHER, "plays"), {}, "must|has no"),
        (None, ("models", 2, "thresholds"), [1.0], "must"),
        (None, ("models", 2, "plays"), 1e6, "must"),
        (None, ("models", 0, "a"), np.nan, "must"),
        (None, ("models", 0), None, "must"),
        (None, ("estimators", 0, "arguments"), {}, "must|has no"),
    ],
)
def test_a_damaged_file_is_refused(estimators: Any, path: tuple[Any, ...], value: Any, message: str) -> None:
    data = copy.deepcopy(saved(estimators))
    inner: Any = data
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = inner["start"] | value if path[-1] == "start" else value
    with pytest.raises(ValueError, match=message):
        pz.AdaptiveFeedforward.from_dict(data)


@pytest.mark.parametrize(("nothing", "message"), [(7, "dictionary"), ({}, "no .controller.: pass")])
def test_what_is_no_controller_is_refused(nothing: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        pz.AdaptiveFeedforward.from_dict(nothing)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        *(({"sample_rate": rate}, "sample_rate") for rate in (0.0, -1.0, np.nan, "fast", None)),
        *(({"feedback": gain}, "feedback must") for gain in (-1.0, np.nan, np.inf, "x", 1300.0)),
        *(({"resonance": wrong}, "resonance must") for wrong in (0.0, -1.0, np.nan, np.inf, "x", 1e30)),
        ({"gain": 0.1, "stroke": 20.0}, "gain and stroke both give the gain: pass one of them"),
        ({"gain": 0.1, "stroke": 20.0, "model": LOOP}, "gain and stroke and model all give"),
        ({"gain": 0.0}, "gain must not be zero"),
        ({"gain": np.nan}, "gain must be finite"),
        ({"gain": "x"}, "gain must be one number"),
        ({"gain": 1e30}, "size of gain must lie within"),
        ({"stroke": 0.0}, "stroke must not be zero"),
        ({"stroke": np.inf}, "stroke must be finite"),
        ({"model": 0.1}, "model must be a model, as LinearGain"),
        *(({"limits": wrong}, "limits must be VoltageLimits") for wrong in (None, (-1.0, 1.0))),
        *(({"limits": pz.VoltageLimits(*wrong)}, "limits must be finite") for wrong in ((), (0.0,))),
        *(({"limits": pz.VoltageLimits(0.0, wrong)}, "limits must lie within") for wrong in (1e7, 1e-9)),
        ({"limits": pz.VoltageLimits(0.0, 1.0, sample_rate=1.0)}, "limits are for 1 Hz"),
        *(({"corridor": wrong}, "corridor must") for wrong in (1.5, "wide")),
        ({"estimators": pz.HysteresisRLS}, "estimators must be a tuple"),
        ({"estimators": (pz.HysteresisRLS(FS),)}, r"estimators\[0\] must be a class"),
        ({"estimators": (pz.HysteresisRLS,) * 5}, "at most 4, got 5"),
        ({"estimators": (pz.BatchFit,)}, r"estimators\[0\] must (make|go)"),
        ({"estimators": (lambda rate: None,)}, "initial_model=..., noise=..."),
        ({"estimators": (lambda rate, **given: None,)}, "must make a compiled estimator"),
        ({"estimators": (lambda rate, **given: pz.HysteresisRLS(rate, initial_model=pz.LinearGain(0.01)),)},
         "of a gain of about one"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        pz.AdaptiveFeedforward(**{"sample_rate": FS, "limits": LIMITS, **options})


@pytest.mark.parametrize(
    ("call", "arguments", "message"),
    [
        *(("reset", {"voltage": wrong}, "voltage must") for wrong in (61.0, np.nan, "x")),
        *(("reset", {"displacement": wrong}, "displacement must") for wrong in (np.nan, np.inf, "x", 1e12)),
        ("home", {"amplitude": 0.0}, "amplitude must be above zero"),
        ("home", {"amplitude": 61.0}, "amplitude must be at most 60 V, half the range, got 61 V"),
        ("home", {"amplitude": np.nan}, "amplitude must be finite"),
        ("home", {"frequency": 0.0}, "frequency must"),
        ("home", {"frequency": 400.0}, "frequency must be at most 312.5 Hz"),
        *(("home", {"cycles": wrong}, "cycles must") for wrong in (0, 1.5, 10**6)),
    ],
)
def test_calls_that_cannot_be_change_nothing(call: str, arguments: dict[str, Any], message: str) -> None:
    driver = controller()
    with pytest.raises(ValueError, match=message):
        getattr(driver, call)(**arguments)
    assert same(driver, controller())


def test_estimators_have_names_keep_their_arguments_and_are_made_for_a_gain_of_one() -> None:
    factories = (pz.HysteresisRLS, functools.partial(pz.HysteresisRLS, memory=0.4), pz.HysteresisEKF)
    made, own = team.made(factories, FS), ("HysteresisRLS", "HysteresisRLS 2", "HysteresisEKF")
    assert team.names(made) == ("line", *own, team.DUHEM, team.RECORDED)
    assert all(0.5 < each.model.line[0] < 2.0 for each in made)
    assert made[1].to_dict()["arguments"]["memory"] == 0.4
    assert len(controller().candidates) == 1


def test_the_model_is_in_micrometres() -> None:
    driver = controller(None)
    assert driver.model is None
    assert [(each.model, each.missed) for each in driver.candidates] == [(None, None)] * 6
    u, x, _ = drive(driver, pz.SimulatedStage(FS, LOOP), triangle(20) + 3.0)
    for each in driver.candidates:
        error = each.model.simulate(u) - x
        assert np.sqrt(np.mean(error[-500:] ** 2)) < (0.6 if each.name == "line" else 0.05), each
        assert each.missed is not None
    assert driver.candidates[0].missed > 0.2
    assert driver.candidates[-2].missed < 0.2 * driver.candidates[0].missed  # the Duhem model
    (driving,) = [each for each in driver.candidates if each.drives]
    assert (driving.name, driving.model) == (driver.status.driving, driver.model)
    assert driving.name != "line"
    kinds = [type(each.model) for each in driver.candidates[:-2]]
    assert kinds == [pz.LinearGain, pz.ColemanHodgdon, pz.ColemanHodgdon, pz.PrandtlIshlinskii]


def test_the_status_counts() -> None:
    limits = pz.VoltageLimits(0.0, 20.0, slew_rate=2e3, sample_rate=FS)
    driver = controller(limits=limits)
    assert driver.status == shown.ControllerStatus(0, 0, "seeking", "line", "", 0, 0, 0)
    u = drive(driver, pz.SimulatedStage(FS, LOOP), triangle(4)).u
    assert 0.0 <= u.min() <= u.max() <= 20.0
    assert driver.status.samples == u.size
    assert driver.status.saturated > 100
    assert driver.voltage == u[-1]
    assert (driver.sample_rate, driver.limits) == (FS, limits)


def test_faults_have_a_name(caplog: pytest.LogCaptureFixture) -> None:
    driver, stage, r = controller(), pz.SimulatedStage(FS, LOOP), triangle(20)
    with caplog.at_level(logging.INFO, logger="piezoest"):
        drive(driver, stage, r, lambda k, x: -x if 4000 <= k < 6000 else x)
    assert [event.action for event in driver.events[:2]] == ["fell back", "resumed"]
    fell, resumed, *more = driver.events
    assert {event.action for event in more} <= {"went on"}
    assert fell.reason.startswith("reversed: ")
    assert 0.8 < fell.time < 0.9
    assert 1.2 < resumed.time < 1.5
    assert [line.levelno for line in caplog.records[:2]] == [logging.WARNING, logging.INFO]
    assert "reversed" in caplog.text
    assert driver.status.fault == ""
    assert read_back(driver).events == driver.events


@pytest.mark.parametrize("gain", [0.0015, 0.15, 3.0, 20.0, -0.2])
def test_the_gain_need_not_be_known(gain: float) -> None:
    scale = gain / LOOP.c
    driver, r = controller(None), triangle(20, amplitude=25.0 * abs(gain))
    x = scale * drive(driver, pz.SimulatedStage(FS, LOOP), r, lambda _, x: scale * x).x
    assert driver.status.stage == "running"
    assert last_error(r, x) < 0.03 * 25.0 * abs(gain)
    assert driver.model.line[0] * gain > 0.0


@pytest.mark.parametrize("limits", [(0.0, 100.0), (10.0, 110.0), (-100.0, 0.0)])
def test_the_range_may_have_one_sign(limits: tuple[float, float]) -> None:
    r = pz.signals.sine(5.0, 10.0, 20, FS).values + 0.5 * LOOP.c * sum(limits)
    u, x, _ = drive(controller(None, pz.VoltageLimits(*limits)), pz.SimulatedStage(FS, LOOP), r)
    assert limits[0] <= u.min() <= u.max() <= limits[1]
    assert last_error(r, x) < 0.1


def test_track_drives_the_ring() -> None:
    r = pz.signals.triangle(5.0, 10.0, 20, FS)
    line, record = (
        pz.track(r, stage=pz.PaperStage(FS, seed=0), controller=controller(estimators))
        for estimators in ((), None)
    )
    assert record.max_error(last_periods=2) < 0.1 * line.max_error(last_periods=2)
    assert (record.parameter_names, record.theta.shape) == ((), (len(r), 0))
    u, x, _ = drive(controller(None), pz.PaperStage(FS, seed=0), r.values)
    np.testing.assert_array_equal(record.voltage, u)
    np.testing.assert_array_equal(record.measured, x)
    assert "max error" in record.table()


def test_track_wants_one_driver() -> None:
    r = pz.signals.triangle(5.0, 10.0, 1, FS)
    driver, stage = controller(), pz.PaperStage(FS, seed=0)
    line: Any = pz.LinearCompensator(pz.LinearGain(0.15))
    for other in ({"compensator": line}, {"estimator": pz.HysteresisRLS(FS)}):
        with pytest.raises(ValueError, match=f"does without {next(iter(other))}"):
            pz.track(r, stage=stage, controller=driver, **other)
    with pytest.raises(ValueError, match="pass compensator= or controller="):
        pz.track(r, stage=stage)
    with pytest.raises(ValueError, match="sample rates differ"):
        pz.track(r, stage=stage, controller=pz.AdaptiveFeedforward(2.0 * FS, limits=LIMITS, estimators=()))
