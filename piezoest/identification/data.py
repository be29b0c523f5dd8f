"""A log as identification sees it: where it counts, how it moves, and whether that is enough."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import bridged
from piezoest.fitting.flaws import Flaws
from piezoest.fitting.gaps import remembered
from piezoest.fitting.runs import BoolArray
from piezoest.fitting.surprise import noise_in
from piezoest.identification.examined import FEWEST_SAMPLES, FEWEST_TURNS
from piezoest.identification.finding import Finding
from piezoest.models import ColemanHodgdon, LinearGain
from piezoest.records import Record
from piezoest.records.source import counted
from piezoest.signals.turns import TURN, turns

SMALLEST_SIGNAL_TO_NOISE = 10.0
# How late a displacement may answer a voltage, in samples, and samples in which that is looked for.
LATEST, MOST_SAMPLES = 10, 100_000
# Part of its range that the displacement rises by, as a straight line, with the voltage.
SMALLEST_RISE = 1e-6


class Data(NamedTuple):
    """A voltage without gaps, a displacement, and the samples at which that counts."""

    u: FloatArray
    x: FloatArray
    counts: Any

    @property
    def middle(self) -> float:
        """Middle of the voltage's range [V]."""
        return 0.5 * float(self.u.max() + self.u.min())

    @property
    def extent(self) -> float:
        """Range of the voltage [V]."""
        return float(np.ptp(self.u))

    @property
    def measured(self) -> FloatArray:
        """Displacement, NaN where it does not count [µm]."""
        return np.where(self.counts, self.x, np.nan)

    @property
    def line(self) -> LinearGain:
        """Least-squares line through the displacement."""
        return LinearGain.guess(self.u, self.measured)

    @property
    def loop_about_line(self) -> ColemanHodgdon:
        """A plain guess: a loop about that line, bent within the range of the voltage."""
        line = self.line
        return ColemanHodgdon.from_loop(2.0 / self.extent, 0.4 * line.gain, 1.3 * line.gain, line.offset)


def prepare(voltage: FloatArray, displacement: FloatArray) -> Data:
    """Bridge gaps of the voltage by straight lines; nothing within a gap counts."""
    return Data(bridged(voltage), displacement, np.isfinite(voltage) & np.isfinite(displacement))


def judged(record: Record, flaws: Flaws, trained: int = 0) -> BoolArray:
    """Samples without flaw at which no turn in a gap is remembered, in the fitted part and behind it."""
    u, counts = flaws.without(record.voltage), record.usable & ~flaws.unusable
    whole, later = bridged(u), np.arange(counts.size) >= trained
    return remembered(u, whole, counts & ~later) | remembered(u, whole, counts & later)


def check_enough(part: str, log: str, usable: int) -> None:
    """Refuse a log in which a part, named in words, has too few usable samples."""
    if usable < FEWEST_SAMPLES:
        raise ValueError(
            f"the {part} of {log} has {counted(usable, 'usable sample')}, at least {FEWEST_SAMPLES} are "
            "needed: record longer, or with fewer gaps"
        )


def noise_of(data: Data) -> float:
    """Standard deviation of the displacement's noise [µm], from its third differences, robustly.

    What those of the voltage explain, as it is and up to some samples late, is no noise.
    """
    x, third = data.x[data.counts], np.diff(data.x[data.counts], 3)
    inputs = np.diff(data.u[data.counts], 3)[:MOST_SAMPLES]
    target = third[LATEST : inputs.size]
    late = np.stack([inputs[LATEST - k : inputs.size - k] for k in range(LATEST + 1)], axis=1)
    left = target - late @ np.linalg.lstsq(late, target)[0]
    return max(min(noise_in(third), noise_in(left)), 1e-9 * float(np.ptp(x)), 1e-12)


def check_excitation(data: Data, noise: float, found: Iterable[Finding]) -> None:
    """Refuse a log that cannot show a hysteresis, or that falls; `found` says whether it is related."""
    if data.extent == 0.0:
        raise ValueError(
            f"too little excitation: the voltage stays at {data.middle:.6g} V over the fitted part, "
            "it must move the stage up and down: cut the rest, or fit a longer part with train=0.9"
        )
    turned = turning_voltages(data)
    if turned.size < FEWEST_TURNS:
        raise ValueError(
            f"too little excitation: over the fitted part the voltage moves by {data.extent:.4g} V but "
            f"turns {counted(turned.size)}, at least {FEWEST_TURNS} are needed: hysteresis shows only at "
            "turns: record more swings, or fit a longer part with train=0.9"
        )
    extent = float(np.ptp(data.x[data.counts]))
    if extent == 0.0:
        raise ValueError(
            f"the displacement stays at {data.x[data.counts][0]:.6g} µm over the fitted part: check that the "
            "right column was taken and the sensor was on"
        )
    if extent < SMALLEST_SIGNAL_TO_NOISE * noise:
        raise ValueError(
            f"too little excitation: the displacement moves by {extent:.3g} µm in noise of {noise:.3g} µm "
            f"rms, {extent / noise:.1f} times that, at least {SMALLEST_SIGNAL_TO_NOISE:g} are needed: "
            "raise the voltage"
        )
    if data.line.gain * data.extent <= SMALLEST_RISE * extent:
        said = {each.name: each.sentence for each in found}
        raise ValueError(
            said.get("falls")
            or said.get("unrelated")
            or next((each.sentence for each in found if each.severity == "doubt"), "")
            or "the displacement falls as the voltage rises over the fitted part, not over the whole log: "
            "check what changed"
        )


def turning_voltages(data: Data) -> FloatArray:
    """Voltages at which it turns and then runs back by more than a twentieth of its range [V]."""
    return data.u[turns(data.u, TURN * data.extent)]
