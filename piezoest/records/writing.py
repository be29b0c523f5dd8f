"""Columns into a file: CSV, Parquet, HDF5, MATLAB or NumPy, by the ending of its name."""

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from piezoest import _extras
from piezoest._checks import FloatArray, array_1d
from piezoest._files import replacing
from piezoest.records.opening import TEXT_ENDINGS
from piezoest.records.source import EXTRA

Columns = Mapping[str, FloatArray]


def write_columns(path: str | Path, columns: Mapping[str, Any], *, allow_nan: bool = True) -> None:
    """Write columns in the format that the ending of the file's name stands for.

    Parameters
    ----------
    path : str or Path
        File to write; an existing one is replaced. ``.csv``, ``.txt``, ``.dat``, ``.tsv`` and none are text
        with a header, to nine significant digits and time to twelve; ``.parquet``, ``.h5``, ``.mat`` (of
        version 5, which every MATLAB reads), ``.npy`` (named fields) and ``.npz`` hold every bit.
    columns : mapping of str to array_like, each of shape (N,)
        Names, which end in the unit, and values: ``time_s``, ``voltage_V``.
    allow_nan : bool
        Whether values may be NaN or infinite. A voltage for a stage may not.

    Raises
    ------
    OSError
        If the file cannot be written; one that was there is then as it was.
    ValueError
        If the columns differ in length, the ending stands for no format, or a value is not finite where it
        must be.
    ImportError
        If writing the format needs a package of the extra ``formats`` that is not installed.

    Examples
    --------
    >>> from pathlib import Path
    >>> import piezoest as pz
    >>> pz.records.write_columns("voltage.csv", {"time_s": [0.0, 0.001], "voltage_V": [0.0, 1.5]})
    >>> print(Path("voltage.csv").read_text().strip())
    time_s,voltage_V
    0,0
    0.001,1.5
    """
    writer = writer_for(path)
    arrays = {name: array_1d(name, values, allow_nan=True) for name, values in columns.items()}
    if len({array.size for array in arrays.values()}) > 1:
        raise ValueError(f"columns must be of one length, got {[array.size for array in arrays.values()]}")
    for name, array in () if allow_nan else arrays.items():
        bad = np.flatnonzero(~np.isfinite(array))
        if bad.size:
            raise ValueError(
                f"{path} is not written: {name} has {bad.size} values of {array.size} that are no finite "
                f"numbers, the first in row {bad[0] + 1}: check the model and the reference"
            )
    with replacing(path) as temporary:
        writer(temporary, arrays)


def writer_for(path: str | Path) -> Callable[[Path, Columns], None]:
    """Function that writes a file of this name; the package that it needs is loaded.

    Parameters
    ----------
    path : str or Path
        File to write.

    Raises
    ------
    ValueError
        If its ending stands for no format.
    ImportError
        If the format needs a package that is not installed.
    """
    ending = Path(path).suffix.lower() or ".csv"  # none: such as /dev/stdout
    for endings, writer, package in WRITERS:
        if ending in endings:
            if package:
                _extras.load(package, EXTRA, f"writing {ending}")
            return writer
    known = ", ".join(each for endings, *_ in WRITERS for each in endings)
    raise ValueError(
        f"{path}: the ending of its name stands for no format that is written: use one of {known}"
    )


def _write_text(path: Path, columns: Columns) -> None:
    delimiter = "\t" if path.suffix.lower() == ".tsv" else ","
    digits = ["%.12g" if name.startswith("time") else "%.9g" for name in columns]
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(delimiter.join(columns) + "\n")
        np.savetxt(file, np.column_stack(list(columns.values())), digits, delimiter)


def _write_parquet(path: Path, columns: Columns) -> None:
    import pyarrow.parquet

    pyarrow.parquet.write_table(pyarrow.table(dict(columns)), path)


def _write_hdf5(path: Path, columns: Columns) -> None:
    import h5py

    # In memory, for the library does not recover from a disk that is full.
    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        for name, values in columns.items():
            file[name] = values
    # A copy: where the disk is full a view of the image outlives it.
    path.write_bytes(image.getvalue())


def _write_mat(path: Path, columns: Columns) -> None:
    from scipy.io import savemat

    # Without appendmat=False it would be log.MAT.mat.
    savemat(path, dict(columns), appendmat=False, oned_as="column")


def _write_npy(path: Path, columns: Columns) -> None:
    with path.open("wb") as file:  # a name in capitals NumPy would lengthen
        np.save(
            file, np.rec.fromarrays(list(columns.values()), dtype=[(name, np.float64) for name in columns])
        )


def _write_npz(path: Path, columns: Columns) -> None:
    arrays: dict[str, Any] = dict(columns)
    with path.open("wb") as file:
        np.savez(file, **arrays)


# Endings, the function, and the package of an extra that it needs.
WRITERS: tuple[tuple[tuple[str, ...], Callable[[Path, Columns], None], str], ...] = (
    ((".parquet", ".pq"), _write_parquet, "pyarrow.parquet"),
    ((".h5", ".hdf5", ".hdf", ".he5"), _write_hdf5, "h5py"),
    ((".mat",), _write_mat, ""),
    ((".npy",), _write_npy, ""),
    ((".npz",), _write_npz, ""),
    (TEXT_ENDINGS, _write_text, ""),
)
