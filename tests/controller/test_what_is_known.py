"""What a user knows of a stage: its gain, where it stands; and what a controller does if that is wrong."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from tests.controller import shared
from tests.controller.shared import LIMITS, LOOP, last_error

FS = 5000.0
SINE = pz.signals.sine(5.0, 10.0, 10, FS).values
FAST, SLOPE, SWEPT = 10_000.0, 0.06, 2.5
UNIPOLAR, BIASED, BIPOLAR = (0.0, 150.0), (-20.0, 120.0), (-100.0, 100.0)


def controller(estimators: Any = (), **options: Any) -> Any:
    return pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=estimators, **options)


def loop() -> Callable[[float], float]:
    return pz.SimulatedStage(FS, LOOP).step


def lag(time_constant: float) -> Callable[[float], float]:
    """A stage that is late by a time constant [s]."""
    x, share = 0.0, 1.0 - np.exp(-1.0 / (time_constant * FS))

    def step(u: float) -> float:
        nonlocal x
        x += share * (0.15 * u - x)
        return float(x)

    return step


def backlash(width: float, slope: float = 0.15) -> Callable[[float], float]:
    """A play of a width [V] on either side."""
    place = 0.0

    def step(u: float) -> float:
        nonlocal place
        place = min(max(place, u - width), u + width)
        return slope * place

    return step


def drive(
    driver: Any, stage: Any, r: FloatArray, noise: float = 0.0
) -> tuple[FloatArray, FloatArray, list[str]]:
    """Voltage, displacement, and stage of the work after each sample."""
    rng = np.random.default_rng(0)
    run = shared.drive(driver, SimpleNamespace(step=stage), r, lambda _, x: x + noise * rng.normal())
    return run.u, run.x, [*run.doing[1:], driver.status.stage]


def fifty_hertz(hum: float, phase: float, rate: float = FAST) -> Callable[[int, float], float]:
    """A sensor with hum of this amplitude [µm], read at this rate [Hz]."""
    return lambda k, x: x + float(hum * np.sin(2.0 * np.pi * 50.0 * k / rate + phase))


@pytest.mark.parametrize(
    "known", [{"gain": 0.2}, {"gain": 0.1}, {"gain": 0.3}, {"stroke": 20.0}, {"model": LOOP}], ids=str
)
@pytest.mark.parametrize("noise", [0.0, 0.05, 0.3])
def test_nothing_is_sought_where_the_gain_is_known(known: dict[str, Any], noise: float) -> None:
    driver = controller(**known)
    _, x, stages = drive(driver, loop(), SINE, noise)
    assert stages.index("approaching") == 4
    assert stages.index("running") < 300
    assert "seeking" not in stages[4:]
    assert last_error(SINE, x) < 0.65
    assert driver.events == ()


@pytest.mark.parametrize("gain", [-0.2, 2.0, 1e-4, 300.0])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_gain_that_is_wrong_is_sought(gain: float, noise: float) -> None:
    driver = controller(gain=gain)
    u, x, stages = drive(driver, loop(), SINE, noise)
    (event,) = driver.events
    assert event.action == "went on"
    assert event.reason.startswith("gain: the stage answers with ")
    assert event.reason.endswith(f"V, not {gain:.3g}: the gain is sought")
    noticed = int(event.time * FS)
    assert np.abs(u[:noticed]).max() < 0.05 * 120.0  # it has not run away
    assert stages[noticed] == "seeking"
    assert driver.model.line[0] == pytest.approx(0.2, rel=0.3)
    assert last_error(SINE, x) < 0.65


@pytest.mark.parametrize("time_constant", [2e-3, 6e-3, 0.03, 0.1])
def test_a_stage_that_lags_is_waited_for(time_constant: float) -> None:
    driver, r = controller(gain=0.15), np.full(6000, 5.0)
    _, x, stages = drive(driver, lag(time_constant), r)
    assert "seeking" not in stages[4:]
    assert stages[-1] == "running"
    assert x.max() < 5.5
    assert abs(x[-1] - 5.0) < 0.4


def test_a_little_backlash_is_waited_for_and_much_is_sought() -> None:
    assert "seeking" not in drive(controller(gain=0.15), backlash(0.8), SINE)[2][4:]
    driver = controller(gain=0.15)
    _, x, _ = drive(driver, backlash(6.0), SINE)
    assert driver.events[0].reason.startswith("gain: the stage answers with 0 µm/V, not 0.15")
    assert last_error(SINE, x) < 2.5


def test_a_stage_that_does_not_answer_is_named() -> None:
    driver = controller(gain=0.15)
    u, _, stages = drive(driver, lambda u: 1.0, np.tile(SINE, 2))
    assert driver.status.fault == "no response"
    assert stages[-1] == "seeking"
    assert np.abs(u).max() < 0.6 * 60.0
    driver = controller(gain=0.15)  # nor does a voltage move much that nobody reads
    driver.reset(displacement=0.0)
    assert 0.0 < np.abs(drive(driver, lambda u: np.nan, SINE)[0]).max() <= 0.011 * 120.0


@pytest.mark.parametrize("gain", [None, 0.2])
def test_the_readings_at_rest_need_not_be_waited_for(gain: float | None) -> None:
    driver, stage = controller(gain=gain), pz.SimulatedStage(FS, LOOP)
    driver.reset(10.0, float(stage.run(np.linspace(0.0, 10.0, 50))[-1]))
    assert driver.step(0.0) == 10.0
    driver.learn(10.0, np.nan)
    u, x, stages = drive(driver, stage.step, SINE)
    assert u[1] != 10.0
    assert stages[0] == ("seeking" if gain is None else "approaching")
    assert last_error(SINE, x) < 0.65
    driver.reset()
    assert driver.to_dict() == controller(gain=gain).to_dict()


def test_limits_may_be_any_numbers() -> None:
    given: Any = (np.int64(-20), np.float32(120.0), np.int64(5000), np.int32(FS))
    limits = pz.VoltageLimits(*given)
    driver = pz.AdaptiveFeedforward(FS, limits=limits, estimators=())
    assert shared.read_back(driver).to_dict() == driver.to_dict()


def test_where_it_stands_may_be_wrong() -> None:
    driver = controller()
    driver.reset(displacement=3.0)
    _, x, _ = drive(driver, loop(), SINE)
    assert last_error(SINE, x) < 0.65


def test_a_gain_that_drowns_in_noise_is_believed() -> None:
    driver = controller(gain=0.2)
    _, _, stages = drive(driver, loop(), np.tile(SINE, 2), noise=3.0)
    assert "seeking" not in stages[4:]
    assert stages[-1] == "running"


@pytest.mark.parametrize("limits", [(0.0, 100.0), (-100.0, 0.0), (-1.0, 100.0)])
@pytest.mark.parametrize("gain", [0.2, -0.2])
def test_the_check_goes_where_there_is_room(limits: tuple[float, float], gain: float) -> None:
    driver = pz.AdaptiveFeedforward(FS, limits=pz.VoltageLimits(*limits), estimators=(), gain=gain)
    r = SINE + 0.1 * sum(limits)
    _, x, stages = drive(driver, loop(), r)
    assert ("seeking" in stages[4:]) == (gain < 0.0)
    assert last_error(r, x) < 0.7


@pytest.mark.parametrize("gain", [0.2, -0.2])
def test_a_fast_reference_and_hum_do_not_lead_astray(gain: float) -> None:
    driver, r = controller(gain=gain), pz.signals.sine(5.0, 40.0, 60, FS).values
    run = shared.drive(driver, pz.SimulatedStage(FS, LOOP), r, fifty_hertz(0.15, 0.0, FS))
    assert ("seeking" in run.doing[5:]) == (gain < 0.0)
    assert driver.status.stage == "running"
    assert np.abs(run.u).max() < 50.0


@pytest.mark.parametrize("gain", [0.1, 0.15, 0.3, -1.0])
def test_models_learn_with_a_gain_that_is_about_right_and_anew_with_one_that_was_sought(gain: float) -> None:
    driver = controller(None, gain=gain)
    _, x, _ = drive(driver, loop(), np.tile(SINE, 2))
    assert [event.action for event in driver.events] == (["went on"] if gain < 0.0 else [])
    assert driver.status.driving != "line"
    assert last_error(SINE, x[SINE.size :]) < 0.1


# Hum passes for the answer to the first small ways, but not where it is as large as the answer.
@pytest.mark.parametrize(
    ("limits", "width", "hum", "doubted"),
    [
        (UNIPOLAR, 2.0, 0.1, True), (UNIPOLAR, 2.0, 0.2, True), (BIASED, 2.0, 0.1, True),
        (BIASED, 2.0, 0.2, True), (BIPOLAR, 2.0, 0.2, True), (BIPOLAR, 3.0, 0.2, True),
        (UNIPOLAR, 5.0, 0.2, False), (BIASED, 5.0, 0.2, False),
    ],
)  # fmt: skip
def test_a_gain_of_the_wrong_sign_is_doubted(limits: Any, width: float, hum: float, doubted: bool) -> None:
    driver = pz.AdaptiveFeedforward(FAST, limits=pz.VoltageLimits(*limits), estimators=())
    wave = pz.signals.triangle(SWEPT, 5.0, 14, FAST).values + 0.35 * SLOPE * sum(limits)
    r, play = np.concatenate((np.linspace(0.0, wave[0], 1000), wave)), backlash(width, 1.0)
    stage = SimpleNamespace(step=lambda u: SLOPE * (play(u) + 0.05 * u) / 1.05)
    run = shared.drive(driver, stage, r, fifty_hertz(hum, 2.0 * np.pi / 3.0))
    assert driver.model is not None
    assert driver.model.line[0] == pytest.approx(SLOPE, rel=0.3)
    assert last_error(r, run.x, 2000) < 0.5 * SWEPT
    if not doubted:
        assert driver.events == ()
        return
    # Where it begins again it does not rest at a limit.
    began = next(event.time for event in driver.events if event.name == "false start")
    later = run.u[int(FAST * began) + 10 :]
    assert np.all((later > limits[0]) & (later < limits[1]))
    assert "out of reach" not in [event.name for event in driver.events]


@pytest.mark.parametrize("widest", [60.0, 90.0])
def test_an_edge_that_touches_a_limit_is_no_rest_there(widest: float) -> None:
    plays = pz.PrandtlIshlinskii(0.1, np.linspace(1.0, widest, 20), np.full(20, 0.01))
    stage, swept = pz.SimulatedStage(2000.0, plays), plays.simulate(np.linspace(0.0, 100.0, 300))
    driver = pz.AdaptiveFeedforward(2000.0, limits=pz.VoltageLimits(0.0, 100.0))
    square = np.tile(np.repeat([0.85, 0.15], 500), 12) * swept[-1]
    shared.drive(driver, stage, square, lambda k, x: x + 1e-3 * np.sin(7.0 * k))
    assert "false start" not in [event.name for event in driver.events]
    assert driver.status.stage == "running"


@pytest.mark.parametrize("phase", np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False))
def test_the_start_does_not_wait_until_hum_rests(phase: float) -> None:
    driver, hum = pz.AdaptiveFeedforward(FAST, limits=pz.VoltageLimits(-20.0, 100.0)), 0.2
    r = pz.signals.sine(2.0, 20.0, 20, FAST).values
    stage = SimpleNamespace(step=lambda u: 0.1 * u)  # moves 0.24 µm on the first way
    _, x, doing = shared.drive(driver, stage, r, fifty_hertz(hum, phase))
    assert doing.count("seeking") < 0.08 * FAST
    assert last_error(r, x, 5000) < 1.5 * hum


@pytest.mark.parametrize("phase", np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False) + 0.2)
def test_the_start_tries_again_at_another_phase_of_hum(phase: float) -> None:
    """Hum of twice the answer to the first way is often taken for noise, but not at each try."""
    driver = pz.AdaptiveFeedforward(1000.0, limits=pz.VoltageLimits(*UNIPOLAR))
    r, stage = 3.5 + pz.signals.sine(2.0, 2.0, 4, 1000.0).values, SimpleNamespace(step=backlash(0.75, SLOPE))
    run = shared.drive(driver, stage, r, fifty_hertz(2.0 * SLOPE * 3.0, phase, 1000.0))
    assert run.doing.count("seeking") < 800


def test_an_event_tells_where_it_was_noticed_also_within_a_block() -> None:
    limits = pz.VoltageLimits(-50.0, 100.0)
    driver = pz.AdaptiveFeedforward(FAST, limits=limits, estimators=())
    r = pz.signals.triangle(14.0, 2.0, 4, FAST).values
    shared.in_blocks(driver, pz.SimulatedStage(FAST, pz.LinearGain(0.1)), r, 2000)
    (event,) = [event for event in driver.events if event.name == "out of reach"]
    assert "limit of 100 V" in event.reason or "limit of -50 V" in event.reason
    assert event.time % (2000 / FAST) != 0.0
