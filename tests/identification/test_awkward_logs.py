"""Logs as they should not be, and the finding that says so of each."""

from collections.abc import Callable

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.fitting.flaws import flawed
from piezoest.fitting.rests import rests_of
from piezoest.identification.lag import tells_lag
from piezoest.identification.sense import findings
from piezoest.models import ColemanHodgdon
from piezoest.records import Record
from piezoest.stage import Gauge, SimulatedStage

FS, N = 1000.0, 8000
T = np.arange(N) / FS
STAGE = ColemanHodgdon.from_loop(0.03, 0.04, 0.1)
SINE = 60.0 * np.sin(2.0 * np.pi * 2.0 * T)

Log = tuple[FloatArray, FloatArray, float]


def noise(size: int = N, deviation: float = 5e-3, seed: int = 0) -> FloatArray:
    return deviation * np.random.default_rng(seed).standard_normal(size)


def log(u: FloatArray = SINE, rate: float = FS) -> Log:
    """A healthy log: 12 µm of stroke, 5 nm of noise."""
    return u, STAGE.simulate(u, allow_jumps=True) + noise(u.size), rate


def times(u: float = 1.0, x: float = 1.0, rate: float = FS) -> Log:
    v, y, _ = log()
    return u * v, x * y, rate


def with_(change: Callable[[FloatArray, FloatArray], object]) -> Callable[[], Log]:
    """The healthy log, its voltage and displacement changed in place, or others in their place."""

    def make() -> Log:
        u, x, rate = log()
        u = u.copy()
        found = change(u, x)
        return (*found, rate) if isinstance(found, tuple) else (u, x, rate)

    return make


def spiky(count: int, size: float) -> Callable[[], Log]:
    places = np.random.default_rng(1).choice(np.arange(10, N - 10), count, replace=False)
    return with_(lambda u, x: np.add.at(x, places, size))


def stands(start: int, end: int, *, u: float | None = None, x: float | None = None) -> Callable[[], Log]:
    """For a while one of both has a value, its own first one for NaN."""

    def change(v: FloatArray, y: FloatArray) -> None:
        for values, value in ((v, u), (y, x)):
            if value is not None:
                values[start:end] = values[start] if np.isnan(value) else value

    return with_(change)


def stepped(*at: int) -> Callable[[], Log]:
    return with_(lambda u, x: (u, x + 0.5 * np.sum([np.arange(N) >= k for k in at], axis=0)))


def early(samples: int) -> Log:
    u, x, rate = log()
    return u[:-samples], x[samples:], rate


def closed_loop(same_row: bool) -> Log:
    """A PI controller that follows a sine; each row holds the reading before or after the voltage."""
    stage = SimulatedStage(FS, STAGE, gauge=Gauge(noise=5e-3), seed=2)
    r, u, x, before = 5.0 * np.sin(2.0 * np.pi * T), np.zeros(N), np.zeros(N), np.zeros(N)
    reading = integral = 0.0
    for k in range(N):
        before[k] = reading
        integral += 0.1 * (r[k] - reading)
        u[k] = (0.2 * (r[k] - reading) + integral) / 0.1
        reading = float(stage.step(float(u[k])))
        x[k] = reading
    return u, before if same_row else x, FS


def followed(unit: float) -> Log:
    """What a closed loop leaves where its reference is logged, in µm or in volts."""
    r = 5.0 * np.sin(2.0 * np.pi * T) + 2.0 * np.sin(2.0 * np.pi * 0.7 * T)
    return r / unit, np.interp(T - 0.001, T, r) + noise(deviation=2e-3), FS


def in_steps_of(step: float) -> Callable[[], Log]:
    return with_(lambda u, x: (u, np.round(x / step) * step))


def ramp(turns: int) -> Log:
    u = np.interp(np.arange(N), np.linspace(0, N, turns + 2), np.resize([-50.0, 50.0], turns + 2))
    return log(u)


def with_rest() -> Log:
    u = SINE.copy()
    u[2000:5000] = u[2000]
    return log(u)


def jump_in_rest() -> Log:
    u, x, rate = with_rest()
    return u, x + 1.2 * (np.arange(N) >= 3000), rate


# name: (the log, name of the finding, a phrase of its sentence)
FOUND: dict[str, tuple[Callable[[], Log], str, str]] = {
    "nm taken for um": (lambda: times(x=1e3), "too large", "nm taken for µm"),
    "volts taken for millivolts": (lambda: times(u=1e-3, x=5.0), "too large", "V for mV"),
    "mm taken for um": (lambda: times(x=1e-3), "too small", "mm or m taken for µm"),
    "m taken for um": (lambda: times(x=1e-6), "too small", "mm or m taken for µm"),
    "mV taken for V": (lambda: times(u=1e3), "voltage", "mV taken for V"),
    "a stroke of some nm": (lambda: times(u=1e-3, x=1e-3), "small stroke", "raise the voltage"),
    "us taken for s": (lambda: times(rate=1e-6 * FS), "sample rate", "unit of time"),
    "ms taken for s": (lambda: times(rate=1.0), "sample rate", "ms"),
    "s taken for us": (lambda: times(rate=1e6 * FS), "sample rate", "unit of time"),
    "a swing of hours": (lambda: (*log(SINE.repeat(80))[:2], 1.1), "swing time", "there and back"),
    "a swing of microseconds": (lambda: (*times()[:2], 9e6 * 4), "sample rate", "unit of time"),
    "sign of the sensor": (lambda: times(x=-1.0), "falls", "change the sign"),
    "sign of the voltage": (lambda: times(u=-1.0), "falls", "change the sign"),
    "columns swapped": (with_(lambda u, x: (x, u)), "clockwise", "swapped"),
    "displacement early": (lambda: early(25), "clockwise", "time stamps"),
    "the reference in um": (lambda: followed(1.0), "reference", "reference in µm"),
    "the reference in volts": (lambda: followed(0.1), "straight", "servo off"),
    "closed loop, reading after": (lambda: closed_loop(False), "closed loop", "later"),
    "closed loop, reading before": (lambda: closed_loop(True), "closed loop", "opposite ways"),
    "sensor clipped above": (
        with_(lambda u, x: (u, x.clip(-9.0, 3.0))),
        "clipped displacement",
        "stands at 3 µm",
    ),
    "sensor clipped below": (with_(lambda u, x: (u, x.clip(-2.5, 9.0))), "clipped displacement", "-2.5 µm"),
    "recorder clips the voltage": (with_(lambda u, x: (u.clip(max=40.0), x)), "clipped voltage", "at 40 V"),
    "amplifier saturates": (
        lambda: (SINE, log(SINE.clip(-45.0, 45.0))[1], FS),
        "clipped displacement",
        "comes back",
    ),
    "four bits": (in_steps_of(0.8), "coarse", "steps of 0.8 µm"),
    "six bits": (in_steps_of(0.15), "coarse", "steps of 0.15 µm"),
    "a slow sensor": (with_(lambda u, x: (u, x[::8].repeat(8))), "repeated", "8 times in a row"),
    "sensor off": (lambda: times(x=0.0), "constant displacement", "stays at 0 µm"),
    "amplifier off": (lambda: times(u=0.0), "constant voltage", "stays at 0 V"),
    "thirty samples": (with_(lambda u, x: (u[:30], x[:30])), "short", "30 usable samples"),
    "nothing but gaps": (lambda: times(x=np.nan), "short", "0 usable samples"),
    "one way": (lambda: ramp(0), "no swing", "turns 0 times"),
    "one turn": (lambda: ramp(1), "no swing", "turns once"),
    "a quarter missing": (
        with_(lambda u, x: (u, np.where((T >= 1.0) & (T < 3.0), np.nan, x))),
        "missing",
        "25 %",
    ),
    "another axis": (lambda: (SINE, np.cumsum(noise(deviation=0.05)), FS), "unrelated", "one axis"),
    "some spikes": (spiky(8, 1.0), "spikes", "8 samples"),
    "many spikes": (spiky(80, -2.0), "spikes", "stand off alone"),
    "a jump of the sensor": (stepped(3000), "jumps", "jumps once"),
    "two jumps": (stepped(2000, 6100), "jumps", "jumps 2 times"),
    "sensor frozen": (stands(1800, 1880, x=np.nan), "dropouts", "80 samples"),
    "sensor lost": (stands(1800, 1860, x=11.0), "dropouts", "60 samples"),
    "a spike of the voltage": (stands(1570, 1571, u=90.0), "wrong voltage", "1 sample "),
    "a voltage of zero": (stands(3600, 3630, u=0.0), "wrong voltage", "30 samples"),
    "a voltage that stands still": (stands(2900, 3100, u=np.nan), "wrong voltage", "at 2.9 s"),
    "a jump of the sensor in a rest": (jump_in_rest, "jumps", "jumps once"),
    "a long rest": (with_rest, "rests", "rests once"),
    "a strong drift": (with_(lambda u, x: (u, x + 0.4 * T)), "drift", "drifts by +3"),
}
NOTES = ("small stroke", "repeated", "rests", "drift")
NOTED = ("six bits", "some spikes", "a spike of the voltage", "a voltage of zero")


@pytest.mark.parametrize("name", FOUND)
def test_what_is_odd_is_said(name: str) -> None:
    make, finding, phrase = FOUND[name]
    found = {each.name: each for each in findings(Record.from_arrays(*make()))}
    assert finding in found, list(found)
    assert phrase in found[finding].sentence
    assert found[finding].severity == ("note" if finding in NOTES or name in NOTED else "doubt")


def test_missing_readings_hide_nothing() -> None:
    u, x, rate = early(25)
    x = x.copy()
    x[1500:4500] = np.nan
    record = Record(np.arange(u.size) / rate, u, x, rate, skipped=3000)
    assert [found.name for found in findings(record)] == ["clockwise", "missing"]


def test_a_date_in_days_is_no_time_in_seconds() -> None:
    """MATLAB counts days; 100 Hz would be 8.6 MHz."""
    u, x, _ = log()
    days = 739_948.4 + 10.0 * T / 86_400.0
    record = Record(days, u, x, (N - 1) / (days[-1] - days[0]))
    assert next(found.name for found in findings(record)) == "days"


def test_a_jump_in_a_rest_leaves_the_voltage_alone() -> None:
    u, x, _ = jump_in_rest()
    assert not flawed(u, x).voltage.any()


def test_flaws_say_where() -> None:
    dropouts = flawed(*FOUND["sensor lost"][0]()[:2]).dropouts
    np.testing.assert_allclose(np.flatnonzero(dropouts), np.arange(1800, 1860), atol=1)
    np.testing.assert_allclose(flawed(*with_rest()[:2]).rests, [[2000, 5000]], atol=1)


@pytest.mark.parametrize("deviation", [0.0, 0.1, 0.5, 1.0])
def test_noise_of_the_voltage_hides_no_rest_and_makes_none(deviation: float) -> None:
    hiss = noise(deviation=deviation, seed=7)
    assert len(rests_of(SINE * np.linspace(0.2, 1.0, N) + hiss)) == 0
    np.testing.assert_allclose(rests_of(with_rest()[0] + hiss), [[2000, 5000]], atol=10)


@pytest.mark.parametrize("hertz", [0.7, 2.0])
@pytest.mark.parametrize("last", [0.05, 0.1, 1.0])
def test_the_top_of_a_small_swing_is_no_rest(hertz: float, last: float) -> None:
    wave = 60.0 * np.sin(2.0 * np.pi * hertz * T) * np.linspace(1.0, last, N)
    for u in (wave, wave[::-1], wave + 20.0 * np.sin(2.0 * np.pi * 2.3 * hertz * T)):
        assert len(rests_of(u)) == 0
        assert len(rests_of(np.round(u, 3))) == 0


def test_swings_about_a_ramp_are_no_drift() -> None:
    """A wide loop follows the ramp by more than it does the swings."""
    u = np.linspace(-40.0, 40.0, N) + 20.0 * np.sin(2.0 * np.pi * 5.0 * T)
    wide = pz.PrandtlIshlinskii(0.05, [15.0, 25.0], [0.05, 0.05], sample_rate=FS)
    assert not findings(Record.from_arrays(u, wide.simulate(u) + noise(), FS))


def test_a_displacement_left_beside_the_line_at_rest_is_no_drift() -> None:
    u, x, rate = HEALTHY["ending at rest"]()
    assert [found.name for found in findings(Record.from_arrays(u, x, rate))] == ["rests"]


def triangle(frequency: float = 2.0) -> FloatArray:
    return pz.signals.triangle(60.0, frequency, N / FS * frequency, FS).values


def levels() -> FloatArray:
    return np.repeat(np.random.default_rng(3).uniform(-60.0, 60.0, 40), N // 40)


HEALTHY: dict[str, Callable[[], Log]] = {
    "sine": log,
    "triangle": lambda: log(triangle()),
    "steps": lambda: log(levels()),
    "square": lambda: log(50.0 * np.sign(SINE)),
    "chirp": lambda: log(pz.signals.chirp(60.0, 0.5, 10.0, N / FS, FS).values),
    "walk": lambda: log(pz.signals.random_walk(60.0, 5.0, N / FS, FS, seed=4).values),
    "dying away": lambda: log(SINE * np.exp(-0.4 * T)),
    "input of an amplifier": lambda: (SINE / 33.0 + 1.8, log()[1] * 3.5 - 120.0, FS),
    "with an offset": lambda: log(SINE + 60.0),
    "sixteen bits": in_steps_of(2e-4),
    "without noise": lambda: (SINE, STAGE.simulate(SINE), FS),
    "a triangle without noise": lambda: (triangle(), STAGE.simulate(triangle()), FS),
    "noisy": lambda: (SINE, log()[1] + noise(deviation=0.05, seed=5), FS),
    "ending at rest": lambda: log(np.append(SINE[: N // 2], np.zeros(N // 2))),
    "noise in the recorded voltage": lambda: (SINE + noise(deviation=0.05, seed=6), log()[1], FS),
    "late": lambda: (SINE[5:], log()[1][:-5], FS),
    "creep": lambda: (SINE, log()[1] + 0.1 * np.log10(1.0 + 10.0 * T), FS),
}


@pytest.mark.parametrize("name", HEALTHY)
def test_nothing_is_doubted_in_a_healthy_log(name: str) -> None:
    u, x, rate = HEALTHY[name]()
    assert [found for found in findings(Record.from_arrays(u, x, rate)) if found.severity == "doubt"] == []
    flaws = flawed(u, x)
    assert not flaws.unusable.any()
    assert flaws.jumps.size == 0


TELLING = ("steps", "square", "chirp", "walk", "dying away")
VOLTAGES: dict[str, tuple[FloatArray, bool]] = {
    **{name: (HEALTHY[name]()[0], name in TELLING) for name in ("sine", "triangle", "late", *TELLING)},
    "noisy": (HEALTHY["noise in the recorded voltage"]()[0], False),
    "nothing": (np.zeros(100), False),
    "no number": (np.full(100, np.nan), False),
    "ramp": (np.linspace(0.0, 1.0, 100), False),
    "two frequencies": (np.concatenate((SINE, triangle(7.0))), True),
    "white": (noise(1000), True),
}


@pytest.mark.parametrize("name", VOLTAGES)
def test_whether_a_voltage_tells_a_lag(name: str) -> None:
    u, tells = VOLTAGES[name]
    assert tells_lag(u) is tells
