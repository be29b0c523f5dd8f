"""Names and units that stand beside arrays: in other arrays, or in attributes."""

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from piezoest.records.titles import quantity_of_unit, with_u

# Names of attributes and arrays with a word for each column of a matrix.
NAMES = ("columns", "column_names", "colheaders", "names", "channels", "labels", "header", "variablenames")
UNITS = ("unit", "units", "column_units")
# Longer lists are no names of columns.
MOST_WORDS = 1000
# Names of texts that may state a unit.
OF_UNITS = re.compile("unit|label|long_?name|description|dimension", re.IGNORECASE)
# Words of such a text, but for those of µm/V.
WORD = re.compile(r"(?<![/^\w])[^\W\d_]+(?![/^\w])")


def words_of(value: Any) -> list[str]:
    """Words of an array of text, or of an array that holds such arrays, as MATLAB's cells; else none."""
    array = np.asarray(value)
    if array.dtype.kind == "O":
        words = [words_of(each) for each in array.ravel() if not np.asarray(each).dtype.hasobject]
        return [word for each in words if len(each) == 1 for word in each]
    return parted([_text(each).strip() for each in array.ravel()] if array.dtype.kind in "US" else [])


def parted(words: list[str]) -> list[str]:
    """Words, which may stand in one text with marks between them."""
    return [word.strip() for word in re.split(r"[,;\t]", words[0])] if len(words) == 1 else words


def units_beside(texts: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Units in texts that stand beside columns under such names, in lower case, each with its text."""
    return {
        word.lower(): f"{name}: {text}"
        for name, text in texts
        if OF_UNITS.search(name)
        for word in WORD.findall(with_u(text))
        if quantity_of_unit(word)
    }


def with_names(arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    """Columns of the only matrix by their names, if an array beside it has a word for each."""
    matrices = [name for name, value in arrays.items() if np.ndim(value) == 2 and 1 not in np.shape(value)]
    matrices = [name for name in matrices if np.asarray(arrays[name]).dtype.kind in "fiu"]
    if len(matrices) != 1:
        return arrays
    matrix = np.asarray(arrays[matrices[0]])
    columns = matrix.T if matrix.shape[0] > matrix.shape[1] else matrix
    lists = {tuple(words) for words in map(words_of, arrays.values()) if len(words) == len(columns)}
    units = {words for words in lists if all(quantity_of_unit(word) is not None for word in words)}
    names = {words for words in lists - units if len(set(words)) == len(words)}
    names = names or {tuple(f"{matrices[0]}:{k}" for k in range(1, len(columns) + 1))}
    if len(names) != 1 or len(units) > 1 or not lists:
        return arrays
    rest = {name: value for name, value in arrays.items() if name != matrices[0]}
    named = dict(zip(names.pop(), columns, strict=True))
    of = {f"{name}_unit": np.asarray(unit) for each in units for name, unit in zip(named, each, strict=True)}
    return {**rest, **named, **of}


def stated(attributes: Any, *keys: str) -> list[str]:
    """Words that attributes state under one of the names, in lower case; none if none does."""
    known = {key.lower(): value for key, value in attributes.items()}
    found = (np.asarray(known[key]).ravel() for key in keys if key in known)
    words = (parted([_text(each) for each in values]) for values in found)
    return next((each for each in words if any(each)), [])


def unit_of(attributes: Any, *keys: str) -> str:
    """Unit that attributes state under one of the names; empty if none does, or several units."""
    words = stated(attributes, *keys)
    return words[0] if len(words) == 1 else ""


def _text(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def texts_of(attributes: Any, above: str = "") -> list[tuple[str, str]]:
    """Names and texts of the attributes that are text."""
    values = ((name, np.asarray(value)) for name, value in attributes.items())
    return [
        (above + name, ", ".join(map(_text, value.ravel())))
        for name, value in values
        if value.dtype.kind in "USO" and value.size <= MOST_WORDS
    ]
