"""Which way round a log's loop runs, and how wide it is, whatever drifts."""

from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.runs import BoolArray
from piezoest.signals.turns import TURN, turns

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
