"""The column of time: evenly spaced samples, or a refusal that names the line."""

from __future__ import annotations

from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records.table import Table

# A step of time may differ from whole samples by this part of a sample, and rows may be
# missing for this part of the record; beyond, the timing is not known well enough.
LARGEST_JITTER = 0.25
MOST_MISSING = 0.1
MENTIONED_JITTER = 0.01


def even_time(table: Table) -> tuple[FloatArray, Any, list[str]]:
    """Evenly spaced time, the sample each row falls on, and notes; refuses what is too uneven."""
    time = table.values["time"]
    known = np.flatnonzero(np.isfinite(time))
    if known.size < 2:
        raise ValueError(f"{table.path}: only {known.size} rows with a time")
    steps = np.diff(time[known])
    if np.any(steps <= 0.0):
        k = int(np.argmax(steps <= 0.0))
        raise ValueError(
            f"{_place(table, known[k + 1])}: time does not increase: {time[known[k + 1]]:.9g} s "
            f"after {time[known[k]]:.9g} s; if it has too few digits, give the sample rate instead"
        )
    where, jitter = _on_a_line(time, known)
    if jitter > LARGEST_JITTER:
        where, jitter = _step_by_step(table, known, steps)
    notes = []
    if jitter > MENTIONED_JITTER:
        notes.append(f"time is uneven by up to {100.0 * jitter:.0f} % of a sample; taken as even")
    period = float((time[known[-1]] - time[known[0]]) / (where[known[-1]] - where[known[0]]))
    start = float(time[known[0]] - (where[known[0]] - where[0]) * period)
    where = where - where[0]
    even = np.asarray(start + np.arange(int(where[-1]) + 1) * period, dtype=np.float64)
    return even, where, notes


def spread(values: FloatArray, where: Any) -> FloatArray:
    """Values on their samples, NaN where no row falls."""
    samples = np.full(int(where[-1]) + 1, np.nan)
    known = np.isfinite(values)
    samples[where[known]] = values[known]
    return samples


def _place(table: Table, row: int) -> str:
    return f"{table.path}, line {table.lines[row]}"


def _on_a_line(time: FloatArray, known: Any) -> tuple[Any, float]:
    """Each row its own sample, and how far times then are from even, in samples."""
    period, start = np.polyfit(known, time[known], 1)
    off = np.abs(time[known] - (start + period * known)) / period
    return np.arange(time.size), float(np.max(off))


def _step_by_step(table: Table, known: Any, steps: FloatArray) -> tuple[Any, float]:
    """Samples by whole steps of time, where rows are missing."""
    rows, size = np.diff(known), table.values["time"].size
    period = float(np.median(steps / rows))
    samples = steps / period
    whole = np.rint(samples)
    jitter = np.where(whole < 1, 1.0, np.abs(samples - whole))
    if jitter.max() > LARGEST_JITTER:
        k = int(np.argmax(jitter > LARGEST_JITTER))
        raise ValueError(
            f"{_place(table, known[k + 1])}: time is sampled unevenly, a step of {steps[k]:.6g} s where "
            f"{period:.6g} s is usual: resample the log, or give the sample rate to take rows as even"
        )
    # Rows without a time lie between their neighbours, as far as there is room.
    where = np.interp(np.arange(size), known, np.concatenate([[0.0], np.cumsum(whole)]))
    where[: known[0]] = np.arange(-known[0], 0)
    where[known[-1] :] = where[known[-1]] + np.arange(size - known[-1])
    absent = int(where[-1] - where[0]) + 1 - size
    if absent > MOST_MISSING * size:
        k = int(np.argmax(whole - rows))
        raise ValueError(
            f"{_place(table, known[k + 1])}: time jumps by {steps[k]:.6g} s where {period:.6g} s "
            f"is usual, {absent} samples are missing in all: cut the log there"
        )
    return np.rint(where).astype(np.int64), float(jitter.max())
