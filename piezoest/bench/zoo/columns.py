"""Columns of the tables: of runs on the zoo, and of the map."""

from collections.abc import Iterable, Iterator

from piezoest.bench.store import Row
from piezoest.bench.zoo.judging import ERRORS

COLUMNS: dict[str, type] = {
    "key": str, "controller": str, "seed": int, "family": str, "gain": float, "width": float, "low": float,
    "high": float, "sample_rate": float, "mechanics": str, "lag": float, "delay": int, "sensor_noise": float,
    "resolution": float, "volts": float, "slew_rate": float, "creep": float, "hum": float, "drift": float,
    "reference": str, "amplitude": float, "centre": float, "frequency": float, "samples": int, "block": int,
    "fault": str, "mode": str, "fault_size": float, "fault_start": float, "fault_stop": float,
    "line_gain": float, "line_centre": float, "failure": str, "finite": bool, "within_limits": bool,
    "rail": float, "rests_at_rail": bool, "swing": float, "noise": float, "floor": float,
    "judged_from": float, **{f"{part}{name}": float for part in ("", "last_", "after_") for name in ERRORS},
    "cycle_ratio": float, "settled": float, "events": int, "named": str, "named_first": str,
    "named_after": float, "named_right": bool, "named_periods": float,
    "recovery": bool, "recovered": int, "driver": str, "status": str, "microseconds": float,
}  # fmt: skip

CELL_COLUMNS: dict[str, type] = {
    "key": str, "controller": str, "family": str, "amplitude": float, "frequency": float, "seed": int,
    "gain": float, "width": float, "block": int, "noise": float, "mechanics": str, "asked": bool,
    "failure": str, "change": str, "periods": int, "error": float, "allowed": float,
}  # fmt: skip

DWELL_COLUMNS: dict[str, type] = {
    **dict(list(COLUMNS.items())[: list(COLUMNS).index("block") + 1]),
    "setpoint_noise": float, "feedback": float, "duration": float, "failure": str, "settled": float,
    "allowed": float, "first": float, "second": float, "third": float, "kept": bool, "excursion": float,
    "events": str,
}  # fmt: skip


def tidy_cells(rows: Iterable[Row]) -> Iterator[Row]:
    """A row for each change of each run of the map. `rows`: from `piezoest.bench.zoo.settling.Cell.play`."""
    for row in rows:
        for segment in row["segments"] or [{}]:
            yield {**row, **segment}
