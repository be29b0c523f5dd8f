"""What compiled code keeps between samples, by name: NumPy structured arrays of float64.

A layout is written once, with `record`, and says of each number what it can be:

>>> from piezoest.layout import COUNT, NUMBER, Length, new, numbers, record
>>> LAW = record(updates=COUNT, theta=numbers(3), P=numbers(3, 3))
>>> STATE = record(u_last=NUMBER, law=LAW)
>>> state = new(STATE, law={"theta": [1.0, 2.0, 3.0]})
>>> state["law"]["theta"]
array([1., 2., 3.])

Compiled code reads the same numbers as ``state.law.theta[i]`` (see `piezoest.compile`), a saved file and
exported C have the same names. A field that is `ABSENT` takes no room, and is None in compiled code: whatever
is done for it is not compiled. An array whose size users choose has a `Length`: machine code does not depend
on its value, which stands in the record as a field of that name.

A record can name the module that its functions are in: ``state.inverse.wanted(state, settings, r)`` calls the
function ``wanted`` of that module, which is how one loop serves models that know nothing of each other.
"""

from __future__ import annotations

import copy
import functools
import importlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self, cast

import numpy as np

from piezoest._checks import WILDEST

# No number that an estimator comes by is beyond the first, and no count beyond the second: six centuries at
# 50 kHz.
LARGEST, MOST = 1e60, 2.0**50


class Kind(NamedTuple):
    """What numbers can be."""

    low: float = -LARGEST  # least value
    high: float = LARGEST  # largest value
    whole: bool = False  # whole numbers only
    square: bool = False  # a symmetric matrix without a variance below zero
    definite: bool = False  # no direction with a variance below zero either, but for rounding
    fixed: bool = False  # as construction leaves them
    idle: bool = False  # work space: written before it is read, and neither saved nor loaded


def whole(low: float, high: float) -> Kind:
    """Whole numbers from `low` to `high`: codes and positions."""
    return Kind(low, high, whole=True)


NUMBER, AMOUNT, SHARE = Kind(), Kind(0.0), Kind(0.0, 1.0)
COUNT, FLAG, SIGN = whole(0.0, MOST), whole(0.0, 1.0), whole(-1.0, 1.0)
COVARIANCE, SYMMETRIC = Kind(square=True, definite=True), Kind(square=True)
FIXED, WORK = Kind(fixed=True), Kind(idle=True)
# Voltages [V] and displacements [µm], also less a centre; what comes in is below WILDEST.
MEASURED, DISTANCE = Kind(-1e3 * WILDEST, 1e3 * WILDEST), Kind(0.0, 1e3 * WILDEST)
# Parameters, most of them relative to their start.
PARAMETER = Kind(-1e20, 1e20)


@dataclass(frozen=True)
class Length:
    """A size that users choose: `count` numbers, in the field `name` of the record that has such arrays."""

    name: str
    count: int


@dataclass(frozen=True)
class Numbers:
    """An array of numbers within a record."""

    shape: tuple[int | Length, ...]
    kind: Kind = NUMBER

    @property
    def counts(self) -> tuple[int, ...]:
        """Shape in numbers."""
        return tuple(size.count if isinstance(size, Length) else size for size in self.shape)

    @property
    def lengths(self) -> tuple[Length, ...]:
        """Sizes that are not known at compile time."""
        return tuple(size for size in self.shape if isinstance(size, Length))


@dataclass(frozen=True)
class Record:
    """Fields with names: single numbers, arrays of them, and records; `functions` is the name of a module."""

    fields: tuple[tuple[str, Kind | Numbers | Record], ...]
    functions: str = ""

    @functools.cached_property
    def dtype(self) -> np.dtype[Any]:
        """Of a NumPy structured array with these fields."""
        return np.dtype([_of_numpy(name, field) for name, field in self.fields])

    @functools.cached_property
    def by_name(self) -> dict[str, Kind | Numbers | Record]:
        """Fields by their names."""
        return dict(self.fields)

    @functools.cached_property
    def lengths(self) -> dict[str, int]:
        """Sizes that stand in fields of this record."""
        arrays = [field for _, field in self.fields if isinstance(field, Numbers)]
        return {length.name: length.count for array in arrays for length in array.lengths}

    @functools.cached_property
    def is_fixed(self) -> bool:
        """Whether all sizes are known at compile time."""
        inner = [field for _, field in self.fields if isinstance(field, Record)]
        return not self.lengths and all(field.is_fixed for field in inner)

    def __hash__(self) -> int:
        return self._hash

    def __reduce__(self) -> Any:
        # Without what is cached: hashes of names are another process's own.
        return Record, (self.fields, self.functions)

    def __deepcopy__(self, memo: Any) -> Record:
        return self

    @functools.cached_property
    def _hash(self) -> int:
        return hash((self.fields, self.functions))


Field = Kind | Numbers | Record
ABSENT = Numbers((0,))


def function_of(module: str, name: str) -> Any:
    """A record's function of this name; None if it has none."""
    return getattr(importlib.import_module(module), name, None) if module else None


def _of_numpy(name: str, field: Field) -> Any:
    if isinstance(field, Record):
        return (name, field.dtype)
    return (name, np.float64, field.counts) if isinstance(field, Numbers) else (name, np.float64)


def numbers(*shape: int | Length, kind: Kind = NUMBER) -> Numbers:
    """Array of numbers of a shape."""
    return Numbers(shape, kind)


def record(functions: str = "", /, **fields: Field) -> Record:
    """Layout with these fields; those whose size compiled code does not know stand last.

    The lengths of its arrays become fields of their own, at its beginning. `functions` is the name of the
    module that its functions are in, if it has any.

    ValueError if a length has the name of a field.
    """
    return _record(functions, tuple(fields.items()))


@functools.lru_cache(maxsize=4096)
def _record(functions: str, items: tuple[tuple[str, Field], ...]) -> Record:
    fields = dict(items)
    lengths = Record(items).lengths
    counts = {n for _, field in items if isinstance(field, Numbers) for n in field.lengths}
    if len(counts) > len(lengths):
        raise ValueError(f"a length has two counts: {sorted((n.name, n.count) for n in counts)}")
    if both := lengths.keys() & fields.keys():
        raise ValueError(f"{sorted(both)} are names of fields and of lengths: choose others")
    known = {name: field for name, field in fields.items() if _is_known(field)}
    unknown = {name: field for name, field in fields.items() if name not in known}
    return Record(tuple({**dict.fromkeys(lengths, FIXED), **known, **unknown}.items()), functions)


def _is_known(field: Field) -> bool:
    if isinstance(field, Numbers):
        return not field.lengths
    return not isinstance(field, Record) or field.is_fixed


def new(layout: Record, **values: Any) -> Any:
    """Structured array of a layout, of shape (): zeros but for `values`; records take dictionaries."""
    array = np.zeros((), layout.dtype)
    _fill_lengths(array, layout)
    fill(array, layout, values)
    return array


def fill(array: Any, layout: Record, values: dict[str, Any]) -> None:
    """Write values into the fields of a structured array."""
    for name, value in values.items():
        field = layout.by_name[name]
        if isinstance(field, Record) and isinstance(value, dict):
            fill(array[name], field, value)
        elif field != ABSENT:
            array[name] = value


def write(target: Any, source: Any) -> None:
    """Write one structured array of shape () over another of its layout, faster than field by field."""
    target.reshape(1).view(np.float64)[:] = source.reshape(1).view(np.float64)


def from_bytes(layout: Record, data: bytes) -> Any:
    """Structured array of shape () from what its ``tobytes()`` gave."""
    return np.frombuffer(bytearray(data), layout.dtype).reshape(())


def _fill_lengths(array: Any, layout: Record) -> None:
    for name, count in layout.lengths.items():
        array[name] = count
    for name, field in layout.fields:
        if isinstance(field, Record):
            _fill_lengths(array[name], field)


def leaves(layout: Record, *arrays: Any, path: str = "") -> Iterator[tuple[str, Kind, list[Any]]]:
    """(name with its path, kind, its numbers in each of `arrays`) of all that a layout holds."""
    for name, field in layout.fields:
        parts = [array[name] for array in arrays]
        if isinstance(field, Record):
            yield from leaves(field, *parts, path=f"{path}{name}.")
        elif field != ABSENT:
            yield f"{path}{name}", field.kind if isinstance(field, Numbers) else field, parts


def by_name(layout: Record, array: Any) -> dict[str, Any]:
    """Numbers of a structured array by name, JSON-safe, without its work space."""
    found: dict[str, Any] = {}
    for name, field in layout.fields:
        if isinstance(field, Record):
            found[name] = by_name(field, array[name])
        elif field != ABSENT and not (field.kind if isinstance(field, Numbers) else field).idle:
            found[name] = array[name].tolist()
    return found


class Named:
    """The fields of a structured array as attributes: compiled functions, called as plain Python, see it.

    Without its layout it knows of no functions, and takes an array of no numbers for one that is absent.
    """

    __slots__ = ("_array", "_layout")

    def __init__(self, array: Any, layout: Record | None = None) -> None:
        object.__setattr__(self, "_array", array)
        object.__setattr__(self, "_layout", layout)

    def __getattr__(self, name: str) -> Any:
        layout = self._layout
        field = layout.by_name.get(name) if layout else None
        if layout and field is None and (function := function_of(layout.functions, name)) is not None:
            return function
        value = self._array[name]
        if value.dtype.names is not None:
            return Named(value, field if isinstance(field, Record) else None)
        if field == ABSENT or (layout is None and value.shape == (0,)):
            return None
        return value if value.ndim else float(value)

    def __setattr__(self, name: str, value: float) -> None:
        self._array[name] = value

    def __getitem__(self, i: int) -> Named:
        return Named(self._array[i], self._layout)


class Copied:
    """What has a state of its own, which its copies do not share."""

    __slots__ = ()

    #: Attributes with machine code. It is neither copied nor pickled: None there means "look it up again".
    _machine_code: ClassVar[tuple[str, ...]] = ()

    def __getstate__(self) -> Any:
        kept, slots = cast(Any, super().__getstate__())
        return kept, {**slots, **dict.fromkeys(self._machine_code)}

    def copy(self) -> Self:
        """Return an independent one in the same state."""
        return copy.deepcopy(self)

    def __copy__(self) -> Self:
        return self.copy()
