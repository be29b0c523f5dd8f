"""Plays, and what each has between two bends, as columns of a regression."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.compile import Matrix, Vector, compiled
from piezoest.equations.play import play
from piezoest.models import Creep, LinearGain, Model, PrandtlIshlinskii

# The slope just after a turn is at least this fraction of the straight line's.
LEAST_GAIN = 0.02
# Beyond the thresholds that the record moved, as many volts again are laid out with so many plays. They have
# this fraction of the density of the last ones that moved: of stages of seven families, driven up to twice as
# far as in the fitted part of a log, some stop there and some go on (benchmarks/logs.py).
BEYOND, LAST, GOES_ON = 5, 0.25, 0.3
# Root of what differences cost of plays that move as far as the voltage; of others, more by as much as they
# move less. Of sixty simulated logs (benchmarks/logs.py) errors are 6 % less than with a cost, not its root,
# in inverse proportion; of plays that move well the record alone says all.
HARDLY, LEAST_MOVING = 3e-5, 1e-3
# ... and this times as much of a segment that a play hardly reaches, to the next one. Without it a voltage
# that goes further may be missed by more than by a line; with more, the next segment suffers.
ACROSS = 0.1
# A range is about 0 V if its middle is nearer to it than this fraction of its half.
ABOUT_ZERO = 0.1
FAR = 1e300
POINTS = 401  # thresholds among which the widest is looked for
CLOSE = 1.5  # steps of thresholds, as so many times the first one, that are about as small


class Start(NamedTuple):
    """Where the plays were before the record: at `centre`, as far as the voltage `left` allows [V].

    `once`: which part it takes of the wider plays that move on the first way alone.
    """

    left: float
    centre: float
    once: float = 0.0

    def states(self, thresholds: FloatArray) -> FloatArray:
        """States of plays [V], shape (n,), that some voltage leaves behind."""
        return np.clip(self.centre, self.left - thresholds, self.left + thresholds)

    def widest(self, low: float, high: float, least: float) -> float:
        """Threshold of the widest play that a voltage from low to high moves by so much, at least [V].

        Swings move plays of half their range. The first way from rest moves wider ones, once.
        """
        thresholds = np.linspace(0.0, high - low, POINTS)
        states = self.states(thresholds)
        way = np.maximum(high - thresholds - states, states - low - thresholds)
        return max(0.5 * (high - low - least), float(np.max(thresholds[way >= least], initial=0.0)))


def starts(u: FloatArray) -> list[Start]:
    """Where a stage may have been left: at rest somewhere, or by a swing over the whole range."""
    low, high, first = float(u.min()), float(u.max()), float(u[0])
    found = [Start(first, centre) for centre in (first, 0.0, low, 0.5 * (low + high), high)]
    return list(
        dict.fromkeys([*found, Start(low, high), Start(high, low), Start(low, low), Start(high, high)])
    )


@dataclass(frozen=True, slots=True)
class PlayColumns:
    """Plays of given thresholds, cut at bends into segments that add up to them."""

    thresholds: FloatArray  # [V], (n,), rising from zero, which is the voltage itself
    bends: FloatArray  # voltages at which slopes may change [V], (k,)
    start: Start  # where the plays were before the first sample
    visited: tuple[float, float]  # range of the voltage of the record that is fitted [V]
    # How far each play goes in it within each segment, relative to the voltage's whole way divided by the
    # number of segments, (k + 1, n).
    moving: FloatArray
    # How many of the plays moved in it; those beyond begin in its middle, so that they move one after the
    # other as the voltage goes further on either side.
    moved: int | None = None

    @property
    def free(self) -> int:
        """None: where the plays began is not linear."""
        return 0

    @property
    def foretells(self) -> bool:
        """No: of plays wider than those that moved nothing is known."""
        return False

    @property
    def bent(self) -> bool:
        """Yes, if slopes change with the voltage."""
        return self.bends.size > 0

    @property
    def size(self) -> int:
        """Slopes: segment by segment, and in each of them play by play."""
        return int(self.thresholds.size * (self.bends.size + 1))

    @property
    def _edges(self) -> FloatArray:
        return edges_of(self.bends)

    def begin(self) -> FloatArray:
        """State before the first sample: that of the plays [V]."""
        states = self.start.states(self.thresholds)
        if self.moved is not None:
            states[self.moved :] = self.middle
        return states

    def afresh(self, u: float) -> PlayColumns:
        """The same for a stage that rests at 0 V until a record begins at voltage u [V]."""
        return replace(self, start=Start(u, 0.0))

    @property
    def middle(self) -> float:
        """Middle of the range of the record [V]."""
        return 0.5 * (self.visited[0] + self.visited[1])

    def rows(self, u: FloatArray, state: FloatArray) -> FloatArray:
        """Columns along a voltage."""
        plays = np.empty((u.size, self.thresholds.size))
        _plays(u, self.thresholds, state, plays)
        if self.bends.size == 0:
            return plays
        return self._by_segments(plays)

    def _by_segments(self, plays: FloatArray) -> FloatArray:
        """How far plays (N, n) are within each segment, from where they are at 0 V: (N, segments n)."""
        rows = np.empty((plays.shape[0], plays.shape[1] * (self.bends.size + 1)))
        _segments(plays, self._edges, rows)
        return rows

    def lower(self, gain: float) -> FloatArray:
        """Slopes are not negative, and the voltage's own is above zero."""
        return LEAST_GAIN * gain * self.line()

    def line(self) -> FloatArray:
        """The voltage alone."""
        w = np.zeros(self.size)
        w[:: self.thresholds.size] = 1.0
        return w

    def unevenness(self) -> FloatArray:
        """Squared differences of neighbouring plays, as densities, and of neighbouring segments."""
        return self._differences(np.ones_like(self.moving[0]), np.ones_like(self.moving[1:]))

    def prior(self) -> FloatArray:
        """The same where plays hardly move: they are as their neighbours are, and as in the next segment."""
        along = HARDLY / np.maximum(self.moving.mean(axis=0), LEAST_MOVING)
        less = np.minimum(self.moving[1:], self.moving[:-1])
        return self._differences(along, ACROSS * HARDLY / np.maximum(less, LEAST_MOVING))

    def _differences(self, along: FloatArray, across: FloatArray) -> FloatArray:
        """The squares, with roots of their weights: of plays (n,), of a segment and the next (k, n)."""
        n, segments = self.thresholds.size, self.bends.size + 1
        steps = (
            np.diff(self.thresholds, prepend=0.0) / self.thresholds[min(1, n - 1)] if n > 1 else np.ones(n)
        )
        alike = int(np.sum(steps < CLOSE))
        plays = along[2:, None] * np.diff(np.diag(1.0 / np.maximum(steps, 1.0)), axis=0)[1:]
        apart = across.reshape(-1, 1) * np.kron(np.diff(np.eye(segments), axis=0), np.eye(n)) / np.sqrt(n)
        rows = np.vstack([np.kron(np.eye(segments), plays), apart])
        return np.asarray((self.thresholds[alike - 1] * alike) ** 2 * rows.T @ rows)

    def merged(self) -> tuple[PlayColumns, FloatArray]:
        """The same without bends, and how its columns come from these (size, n)."""
        n, segments = self.thresholds.size, self.bends.size + 1
        whole = replace(self, bends=np.empty(0), moving=self.moving.mean(axis=0, keepdims=True))
        return whole, np.tile(np.eye(n), (segments, 1))

    def model(self, w: FloatArray, offset: float, creep: Creep | None, rate: float) -> Model:
        """Plays that have a slope."""
        slopes = w.reshape(self.bends.size + 1, -1)
        if slopes.size == 1:
            return LinearGain(float(slopes[0, 0]), offset)
        kept = self._kept(slopes)
        slopes, thresholds = slopes[:, kept], self.thresholds[kept][1:]
        changes = np.diff(slopes, axis=0)
        return PrandtlIshlinskii(
            float(slopes[0, 0]), thresholds, slopes[0, 1:], offset, creep, self.bends, changes, rate
        )

    def beyond(self, w: FloatArray) -> tuple[PlayColumns, FloatArray, float]:
        """The same with wider plays, all coefficients, and what they add in the record [µm].

        Nothing is known of them but their neighbours. There are none where they cannot be at zero, as a model
        has them without a record: they begin there if the voltage swings about it, and has left the widest
        that moved near it. Nor are there any where the stage comes from a voltage beyond the record: plays
        that had moved there go along with each new extreme, whatever their width.
        """
        n, slopes = self.thresholds.size, w.reshape(self.bends.size + 1, -1)
        low, high = self.visited
        about_zero = abs(self.middle) < ABOUT_ZERO * 0.5 * (high - low)
        apart = abs(float(self.begin()[-1]) - self.middle)
        beside = apart <= self.thresholds[-1] / BEYOND
        if n < 3 or not (about_zero and beside and low <= self.start.centre <= high):
            return self, w, 0.0
        step, widest = float(self.thresholds[1]), float(self.thresholds[-1])
        more = widest * (1.0 + np.arange(1, BEYOND + 1) / BEYOND)
        density = slopes[:, -max(1, round(LAST * n)) :].mean(axis=1, keepdims=True) / step
        added = np.repeat(GOES_ON * density * widest / BEYOND, BEYOND, axis=1)
        wider = replace(self, thresholds=np.concatenate([self.thresholds, more]), moved=n)
        rest = self._by_segments(wider.begin()[None, n:])
        return wider, np.hstack([slopes, added]).ravel(), float(np.sum(added * rest.reshape(added.shape)))

    def initial_state(self, w: FloatArray, model: Any) -> FloatArray | None:
        """States of the model's plays [V]."""
        if not isinstance(model, PrandtlIshlinskii):
            return None
        return self.begin()[self._kept(w.reshape(self.bends.size + 1, -1))][1:]

    def names(self, w: FloatArray) -> dict[str, FloatArray]:
        """Gain, weights, and what each bend changes of them."""
        n = self.thresholds.size
        unit = np.eye(self.size)
        kept = self._kept(w.reshape(self.bends.size + 1, -1))
        found = {"gain": unit[0]} | {f"weights[{i}]": unit[c] for i, c in enumerate(kept[1:])}
        for j in range(self.bends.size):
            change = unit[(j + 1) * n : (j + 2) * n] - unit[j * n : (j + 1) * n]
            found |= {f"bend_weights[{j},{i}]": change[c] for i, c in enumerate(kept)}
        return found

    @staticmethod
    def _kept(slopes: FloatArray) -> FloatArray:
        """Plays that have a slope somewhere, and the voltage."""
        return np.union1d([0], np.flatnonzero(np.any(slopes > 0.0, axis=0)))


def edges_of(bends: FloatArray) -> FloatArray:
    """Bounds of the segments between bends, shape (k + 2,) [V]; the outermost are far away."""
    return np.concatenate(([-FAR], bends, [FAR]))


def moving_of(u: FloatArray, thresholds: FloatArray, bends: FloatArray, start: Start) -> FloatArray:
    """How far plays go along a voltage within segments, shape (k + 1, n), as `PlayColumns.moving`."""
    way = np.zeros((bends.size + 1, thresholds.size))
    _ways(u, thresholds, edges_of(bends), start.states(thresholds), way)
    return way * way.shape[0] / max(float(np.sum(np.abs(np.diff(u)))), 1e-300)


@compiled
def _ways(u: Vector, thresholds: Vector, edges: Vector, y: Vector, way: Matrix) -> None:
    """Adds to `way` how far plays go in each segment; the states `y` go on."""
    for k in range(u.size):
        for i in range(y.size):
            now = play(y[i], u[k], thresholds[i])
            low, high = min(y[i], now), max(y[i], now)
            for s in range(way.shape[0]):
                way[s, i] += max(min(high, edges[s + 1]) - max(low, edges[s]), 0.0)
            y[i] = now


@compiled
def _plays(u: Vector, thresholds: Vector, y: Vector, plays: Matrix) -> None:
    """Plays along a voltage; the states `y` go on."""
    for k in range(u.size):
        for i in range(y.size):
            y[i] = play(y[i], u[k], thresholds[i])
            plays[k, i] = y[i]


@compiled
def _segments(plays: Matrix, edges: Vector, rows: Matrix) -> None:
    """How far each play is within each segment, from where it is at 0 V, into `rows`."""
    n = plays.shape[1]
    for k in range(plays.shape[0]):
        for s in range(edges.size - 1):
            low, high = edges[s], edges[s + 1]
            zero = min(max(0.0, low), high)
            for i in range(n):
                rows[k, s * n + i] = min(max(plays[k, i], low), high) - zero
