"""Opens a log of whatever format, by what it begins with."""

import importlib
import zipfile
from pathlib import Path

from piezoest.records.lines import beginning, encoding_of, unpacking
from piezoest.records.source import LogError, Source

OF_SHEETS = "frame:open_sheet"
TEXT_ENDINGS = (".csv", ".txt", ".tsv", ".dat")
SHEET_ENDINGS = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")
ARCHIVE = b"PK\x03\x04"
HDF5, BLOCKS = b"\x89HDF\r\n\x1a\n", (0, 512, 1024, 2048)
# Name, what files begin with, endings of their names, and what opens them.
FORMATS: tuple[tuple[str, tuple[bytes, ...], tuple[str, ...], str], ...] = (
    ("Parquet", (b"PAR1",), (".parquet", ".pq"), "parquet:Parquet"),
    ("HDF5", (HDF5, b"MATLAB 7.3"), (".h5", ".hdf5", ".hdf", ".he5"), "hdf5:open_hdf5"),
    ("MATLAB", (b"MATLAB 5.0",), (), "formats:open_mat"),
    ("NumPy", (b"\x93NUMPY",), (".npy",), "formats:open_npy"),
    ("TDMS", (b"TDSm",), (".tdms",), "formats:Tdms"),
    ("spreadsheet", (ARCHIVE, b"\xd0\xcf\x11\xe0"), SHEET_ENDINGS, OF_SHEETS),
    ("NumPy", (ARCHIVE,), (".npz",), "formats:open_npz"),
    ("LabVIEW", (b"LabVIEW Measurement", b"\xef\xbb\xbfLabVIEW Measurement"), (), "lvm:Lvm"),
    ("MATLAB", (), (".mat",), "formats:open_mat"),  # before version 5 it has no mark
)
# A file in the archive by which a spreadsheet is known.
OF_SPREADSHEETS = {"xl/workbook.xml", "xl/workbook.bin", "content.xml"}


def open_source(path: Path) -> Source:
    """Open a log by what it begins with, or else by the ending of its name."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise LogError(f"{path}: a log is read more than once, a pipe is not: save it as a file first")
    start, ending = _signature(path), path.suffix.lower()
    if not start.strip():
        raise LogError(f"{path}: the file is empty")
    with path.open("rb") as file:
        packed = unpacking(file.read(6)) is not None
    opener = "text:open_text"
    for name, beginnings, endings, function in FORMATS:
        if start.startswith(beginnings) and not (start.startswith(ARCHIVE) and _is_other(path, name)):
            if packed and name != "LabVIEW":
                raise LogError(f"{path}: a packed {name} file: unpack it first; only text is read packed")
            opener = function
            break
        if ending in endings and not beginnings:
            opener = function
        elif ending in endings and not (function == OF_SHEETS and _is_text(path)):
            raise LogError(
                f"{path}: this is no {name} file, although its name ends in {ending}: "
                "it may be truncated, or of another format under a wrong name"
            )
    # What a format needs is imported only now.
    module, _, function = opener.partition(":")
    return getattr(importlib.import_module(f"piezoest.records.{module}"), function)(path)


def _signature(path: Path) -> bytes:
    """First bytes of a file; of HDF5 those behind a block of the user, which Julia writes."""
    begun = beginning(path, max(BLOCKS) + len(HDF5))
    return next((HDF5 for place in BLOCKS if begun[place:].startswith(HDF5)), begun[:128])


def _is_text(path: Path) -> bool:
    """Whether a file is a text, which instruments often give the name of a spreadsheet."""
    try:
        encoding_of(path)
    except LogError:
        return False
    return True


def _is_other(path: Path, name: str) -> bool:
    """Whether an archive is not of the format."""
    ending = path.suffix.lower()
    if name != "spreadsheet":
        return ending in TEXT_ENDINGS
    try:
        with zipfile.ZipFile(path) as archive:
            return ending not in SHEET_ENDINGS and OF_SPREADSHEETS.isdisjoint(archive.namelist())
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return ending not in SHEET_ENDINGS
