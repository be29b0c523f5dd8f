"""What an adaptive compensator has to live through: scenarios, named for good and seeded.

The same name, seed and conditions give the same reference, start and stage, to the bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from piezoest import signals
from piezoest._checks import FloatArray, integer, non_negative, positive
from piezoest.models import ColemanHodgdon, LinearGain
from piezoest.signals import Signal
from piezoest.stage import PaperStage, PreisachStage

# Table I, triangle of 5 µm at 5 Hz: what a start would be that is right.
RIGHT_MODEL = ColemanHodgdon(alpha=2.10e-2, beta=1.47e-1, gamma=4.29e-3)
RIGHT_GAIN = LinearGain(0.155)
COLD, WARM = 0.5, 0.1  # a start parameter is off by up to this, in parts of its value

AMPLITUDE = 5.0  # µm, of the scenarios with one amplitude
LARGE = 7.5  # µm, the larger of two amplitudes; the smaller is a third of it (Table III)
GAIN_STEP = -0.20
# A gain that jumped within a sample would throw the stage by a fifth of its position at once.
# A twentieth of a period, 10 ms at 5 Hz, is several periods of the stage's resonance.
GAIN_RAMP = 0.05  # periods
DRIFT = -0.01  # 1/s
NOISE = (1e-4, 3e-2)  # µm


@dataclass(frozen=True, slots=True)
class Conditions:
    """What a scenario leaves open.

    Parameters
    ----------
    sample_rate : float
        [Hz]. A lower one means the same on the same time axis, with fewer samples; at 20 kHz and
        below the stage leaves its filters out, whose delay costs an estimator accuracy.
    amplitude : float, optional
        Largest nominal amplitude of the reference [µm]; default 5, and 7.5 where there are two.
    frequency : float
        Of the reference [Hz]; signals that are no wave are stretched in time with it.
    noise : float, optional
        Standard deviation of the gauge's noise [µm]; default the stage's own.
    before, after : int
        Periods before the change, where there is one, and after it.
    rest : float
        Length of the dwell [s].
    drift : float
        Length of the drift [s].
    updates : int
        Updates of the compensator's model in a period of the wave; the default is one a
        millisecond at 5 Hz.
    creep : bool
        Whether the stage creeps.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    sample_rate: float = 50_000.0
    amplitude: float | None = None
    frequency: float = 5.0
    noise: float | None = None
    before: int = 10
    after: int = 15
    rest: float = 60.0
    drift: float = 30.0
    updates: int = 200
    creep: bool = True

    def __post_init__(self) -> None:
        for name in ("sample_rate", "frequency", "rest", "drift"):
            positive(name, getattr(self, name))
        if self.amplitude is not None:
            positive("amplitude", self.amplitude)
        if self.noise is not None:
            non_negative("noise", self.noise)
        integer("before", self.before, 1)
        integer("after", self.after, 1)
        integer("updates", self.updates, 1)

    @property
    def period(self) -> float:
        """Of the wave, in samples."""
        return self.sample_rate / self.frequency


@dataclass(frozen=True, slots=True)
class Case:
    """One run: everything but the estimator.

    Parameters
    ----------
    scenario : str
        Name of the scenario.
    seed : int
        Start of the random numbers, the stage's noise among them.
    reference : Signal
        What the stage has to follow [µm].
    period : float
        Samples over which an error is taken.
    change : int
        Sample at which something changes; 0 if it is the start itself.
    amplitude : float
        Nominal amplitude after the change [µm].
    start : ColemanHodgdon
        Model to start from.
    linear_start : LinearGain
        The same for linear feed-forward.
    update_interval : int
        Samples between two updates of the compensator's model.
    rest : tuple of int, optional
        First sample of a dwell and the first after it.
    noise : float, optional
        Standard deviation of the gauge's noise [µm]; None for the stage's own.
    gain_schedule : tuple, optional
        Time [s] and factor of the stage's hysteresis, see `PaperStage`.
    creep : bool
        Whether the stage creeps.
    stage : type
        `PaperStage` or `PreisachStage`; ``dataclasses.replace(case, stage=...)`` plays it on the other.
    """

    scenario: str
    seed: int
    reference: Signal
    period: float
    change: int
    amplitude: float
    start: ColemanHodgdon
    linear_start: LinearGain
    update_interval: int
    rest: tuple[int, int] | None = None
    noise: float | None = None
    gain_schedule: tuple[tuple[float, float], ...] | None = None
    creep: bool = True
    stage: type[PaperStage] | type[PreisachStage] = PaperStage

    @property
    def sample_rate(self) -> float:
        """[Hz]."""
        return self.reference.sample_rate

    def new_stage(self) -> PaperStage | PreisachStage:
        """Stage at rest; every one of the same case is identical, its noise included."""
        return self.stage(
            self.sample_rate,
            seed=self.seed,
            noise=self.noise,
            gain_schedule=self.gain_schedule,
            creep=self.creep,
        )


@dataclass(frozen=True, slots=True)
class Scenario:
    """A named situation.

    Parameters
    ----------
    name : str
        Stays what it is.
    description : str
        One line.
    make : callable
        Case from seed, random numbers and conditions.
    """

    name: str
    description: str
    make: Callable[[int, np.random.Generator, Conditions], Case] = field(repr=False)

    def build(self, seed: int, **overrides: Any) -> Case:
        """Make the run of one seed.

        Parameters
        ----------
        seed : int
            Start of the random numbers.
        **overrides
            Fields of `Conditions`.

        Returns
        -------
        Case

        Raises
        ------
        ValueError
            If a value is out of its range.
        """
        seed = integer("seed", seed)
        return self.make(seed, np.random.default_rng([seed, *self.name.encode()]), Conditions(**overrides))


def drawn_start(rng: np.random.Generator, spread: float) -> ColemanHodgdon:
    """Start model with each parameter off by up to `spread`; drawn again until it is admissible.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    spread : float
        In parts of each parameter's value.
    """
    while True:
        model = ColemanHodgdon.from_theta(RIGHT_MODEL.theta * (1.0 + rng.uniform(-spread, spread, 3)))
        if model.is_admissible:
            return model


def _case(
    name: str,
    seed: int,
    rng: np.random.Generator,
    given: Conditions,
    reference: Signal,
    amplitude: float,
    *,
    spread: float = WARM,
    period: float | None = None,
    **rest: Any,
) -> Case:
    options = {"change": 0, "noise": given.noise, "creep": given.creep, **rest}
    return Case(
        scenario=name,
        seed=seed,
        reference=reference,
        period=given.period if period is None else period,
        amplitude=amplitude,
        start=drawn_start(rng, spread),
        linear_start=LinearGain(RIGHT_GAIN.gain * (1.0 + float(rng.uniform(-spread, spread)))),
        update_interval=max(1, round(given.period / given.updates)),
        **options,
    )


def _triangle(given: Conditions, amplitude: float, periods: float) -> Signal:
    return signals.triangle(amplitude, given.frequency, periods, given.sample_rate)


def _cold_start(seed: int, rng: np.random.Generator, given: Conditions) -> Case:
    amplitude = given.amplitude or AMPLITUDE
    reference = _triangle(given, amplitude, given.after)
    return _case("cold-start", seed, rng, given, reference, amplitude, spread=COLD)


def _two_amplitudes(name: str, first: float, second: float) -> Callable[..., Case]:
    """Amplitudes in parts of the larger one; the change is at a rise through zero."""

    def make(seed: int, rng: np.random.Generator, given: Conditions) -> Case:
        largest = given.amplitude or LARGE
        reference = signals.multi_amplitude(
            [first * largest, second * largest],
            given.frequency,
            [given.before, given.after],
            given.sample_rate,
        )
        change = round(given.before * given.period)
        return _case(name, seed, rng, given, reference, second * largest, change=change)

    return make


def _gain_step(seed: int, rng: np.random.Generator, given: Conditions) -> Case:
    amplitude = given.amplitude or AMPLITUDE
    begins = given.before + float(rng.uniform())  # anywhere within a period
    reference = _triangle(given, amplitude, given.before + 1 + given.after)
    times = begins / given.frequency, (begins + GAIN_RAMP) / given.frequency
    return _case(
        "gain-step", seed, rng, given, reference, amplitude,
        change=round(begins * given.period),
        gain_schedule=((times[0], 1.0), (times[1], 1.0 + GAIN_STEP)),
    )  # fmt: skip


def _drift(seed: int, rng: np.random.Generator, given: Conditions) -> Case:
    amplitude = given.amplitude or AMPLITUDE
    start = given.before / given.frequency
    reference = _triangle(given, amplitude, given.before + np.ceil(given.drift * given.frequency))
    return _case(
        "drift", seed, rng, given, reference, amplitude,
        change=round(given.before * given.period),
        gain_schedule=((start, 1.0), (start + given.drift, 1.0 + DRIFT * given.drift)),
    )  # fmt: skip


def _dwell(seed: int, rng: np.random.Generator, given: Conditions) -> Case:
    amplitude = given.amplitude or AMPLITUDE
    before, after = (_triangle(given, amplitude, periods) for periods in (given.before, given.after))
    silence = signals.dwell(0.0, given.rest, given.sample_rate)
    values: FloatArray = np.concatenate([before.values, silence.values, after.values])
    reference = Signal(values, given.sample_rate, given.period, "triangle with a dwell")
    rest = len(before), len(before) + len(silence)
    return _case("dwell", seed, rng, given, reference, amplitude, change=rest[1], rest=rest)


def _prbs(seed: int, rng: np.random.Generator, given: Conditions) -> Case:
    amplitude = given.amplitude or AMPLITUDE
    chip_rate = given.sample_rate / round(given.period / 8.0)  # 40 Hz at 5 Hz
    reference = signals.prbs(
        amplitude, given.after, given.sample_rate,
        chip_rate=chip_rate, cutoff=2.0 * given.frequency, start="zero",
    )  # fmt: skip
    return _case("prbs", seed, rng, given, reference, amplitude, spread=COLD, period=reference.period)


def _random_walk(seed: int, rng: np.random.Generator, given: Conditions) -> Case:
    amplitude = given.amplitude or AMPLITUDE
    period = 5.0 * given.period  # it repeats only as a whole; an error is taken over so long
    walk = signals.random_walk(
        amplitude, 2.0 * given.frequency, 5.0 * given.after / given.frequency, given.sample_rate, seed
    )
    return _case("random-walk", seed, rng, given, walk, amplitude, spread=COLD, period=period)


def _two_tone(seed: int, rng: np.random.Generator, given: Conditions) -> Case:
    amplitude = given.amplitude or AMPLITUDE
    # Two cycles of the slow tone in seven of the fast one, whose slope is the greater: minor loops.
    frequencies = [0.4 * given.frequency, 1.4 * given.frequency]
    amplitudes = [0.7 * amplitude, 0.3 * amplitude]
    duration = 5.0 * given.after / given.frequency
    reference = signals.two_tone(amplitudes, frequencies, duration, given.sample_rate)
    period = 5.0 * given.period
    return _case("two-tone", seed, rng, given, reference, amplitude, spread=COLD, period=period)


def _noise(seed: int, rng: np.random.Generator, given: Conditions) -> Case:
    amplitude = given.amplitude or AMPLITUDE
    drawn = float(np.exp(rng.uniform(*np.log(NOISE))))
    noise = drawn if given.noise is None else given.noise
    reference = _triangle(given, amplitude, given.after)
    return _case("noise", seed, rng, given, reference, amplitude, spread=COLD, noise=noise)


SCENARIOS: dict[str, Scenario] = {
    scenario.name: scenario
    for scenario in (
        Scenario("cold-start", "Each start parameter off by up to ±50 %.", _cold_start),
        Scenario(
            "amplitude-switch", "2.5 → 7.5 µm, as in Table III.",
            _two_amplitudes("amplitude-switch", 1.0 / 3.0, 1.0),
        ),
        Scenario(
            "amplitude-drop", "7.5 → 2.5 µm, as in Table III.",
            _two_amplitudes("amplitude-drop", 1.0, 1.0 / 3.0),
        ),
        Scenario(
            "gain-step", "The stage's gain falls by 20 % within 10 ms, at any phase of the wave.", _gain_step
        ),
        Scenario("drift", "The stage's gain falls by 1 % of its first value a second, for 30 s.", _drift),
        Scenario("dwell", "60 s at rest at zero, then on.", _dwell),
        Scenario("prbs", "Filtered pseudo-random binary signal from a cold start.", _prbs),
        Scenario("random-walk", "Band-limited random walk of 10 Hz from a cold start.", _random_walk),
        Scenario("two-tone", "2 Hz and 7 Hz, minor loops, from a cold start.", _two_tone),
        Scenario("noise", "Gauge noise of 0.1 to 30 nm, drawn evenly in its logarithm; cold start.", _noise),
    )
}  # fmt: skip
