"""What a saved estimator must be before it is believed: its dictionary, each number of its state.

Much in a state becomes an index, a count or a divisor in compiled code, which asks no questions. Its layout
says of each number what it can be.
"""

import inspect
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, fields, finite, instance
from piezoest.layout import Kind, Record, by_name, leaves

# Least argument other than zero, and the reciprocal of the largest.
SMALLEST_ARGUMENT = 1e-20
# Rounding that a covariance may show, relative to its variances; and how far below zero an eigenvalue.
ASYMMETRY, INDEFINITE = 1e-9, 1e-6
# Rounding of a variance that is no divisor.
NEGATIVE = 1e-9


Rule = tuple[str, Any]


def check(saved: Any, layout: Record, start: Any, rules: Callable[[Any], Iterable[Rule]]) -> Any:
    """Return numbers by name as a structured array, if they are of a layout and its rules hold."""
    state = start.copy()
    _read(saved, layout, state, "state")
    for name, kind, (values, first) in leaves(layout, state, start):
        _check_numbers(name, kind, values, first)
    for words, holds in rules(state):
        if not holds:
            raise ValueError(f"state: {words}: it was changed after to_dict()")
    return state


def no_more_than(samples: Any, *counters: Any) -> Rule:
    """Rule for counters that are parts of another."""
    words = "its counters cannot add up to more than the samples or solves that there were"
    return words, sum(counters) <= samples


def _read(saved: Any, layout: Record, state: Any, path: str) -> None:
    """Write saved numbers into a state, if names and shapes are its own."""
    kept = by_name(layout, state)
    fields(path, saved, kept)
    for name in kept:
        field, value = layout.by_name[name], saved[name]
        if isinstance(field, Record):
            _read(value, field, state[name], f"{path}[{name!r}]")
        else:
            state[name] = _as_numbers(value, state[name].shape, f"{path}[{name!r}]")


def _as_numbers(value: Any, shape: tuple[int, ...], path: str) -> Any:
    """Floats of a shape, of nothing but numbers."""
    flat = [value]
    for _ in shape:
        flat = [each for inner in flat for each in (inner if isinstance(inner, list | tuple) else [None])]
    if not all(isinstance(each, float | int) for each in flat):
        raise ValueError(f"state: {path} must be made of numbers, of shape {shape}")
    try:
        array = np.array(value, dtype=np.float64)
    except (ValueError, OverflowError):
        raise ValueError(f"state: {path} must be made of float64 numbers, of shape {shape}") from None
    if array.shape != shape:
        raise ValueError(f"state: {path} must have shape {shape}, got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise ValueError(f"state: {path} must be finite")
    return array


def _check_numbers(name: str, kind: Kind, values: Any, start: Any) -> None:
    if kind.idle:
        return
    if kind.fixed:
        if not np.array_equal(values, start):
            raise ValueError(f"state: {name} must be as the arguments make it")
        return
    wrong = (values < kind.low) | (values > kind.high)
    if kind.whole:
        wrong |= values != np.floor(values)
    if np.any(wrong):
        number = "whole number" if kind.whole else "number"
        raise ValueError(
            f"state: {name} must be a {number} from {kind.low:g} to {kind.high:g}, "
            f"got {float(np.asarray(values)[wrong].flat[0]):g}"
        )
    if kind.square and not is_covariance(values, kind.definite):
        raise ValueError(f"state: {name} must be symmetric and positive, as a covariance is")


def is_covariance(P: FloatArray, definite: bool) -> bool:
    """Whether a matrix is a covariance but for rounding; `definite`: in all directions."""
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


def check_head(key: str, name: str, version: int, data: Any, needed: Iterable[str]) -> None:
    """Refuse a dictionary that is not of the class `name`, given at `key`, and this version's format."""
    instance("data", data, dict, "a dictionary that to_dict() gave")
    if key not in data:
        raise ValueError(f"data has no {key!r}: pass what {name}.to_dict() gave")
    if data[key] != name:
        raise ValueError(f"data is of a {data[key]!r}, not of a {name}")
    if data.get("format") != version:
        raise ValueError(f"data has format {data.get('format')!r}, this version reads {version}")
    fields("data", data, (key, "format", *needed))


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
