"""The column of time, block by block: evenly spaced samples, or a refusal that names the line."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray

# A step of time may differ from whole samples by this part of a sample, and rows may be
# missing for this part of the record; beyond, the timing is not known well enough.
LARGEST_JITTER = 0.25
MOST_MISSING = 0.1
MENTIONED_JITTER = 0.01

Times = tuple[Any, FloatArray]  # numbers of rows in the file, times [s]
Blocks = Callable[[], Iterable[Times]]


class Timing(NamedTuple):
    """Where the samples of a log lie in time.

    Parameters
    ----------
    rows, samples : int
        Rows of the file; samples of the record, which are more where rows are missing.
    start, period : float
        Time of the first sample and from one to the next [s].
    usual : float or None
        Step by which rows are placed on samples [s]; None if each row is the next sample.
    notes : tuple of str
        What had to be assumed.
    """

    rows: int
    samples: int
    start: float
    period: float
    usual: float | None = None
    notes: tuple[str, ...] = ()

    def times(self, first: int, count: int) -> FloatArray:
        """Times of samples [s]."""
        return np.asarray(self.start + np.arange(first, first + count) * self.period, dtype=np.float64)

    @property
    def sample_rate(self) -> float:
        """[Hz]."""
        last = self.start + (self.samples - 1) * self.period
        return float((self.samples - 1) / (last - self.start))


def scan(where: str, place: str, blocks: Blocks) -> Timing:
    """Find the timing; ValueError, with the place in the file, if time is not even enough.

    Parameters
    ----------
    where, place : str
        File and what it calls a row, for messages.
    blocks : callable
        Returns an iterable of numbers of rows and their times; is called twice.
    """
    line = _Line()
    for numbers, time in blocks():
        line.add(where, place, numbers, time)
    if line.known < 2:
        raise ValueError(f"{where}: only {line.known} rows with a time")
    steps = _Steps(line.usual)
    jitter, row = 0.0, 0
    for numbers, time in blocks():
        jitter = max(jitter, line.deviation(row, time))
        steps.add(where, place, numbers, time)
        row += time.size
    by_step = jitter > LARGEST_JITTER
    if by_step:
        steps.check(line.rows)
        jitter = steps.jitter
    first, last = (steps.first, steps.last) if by_step else (line.first, line.last)
    period = (line.last_time - line.first_time) / (last - first)
    samples = int(last) + line.rows - line.last if by_step else line.rows
    notes: tuple[str, ...] = ()
    if jitter > MENTIONED_JITTER:
        notes = (f"time is uneven by up to {100.0 * jitter:.0f} % of a sample; taken as even",)
    return Timing(
        line.rows, samples, line.first_time - first * period, period, line.usual if by_step else None, notes
    )


class _Line:
    """A straight line through times over rows, by least squares, as rows come."""

    def __init__(self) -> None:
        self.rows = self.known = 0
        self.first = self.last = 0
        self.first_time = self.last_time = 0.0
        self.usual = 0.0
        self._sums = np.zeros(4)

    def add(self, where: str, place: str, numbers: Any, time: FloatArray) -> None:
        known = np.flatnonzero(np.isfinite(time))
        if known.size:
            before = [self.last_time] if self.known else []
            steps = np.diff(np.concatenate([before, time[known]]))
            if np.any(steps <= 0.0):
                k = int(np.argmax(steps <= 0.0)) + (0 if self.known else 1)
                now = time[known[k]]
                raise ValueError(
                    f"{where}, {place} {numbers[known[k]]}: time does not increase: {now:.9g} s after "
                    f"{now - steps[k - (0 if self.known else 1)]:.9g} s; if it has too few digits, give the "
                    "sample rate instead"
                )
            if not self.known:
                self.first, self.first_time = int(known[0]) + self.rows, float(time[known[0]])
            if self.usual == 0.0 and known.size > 1:
                # Of the first block only: the median of a whole column would need all of it.
                self.usual = float(np.median(np.diff(time[known]) / np.diff(known)))
            row, t = known + float(self.rows), time[known] - self.first_time
            self._sums += row.sum(), t.sum(), (row * row).sum(), (row * t).sum()
            self.known += known.size
            self.last, self.last_time = int(known[-1]) + self.rows, float(time[known[-1]])
        self.rows += time.size
        if self.usual == 0.0 and self.known > 1:
            self.usual = (self.last_time - self.first_time) / (self.last - self.first)

    def deviation(self, row: int, time: FloatArray) -> float:
        """How far times are off the line, in samples, the first of them being that of `row`."""
        known = np.flatnonzero(np.isfinite(time))
        if not known.size:
            return 0.0
        k, t, kk, kt = self._sums / self.known
        period = (kt - k * t) / (kk - k * k)
        on_the_line = self.first_time + t + period * (known + row - k)
        return float(np.max(np.abs(time[known] - on_the_line)) / period)


class _Steps:
    """Whole steps from row to row, where rows are missing."""

    def __init__(self, usual: float) -> None:
        self.usual = usual
        self.first = self.last = 0.0
        self.jitter = 0.0
        self._rows = 0
        self._seen: tuple[int, float] | None = None
        self._uneven = self._jump = ""
        self._largest = -np.inf

    def add(self, where: str, place: str, numbers: Any, time: FloatArray) -> None:
        known = np.flatnonzero(np.isfinite(time))
        if known.size:
            rows, times = known + self._rows, time[known]
            if self._seen is None:
                self.first = self.last = float(rows[0])
                self._seen = (int(rows[0]), float(times[0]))
            rows = np.concatenate([[self._seen[0]], rows])
            steps = np.diff(np.concatenate([[self._seen[1]], times]))
            self._judge(steps, np.diff(rows), lambda k: f"{where}, {place} {numbers[known[k]]}: ")
            self._seen = (int(rows[-1]), float(times[-1]))
        self._rows += time.size

    def _judge(self, steps: FloatArray, rows: Any, at: Callable[[int], str]) -> None:
        samples, real = steps / self.usual, rows > 0
        whole = np.rint(samples)
        jitter = np.where(real, np.where(whole < 1.0, 1.0, np.abs(samples - whole)), 0.0)
        if not self._uneven and jitter.max() > LARGEST_JITTER:
            k = int(np.argmax(jitter > LARGEST_JITTER))
            self._uneven = (
                f"{at(k)}time is sampled unevenly, a step of {steps[k]:.6g} s where {self.usual:.6g} s is "
                "usual: resample the log, or give the sample rate to take rows as even"
            )
        absent = whole - rows
        if absent.max() > self._largest:
            k = int(np.argmax(absent))
            self._largest = float(absent[k])
            self._jump = f"{at(k)}time jumps by {steps[k]:.6g} s where {self.usual:.6g} s is usual"
        self.jitter = max(self.jitter, float(jitter.max()))
        self.last += float(whole.sum())

    def check(self, rows: int) -> None:
        """Refuse what is uneven, or has too much missing."""
        if self._uneven:
            raise ValueError(self._uneven)
        assert self._seen is not None
        absent = int(self.last) - self._seen[0]
        if absent > MOST_MISSING * rows:
            raise ValueError(f"{self._jump}, {absent} samples are missing in all: cut the log there")


def placed(
    timing: Timing, blocks: Iterable[tuple[FloatArray, list[FloatArray]]]
) -> Iterator[list[FloatArray]]:
    """Values on their samples, NaN where no row falls.

    Parameters
    ----------
    timing : Timing
        From `scan`.
    blocks : iterable
        Times of rows, and values of any number of columns.
    """
    if timing.usual is None:
        for _, values in blocks:
            yield values
        return
    # Rows behind the last known time wait for the next one, between which they then lie.
    row, position = 0, 0.0
    began, waiting = False, (np.empty(0), [np.empty(0)])
    pending: list[FloatArray] = []
    emitted = 0
    for time, values in blocks:
        if not pending:
            pending = [np.full(1, np.nan) for _ in values]
            waiting = (np.empty(0), [np.empty(0) for _ in values])
        time = np.concatenate([waiting[0], time])
        values = [np.concatenate(pair) for pair in zip(waiting[1], values, strict=True)]
        known = np.flatnonzero(np.isfinite(time))
        if not known.size or (began and known.size == 1):
            waiting = (time, values)
            continue
        steps = np.rint(np.diff(time[known]) / timing.usual)
        if not began:
            position, began = float(known[0]), True
        marks = position + np.concatenate([[0.0], np.cumsum(steps)])
        where = np.interp(np.arange(row, row + time.size), row + known, marks)
        where[: known[0]] = marks[0] + np.arange(-known[0], 0)
        where = np.rint(where[: known[-1]]).astype(np.int64)
        end = int(marks[-1])
        # The sample of the last known time may get another row, so it is not given out yet.
        samples = [np.full(end + 1 - emitted, np.nan) for _ in values]
        for sample, before, value in zip(samples, pending, values, strict=True):
            sample[0] = before[0]
            fits = np.isfinite(value[: known[-1]])
            sample[where[fits] - emitted] = value[: known[-1]][fits]
        pending = [sample[-1:].copy() for sample in samples]
        if end > emitted:
            yield [sample[:-1] for sample in samples]
        row, position, emitted = row + int(known[-1]), marks[-1], end
        waiting = (time[known[-1] :], [value[known[-1] :] for value in values])
    samples = [np.full(waiting[0].size, np.nan) for _ in waiting[1]]
    for sample, before, value in zip(samples, pending, waiting[1], strict=True):
        sample[0] = before[0]
        fits = np.isfinite(value)
        sample[fits] = value[fits]
    if waiting[0].size:
        yield samples
