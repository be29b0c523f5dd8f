"""HDF5 files, and those of MATLAB 7.3: each array a column, or several, by its path."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from piezoest import _extras
from piezoest.records.beside import MOST_WORDS, NAMES, UNITS, stated, texts_of, unit_of, words_of
from piezoest.records.rates import DECIMATED, PERIODS, RATES
from piezoest.records.source import EXTRA, LogError, check_size, damaged, finite, shown
from piezoest.records.table import Named, Table, columns_of

PACKING = (("scale_factor", 1.0), ("add_offset", 0.0))
FILLED = ("_FillValue", "missing_value")
# Attributes that may say how whole numbers are to be scaled, each in another way.
SCALED = {"scale", "gain", "factor", "slope", "resolution", "lsb", "calibration"}
ONE_FILE = "save all columns in one file, for no other is opened"
TEXT = (b"char", "char")  # MATLAB's class of text, which is an array of numbers


def open_hdf5(path: Path) -> Table:
    """Open an HDF5 file: each array a column, or several, by its path; fields of compound types too."""
    h5py = _extras.load("h5py", EXTRA, "reading HDF5 and MATLAB 7.3")
    # They are looked for once: the arrays are listed again for each reading.
    with damaged(path, "HDF5"), h5py.File(path, "r") as file:
        words = _words(h5py, file)
    return Table(
        path,
        "HDF5",
        lambda: h5py.File(path, "r"),
        lambda file: _in_hdf5(h5py, path, file, words),
        texts=lambda file: [*((name, ", ".join(each)) for name, each in words.items()), *_attributes(file)],
        separator="/",
    )


def _in_hdf5(h5py: Any, path: Path, file: Any, words: dict[str, list[str]]) -> list[Named]:
    """Columns and rates. `words`: what `_words` finds."""
    found = _rates("", file.attrs)
    # A link is followed by nobody here, but a column that is not found for it would be a riddle.
    if outside := file.visititems_links(
        lambda name, link: name if isinstance(link, h5py.ExternalLink) else None
    ):
        raise LogError(f"{path}: {shown(outside)} lies in another file: {ONE_FILE}")

    def visit(name: str, item: Any) -> None:
        # MATLAB keeps what cells and objects refer to in these.
        if _is_hidden(name):
            return
        found.extend(_rates(f"{name}/", item.attrs))
        # A group has no shape, and an array may have none either.
        if getattr(item, "shape", None) is None:
            return
        others = [entry[0] for entry in item.external or ()]
        if item.is_virtual:
            others = [source.file_name for source in item.virtual_sources() if source.file_name != "."]
        if others:
            raise LogError(f"{path}: {shown(name)} lies in another file, {shown(others[0])}: {ONE_FILE}")
        check_size(path, int(item.nbytes))
        units = stated(item.attrs, *UNITS) or words.get(f"{name}_unit") or words.get(f"{name}_units") or []
        if item.dtype.names:
            known = dict(zip(item.dtype.names, units, strict=False))
            fields = [field for field in item.dtype.names if item.dtype[field].kind in "fiu"]
            found.extend((f"{name}/{field}", item.fields(field), known.get(field, "")) for field in fields)
        elif item.dtype.kind in "fiu" and item.attrs.get("MATLAB_class") not in TEXT:
            above = name.rpartition("/")[0]
            beside = [words.get(f"{above}/{key}".lstrip("/"), []) for key in NAMES]
            attributes = [stated(each.attrs, *NAMES) for each in (item, item.parent)]
            names = next(filter(None, (*attributes, *beside)), [])
            found.extend(_columns_of(name, _unpacked(item), names, _counts(item) or units))

    file.visititems(visit)
    return found


def _is_hidden(name: str) -> bool:
    return name.startswith(("#refs#", "#subsystem#"))


def _rates(above: str, attributes: Any) -> list[Named]:
    """Attributes that state a sample rate or a period, or how many samples were left out."""
    found = [
        (name, value)
        for name, value in attributes.items()
        if name.lower() in (*RATES, *PERIODS) or DECIMATED.match(f"{name} 0")
    ]
    return [
        (
            above + name,
            np.asarray(value),
            unit_of(attributes, *(f"{name}_{end}".lower() for end in ("unit", "units"))),
        )
        for name, value in found
        if np.size(value) == 1
    ]


def _attributes(file: Any) -> list[tuple[str, str]]:
    """All attributes of all that is in a file which are text."""
    found = texts_of(file.attrs)
    file.visititems(lambda name, item: found.extend(texts_of(item.attrs, f"{name}/")))
    return found


def _words(h5py: Any, file: Any) -> dict[str, list[str]]:
    """Words in arrays of text, in MATLAB's text and in its cells of text, by the path of the array."""
    found: dict[str, list[str]] = {}

    def words_in(item: Any) -> list[str]:
        if getattr(item, "shape", None) is None or item.size > MOST_WORDS:
            return []
        if item.attrs.get("MATLAB_class") in TEXT:
            return ["".join(chr(int(sign)) for sign in np.ravel(item[()]))]
        if h5py.check_ref_dtype(item.dtype):
            return [word for each in np.ravel(item[()]) if each for word in words_in(file[each])]
        if h5py.check_string_dtype(item.dtype):
            return words_of(np.asarray(item.asstr()[()], dtype=str))
        return []

    def visit(name: str, item: Any) -> None:
        if not _is_hidden(name) and (known := words_in(item)):
            found[name] = known

    file.visititems(visit)
    return found


def _columns_of(name: str, values: Any, names: list[str], units: list[str]) -> list[Named]:
    """A dataset, or its columns where a name or a unit is known for each of them."""
    columns = [each for _, each, _ in columns_of([(name, values, "")])]
    if len(columns) > 1 and len(columns) in (len(names), len(units)):
        names = names if len(names) == len(columns) else [f"{name}:{k}" for k in range(1, len(columns) + 1)]
        units = units if len(units) == len(columns) else [""] * len(columns)
        return list(zip(names, columns, units, strict=True))
    return [(name, values, units[0] if len(units) == 1 else "")]


def _counts(item: Any) -> list[str]:
    """Unit of whole numbers that an attribute may scale in a way which is not known here."""
    scaled = item.dtype.kind in "iu" and not SCALED.isdisjoint(map(str.lower, item.attrs))
    return ["counts"] if scaled else []


class _Packed(NamedTuple):
    """Numbers that a file holds as others, as netCDF does: number = factor stored + offset."""

    stored: Any
    factor: Any
    offset: Any
    fill: Any  # what stands for no number

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(self.stored.shape)

    def __getitem__(self, part: Any) -> Any:
        stored = self.stored[part]
        return finite(np.where(np.isin(stored, self.fill), np.nan, stored * self.factor + self.offset))


def _unpacked(item: Any) -> Any:
    """The dataset, with what its attributes say of how its numbers are stored."""
    factor, offset = (item.attrs.get(key, usual) for key, usual in PACKING)
    fill = np.ravel([each for key in FILLED for each in np.ravel(item.attrs.get(key, []))])
    plain = (factor, offset) == (1.0, 0.0) and not np.isfinite(fill.astype(np.float64)).any()
    return item if plain else _Packed(item, factor, offset, fill)
