"""A log as the checks see it: without gaps and spikes, with its line and its loop."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import bridged, late
from piezoest.fitting.flaws import Flaws, flawed
from piezoest.fitting.lost_voltage import delay_of
from piezoest.fitting.runs import BoolArray
from piezoest.identification.feedback_in_log import goes_in_steps
from piezoest.records import Record
from piezoest.signals.turns import TURN, turns

# What a log must have; the samples also in each part that a model is fitted to or judged on.
FEWEST_SAMPLES, FEWEST_TURNS = 50, 2
# Part of the displacement's scatter that a line in the voltage must not leave, if they belong together.
UNRELATED = 0.5
# Voltages at which the branches of the loop are compared.
PLACES = 16


class Loop(NamedTuple):
    """The loop of displacement over voltage, branch by branch."""

    # Mean height of the falling branch above the rising one, at the same voltage [µm]: above zero where the
    # loop runs counter-clockwise, as that of a stage does, whose displacement lags the voltage.
    openings: FloatArray
    strokes: FloatArray  # what the branch spans of the displacement's straight line [µm]

    @property
    def opening(self) -> float:
        """Median of the openings relative to their strokes; zero if there are none."""
        return float(np.median(self.openings / self.strokes)) if self.openings.size else 0.0

    @property
    def clockwise(self) -> float:
        """Share of the branches that run clockwise; zero if there are none."""
        return float(np.mean(self.openings < 0.0)) if self.openings.size else 0.0


class Examined:
    """A record without gaps and spikes, and what several checks ask."""

    def __init__(self, record: Record) -> None:
        self.record, self.rate = record, record.sample_rate
        self.counts = record.usable
        self.flaws: Flaws = flawed(record.voltage, record.displacement)
        self.u = bridged(self.flaws.without(record.voltage))
        self.x = bridged(np.where(self.flaws.unusable, np.nan, record.displacement))
        # With what stands still: at a limit a sensor does so, too.
        lost = self.flaws.unusable & ~self.flaws.dropouts
        self.shown = bridged(np.where(lost, np.nan, record.displacement))
        self.swing = float(np.ptp(self.u))
        # A staircase that is answered late is off by whole steps for as long.
        stepped = np.ptp(self.x) > 0.0 and goes_in_steps(self.u)
        self.late = late(self.u, float(delay_of(self.u, self.x)) if stepped else 0.0)
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
    def unexplained(self) -> float:
        """The same relative to the scatter of the displacement."""
        return self.off / float(np.std(self.level[self.counts]))

    @property
    def related(self) -> bool:
        """Whether the displacement follows the voltage enough for a word about gain and loop."""
        return self.unexplained < UNRELATED


def loop_of(u: FloatArray, x: FloatArray, counts: BoolArray, gain: float) -> Loop:
    """Compare each branch of a loop with the one before and the one after it, so that a drift cancels."""
    extent = float(np.ptp(u))
    places = turns(u, TURN * extent)
    nothing = Loop(np.empty(0), np.empty(0))
    if places.size < 2 or extent == 0.0 or gain == 0.0:
        return nothing
    branch = np.searchsorted(places, np.arange(u.size), side="left")
    branches = places.size + 1
    # Of the way there from rest, and of a last one back, only what lies between turns is compared.
    low, high = float(u[places].min()), float(u[places].max())
    place = np.floor((u - low) / (high - low) * PLACES).astype(np.int64)
    between = counts & (place >= 0) & (place < PLACES)
    cell = (branch * PLACES + place)[between]
    size = branches * PLACES
    number = np.bincount(cell, minlength=size)
    height = np.bincount(cell, (x - gain * u)[between], size)
    with np.errstate(invalid="ignore"):
        heights = (height / number).reshape(branches, PLACES)
    ends = u[np.concatenate(([0], places, [u.size - 1]))]
    rising = np.sign(np.diff(ends))[:, None]
    difference = -rising[1:-1] * (heights[1:-1] - 0.5 * (heights[:-2] + heights[2:]))
    # A way from rest, at the start, is no branch of a loop.
    first = 1 if branches > 4 else 0
    difference, spans = difference[first:], np.abs(np.diff(ends))[1:-1][first:]
    known = np.isfinite(difference)
    # In part of a branch a drift would not cancel.
    own = np.sum(np.isfinite(heights[1:-1][first:]), axis=1)
    enough = np.sum(known, axis=1) >= np.maximum(3, 0.8 * own)
    if not np.any(enough):
        return nothing
    openings = np.nanmean(difference[enough], axis=1)
    return Loop(openings, abs(gain) * spans[enough])
