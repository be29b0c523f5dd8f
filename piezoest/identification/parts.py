"""A log larger than memory in parts of equal size, for any size of the blocks of its file."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.flaws import flawed
from piezoest.records import RecordStream

# Samples of a part. What is found depends on parts: flaws are looked for in each of them.
PART = 50_000

Progress = Callable[[int, int], None]


class Part(NamedTuple):
    """Samples of a log: the first one's number, voltage as it comes late, displacement, what counts."""

    first: int
    u: FloatArray
    x: FloatArray
    counts: Any


def pieces(log: RecordStream, progress: Progress | None) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Voltage and displacement as they are in the file, 50 000 samples at a time."""
    held: list[FloatArray] = []
    for block in log.blocks(progress=progress):
        held.append(np.stack([block.voltage, block.displacement]))
        if sum(each.shape[1] for each in held) >= PART:
            joined = np.concatenate(held, axis=1)
            whole = joined.shape[1] // PART * PART
            for k in range(0, whole, PART):
                yield joined[0, k : k + PART], joined[1, k : k + PART]
            held = [joined[:, whole:]]
    voltage, displacement = np.concatenate(held, axis=1) if held else np.empty((2, 0))
    # None are left of a log of so many whole pieces.
    if voltage.size:
        yield voltage, displacement


def parts(log: RecordStream, delay: float, progress: Progress | None) -> Iterator[Part]:
    """The log from its start, with the voltage late and without gaps, where it is the last one known."""
    before, seen = None, 0
    whole, rest = divmod(delay, 1.0)
    for u, x in pieces(log, progress):
        known = np.isfinite(u)
        if before is None and not known.any():
            seen += u.size
            continue
        if before is None:
            first = u[np.argmax(known)]
            before = np.full(int(np.ceil(delay)) + 2, first)
            for k in range(0, seen, PART):
                yield Part(k, np.full(PART, first), np.zeros(PART), np.zeros(PART, np.bool_))
        flaws = flawed(np.where(known, u, np.nan), x)
        counts = known & np.isfinite(x) & ~flaws.unusable
        u = flaws.without(u)
        path = np.concatenate([before, u])
        path = path[np.maximum.accumulate(np.where(np.isfinite(path), np.arange(path.size), 0))]
        now = np.arange(before.size, path.size) - int(whole)
        late = (1.0 - rest) * path[now] + rest * path[now - 1]
        before = path[-before.size :]
        yield Part(seen, late, np.where(np.isfinite(x), x, 0.0), counts)
        seen += u.size
