"""What the first rows of a log tell of its time: its unit, and whether it agrees with a sample rate."""

from collections.abc import Mapping

import numpy as np

from piezoest._checks import FloatArray
from piezoest.records.columns import Column, choose, has_column
from piezoest.records.source import LogError, Source
from piezoest.records.titles import UNITS, split_unit

# Rows by which a sample rate that is given is compared with the column of time, and how near it must be.
FIRST_ROWS, SAME_RATE = 1000, 0.01
# Time since 1970 is between these [s] from 2000 to 2100: so its size tells its unit, one of these.
SINCE_1970 = 9.4e8, 4.1e9
OF_STAMPS = ("ms", "us", "ns")
# So do clocks of Windows, which count 100 ns from the year 1 or from 1601 on.
TICKS = ((6.3e17, 6.7e17), (1.25e17, 1.6e17))
# A column without a unit is not in seconds if rows are farther apart than some minutes or nearer than any log
# has them, or if it counts days, as spreadsheets do from 1900 on and MATLAB from the year 0: from about 1980
# to 2065.
LONGEST_PERIOD, SHORTEST_PERIOD, SHORTEST_OF_DAYS, DAYS = (
    600.0,
    5e-8,
    3e-5,
    ((2.9e4, 6.1e4), (7.23e5, 7.55e5)),
)


def states_its_rate(source: Source) -> bool:
    """Whether a file states its sample rate and has no column of time."""
    if source.sample_rate is None:
        return False
    if source.titles:
        return not has_column(source, "time")
    return source.width == 2 or (source.width == 3 and source.sample_rate != 1.0 and _counts(source))


def _counts(source: Source) -> bool:
    """Whether the first column is the number of the row."""
    first = next((rows.values[0] for rows in source.read([0], FIRST_ROWS)), np.empty(0))
    return first.size > 1 and first[0] in (0.0, 1.0) and bool(np.all(np.diff(first) == 1.0))


def in_seconds(source: Source, column: Column, units: Mapping[str, str], times: FloatArray) -> Column:
    """The column of time by its first numbers; without a unit, stamps since 1970 have that of their size."""
    known = times[np.isfinite(times)]
    if "time" in units or (source.titles and split_unit(column.title)[1]) or not known.size:
        return column
    first, period = float(known[0]), float(np.median(np.diff(known))) if known.size > 1 else 1.0
    for unit in OF_STAMPS:
        factor = UNITS["time"][unit]
        if SINCE_1970[0] <= factor * first < SINCE_1970[1]:
            said = f"column {column.title!r}: taken as {unit.replace('us', 'µs')} since 1970"
            column = column._replace(factor=factor, note=said)
            break
    if any(low <= first < high for low, high in TICKS):
        column = column._replace(factor=1e-7, note=f"column {column.title!r}: taken as ticks of 100 ns")
    seconds = column.factor * period
    of_days = 0.0 < seconds < SHORTEST_OF_DAYS and any(low <= first < high for low, high in DAYS)
    of_days = of_days or 0.0 < seconds < SHORTEST_PERIOD
    if seconds > LONGEST_PERIOD or of_days:
        unit = "days" if of_days else "ns"
        raise LogError(
            f"{source.path}: column {column.title!r} has no unit; its rows would be {seconds:.3g} s apart: "
            f"say what 1 in it stands for, such as '{unit}' or '100 ns': units={{'time': '{unit}'}}, or "
            f"--units time={unit}"
        )
    return column


def check_first_column(source: Source, wanted: int, timed: bool) -> None:
    """Refuse columns without names of which the first, beside those that are wanted, is not time."""
    if source.width == wanted:
        return
    if timed:
        second = next((rows.values[0] for rows in source.read([1], FIRST_ROWS)), np.empty(0))
        if _counts(source) and np.all(np.diff(second) > 0.0):
            raise LogError(
                f"{source.path}: {source.width} columns without a header, and the first counts the rows: "
                "name time, voltage and displacement by their numbers, such as columns={'time': '2', "
                "'voltage': '3', 'displacement': '4'}, or --columns time=2,voltage=3,displacement=4"
            )
        return
    first = next((rows.values[0] for rows in source.read([0], FIRST_ROWS)), np.empty(0))
    if np.any(np.diff(first[np.isfinite(first)]) < 0.0):
        raise LogError(
            f"{source.path}: {source.width} columns without a header, and the first does not rise as time "
            "does: name voltage and displacement by their numbers, such as columns={'voltage': '1', "
            "'displacement': '2'}, or --columns voltage=1,displacement=2"
        )


def contradicted(
    source: Source, named: dict[str, str], units: Mapping[str, str], sample_rate: float
) -> list[str]:
    """What to say where a column of time, by its first rows, has another sample rate than is given."""
    if "time" not in named and not (source.titles and has_column(source, "time")):
        return []
    try:
        column = choose(source, ("time",), named, units)["time"]
        times = next(source.read([column.position], FIRST_ROWS)).values[0][:FIRST_ROWS]
        column = in_seconds(source, column, units, times)
    except (LogError, StopIteration):
        return []
    steps = column.factor * np.diff(times[np.isfinite(times)])
    rate = 1.0 / float(np.median(steps)) if steps.size and np.median(steps) > 0.0 else sample_rate
    if abs(rate / sample_rate - 1.0) < SAME_RATE:
        return []
    return [f"column {column.title!r} has {rate:.4g} Hz, it is ignored: {sample_rate:g} Hz was given"]


def ignored(stated: float, found: float) -> list[str]:
    """What to say where a file states another sample rate than its column of time has."""
    if abs(found / stated - 1.0) < SAME_RATE:
        return []
    return [f"the file states {stated:g} Hz, which is ignored: time has {found:.4g} Hz"]
