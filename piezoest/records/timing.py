"""The column of time, block by block: evenly spaced samples, or a refusal that names the line."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records.source import LogError, counted

# A step of time may differ from whole samples by this part of a sample, and rows may be missing in one place
# for this part of the record, or all over it for the second part; beyond, the timing is not known.
LARGEST_JITTER = 0.25
MOST_MISSING, MOST_IN_ALL = 0.1, 0.5
MENTIONED_JITTER = 0.01
# Times of too few digits take two steps, a digit apart, and are off by half a digit, or some more; so many
# long steps are not rows that are missing.
HALF_STEP, OFTEN = 0.6, 10
# Rows that are missing by chance leave runs of any length between them. Where the lengths of many runs spread
# by less than this part of what chance would give, the long steps come of the digits; of few, by still less.
REGULAR = 0.8
# Part of the rows, and one in any case, that may repeat the time before; with more, digits are too few.
MOST_REPEATED = 0.01

Blocks = Callable[[], Iterable[tuple[Any, FloatArray]]]  # numbers of rows in the file, times [s]


class Timing(NamedTuple):
    """Where the samples of a log lie in time."""

    samples: int  # samples of the record, more than rows of the file where some are missing
    start: float  # time of the first sample [s]
    period: float  # from one to the next [s]
    usual: float | None  # step by which rows are placed on samples [s]; None if each row is the next sample
    jump: int  # number of the row before which most samples are missing
    notes: tuple[str, ...] = ()  # what had to be assumed

    def times(self, first: int, count: int) -> FloatArray:
        """Times of samples [s]."""
        return np.asarray(self.start + np.arange(first, first + count) * self.period, dtype=np.float64)

    @property
    def sample_rate(self) -> float:
        """[Hz]."""
        last = self.start + (self.samples - 1) * self.period
        return float((self.samples - 1) / (last - self.start))


class _Known(NamedTuple):
    """Rows with a time of their own, behind the last one of the block before; numbers of those without."""

    rows: Any  # counted from 0
    numbers: Any
    times: FloatArray
    repeating: Any = ()


def _own(time: FloatArray) -> FloatArray:
    """Times with NaN where one repeats the time before."""
    known = np.flatnonzero(np.isfinite(time))
    own = time.copy()
    own[known[1:][np.diff(time[known]) == 0.0]] = np.nan
    return own


def _known(blocks: Iterable[tuple[Any, FloatArray]]) -> Iterator[tuple[int, _Known, int]]:
    """Rows so far, those of a block that have a time, and how many of these are of the block before."""
    start, last = 0, _Known(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))
    for numbers, time in blocks:
        own = _own(np.append(last.times, time))[last.times.size :]
        known = np.flatnonzero(np.isfinite(own))
        found = _Known(
            np.append(last.rows, known + start),
            np.append(last.numbers, numbers[known]),
            np.append(last.times, time[known]),
            numbers[np.isfinite(time) & np.isnan(own)],
        )
        start += time.size
        yield start, found, last.rows.size
        last = _Known(found.rows[-1:], found.numbers[-1:], found.times[-1:])


def scan(where: str, place: str, blocks: Blocks) -> Timing:
    """Find the timing; ValueError, with the place in the file, if time is not even enough."""
    rows, count, usual, jitter, absent = 0, 0, 0.0, 0.0, 0
    largest, jump, moved, words, uneven = 0, 0, False, "", ""
    repeats, repeated = 0, ""
    sums, first, last, least, most = np.zeros(4), (0, 0.0), (0, 0.0), np.inf, 0.0
    runs = _Runs()
    for rows, known, old in _known(blocks()):  # noqa: B007
        steps, apart = np.diff(known.times), np.diff(known.rows)

        def at(k: int, numbers: Any = known.numbers) -> str:
            return f"{where}, {place} {numbers[k + 1]}: time "

        if not known.times.size:
            continue
        if len(known.repeating):
            repeats += len(known.repeating)
            repeated = repeated or f"{place} {known.repeating[0]}"
        if np.any(steps < 0.0):
            k = int(np.argmax(steps < 0.0))
            if np.all(steps < 0.0):
                raise LogError(f"{at(k)}falls from row to row: put the rows in the order of time")
            raise LogError(
                f"{at(k)}does not increase: {known.times[k + 1]:.15g} s after {known.times[k]:.15g} s; cut "
                "the log where the clock starts again, or give the sample rate to take rows as even"
            )
        if not count:
            first = int(known.rows[0]), float(known.times[0])
        count += known.times.size - old
        last = int(known.rows[-1]), float(known.times[-1])
        # Of a straight line through times over rows, by least squares.
        row, t = known.rows[old:] - float(first[0]), known.times[old:] - first[1]
        sums += row.sum(), t.sum(), (row * row).sum(), (row * t).sum()
        if not steps.size:
            continue
        # Of the first steps only: the median of a whole column would need all of it.
        usual = usual or float(np.median(steps / apart))
        least, most = min(least, float(np.min(steps))), max(most, float(np.max(steps)))
        whole = np.rint(steps / usual)
        off = np.where(whole < 1.0, 1.0, np.abs(steps / usual - whole))
        gaps = whole - apart
        if off.max() > LARGEST_JITTER and not uneven:
            k = int(np.argmax(off > LARGEST_JITTER))
            uneven = (
                f"{at(k)}is sampled unevenly, a step of {steps[k]:.6g} s where {usual:.6g} s is usual: "
                "resample the log, or give the sample rate to take rows as even"
            )
        runs.add(known.rows[1:][gaps > 0.0])
        k = int(np.argmax(gaps))
        if not words or gaps[k] > largest:
            largest, jump = gaps[k], int(known.numbers[k + 1])
            words = f"{at(k)}jumps by {steps[k]:.6g} s where {usual:.6g} s is usual"
        moved = moved or bool(np.any(gaps))
        jitter, absent = max(jitter, float(off.max())), absent + int(gaps.sum())
    if repeats > max(1.0, MOST_REPEATED * rows):
        raise LogError(
            f"{where}, {repeated}: time does not increase, and so in {counted(repeats, 'row')}; if it has "
            "too few digits, give the sample rate instead"
        )
    if count < 2:
        raise LogError(f"{where}: only {counted(count, 'row')} with a time")
    # Steps that differ by more than one are no matter of digits.
    if uneven or (absent >= OFTEN and most - least < 1.5 * usual):
        # Steps may be so where times are not: of 3, 4 and 3 ms, where three decimals are too few for 10/3.
        apart_from_line, even = _deviation(sums / count, first, (least, most), blocks())
        if uneven and not even:
            raise LogError(uneven)
        if even:
            absent, largest, moved, jitter = 0, 0, False, apart_from_line
    if runs.end_to_end(rows):
        raise LogError(f"{words}, and from there on: the sample rate changes, cut the log there")
    if absent and runs.regular():
        raise LogError(
            f"{words}, and such steps come too regularly for rows that are missing: time has too few digits; "
            "give the sample rate to take rows as even"
        )
    if largest > MOST_MISSING * (rows + absent) or absent > MOST_IN_ALL * (rows + absent):
        raise LogError(f"{words}, {absent} samples are missing in all: cut the log there")
    period = float((last[1] - first[1]) / (last[0] + absent - first[0]))
    notes = []
    if jitter > MENTIONED_JITTER:
        notes.append(f"time is uneven by up to {100.0 * jitter:.0f} % of a sample; taken as even")
    if repeats:
        notes.append(
            f"{counted(repeats, 'row')} with the time of the row before, the first in {repeated}: placed by "
            "the rows beside"
        )
    return Timing(
        rows + absent, float(first[1] - first[0] * period), period, usual if moved else None, jump,
        tuple(notes),
    )  # fmt: skip


class _Runs:
    """Lengths of the runs of rows between long steps of time."""

    def __init__(self) -> None:
        self.count, self.first, self.last, self.squares = 0, 0.0, 0.0, 0.0

    def add(self, rows: Any) -> None:
        """Rows behind long steps, later than those before."""
        if not len(rows):
            return
        if not self.count:
            self.first = self.last = float(rows[0])
        lengths = np.diff(np.append(self.last, rows))
        self.squares += float(lengths @ lengths)
        self.count, self.last = self.count + len(rows), float(rows[-1])

    def end_to_end(self, rows: int) -> bool:
        """Whether all steps are long from some row on."""
        return self.count > OFTEN and self.last - self.first == self.count - 1 and self.last == rows - 1

    def regular(self) -> bool:
        """Whether lengths differ by less than those of rows that are missing by chance."""
        if self.count <= OFTEN:
            return False
        mean = (self.last - self.first) / (self.count - 1)
        spread = self.squares / (self.count - 1) - mean * mean
        # Variance of the geometric distribution, and the standard error of its root.
        part = REGULAR - 1.0 / np.sqrt(self.count)
        return bool(spread < part * part * mean * max(mean - 1.0, 0.1))


def _deviation(
    means: FloatArray,
    first: tuple[int, float],
    steps: tuple[float, float],
    blocks: Iterable[tuple[Any, FloatArray]],
) -> tuple[float, bool]:
    """How far times are off a straight line, in samples, by its sums; whether rows are even.

    `steps`: the shortest and the longest.
    """
    k, t, kk, kt = means
    period = (kt - k * t) / (kk - k * k)
    off, middle, reach = 0.0, 0.5 * (steps[0] + steps[1]), 0.45 * (steps[1] - steps[0])
    coarse = True
    for _, known, _ in _known(blocks):
        line = first[1] + t + period * (known.rows - first[0] - k)
        off = max(off, float(np.max(np.abs(known.times - line), initial=0.0)) / period)
        coarse = coarse and not np.any(np.abs(np.diff(known.times) - middle) < reach)
    return off, off <= LARGEST_JITTER or (coarse and off * period <= HALF_STEP * (steps[1] - steps[0]))


def placed(timing: Timing, blocks: Iterable[list[FloatArray]]) -> Iterator[list[FloatArray]]:
    """Columns on their samples, NaN where no row falls, by the first one, which is time."""
    if timing.usual is None:
        yield from (values for _, *values in blocks)
        return
    # Rows behind the last known time wait for the next one, between which they then lie.
    waiting: Any = None
    for block in itertools.chain(blocks, (None,)):
        rows = np.array(block) if waiting is None else np.hstack([waiting, block or waiting[:, :0]])
        rows[0] = _own(rows[0])
        known = np.flatnonzero(np.isfinite(rows[0]))
        end = rows.shape[1] if block is None else known[-1] if known.size else 0
        knots = np.unique(np.concatenate([[0], known, [end]]))
        steps = np.rint(np.diff(np.append(rows[0], np.nan)[knots]) / timing.usual)
        marks = np.append(0, np.cumsum(np.where(np.isnan(steps), np.diff(knots), steps)))
        where = np.interp(np.arange(end), knots, marks)
        samples = np.full((len(rows) - 1, int(marks[-1])), np.nan)
        place = np.floor(where + 1e-6).astype(np.int64)
        for sample, values in zip(samples, rows[1:, :end], strict=True):
            # Of rows without a time, more than there is room for fall on the sample of another.
            fits = np.isfinite(values)
            sample[place[fits]] = values[fits]
        waiting = rows[:, end:]
        if end:
            yield list(samples)
