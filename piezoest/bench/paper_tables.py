"""Tables I, II and III as published, and how close the simulated stage has to come to them.

A. A. Eielsen, J. T. Gravdahl, K. Y. Pettersen, Rev. Sci. Instrum. 83, 085001 (2012).
"""

import csv
import functools
from dataclasses import dataclass
from importlib import resources
from typing import Any

# Largest deviation that passes, relative to the published number (error_reduction: in points
# of per cent). Relative errors have none: they are the maximum errors over the peak of the
# reference, printed with two digits.
Bounds = dict[str, float]
CALIBRATION_BOUNDS: Bounds = {
    "alpha": 0.15, "beta": 0.02, "gamma": 0.15, "K": 0.02, "linear_max_error": 0.05,
    "compensated_max_error": 0.25, "error_reduction": 2.0,
}  # fmt: skip
PRBS_BOUNDS: Bounds = {
    "alpha": 0.15, "beta": 0.03, "gamma": 0.15, "K": 0.03, "linear_max_error": 0.10,
    "compensated_max_error": 0.20, "error_reduction": 6.0,
}  # fmt: skip
TABLE_III_BOUNDS: Bounds = {"compensated_max_error": 0.20}


@dataclass(frozen=True, slots=True)
class Published:
    """One number of the paper."""

    table: str  # ``"I"``, ``"II"`` or ``"III"``
    row: str  # reference signal, as `triangle_row` and `PRBS_ROW` name it
    quantity: str  # column: alpha, beta, gamma, K, linear_max_error and so on
    value: float  # as printed
    unit: str  # of the value
    held_out: bool  # whether the calibration of the stage never saw it

    @property
    def bound(self) -> float | None:
        """Largest deviation that passes; None if the number has no bound."""
        if not self.held_out:
            bounds = CALIBRATION_BOUNDS
        else:
            bounds = TABLE_III_BOUNDS if self.table == "III" else PRBS_BOUNDS
        return bounds.get(self.quantity)

    def deviation(self, ours: float) -> float:
        """Deviation of `ours`, relative to the value or in points of per cent."""
        difference = ours - self.value
        return difference if self.quantity == "error_reduction" else difference / self.value


PRBS_ROW = "Filtered PRBS"


def triangle_row(amplitude: float, frequency: float) -> str:
    """Name of a triangle reference in the tables: amplitude [µm], frequency [Hz]."""
    return f"{amplitude:.1f} µm @ {frequency:.1f} Hz"


def crossed_row(amplitude: float, frequency: float, found_for: float) -> str:
    """Name of a row of Table III: with the parameters found for another amplitude [µm]."""
    return f"{triangle_row(amplitude, frequency)}, parameters of {found_for:.1f} µm"


@functools.cache
def published() -> tuple[Published, ...]:
    """Every number of Tables I, II and III, in their order."""
    text = resources.files("piezoest.bench").joinpath("paper_tables.csv").read_text(encoding="utf-8")
    lines: list[dict[str, Any]] = list(csv.DictReader(text.splitlines()))
    return tuple(
        Published(**{**line, "value": float(line["value"]), "held_out": line["held_out"] == "1"})
        for line in lines
    )
