"""Opens a log of whatever format, by what it begins with."""

from __future__ import annotations

import importlib
import zipfile
from pathlib import Path

from piezoest.records.lines import PACKED, beginning
from piezoest.records.source import LogError, Source

# Name, what files begin with, endings of their names, and the function that opens them.
FORMATS: tuple[tuple[str, tuple[bytes, ...], tuple[str, ...], str], ...] = (
    ("Parquet", (b"PAR1",), (".parquet", ".pq"), "parquet:Parquet"),
    ("HDF5", (b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3"), (".h5", ".hdf5", ".hdf", ".he5"), "formats:open_hdf5"),
    ("MATLAB", (b"MATLAB 5.0",), (".mat",), "formats:open_mat"),
    ("NumPy", (b"\x93NUMPY",), (".npy",), "formats:open_npy"),
    ("TDMS", (b"TDSm",), (".tdms",), "formats:open_tdms"),
    (
        "spreadsheet",
        (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"),
        (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"),
        "frame:open_sheet",
    ),
    ("NumPy", (b"PK\x03\x04",), (".npz",), "formats:open_npz"),
    ("LabVIEW", (b"LabVIEW Measurement", b"\xef\xbb\xbfLabVIEW Measurement"), (), "lvm:Lvm"),
)
TEXT_ENDINGS = (".csv", ".txt", ".tsv", ".dat")
TEXT = "text:open_text"
# A file in the archive by which a spreadsheet is known.
OF_SPREADSHEETS = frozenset({"xl/workbook.xml", "xl/workbook.bin", "content.xml"})


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
    start = beginning(path, 128)
    ending = path.suffix.lower()
    if not start.strip():
        raise LogError(f"{path}: the file is empty")
    with path.open("rb") as file:
        packed = file.read(2) == PACKED
    for name, beginnings, endings, opener in FORMATS:
        begins = start.startswith(beginnings) and _is_what_it_may_be(path, opener)
        if begins and packed and name != "LabVIEW":
            raise LogError(f"{path}: a packed {name} file: unpack it first; only text is read packed")
        if begins:
            return _opened(opener, path)
        # Files of MATLAB before version 5 have no mark.
        if ending in endings and name != "MATLAB":
            raise LogError(
                f"{path}: this is no {name} file, although its name ends in {ending}: "
                "it may be truncated, or of another format under a wrong name"
            )
    return _opened("formats:open_mat" if ending == ".mat" else TEXT, path)


def _is_what_it_may_be(path: Path, opener: str) -> bool:
    """Whether an archive is a spreadsheet or NumPy's; true of all other formats."""
    if opener not in ("frame:open_sheet", "formats:open_npz"):
        return True
    names: frozenset[str] = frozenset()
    try:
        with zipfile.ZipFile(path) as archive:
            names = frozenset(archive.namelist())
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        pass
    if opener == "frame:open_sheet":
        return bool(names & OF_SPREADSHEETS) or path.suffix.lower() in (".xls", ".xlsx", ".xlsm", ".ods")
    return path.suffix.lower() not in TEXT_ENDINGS


def _opened(opener: str, path: Path) -> Source:
    """Source of a file; what a format needs is imported only now."""
    module, _, function = opener.partition(":")
    return getattr(importlib.import_module(f"piezoest.records.{module}"), function)(path)
