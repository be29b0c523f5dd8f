"""A log as the checks see it: without gaps and spikes, with its line and its loop."""

from functools import cached_property

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import bridged, late
from piezoest.fitting.flaws import Flaws, flawed
from piezoest.fitting.lost_voltage import delay_of
from piezoest.fitting.surprise import noise_in
from piezoest.identification.feedback_in_log import goes_in_steps
from piezoest.identification.loop_direction import Loop, loop_of
from piezoest.records import Record
from piezoest.signals.turns import TURN, turns

# What a log must have; the samples also in each part that a model is fitted to or judged on.
FEWEST_SAMPLES, FEWEST_TURNS = 50, 2
# Part of the displacement's scatter that a line in the voltage must not leave, if they belong together.
UNRELATED = 0.5
# The voltage moves nothing if it moves less than this part of the displacement's range.
NOTHING = 1e-3


class Examined:
    """A record without gaps and spikes, and what several checks ask."""

    def __init__(self, record: Record) -> None:
        self.record, self.rate = record, record.sample_rate
        self.flaws: Flaws = flawed(record.voltage, record.displacement)
        self.counts = record.usable & ~self.flaws.clipped
        self.u = bridged(self.flaws.without(record.voltage))
        self.x = bridged(np.where(self.flaws.unusable, np.nan, record.displacement))
        self.swing = float(np.ptp(self.u))
        # A staircase that is answered late is off by whole steps for as long.
        self.stepped = bool(np.ptp(self.x) > 0.0 and goes_in_steps(self.u))
        self.late = late(self.u, float(delay_of(self.u, self.x)) if self.stepped else 0.0)
        self.turns = turns(self.u, TURN * self.swing)
        # The voltage without what drifts; each stretch between jumps has an offset of its own.
        offsets = np.zeros(self.x.size)
        offsets[self.flaws.jumps] = self.flaws.jump_sizes
        self.level = self.x - np.cumsum(offsets)
        self.stroke = float(np.ptp(self.level))

    @cached_property
    def line(self) -> tuple[FloatArray, FloatArray]:
        """Weights and rest of a line in the late voltage and its rate, and a parabola in time."""
        return self._line(slice(None))

    def _line(self, part: slice) -> tuple[FloatArray, FloatArray]:
        u, level, counts = self.late[part], self.level[part], self.counts[part]
        t = np.linspace(-1.0, 1.0, u.size)
        A = np.stack([u - u.mean(), np.gradient(u), np.ones_like(t), t, t * t], axis=1)
        size = np.sqrt(np.mean(A**2, axis=0))
        A = A / np.where(size > 0.0, size, 1.0)
        weights = np.linalg.lstsq(A[counts], level[counts])[0]
        return weights / np.where(size > 0.0, size, 1.0), level - A @ weights

    @property
    def drift(self) -> float:
        """Rise in time of that line between the first turn and the last one [µm].

        Before and behind them the voltage may rest, where hysteresis leaves the displacement beside the line.
        """
        return 2.0 * float(self._line(slice(self.turns[0], self.turns[-1] + 1))[0][3])

    @property
    def trend(self) -> float:
        """Rise in time of the voltage there, by a parabola [V]."""
        part = self.late[self.turns[0] : self.turns[-1] + 1]
        return 2.0 * float(np.polyfit(np.linspace(-1.0, 1.0, part.size), part, 2)[1])

    @property
    def gain(self) -> float:
        """Slope of that line [µm/V]."""
        return float(self.line[0][0])

    @property
    def moved(self) -> float:
        """What the line moves over the range of the voltage [µm]."""
        return abs(self.gain) * self.swing

    @property
    def wave(self) -> float:
        """How long the voltage's way there and back takes [s]; infinite with fewer than two turns."""
        if self.turns.size < FEWEST_TURNS:
            return np.inf
        return 2.0 * float(np.median(np.diff(self.turns))) / self.rate

    @cached_property
    def loop(self) -> Loop:
        """The loop of displacement over voltage."""
        return loop_of(self.u, self.level, self.counts & ~self.flaws.unusable, self.gain)

    @property
    def off(self) -> float:
        """Standard deviation from that line [µm]; what gaps are bridged by does not count."""
        return float(np.std(self.line[1][self.counts]))

    @property
    def noise(self) -> float:
        """Standard deviation of the displacement's noise [µm]."""
        return noise_in(np.diff(self.x, 3))

    @property
    def unexplained(self) -> float:
        """The same relative to the scatter of the displacement; one where the voltage moves nothing."""
        if self.moved < NOTHING * self.stroke:
            return 1.0
        return self.off / float(np.std(self.level[self.counts]))

    @property
    def related(self) -> bool:
        """Whether the displacement follows the voltage enough for a word about gain and loop."""
        return self.unexplained < UNRELATED
