"""Sample rates that a file states beside its columns."""

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from piezoest.records.titles import UNITS, with_u

# Names under which a file may state its sample rate [Hz], or the time between samples [s], in lower case.
RATES = (
    "fs", "f_s", "sample_rate", "samplerate", "sampling_rate", "sample_rate_hz", "sampling_rate_hz",
    "sampling_frequency", "sample_frequency", "abtastrate", "abtastfrequenz",
)  # fmt: skip
PERIODS = (
    "dt", "ts", "sample_time", "sampling_time", "sample_period", "sampling_period", "sample_interval",
    "sampling_interval", "tinc", "abtastzeit",
)  # fmt: skip
OF_RATES = {
    "": 1.0, "hz": 1.0, "khz": 1e3, "k": 1e3, "mhz": 1e6, "s/s": 1.0, "sa/s": 1.0, "sps": 1.0, "ks/s": 1e3,
    "ksa/s": 1e3, "ksps": 1e3,
}  # fmt: skip
# What the units are in s.
OF_PERIODS = {"": 1.0, **UNITS["time"]}
# A file that keeps one sample of several states a rate that may be that of all of them.
DECIMATED = re.compile(
    r"(?:decimat|\bdec\b|down_?sampl|sub_?-?sampl|untersetz|record_table_rate|\bevery|reduction|divider|"
    r"\bskip|\bavg|averag|binn)\D*(\d+)",
    re.IGNORECASE,
)


def stated_rate(value: Any, unit: str = "") -> float | None:
    """Sample rate that a file states [Hz]; None if it is not one number above zero, or of unknown unit."""
    try:
        # Of all units only this one is another in capitals.
        factor = 1e-3 if unit.strip() == "mHz" else OF_RATES[unit.strip().lower()]
        number = factor * float(np.asarray(value).reshape(()))
    except (TypeError, ValueError, OverflowError, KeyError):
        return None
    return number if 0.0 < number < np.inf else None


def rate_of(name: str, value: Any, unit: str = "") -> float | None:
    """Sample rate that a number of some name states [Hz], itself or by its period; None if it does not."""
    name = name.strip().lower().replace(" ", "_")
    if name in PERIODS:
        period, factor = stated_rate(value), OF_PERIODS.get(with_u(unit).strip().lower())
        return None if period is None or factor is None else stated_rate(1.0 / period / factor)
    return stated_rate(value, unit) if name in RATES else None


def rate_among(numbers: Iterable[tuple[str, Any, str]]) -> tuple[float | None, str]:
    """Sample rate that one of some numbers states [Hz]; or None, and why it is not known if they state one.

    `numbers`: name, value and unit of each.
    """
    numbers = list(numbers)
    rates = {rate_of(*number) for number in numbers} - {None}
    if len(rates) > 1 or (rates and any(is_decimated(f"{name} {value}") for name, value, _ in numbers)):
        return None, "it states several sample rates, or that only some samples were kept"
    return (rates.pop() if rates else None), ""


def is_decimated(text: str) -> bool:
    """Whether a text says that only one sample of several was kept."""
    found = DECIMATED.search(text)
    return found is not None and int(found[1]) > 1
