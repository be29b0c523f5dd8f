"""Checks of arguments: every message names the argument, what came, and what to do."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Beyond this, in V or µm, no stage goes: a sample that does is taken for missing.
WILDEST = 1e9

# Settings and parameters of estimators lie within this and its inverse: products of a few of them, and of
# their squares, are far from overflow.
MODERATE = 1e20


def finite(name: str, value: Any, kind: str = "a plain float") -> float:
    """Return `value` as a finite float."""
    if type(value) is float and math.isfinite(value):
        return value  # a live loop makes a model now and then
    try:
        if isinstance(value, (str, bytes)) or np.ndim(value) != 0:
            raise TypeError
        number = float(value)
    except OverflowError:
        raise ValueError(f"{name} must be a number of at most 1.8e308: check where it comes from") from None
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be one number, got {value!r}: pass {kind}") from None
    if not math.isfinite(number):
        raise ValueError(f"{name} must be finite, got {number}: check where it was computed")
    return number


def positive(name: str, value: Any) -> float:
    """Return `value` as a float above zero."""
    number = finite(name, value)
    if number <= 0.0:
        raise ValueError(f"{name} must be above zero, got {number:g}")
    return number


def non_negative(name: str, value: Any) -> float:
    """Return `value` as a float of zero or more."""
    number = finite(name, value)
    if number < 0.0:
        raise ValueError(f"{name} must be zero or more, got {number:g}")
    return number


def moderate(name: str, value: Any, *, or_zero: bool = False) -> float:
    """Return `value` as a float above zero, or zero, whose square is far from overflow and underflow."""
    number = non_negative(name, value) if or_zero else positive(name, value)
    if number != 0.0 and not 1.0 / MODERATE <= number <= MODERATE:
        raise ValueError(
            f"{name} must lie within [{1.0 / MODERATE:g}, {MODERATE:g}], got {number:g}: check its unit"
        )
    return number


def check_start(initial: Any) -> None:
    """Refuse an initial model with parameters that no stage has, in the units of this library."""
    for value in (*initial.theta.tolist(), initial.offset):
        if value != 0.0 and not 1.0 / MODERATE <= abs(value) <= MODERATE:
            raise ValueError(
                f"initial_model must have parameters within [{1.0 / MODERATE:g}, {MODERATE:g}] in size, "
                f"got {value:g} in {initial}: check its units"
            )


def fraction(name: str, value: Any, low: float = 0.0, high: float = 1.0) -> float:
    """Return `value` as a float within [low, high]."""
    number = finite(name, value)
    if not low <= number <= high:
        raise ValueError(f"{name} must lie within [{low:g}, {high:g}], got {number:g}")
    return number


def integer(name: str, value: Any, minimum: int = 0, maximum: int | None = None) -> int:
    """Return `value` as an int from `minimum` to `maximum`; 3.0 passes, 3.5 does not."""
    number = finite(name, value, "an int")
    if number != int(number) or number < minimum or (maximum is not None and number > maximum):
        bounds = f"of at least {minimum}" if maximum is None else f"from {minimum} to {maximum}"
        raise ValueError(f"{name} must be a whole number {bounds}, got {value!r}")
    return int(number)


def measured(name: str, value: Any) -> float:
    """Return a displacement, or a voltage, that can be."""
    return fraction(name, value, -0.5 * WILDEST, 0.5 * WILDEST)


def number_or_nan(value: Any) -> float:
    """Return what a driver gave as a float; NaN where it is not one real number, whatever else it is."""
    if isinstance(value, float):
        return float(value)
    if value is None:
        return math.nan
    try:
        if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim == 1):
            (value,) = value
        if isinstance(value, np.ndarray) and value is not np.ma.masked:
            value = value[()]  # of no dimensions; with more it stays an array
        if value is np.ma.masked or isinstance(value, (str, bytes, bytearray, np.ndarray)):
            return math.nan
        if isinstance(value, np.generic) and value.dtype.kind not in "biuf":
            return math.nan
        return float(value)
    except Exception:  # whatever a driver's own class does: a stream must not stop
        return math.nan


def as_floats(name: str, value: Any) -> FloatArray:
    """Return numbers of any shape as float64, masked ones as NaN."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    try:
        if isinstance(value, (list, tuple)) and any(item is np.ma.masked for item in value):
            value = [math.nan if item is np.ma.masked else item for item in value]
        array = np.asanyarray(value)
        if np.ma.isMaskedArray(array):
            array = np.ma.filled(array.astype(np.float64), np.nan)
        if array.dtype.kind not in "biufO":
            raise TypeError
        if array.dtype.kind == "O" and any(isinstance(item, (str, bytes)) for item in array.flat):
            raise TypeError
        return np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be numbers, got {_described(value)}") from None


def instance(name: str, value: Any, classes: Any, expected: str) -> Any:
    """Return `value` if it is of one of the classes; `expected` says what they are, and what to do."""
    if not isinstance(value, classes):
        what, _, hint = expected.partition(": ")
        got = f"the class {value.__name__}" if isinstance(value, type) else type(value).__name__
        raise ValueError(f"{name} must be {what}, got {got}{hint and f': {hint}'}")
    return value


def dictionary(value: Any) -> dict[str, Any]:
    """Return `value` if it is a dictionary, else an empty one: for what came from a file."""
    return value if isinstance(value, dict) else {}


def class_named(data: Any, key: str, classes: Iterable[Any]) -> Any:
    """Return the class whose name a dictionary has under `key`."""
    known = {cls.__name__: cls for cls in classes}
    name = data.get(key) if hasattr(data, "get") else data
    if str(name) not in known:
        raise ValueError(f"{key} {name!r} is unknown: choose one of {sorted(known)}")
    return known[str(name)]


def _described(value: Any) -> str:
    dtype = getattr(value, "dtype", None)
    return type(value).__name__ if dtype is None else f"{type(value).__name__} of {dtype}"


def fields(name: str, data: Any, needed: Iterable[str], optional: Iterable[str] = ()) -> dict[str, Any]:
    """Return a dictionary that came from outside, if it has the fields it needs and no others."""
    instance(name, data, dict, "a dictionary")
    needed = list(needed)
    if missing := [field for field in needed if field not in data]:
        raise ValueError(f"{name} has no {', '.join(map(repr, missing))}")
    known = {*needed, *optional}
    if unknown := [field for field in data if field not in known]:
        raise ValueError(f"{name} has unknown fields {unknown}: choose one of {sorted(known)}")
    return data


def rate_of(value: Any, stated: float | None) -> float | None:
    """Sample rate that was stated, else that of a `Signal`."""
    return getattr(value, "sample_rate", None) if stated is None else stated


def array_1d(
    name: str,
    value: Any,
    *,
    allow_nan: bool = False,
    minimum_length: int = 0,
    sample_rate: float | None = None,
) -> FloatArray:
    """Return `value` as a contiguous float64 array of shape (N,); a `Signal` of another rate is refused."""
    if (
        allow_nan
        and type(value) is np.ndarray
        and value.dtype == np.float64
        and value.ndim == 1
        and value.flags.c_contiguous
        and value.size >= minimum_length
    ):
        return value
    if value is None:
        raise ValueError(f"{name} must be an array, got None")
    own = rate_of(value, None)
    if own is not None and sample_rate is not None and own != sample_rate:
        raise ValueError(f"sample rates differ: {name} has {own:g} Hz, {sample_rate:g} Hz is expected")
    array = as_floats(name, value)
    if array.ndim != 1:
        hint = f"pass one column, as {name}[:, 0]"
        if array.ndim == 0:
            hint = "pass all samples as one array"
        elif array.size == max(array.shape):
            hint = f"pass {name}.ravel()"
        raise ValueError(f"{name} must have shape (N,), got {array.shape}: {hint}")
    if array.size < minimum_length:
        raise ValueError(f"{name} needs at least {minimum_length} samples, got {array.size}")
    if not allow_nan:
        bad = np.flatnonzero(~np.isfinite(array))
        if bad.size:
            raise ValueError(
                f"{name} holds {bad.size} values that are NaN or infinite (first at index {bad[0]}): "
                "remove or interpolate them first"
            )
    return np.ascontiguousarray(array)
