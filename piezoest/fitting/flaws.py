"""Samples of a log that belong to no stage: spikes, jumps of the sensor, readings that stand still, rests."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray, array_1d
from piezoest.compile import Vector, compiled
from piezoest.fitting.bursts import LONGEST as LONGEST_BURST
from piezoest.fitting.bursts import bursts, wild
from piezoest.fitting.clipping import Top, flat_tops, marked
from piezoest.fitting.coordinates import bridged
from piezoest.fitting.held import held
from piezoest.fitting.jumps import EACH_SIDE, FEWEST_SAMPLES, KINK, UNUSUAL, jumps_of
from piezoest.fitting.lost_voltage import delay_of, lost_voltage
from piezoest.fitting.rests import rests_of
from piezoest.fitting.rows import dot
from piezoest.fitting.runs import BoolArray, IntArray, runs
from piezoest.fitting.surprise import is_peak, scale_of, surprise

# A spike is at least so much of the range of the displacement: less does no harm to a fit.
SMALLEST_SPIKE = 1e-3
PASSES = 4
# Steps of the voltage explain what happens for some samples, and this much more than their size.
FORGOTTEN_PER_SAMPLE = 0.98
EXPLAINED_BY_STEP = 3.0
# Neighbours on either side that foresee a sample.
NEIGHBOURS = 3
# What surprises on either side of a spike, relative to it: largest difference, and least sum, the other way.
ONE_SIDED, BOTH_SIDES = 0.6, 0.15
# Samples beside a spike that say whether the displacement comes back.
BESIDE = np.arange(2, 7)
# A gap of the voltage of more samples may hide a turn.
SHORTEST_GAP = 8
# A sensor that stands still for so many samples while the stage moves by so many of its steps.
SHORTEST_DROPOUT, MOVED_IN_DROPOUT = 8, 50.0
# Part of the range that the voltage moves, and from its ends, at which no stage stands still by itself.
MOST, FAR_INSIDE = 0.6, 0.02
# Part of what the voltage moves by which the reading then jumps.
JUMPED = 0.2
# The displacement is clipped where the voltage goes on by this part of its range, if a line explains so much
# of its mean square.
GOES_ON, RELATED = 0.04, 0.5


class Flaws(NamedTuple):
    """What in a log belongs to no stage. Marks of samples have shape (N,)."""

    # Displacement that is off, alone or up to six samples together, or beyond all others as error codes are.
    spikes: BoolArray
    dropouts: BoolArray  # the reading stands still while the voltage moves
    jumps: IntArray  # first samples after steps that no step of the voltage explains, (J,)
    jump_sizes: FloatArray  # [µm], (J,)
    rests: IntArray  # stretches [start, end) in which the voltage stands still, (R, 2)
    # Voltage that the displacement does not answer: spikes, zeros, and a column that stands still while the
    # stage moves.
    voltage: BoolArray
    # Repetitions of the reading before, where the sensor measures less often than the log has samples.
    repeated: BoolArray
    tops: tuple[Top, ...] = ()  # where the displacement is clipped, above and below

    @property
    def clipped(self) -> BoolArray:
        """Samples at which the displacement is clipped, shape (N,)."""
        return marked(self.tops, self.spikes.size)

    @property
    def unusable(self) -> BoolArray:
        """Samples that a fit should leave out, shape (N,)."""
        return self.spikes | self.dropouts | self.voltage | self.repeated | self.clipped

    def without(self, u: FloatArray) -> FloatArray:
        """The voltage [V] with NaN where it is wrong."""
        return np.where(self.voltage, np.nan, u)

    def before(self, end: int) -> Flaws:
        """Those of the first `end` samples."""
        jumps, rests = self.jumps < end, self.rests[:, 0] < end
        return Flaws(
            self.spikes[:end],
            self.dropouts[:end],
            self.jumps[jumps],
            self.jump_sizes[jumps],
            self.rests[rests],
            self.voltage[:end],
            self.repeated[:end],
            tuple(top._replace(samples=top.samples[:end]) for top in self.tops),
        )


def flawed(u: Any, x: Any) -> Flaws:
    """Find spikes, jumps, dropouts and rests in an evenly sampled log.

    Voltage [V] and displacement [µm] are NaN where a sample is missing. Nothing is found where fewer than 64
    samples are known, or one of the two never moves. ValueError if they are not numbers of one shape (N,).

    >>> import numpy as np
    >>> from piezoest.fitting.flaws import flawed
    >>> u = 10.0 * np.sin(np.linspace(0.0, 40.0, 4000))
    >>> x = 0.1 * u
    >>> x[1000] += 0.5
    >>> np.flatnonzero(flawed(u, x).spikes)
    array([1000])
    """
    u, x = array_1d("u", u, allow_nan=True), array_1d("x", x, allow_nan=True)
    if u.size != x.size:
        raise ValueError(f"x must have shape ({u.size},) as u has, got ({x.size},)")
    known = np.isfinite(u) & np.isfinite(x)
    nowhere, none = np.empty(0, np.int64), np.zeros(u.size, dtype=np.bool_)
    nothing = Flaws(none, none, nowhere, np.empty(0), nowhere.reshape(0, 2), none, none)
    if np.sum(known) < FEWEST_SAMPLES or np.ptp(u[known]) == 0.0:
        return nothing
    codes = wild(u, x)
    x = np.where(codes, np.nan, x)
    repeated = held(u, x)
    if repeated.any():
        x = bridged(np.where(repeated, np.nan, x))
    known &= ~codes
    wrong = lost_voltage(u, x) if np.ptp(x[known]) > 0.0 else none
    known &= ~wrong
    unknown = _long_gaps(u, wrong)
    u = bridged(np.where(wrong, np.nan, u))
    rests = rests_of(u)
    if np.ptp(x[known]) == 0.0:
        return nothing._replace(spikes=codes, rests=rests)
    found = nothing._replace(spikes=codes, rests=rests, voltage=wrong, repeated=repeated)
    return _of_readings(found, u, bridged(x), known, unknown)


def _of_readings(found: Flaws, u: FloatArray, x: FloatArray, known: BoolArray, unknown: BoolArray) -> Flaws:
    """Add the flaws of the displacement, of which only what the sensor measured anew is looked at."""
    place = np.flatnonzero(~found.repeated)
    known, unknown = known[place], unknown[place]
    log = _Log(u[place], x[place])
    lost = _dropouts(log, known)
    off = _bursts(log, lost | unknown)
    spikes, clean = _spikes(log, lost | unknown)
    spikes = _isolated(spikes | off)
    tops = _clipped(log)
    clipped = marked(tops, lost.size)
    # Where the displacement comes to a limit or leaves it, the voltage does not tell what it does.
    jumps, sizes = jumps_of(log, clean, spikes | lost | clipped | ~known, unknown | clipped)

    def whole(marks: BoolArray) -> BoolArray:
        out = np.zeros_like(found.spikes)
        out[place[marks]] = True
        return out

    return found._replace(
        spikes=found.spikes | whole(spikes & known),
        dropouts=found.dropouts | whole(lost),
        jumps=place[jumps],
        jump_sizes=sizes,
        tops=tuple(top._replace(samples=whole(top.samples)) for top in tops),
    )


def _clipped(log: _Log) -> tuple[Top, ...]:
    """Where the displacement stands at a limit, if it is related to the voltage."""
    related = float(np.corrcoef(log.late, log.x)[0, 1]) if np.ptp(log.x) > 0.0 else 0.0
    return flat_tops(log.x, np.sign(related) * log.u, GOES_ON) if related * related > RELATED else ()


def _long_gaps(u: FloatArray, wrong: BoolArray) -> BoolArray:
    """Where the voltage is missing for so long that the displacement goes its own way; and just beside."""
    gaps = ~np.isfinite(u) | wrong
    out = np.zeros_like(gaps)
    starts, ends = runs(gaps)
    long = ends - starts > SHORTEST_GAP
    for start, end in zip(starts[long], ends[long], strict=True):
        out[max(start - EACH_SIDE, 0) : end + EACH_SIDE] = True
    return out


class _Log:
    """A log without gaps, and what it takes to judge a sample of it."""

    def __init__(self, u: FloatArray, x: FloatArray) -> None:
        self.u, self.x = u, x
        low, high = np.quantile(x, [0.001, 0.999])
        self.range = float(high - low) or float(np.ptp(x))
        self.delay = delay_of(u, x)
        self.late = u[np.maximum(np.arange(u.size) - self.delay, 0)]
        self.gain = _gain(self.late, x)
        moved = np.abs(np.diff(x))
        self.quantum = float(np.min(moved[moved > 0.0]))
        # The stage may answer at once, or be as late as it seems.
        curved = np.max(
            [np.abs(np.diff(v, 2, prepend=v[0], append=v[-1])) for v in (self.u, self.late)], axis=0
        )
        steps = np.empty_like(curved)
        _remembered(curved, FORGOTTEN_PER_SAMPLE, steps)
        #: What the voltage moves in a sample [µm].
        self.moving = self.gain * np.abs(np.diff(self.late, append=self.late[-1]))
        #: What it may do to a sample, beyond what the neighbours say [µm].
        self.explained = self.gain * EXPLAINED_BY_STEP * steps + KINK * self.moving


def _gain(u: FloatArray, x: FloatArray) -> float:
    """Size of the slope of the displacement over the voltage [µm/V]; jumps and spikes do little to it."""
    about = u - np.mean(u)
    return abs(dot(about, x)) / dot(about, about)


@compiled
def _remembered(size: Vector, keep: float, out: Vector) -> None:
    """The largest so far, forgotten by a factor for each sample; and that of the two samples ahead."""
    largest = 0.0
    for k in range(len(size)):
        ahead = max(size[k], size[min(k + 1, len(size) - 1)], size[min(k + 2, len(size) - 1)])
        largest = max(keep * largest, ahead)
        out[k] = largest


def _bursts(log: _Log, stuck: BoolArray) -> BoolArray:
    """Samples that are off a few together; the log goes on with something sensible in their place."""
    found = np.zeros(log.x.size, dtype=np.bool_)
    ways = log.gain * log.late
    for start, end in zip(*bursts(log.x - ways, log.explained, log.range, stuck), strict=True):
        found[start:end] = True
    log.x = np.where(found, bridged(np.where(found, np.nan, log.x - ways)) + ways, log.x)
    return found


def _spikes(log: _Log, stuck: BoolArray) -> tuple[BoolArray, FloatArray]:
    """Samples that are off alone, and the displacement with something sensible in their place."""
    inputs = log.gain * np.diff(log.late, 2, prepend=log.late[0], append=log.late[-1])
    clean, spikes = log.x.copy(), np.zeros(log.x.size, dtype=np.bool_)
    for _ in range(PASSES):
        e = surprise(clean, inputs, NEIGHBOURS)
        size = np.abs(e)
        floor = SMALLEST_SPIKE * log.range + log.quantum
        limit = np.maximum(UNUSUAL * scale_of(e), np.maximum(floor, log.explained))
        found = np.flatnonzero((size > limit) & ~stuck)
        found = found[is_peak(size, 2, found)]
        # The neighbours of a spike are surprising the other way: of a step only one is, of a kink none. What
        # stands beside a greater spike waits for the next pass.
        before, after = (e[found + side] * np.sign(e[found]) / size[found] for side in (-1, 1))
        found = found[(np.abs(before - after) < ONE_SIDED) & (before + after < -BOTH_SIDES)]
        found = found[_comes_back(log, clean, found, size[found])]
        if not found.size:
            break
        spikes[found] = True
        clean[found] -= e[found]
    return spikes, clean


def _comes_back(log: _Log, x: FloatArray, found: IntArray, size: FloatArray) -> BoolArray:
    """Whether the displacement is after a spike what it was before, but for what the voltage did."""
    h = x - log.gain * log.late
    sides = [h[np.clip(found[:, None] + place, 0, h.size - 1)] for place in (-BESIDE, BESIDE)]
    medians = [np.median(values[:, :3], axis=1) for values in sides]
    t = BESIDE - BESIDE.mean()
    ends = [values.mean(axis=1) - values @ t / (t @ t) * BESIDE.mean() for values in sides]
    # Of a stage in motion the lines tell, beside another spike the medians.
    stays = np.minimum(np.abs(medians[1] - medians[0]), np.abs(ends[1] - ends[0]))
    return np.asarray(stays < 0.5 * size)


def _isolated(marks: BoolArray) -> BoolArray:
    """Marks of which no more than in a burst stand together."""
    starts, ends = runs(marks)
    long = ends - starts > LONGEST_BURST
    out = marks.copy()
    for start, end in zip(starts[long], ends[long], strict=True):
        out[start:end] = False
    return out


def _dropouts(log: _Log, known: BoolArray) -> BoolArray:
    """Samples at which the reading stands still though the voltage moves, unless it is clipped there."""
    out = np.zeros(log.x.size, dtype=np.bool_)
    same = (np.diff(log.x) == 0.0) & known[1:] & known[:-1]
    starts, ends = runs(same)
    ends = ends + 1
    usual = log.x.size / float(np.sum(~same))
    worth = ends - starts >= max(SHORTEST_DROPOUT, 5.0 * usual)
    for start, end in zip(starts[worth], ends[worth], strict=True):
        moved = log.gain * float(np.ptp(log.late[start:end]))
        if moved > max(MOVED_IN_DROPOUT * log.quantum, 0.02 * log.range) and _is_lost(log, start, end, moved):
            out[start:end] = True
    return out


def _is_lost(log: _Log, start: int, end: int, moved: float) -> bool:
    """Whether the reading comes to its rest, or goes on, by a jump; where it does neither it is clipped.

    It is not clipped far from both ends of the range while the stage goes through most of it.
    """
    value = log.x[start]
    inside = min(value - log.x.min(), log.x.max() - value)
    if end >= log.x.size - 1:
        return bool(inside > 0.0)
    if moved > MOST * log.range and inside > FAR_INSIDE * log.range:
        return True
    return bool(max(abs(value - log.x[max(start - 1, 0)]), abs(value - log.x[end])) > JUMPED * moved)
