"""What an adaptive compensator has to live through: scenarios, named for good and seeded.

A scenario is a function from a `Draft` to a `Case`, entered into `SCENARIOS` by its decorator.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from piezoest import signals
from piezoest._checks import FloatArray, integer
from piezoest.bench.cases import COLD, Case, Conditions, Draft
from piezoest.bench.zoo.families import log_uniform
from piezoest.signals import Signal

LARGE = 7.5  # µm, the larger of two amplitudes; the smaller is a third of it (Table III)
GAIN_STEP = -0.20
# A gain that jumped within a sample would throw the stage by a fifth of its position at once.
# A twentieth of a period, 10 ms at 5 Hz, is several periods of the stage's resonance.
GAIN_RAMP = 0.05  # periods
DRIFT = -0.01  # 1/s
NOISE = (1e-4, 3e-2)  # µm


@dataclass(frozen=True, slots=True)
class Scenario:
    """A named situation."""

    name: str  # stays what it is
    description: str  # one line
    make: Callable[[Draft], Case] = field(repr=False)  # case from a `Draft`

    def build(self, seed: int, **overrides: Any) -> Case:
        """Make the run of one seed; `overrides` are fields of `Conditions`."""
        seed = integer("seed", seed)
        rng = np.random.default_rng([seed, *self.name.encode()])
        return self.make(Draft(self.name, seed, rng, Conditions(**overrides)))


SCENARIOS: dict[str, Scenario] = {}
UNREPEATED = ("prbs", "random-walk", "two-tone")  # minor loops, or no period within a swing


def scenario(name: str, description: str) -> Callable[[Callable[[Draft], Case]], Callable[[Draft], Case]]:
    """Decorator that enters a function from `Draft` to `Case` into `SCENARIOS`."""
    if name in SCENARIOS:
        raise ValueError(f"there is a scenario {name} already: choose another name")

    def enter(make: Callable[[Draft], Case]) -> Callable[[Draft], Case]:
        SCENARIOS[name] = Scenario(name, description, make)
        return make

    return enter


@scenario("cold-start", "Each start parameter off by up to ±50 %.")
def _cold_start(draft: Draft) -> Case:
    return draft.case(draft.triangle(draft.conditions.after), spread=COLD)


def _two_amplitudes(draft: Draft, first: float, second: float) -> Case:
    """Amplitudes relative to the larger one; the change is at a rise through zero."""
    given = draft.conditions
    largest = given.amplitude or LARGE
    amplitudes, periods = [first * largest, second * largest], [given.before, given.after]
    reference = signals.multi_amplitude(amplitudes, given.frequency, periods, given.sample_rate)
    change = round(given.before * given.period)
    return draft.case(reference, amplitude=second * largest, change=change)


@scenario("amplitude-switch", "2.5 → 7.5 µm, as in Table III.")
def _amplitude_switch(draft: Draft) -> Case:
    return _two_amplitudes(draft, 1.0 / 3.0, 1.0)


@scenario("amplitude-drop", "7.5 → 2.5 µm, as in Table III.")
def _amplitude_drop(draft: Draft) -> Case:
    return _two_amplitudes(draft, 1.0, 1.0 / 3.0)


@scenario("gain-step", "The stage's gain falls by 20 % within 10 ms, at any phase of the wave.")
def _gain_step(draft: Draft) -> Case:
    given = draft.conditions
    begins = given.before + float(draft.rng.uniform())  # anywhere within a period
    start, end = begins / given.frequency, (begins + GAIN_RAMP) / given.frequency
    return draft.case(
        draft.triangle(given.before + 1 + given.after),
        change=round(begins * given.period),
        gain_schedule=((start, 1.0), (end, 1.0 + GAIN_STEP)),
    )


@scenario("drift", "The stage's gain falls by 1 % of its first value a second.")
def _drift(draft: Draft) -> Case:
    given = draft.conditions
    start = given.before / given.frequency
    return draft.case(
        draft.triangle(given.before + np.ceil(given.drift * given.frequency)),
        change=round(given.before * given.period),
        gain_schedule=((start, 1.0), (start + given.drift, 1.0 + DRIFT * given.drift)),
    )


@scenario("dwell", "A rest at zero, then on.")
def _dwell(draft: Draft) -> Case:
    given = draft.conditions
    before, after = draft.triangle(given.before), draft.triangle(given.after)
    silence = signals.dwell(0.0, given.rest, given.sample_rate)
    values: FloatArray = np.concatenate([before.values, silence.values, after.values])
    reference = Signal(values, given.sample_rate, given.period, "triangle with a dwell")
    return draft.case(reference, change=len(before) + len(silence))


@scenario("prbs", "Filtered pseudo-random binary signal from a cold start.")
def _prbs(draft: Draft) -> Case:
    given = draft.conditions
    reference = signals.prbs(
        draft.amplitude, given.after, given.sample_rate,
        chip_rate=given.sample_rate / round(given.period / 8.0),  # 40 Hz at 5 Hz
        cutoff=2.0 * given.frequency, start="zero",
    )  # fmt: skip
    return draft.case(reference, spread=COLD, period=reference.period)


@scenario("random-walk", "Band-limited random walk of 10 Hz from a cold start.")
def _random_walk(draft: Draft) -> Case:
    given = draft.conditions
    duration = 5.0 * given.after / given.frequency
    walk = signals.random_walk(
        draft.amplitude, 2.0 * given.frequency, duration, given.sample_rate, draft.seed
    )
    # It repeats only as a whole; an error is taken over so long.
    return draft.case(walk, spread=COLD, period=5.0 * given.period)


@scenario("two-tone", "2 Hz and 7 Hz, minor loops, from a cold start.")
def _two_tone(draft: Draft) -> Case:
    given = draft.conditions
    # Two cycles of the slow tone in seven of the fast one, whose slope is the greater: minor loops.
    frequencies = [0.4 * given.frequency, 1.4 * given.frequency]
    amplitudes = [0.7 * draft.amplitude, 0.3 * draft.amplitude]
    duration = 5.0 * given.after / given.frequency
    reference = signals.two_tone(amplitudes, frequencies, duration, given.sample_rate)
    return draft.case(reference, spread=COLD, period=5.0 * given.period)


@scenario("noise", "Gauge noise of 0.1 to 30 nm, drawn evenly in its logarithm; cold start.")
def _noise(draft: Draft) -> Case:
    given = draft.conditions
    drawn = log_uniform(draft.rng, *NOISE)
    noisy = replace(given, noise=drawn if given.noise is None else given.noise)
    return draft.case(draft.triangle(given.after), spread=COLD, conditions=noisy)
