"""Stretches of samples that a mark is set for."""

from typing import Any

import numpy as np

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]
IntArray = np.ndarray[Any, np.dtype[np.int64]]


def runs(marks: BoolArray) -> tuple[IntArray, IntArray]:
    """Starts and ends [start, end) of the stretches in which marks are set."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], marks, [False]))))
    return edges[::2], edges[1::2]
