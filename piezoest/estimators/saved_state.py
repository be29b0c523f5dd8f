"""What a saved estimator must be before it is believed: its dictionary, each block of its state.

A state is one flat vector, and much in it becomes an index, a count or a divisor in compiled code, which asks
no questions. A layout's `Table` says of each block what its numbers can be; the tables are in
`piezoest.estimators.state_tables`.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray, array_1d, fields, finite

# No number that an estimator comes by is beyond this, and no count: six centuries at 50 kHz.
LARGEST, MOST = 1e60, 2.0**50
# Least argument other than zero, and the reciprocal of the largest.
SMALLEST_ARGUMENT = 1e-20
# Rounding that a covariance may show, in parts of its variances; and how far below zero an eigenvalue.
ASYMMETRY, INDEFINITE = 1e-9, 1e-6
# Rounding of a variance that is no divisor.
NEGATIVE = 1e-9


class Kind(NamedTuple):
    """What the numbers of a block can be.

    Parameters
    ----------
    low, high : float
        Least and largest value.
    whole : bool
        Whole numbers only.
    square : bool
        A symmetric matrix without a variance below zero, row by row.
    definite : bool
        No direction with a variance below zero either, but for rounding.
    fixed : bool
        As construction leaves them.
    idle : bool
        Work space: written before it is read, and neither saved nor loaded.
    """

    low: float = -LARGEST
    high: float = LARGEST
    whole: bool = False
    square: bool = False
    definite: bool = False
    fixed: bool = False
    idle: bool = False


def whole(low: float, high: float) -> Kind:
    """Whole numbers from `low` to `high`: codes and positions."""
    return Kind(low, high, whole=True)


NUMBER, AMOUNT, SHARE = Kind(), Kind(0.0), Kind(0.0, 1.0)
COUNT, FLAG, SIGN = whole(0.0, MOST), whole(0.0, 1.0), whole(-1.0, 1.0)
COVARIANCE, SYMMETRIC = Kind(square=True, definite=True), Kind(square=True)
FIXED, WORK = Kind(fixed=True), Kind(idle=True)


class Block(NamedTuple):
    """A block of a state: it reaches to where the next one starts.

    Parameters
    ----------
    start : int
        Position of its first number.
    name : str
        For messages.
    kind : Kind
        What its numbers can be.
    """

    start: int
    name: str
    kind: Kind


class Table(NamedTuple):
    """A layout: blocks from the first number to the last, and what must hold between them.

    Parameters
    ----------
    blocks : tuple of Block
        In order, without gaps.
    rules : tuple of (str, callable)
        What must hold, in words, and as a function of the state.
    """

    blocks: tuple[Block, ...]
    rules: tuple[tuple[str, Callable[[FloatArray], Any]], ...] = ()


def check(values: Any, table: Table, start: FloatArray) -> FloatArray:
    """Return a saved state as an array, if it is one of a layout; `start` is the state after construction.

    Raises
    ------
    ValueError
        Naming the block that it cannot be.
    """
    if not isinstance(values, list | tuple | np.ndarray):
        raise ValueError(f"state must be a list of numbers, got {type(values).__name__}")
    for place, value in enumerate(values):
        if not isinstance(value, float | int):
            raise ValueError(f"state must be a list of numbers, got {value!r} at position {place}")
    state = array_1d("state", values).copy()
    if state.size != start.size:
        raise ValueError(f"state holds {state.size} numbers, these arguments need {start.size}")
    for block, part in _parts(table, state.size):
        if block.kind.idle:
            state[part] = start[part]
        else:
            _check_block(block, state[part], start[part])
    for words, holds in table.rules:
        if not holds(state):
            raise ValueError(f"state: {words}: it was changed after to_dict()")
    return state


def to_save(state: FloatArray, table: Table) -> list[float]:
    """Return the numbers of a state without what is left in its work space."""
    state = state.copy()
    for block, part in _parts(table, state.size):
        if block.kind.idle:
            state[part] = 0.0
    numbers: list[float] = state.tolist()
    return numbers


def _parts(table: Table, size: int) -> list[tuple[Block, slice]]:
    edges = [*(block.start for block in table.blocks), size]
    return [(block, slice(*pair)) for block, pair in zip(table.blocks, pairwise(edges), strict=True)]


def _check_block(block: Block, values: FloatArray, start: FloatArray) -> None:
    kind = block.kind
    if kind.fixed:
        if not np.array_equal(values, start):
            raise ValueError(f"state: {block.name} must be as the arguments make them")
        return
    wrong = (values < kind.low) | (values > kind.high)
    if kind.whole:
        wrong |= values != np.floor(values)
    if wrong.any():
        number = "whole number" if kind.whole else "number"
        raise ValueError(
            f"state: {block.name} must be a {number} from {kind.low:g} to {kind.high:g}, "
            f"got {values[wrong][0]:g} at position {block.start + int(np.argmax(wrong))}"
        )
    if kind.square and not is_covariance(values, kind.definite):
        raise ValueError(f"state: {block.name} must be symmetric and positive, as a covariance is")


def is_covariance(flat: FloatArray, definite: bool) -> bool:
    """Whether numbers are a covariance, row by row, but for rounding; `definite`: in all directions."""
    n = math.isqrt(flat.size)
    P = flat.reshape(n, n)
    variance = np.diag(P)
    if np.any(variance < (0.0 if definite else -NEGATIVE)):
        return False
    deviation = np.sqrt(np.fmax(variance, 0.0))
    unit = np.outer(deviation, deviation)
    if np.any(np.abs(P - P.T) > ASYMMETRY * unit):
        return False
    if not definite:
        return True
    if np.any(np.abs(P) > (1.0 + INDEFINITE) * unit):
        return False
    correlation = np.divide(P, unit, out=np.zeros_like(P), where=unit > 0.0)
    return bool(np.linalg.eigvalsh(0.5 * (correlation + correlation.T))[0] >= -INDEFINITE)


def check_head(name: str, version: int, data: Any, more: tuple[str, ...]) -> None:
    """Refuse a dictionary that is not of the class `name` and this version's format.

    `more` names the fields that the class has beside those of all.
    """
    if not isinstance(data, dict):
        raise ValueError(f"data must be a dictionary that to_dict() gave, got {type(data).__name__}")
    if data.get("estimator") != name:
        raise ValueError(f"data is of a {data.get('estimator')!r}, not of a {name}")
    if data.get("format") != version:
        raise ValueError(f"data has format {data.get('format')!r}, this version reads {version}")
    fields("data", data, ("estimator", "format", "arguments", "state", "pending", *more))


def construct(cls: Any, arguments: Any) -> Any:
    """Make an estimator from saved arguments, all of which must be there."""
    fields("arguments", arguments, inspect.signature(cls).parameters)
    _check_magnitudes("arguments", arguments)
    try:
        with np.errstate(all="ignore"):
            return cls(**cls._revive(arguments))
    except (TypeError, ArithmeticError) as error:
        raise ValueError(f"arguments make no {cls.__name__}: {error}") from None


def _check_magnitudes(name: str, value: Any) -> None:
    """Refuse numbers whose squares and products are beyond those of float64: no stage has them."""
    if isinstance(value, dict):
        for key, inner in value.items():
            _check_magnitudes(f"{name}[{key!r}]", inner)
    elif isinstance(value, list | tuple):
        for place, inner in enumerate(value):
            _check_magnitudes(f"{name}[{place}]", inner)
    elif isinstance(value, int | float) and value not in (0, math.inf):
        largest = 1.0 / SMALLEST_ARGUMENT
        if not SMALLEST_ARGUMENT <= abs(value) <= largest:
            raise ValueError(
                f"{name} must be zero or of a size from {SMALLEST_ARGUMENT:g} to {largest:g}, "
                f"got {str(value)[:20]}"
            )


def pending_voltage(value: Any) -> float | None:
    """Return the voltage that waits for its measurement, as `to_dict` wrote it."""
    if value is None:
        return None
    return math.nan if isinstance(value, str) and value == "missing" else finite("pending", value)
