"""Columns in the CSV files of oscilloscopes, which measure volts, whatever stands for them."""

import re
from itertools import pairwise

from piezoest.records.titles import titled, with_units

# Rigol: ``X,CH1,CH2,Start,Increment`` above ``Sequence,Volt,Volt,0.0,2e-05``.
START, INCREMENT, SEQUENCE = "start", "increment", "sequence"
# Tektronix: lines of a name and of what it is for each channel, above the rows or in the columns beside them.
FIRST, SOURCE, HORIZONTAL, VERTICAL = "record length", "source", "horizontal units", "vertical units"
CHANNEL = re.compile(r"^(CH\d)V$")  # Rigol: ``CH1V,CH2V,t0 = 0.0, tInc = 2e-05``
BESIDE = 3  # columns of a name, a value and its unit


def heading(lines: list[list[str]]) -> tuple[list[str], int] | None:
    """Names of columns and number of lines above the rows; None if no oscilloscope is known by them."""
    first = [cell.lower() for cell in lines[0]]
    if first[0] == FIRST and any(first[BESIDE:]):
        return _beside(lines, first), 0
    if {START, INCREMENT}.issubset(first) and len(lines) > 1 and lines[1][0].lower() == SEQUENCE:
        count = first.index(START)
        return [titled(*named) for named in zip(lines[0][:count], lines[1], strict=False)], 2
    return None


def entries(lines: list[list[str]]) -> list[str]:
    """Entries that say the sample period where it stands below its name."""
    pairs = ((above, below) for above, below in pairwise(lines) if below[0].lower() == SEQUENCE)
    cells = (each for pair in pairs for each in zip(*pair, strict=False))
    return [f"dt = {value}" for name, value in cells if name.lower() == INCREMENT]


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
