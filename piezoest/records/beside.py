"""Names and units that stand beside arrays: in other arrays, or in attributes."""

from collections.abc import Mapping
from typing import Any

import numpy as np

# Names of attributes and arrays with a word for each column of a matrix.
NAMES, UNITS = ("columns", "column_names", "colheaders", "names", "channels"), ("unit", "units")


def words_of(value: Any) -> list[str]:
    """Words of an array of text, or of an array that holds such arrays, as MATLAB's cells; else none."""
    array = np.asarray(value)
    if array.dtype.kind == "O":
        words = [words_of(each) for each in array.ravel() if not np.asarray(each).dtype.hasobject]
        return [word for each in words if len(each) == 1 for word in each]
    return [str(each).strip() for each in array.ravel()] if array.dtype.kind in "U" else []


def with_names(arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    """Columns of the only matrix by their names, if an array beside it has a word for each."""
    matrices = [name for name, value in arrays.items() if np.ndim(value) == 2 and 1 not in np.shape(value)]
    matrices = [name for name in matrices if np.asarray(arrays[name]).dtype.kind in "fiu"]
    if len(matrices) != 1:
        return arrays
    matrix = np.asarray(arrays[matrices[0]])
    columns = matrix.T if matrix.shape[0] > matrix.shape[1] else matrix
    lists = {tuple(words) for words in map(words_of, arrays.values()) if len(set(words)) == len(columns)}
    if len(lists) != 1:
        return arrays
    rest = {name: value for name, value in arrays.items() if name != matrices[0]}
    return {**rest, **dict(zip(lists.pop(), columns, strict=True))}


def stated(attributes: Any, *keys: str) -> list[str]:
    """Words that attributes state under one of the names, in lower case; none if none does."""
    known = {key.lower(): value for key, value in attributes.items()}
    found = (np.asarray(known[key]).ravel() for key in keys if key in known)
    words = ([_text(each) for each in values] for values in found)
    return next((each for each in words if any(each)), [])


def unit_of(attributes: Any, *keys: str) -> str:
    """Unit that attributes state under one of the names; empty if none does, or several units."""
    words = stated(attributes, *keys)
    return words[0] if len(words) == 1 else ""


def _text(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
