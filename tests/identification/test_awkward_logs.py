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


def with_(change: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]) -> Callable[[], Log]:
    """The healthy log, changed."""
    return lambda: (*change(*log()[:2]), FS)


def spiky(count: int, size: float) -> Callable[[], Log]:
    places = np.random.default_rng(1).choice(np.arange(10, N - 10), count, replace=False)
    return with_(lambda u, x: (u, x + size * np.isin(np.arange(N), places)))


def stands(values: FloatArray, start: int, end: int, value: float | None = None) -> FloatArray:
    """For a while the same: a value, or the first one."""
    stays = values[start] if value is None else value
    return np.where((np.arange(N) >= start) & (np.arange(N) < end), stays, values)


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


def followed(unit: float, late: float = 0.001) -> Log:
    """What a closed loop leaves where its reference is logged, in µm or in volts, some seconds late."""
    r = 5.0 * np.sin(2.0 * np.pi * T) + 2.0 * np.sin(2.0 * np.pi * 0.7 * T)
    return r / unit, np.interp(T - late, T, r) + noise(deviation=2e-3), FS


def unipolar() -> Log:
    """An amplifier that ends at -20 V, on a stage that creeps."""
    driven = np.maximum(SINE, -20.0)
    return (
        SINE,
        log(driven)[1]
        + pz.Creep.logarithmic(0.03, shortest=0.01, longest=100.0).simulate(0.1 * driven, sample_rate=FS),
        FS,
    )


def two_runs() -> Log:
    u = np.concatenate([SINE[:3100], SINE[500 : N - 2600]])
    return u, log(u)[1] + 0.3 * (np.arange(N) >= 3100), FS


def in_steps_of(step: float) -> Callable[[], Log]:
    return with_(lambda u, x: (u, np.round(x / step) * step))


def ramp(turns: int) -> Log:
    return log(np.interp(np.arange(N), np.linspace(0, N, turns + 2), np.resize([-50.0, 50.0], turns + 2)))


def with_rest(jump: float = 0.0) -> Log:
    """With a rest from sample 2000 to 5000, and perhaps a jump in it."""
    u = stands(SINE, 2000, 5000)
    return u, log(u)[1] + jump * (T >= 3.0), FS


# name: (the log, name of the finding, a phrase of its sentence)
FOUND: dict[str, tuple[Callable[[], Log], str, str]] = {
    "nm taken for um": (lambda: times(x=1e3), "too large", "nm taken for µm"),
    "volts taken for millivolts": (lambda: times(u=1e-3, x=5.0), "too large", "V for mV"),
    "mm taken for um": (lambda: times(x=1e-3), "too small", "mm or m taken for µm"),
    "mV taken for V": (lambda: times(u=1e3), "voltage", "mV taken for V"),
    "a stroke of some nm": (lambda: times(u=1e-3, x=1e-3), "small stroke", "raise the voltage"),
    "us taken for s": (lambda: times(rate=1e-6 * FS), "sample rate", "unit of time"),
    "ms taken for s": (lambda: times(rate=1.0), "sample rate", "ms"),
    "s taken for us": (lambda: times(rate=1e6 * FS), "sample rate", "unit of time"),
    "a swing of hours": (lambda: (*log(SINE.repeat(80))[:2], 1.1), "swing time", "there and back"),
    "sign of the sensor": (lambda: times(x=-1.0), "falls", "change the sign"),
    "columns swapped": (with_(lambda u, x: (x, u)), "clockwise", "swapped"),
    "displacement early": (lambda: early(25), "clockwise", "time stamps"),
    "the reference in um": (lambda: followed(1.0), "reference", "reference in µm"),
    "the reference in volts": (lambda: followed(0.1), "straight", "servo off"),
    "the reference in um, early": (lambda: followed(1.0, 0.0063), "reference", "6.3 samples earlier"),
    "the reference in volts, early": (lambda: followed(0.1, 0.0063), "straight", "6.3 samples earlier"),
    "two levels": (lambda: log(np.where(SINE > 0.0, 50.0, -50.0)), "two values", "slopes up and down"),
    "an amplifier that ends at -20 V": (unipolar, "flat end", "Below about -24 V"),
    "two runs": (two_runs, "voltage jumps", "two runs were joined"),
    "closed loop, reading after": (lambda: closed_loop(False), "closed loop", "later"),
    "closed loop, reading before": (lambda: closed_loop(True), "closed loop", "opposite ways"),
    "clipped above": (with_(lambda u, x: (u, x.clip(-9.0, 3.0))), "clipped displacement", "stands at 3 µm"),
    "clipped below": (with_(lambda u, x: (u, x.clip(-2.5, 9.0))), "clipped displacement", "-2.5 µm"),
    "recorder clips the voltage": (with_(lambda u, x: (u.clip(max=40.0), x)), "clipped voltage", "at 40 V"),
    "saturated": (lambda: (SINE, log(SINE.clip(-45, 45))[1], FS), "clipped displacement", "comes back"),
    "four bits": (in_steps_of(0.8), "coarse", "steps of 0.8 µm"),
    "six bits": (in_steps_of(0.15), "coarse", "steps of 0.15 µm"),
    "a slow sensor": (with_(lambda u, x: (u, x[::8].repeat(8))), "repeated", "8 times in a row"),
    "sensor off": (lambda: times(x=0.0), "constant displacement", "stays at 0 µm"),
    "amplifier off": (lambda: times(u=0.0), "constant voltage", "stays at 0 V"),
    "thirty samples": (with_(lambda u, x: (u[:30], x[:30])), "short", "30 usable samples"),
    "nothing but gaps": (lambda: times(x=np.nan), "short", "0 usable samples"),
    "one way": (lambda: ramp(0), "no swing", "turns 0 times"),
    "one turn": (lambda: ramp(1), "no swing", "turns once"),
    "a quarter missing": (with_(lambda u, x: (u, np.where(abs(T - 2) < 1, np.nan, x))), "missing", "25 %"),
    "another axis": (lambda: (SINE, np.cumsum(noise(deviation=0.05)), FS), "unrelated", "one axis"),
    "some spikes": (spiky(8, 1.0), "spikes", "8 samples"),
    "many spikes": (spiky(80, -2.0), "spikes", "stand off alone"),
    "a jump of the sensor": (with_(lambda u, x: (u, x + 0.5 * (T >= 3.0))), "jumps", "jumps once"),
    "two jumps": (with_(lambda u, x: (u, x + 0.5 * (T >= 2.0) + 0.5 * (T >= 6.1))), "jumps", "jumps 2 times"),
    "sensor frozen": (with_(lambda u, x: (u, stands(x, 1800, 1880))), "dropouts", "80 samples"),
    "sensor lost": (with_(lambda u, x: (u, stands(x, 1800, 1860, 11.0))), "dropouts", "60 samples"),
    "voltage spike": (with_(lambda u, x: (stands(u, 1570, 1571, 90.0), x)), "wrong voltage", "1 sample "),
    "voltage of zero": (with_(lambda u, x: (stands(u, 3600, 3630, 0.0), x)), "wrong voltage", "30 samples"),
    "voltage stands still": (with_(lambda u, x: (stands(u, 2900, 3100), x)), "wrong voltage", "at 2.9 s"),
    "a jump of the sensor in a rest": (lambda: with_rest(1.2), "jumps", "jumps once"),
    "a long rest": (with_rest, "rests", "rests once"),
    "a strong drift": (with_(lambda u, x: (u, x + 0.4 * T)), "drift", "drifts by +3"),
}
NOTES = ("small stroke", "repeated", "rests", "drift", "two values", "voltage jumps")
NOTED = ("six bits", "some spikes", "voltage spike", "voltage of zero")


@pytest.mark.parametrize("name", FOUND)
def test_what_is_odd_is_said(name: str) -> None:
    make, finding, phrase = FOUND[name]
    found = {each.name: each for each in findings(Record.from_arrays(*make()))}
    assert finding in found, list(found)
    assert phrase in found[finding].sentence
    assert found[finding].severity == ("note" if finding in NOTES or name in NOTED else "doubt")


def test_missing_readings_hide_nothing() -> None:
    u, x, rate = early(25)
    record = Record.from_arrays(u, np.where(abs(np.arange(u.size) - 2999.5) < 1500, np.nan, x), rate)
    assert [found.name for found in findings(record)] == ["clockwise", "missing"]


def test_a_date_in_days_is_no_time_in_seconds() -> None:
    """MATLAB counts days; 100 Hz would be 8.6 MHz."""
    days = 739_948.4 + 10.0 * T / 86_400.0
    record = Record(days, *log()[:2], (N - 1) / (days[-1] - days[0]))
    assert next(found.name for found in findings(record)) == "days"


def test_flaws_say_where() -> None:
    dropouts = flawed(*FOUND["sensor lost"][0]()[:2]).dropouts
    np.testing.assert_allclose(np.flatnonzero(dropouts), np.arange(1800, 1860), atol=1)
    np.testing.assert_allclose(flawed(*with_rest()[:2]).rests, [[2000, 5000]], atol=1)
    assert not flawed(*with_rest(1.2)[:2]).voltage.any()


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
        assert len(rests_of(u)) == len(rests_of(np.round(u, 3))) == 0


def test_swings_about_a_ramp_are_no_drift() -> None:
    """A wide loop follows the ramp by more than it does the swings."""
    u = np.linspace(-40.0, 40.0, N) + 20.0 * np.sin(2.0 * np.pi * 5.0 * T)
    wide = pz.PrandtlIshlinskii(0.05, [15.0, 25.0], [0.05, 0.05], sample_rate=FS)
    assert not findings(Record.from_arrays(u, wide.simulate(u) + noise(), FS))


TRIANGLE = pz.signals.triangle(60.0, 2.0, 16.0, FS).values
HEALTHY: dict[str, Callable[[], Log]] = {
    "sine": log,
    "triangle": lambda: log(TRIANGLE),
    "steps": lambda: log(np.repeat(np.random.default_rng(3).uniform(-60.0, 60.0, 40), N // 40)),
    "square": lambda: log(50.0 * np.sign(SINE)),
    "chirp": lambda: log(pz.signals.chirp(60.0, 0.5, 10.0, N / FS, FS).values),
    "walk": lambda: log(pz.signals.random_walk(60.0, 5.0, N / FS, FS, seed=4).values),
    "dying away": lambda: log(SINE * np.exp(-0.4 * T)),
    "input of an amplifier": lambda: (SINE / 33.0 + 1.8, log()[1] * 3.5 - 120.0, FS),
    "with an offset": lambda: log(SINE + 60.0),
    "sixteen bits": in_steps_of(2e-4),
    "without noise": lambda: (SINE, STAGE.simulate(SINE), FS),
    "a triangle without noise": lambda: (TRIANGLE, STAGE.simulate(TRIANGLE), FS),
    "noisy": lambda: (SINE, log()[1] + noise(deviation=0.05, seed=5), FS),
    "ending at rest": lambda: log(np.append(SINE[: N // 2], np.zeros(N // 2))),
    "noise in the recorded voltage": lambda: (SINE + noise(deviation=0.05, seed=6), log()[1], FS),
    "late": lambda: (SINE[5:], log()[1][:-5], FS),
    "creep": lambda: (SINE, log()[1] + 0.1 * np.log10(1.0 + 10.0 * T), FS),
}


TELLING = ("steps", "square", "chirp", "walk", "dying away")


@pytest.mark.parametrize("name", HEALTHY)
def test_nothing_is_doubted_in_a_healthy_log(name: str) -> None:
    u, x, rate = HEALTHY[name]()
    # A displacement left beside the line at rest is no drift.
    expected = ["rests"] if name == "ending at rest" else []
    found = findings(Record.from_arrays(u, x, rate))
    assert [each.name for each in found if expected or each.severity == "doubt"] == expected
    flaws = flawed(u, x)
    assert not flaws.unusable.any()
    assert flaws.jumps.size == 0
    assert tells_lag(u) is (name in TELLING)


@pytest.mark.parametrize(
    ("u", "tells"),
    [(np.zeros(100), False), (np.full(100, np.nan), False), (np.linspace(0.0, 1.0, 100), False),
     (np.concatenate((SINE, pz.signals.triangle(60.0, 7.0, 56.0, FS).values)), True), (noise(1000), True)],
)  # fmt: skip
def test_whether_a_voltage_tells_a_lag(u: FloatArray, tells: bool) -> None:
    assert tells_lag(u) is tells
