"""What comments and other lines above the rows of a text file state: names of columns, the sample rate.

The files of oscilloscopes have forms of their own; they measure volts, whatever stands for them.
"""

import itertools
import re

from piezoest.records.columns import UNITS, titled, with_u, with_units
from piezoest.records.source import RATES, stated_rate

COMMENTS = ("#", "%")
# A line ``sample rate [kHz]: 10`` or ``SAMPLE_TIME = 5e-05``, with the unit beside the name or the number.
ENTRY = re.compile(r"\s*([A-Za-z_][\w ]*?)\s*(?:[(\[](\w+)[)\]])?\s*[:=]\s*([-+.\deE]+)\s*(\w*)\s*")
PERIODS = (
    "dt", "ts", "sample_time", "sampling_time", "sample_period", "sampling_period", "sample_interval",
    "tinc",
)  # fmt: skip
# What the units are in Hz and in s.
OF_RATES = {"": 1.0, "hz": 1.0, "khz": 1e3, "mhz": 1e6}
OF_PERIODS = {"": 1.0, **UNITS["time"]}
# A line ``NAME0 = Actual Position of Axis 1``, of which Physik Instrumente's GCS arrays have one a column.
NUMBERED_NAME = re.compile(r"\s*NAME(\d+)\s*=\s*(\S.*?)\s*")
# Rigol: ``X,CH1,CH2,Start,Increment`` above ``Sequence,Volt,Volt,0.0,2e-05``.
START, INCREMENT, SEQUENCE = "start", "increment", "sequence"
# Tektronix: lines of a name and of what it is for each channel, above the rows or in the columns beside them.
FIRST, SOURCE, HORIZONTAL, VERTICAL = "record length", "source", "horizontal units", "vertical units"
CHANNEL = re.compile(r"^(CH\d)V$")  # Rigol: ``CH1V,CH2V,t0 = 0.0, tInc = 2e-05``
BESIDE = 3  # columns of a name, a value and its unit


def bare(comment: str) -> str:
    """Comment without its sign and without quotation marks, which need not be closed there."""
    return comment.lstrip().lstrip("".join(COMMENTS)).replace('"', "")


def entries_in(lines: list[list[str]]) -> list[str]:
    """Entries in the cells of lines: one in a cell, or with the number in the cell behind it or below."""
    found = [cell for line in lines for cell in line]
    found += [f"{line[0]} = {line[1]}" for line in lines if len(line) > 1]
    for upper, lower in itertools.pairwise(lines):
        # An increment is a sample period in the files of Rigol alone.
        rigol = lower[0].lower() == SEQUENCE
        for name, value in zip(upper, lower, strict=False):
            found.append(f"{'dt' if rigol and name.lower() == INCREMENT else name} = {value}")
    return found


def rate_in(comments: list[str]) -> float | None:
    """Sample rate that comments state [Hz]; None if they state none, or several."""
    found = {_rate_of(entry) for comment in comments if (entry := ENTRY.fullmatch(bare(comment)))} - {None}
    return found.pop() if len(found) == 1 else None


def _rate_of(entry: re.Match[str]) -> float | None:
    """Sample rate that an entry states [Hz], itself or by its period; None if it is another entry."""
    name, unit = entry[1].lower().replace(" ", "_"), with_u(entry[2] or entry[4]).lower()
    number = stated_rate(entry[3])
    if number is not None and name in RATES and unit in OF_RATES:
        return stated_rate(number * OF_RATES[unit])
    if number is not None and name in PERIODS and unit in OF_PERIODS:
        return stated_rate(1.0 / number / OF_PERIODS[unit])
    return None


def numbered_names(comments: list[str]) -> list[str]:
    """Names of columns that have a line each, in the order of their numbers."""
    found = [entry for comment in comments if (entry := NUMBERED_NAME.fullmatch(bare(comment)))]
    return [entry[2] for entry in sorted(found, key=lambda entry: int(entry[1]))]


def scope_heading(lines: list[list[str]]) -> tuple[list[str], int] | None:
    """Names of columns and number of lines above the rows; None if no oscilloscope is known by them."""
    first = [cell.lower() for cell in lines[0]]
    if first[0] == FIRST and any(first[BESIDE:]):
        return _beside(lines, first), 0
    if {START, INCREMENT}.issubset(first) and len(lines) > 1 and lines[1][0].lower() == SEQUENCE:
        count = first.index(START)
        return [titled(*named) for named in zip(lines[0][:count], lines[1], strict=False)], 2
    return None


def with_stated_units(header: list[str], lines: list[list[str]]) -> list[str]:
    """Names with the units that lines above the rows state."""
    stated = {line[0].lower(): line[1:] for line in lines}
    if VERTICAL in stated:
        header = with_units(header, [*stated.get(HORIZONTAL, ["s"])[:1], *stated[VERTICAL]]) or header
    return [CHANNEL.sub(r"\1 [V]", name) for name in header]


def _beside(lines: list[list[str]], first: list[str]) -> list[str]:
    """Names of columns where lines of names and values stand beside the rows, for each channel or for all."""
    header = [str(k + 1) for k in range(len(first))]
    starts = [k for k, cell in enumerate(first) if cell == FIRST]
    for number, (start, end) in enumerate(zip(starts, [*starts[1:], len(first)], strict=True), 1):
        stated = {line[start].lower(): line[start + 1] for line in lines if len(line) > start + 1}
        data = [k for k in range(start + BESIDE, end) if first[k]]
        if not data:
            continue
        names = [
            f"time {number}" if number > 1 else "time",
            *(f"CH{number + k}" for k in range(len(data) - 1)),
        ]
        units = [stated.get(HORIZONTAL) or "s", *[stated.get(VERTICAL) or "V"] * (len(data) - 1)]
        if len(data) == 2:
            names[1] = stated.get(SOURCE) or names[1]
        for k, name, unit in zip(data, names, units, strict=True):
            header[k] = titled(name, unit)
    return header
