"""A record of whatever holds one."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from piezoest.records.frame import is_frame
from piezoest.records.record import Record, read_record

TAKEN = "pass a Record, the path of a file or a DataFrame of pandas or Polars"
ARRAYS = "or two arrays: voltage, displacement, sample_rate=..."


def as_record(
    data: Any,
    displacement: Any = None,
    *,
    sample_rate: float | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> Record:
    """Make a record of a file, a table or arrays.

    Parameters
    ----------
    data : Record, str, Path, DataFrame or array_like of shape (N,)
        A record, which is returned as it is; a file, as for `read_record`; a table, as for
        `Record.from_frame`; or the voltage [V].
    displacement : array_like, shape (N,), optional
        With an array for `data` only: the displacement [µm].
    sample_rate : float, optional
        [Hz]; must be given with arrays.
    columns, units : mapping of str to str, optional
        With a file or a table only, as for `read_record`.

    Returns
    -------
    Record
        In s, V and µm.

    Raises
    ------
    OSError
        If a file cannot be read.
    ValueError
        If `data` is nothing of these, an argument does not go with it, or as `read_record`.

    Examples
    --------
    >>> import piezoest as pz
    >>> pz.records.as_record([0.0, 1.0, 2.0], [0.0, 0.1, 0.2], sample_rate=100.0).duration
    0.03
    """
    given = {"displacement": displacement, "sample_rate": sample_rate, "columns": columns, "units": units}
    if isinstance(data, Record):
        _refuse(given, tuple(given), "a Record has its own")
        return data
    if isinstance(data, str | Path):
        _refuse(given, ("displacement",), "a file has its own, named by columns")
        return read_record(data, columns=columns, units=units, sample_rate=sample_rate)
    if is_frame(data) or hasattr(data, "collect"):
        _refuse(given, ("displacement",), "a DataFrame has its own, named by columns")
        return Record.from_frame(data, columns=columns, units=units, sample_rate=sample_rate)
    if displacement is None:
        shape = getattr(data, "shape", None)
        got = type(data).__name__ if shape is None else f"one array of shape {tuple(shape)}"
        raise ValueError(f"data must be a log, got {got} and no displacement: {TAKEN}, {ARRAYS}")
    _refuse(given, ("columns", "units"), "arrays are voltage in V and displacement in µm")
    if sample_rate is None:
        raise ValueError("sample_rate must be given with two arrays, in Hz: sample_rate=10000.0")
    return Record.from_arrays(data, displacement, sample_rate)


def one_log(name: str, log: Any) -> Record:
    """Make a record of an argument that is a whole log: no arrays."""
    if not (isinstance(log, Record | str | Path) or is_frame(log) or hasattr(log, "collect")):
        got = type(log).__name__
        raise ValueError(f"{name} must be a log, got {got}: {TAKEN}; make one by Record.from_arrays")
    return as_record(log)


def _refuse(given: Mapping[str, Any], names: tuple[str, ...], why: str) -> None:
    for name in names:
        if given[name] is not None:
            raise ValueError(f"{name} does not go with this: {why}; leave {name} out")
