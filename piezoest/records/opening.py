"""Opens a log of whatever format, by what it begins with."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from piezoest.records.source import Source

FORMATS: tuple[tuple[str, tuple[bytes, ...], tuple[str, ...]], ...] = (
    ("parquet", (b"PAR1",), (".parquet", ".pq")),
    ("hdf5", (b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3"), (".h5", ".hdf5", ".hdf", ".he5")),
    ("mat", (b"MATLAB 5.0",), (".mat",)),
    ("npy", (b"\x93NUMPY",), (".npy",)),
    ("npz", (b"PK\x03\x04",), (".npz",)),
)
NAMES_OF_FORMATS = {"parquet": "Parquet", "hdf5": "HDF5", "npy": "NumPy", "npz": "NumPy"}
TEXT_ENDINGS = (".csv", ".txt", ".tsv", ".dat")


def open_source(path: Path) -> Source:
    """Open a log by what it begins with, or else by the ending of its name.

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        If it is empty, or not of the format that its name promises.
    MissingExtraError
        If its format needs a package that is not installed.
    """
    with path.open("rb") as file:
        start = file.read(128)
    ending = path.suffix.lower()
    if not start.strip():
        raise ValueError(f"{path}: the file is empty")
    for format_, beginnings, endings in FORMATS:
        begins = start.startswith(beginnings)
        if begins and (format_ != "npz" or ending not in TEXT_ENDINGS):
            return _opener(format_)(path)
        # Files of MATLAB before version 5 have no mark.
        if ending in endings and not begins and format_ != "mat":
            raise ValueError(
                f"{path}: this is no {NAMES_OF_FORMATS[format_]} file, although its name ends in {ending}: "
                "it may be truncated, or of another format under a wrong name"
            )
    return _opener("mat" if ending == ".mat" else "text")(path)


def _opener(format_: str) -> Callable[[Path], Source]:
    """Function that opens a format; each pulls in what it needs only when it is called."""
    if format_ == "text":
        from piezoest.records.text import open_text

        return open_text
    from piezoest.records import binary, hdf5

    return {
        "parquet": binary.open_parquet,
        "hdf5": hdf5.open_hdf5,
        "mat": binary.open_mat,
        "npy": binary.open_npy,
        "npz": binary.open_npz,
    }[format_]
