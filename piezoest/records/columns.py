"""Which column holds what: names, numbers and units, as given or guessed."""

import math
import re
import unicodedata
from collections.abc import Mapping
from typing import NamedTuple

from piezoest.records.source import LogError, Source, counted, shown

# Names by which logs call the quantities, in lower case; the unit stands beside them.
NAMES = {
    "time": (
        "time", "t", "timestamp", "time stamp", "datetime", "seconds", "elapsed", "elapsed time", "zeit",
    ),
    "voltage": (
        "voltage", "u", "v", "volt", "volts", "vin", "drive", "input", "control voltage", "output voltage",
        "piezo voltage", "drive voltage", "command voltage", "applied voltage", "spannung",
    ),
    "displacement": (
        "displacement", "x", "y", "w", "disp", "position", "pos", "measured", "measurement", "output",
        "sensor", "gauge", "weg", "actual position", "current position", "measured position",
        "measured displacement", "sensor position", "stage position",
    ),
    "reference": (
        "reference", "ref", "r", "setpoint", "target", "desired", "target position", "commanded position",
    ),
}  # fmt: skip
UNITS = {
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0,
             "msec": 1e-3, "usec": 1e-6, "h": 3600.0, "hr": 3600.0, "second": 1.0, "seconds": 1.0,
             "milliseconds": 1e-3, "microseconds": 1e-6, "minutes": 60.0, "hours": 3600.0, "days": 86_400.0,
             "nanoseconds": 1e-9, "millisecond": 1e-3, "microsecond": 1e-6, "nanosecond": 1e-9},
    "voltage": {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3, "uv": 1e-6, "kv": 1e3, "millivolts": 1e-3,
                "microvolts": 1e-6, "kilovolts": 1e3, "millivolt": 1e-3, "microvolt": 1e-6, "kilovolt": 1e3},
    "displacement": {"um": 1.0, "micron": 1.0, "microns": 1.0, "nm": 1e-3, "pm": 1e-6, "mm": 1e3, "m": 1e6,
                     "micrometer": 1.0, "micrometers": 1.0, "micrometre": 1.0, "micrometres": 1.0,
                     "nanometers": 1e-3, "nanometres": 1e-3, "millimeters": 1e3, "millimetres": 1e3,
                     "nanometer": 1e-3, "nanometre": 1e-3, "millimeter": 1e3, "millimetre": 1e3,
                     "angstrom": 1e-4, "angstroms": 1e-4, "å": 1e-4, "cm": 1e4, "centimeters": 1e4,
                     "centimetres": 1e4, "meter": 1e6, "meters": 1e6, "metre": 1e6, "metres": 1e6},
}  # fmt: skip
UNITS["reference"] = UNITS["displacement"]
BASE_UNITS = {"time": "s", "voltage": "V", "displacement": "µm", "reference": "µm"}
# Words that say in what a column counts: units of more than one letter, and what is none.
SCALES = {unit for units in UNITS.values() for unit in units if len(unit) > 1} | {
    "count", "counts", "code", "codes", "adc", "dac", "lsb", "percent", "pct", "inch", "inches",
}  # fmt: skip
# Words of other quantities that have the same units.
OTHERS = {
    "time": ("exposure", "delay", "period", "lag", "jitter", "latency", "cpu", "settle", "settling"),
    "voltage": (
        "supply", "photodiode", "pd", "noise", "rms", "error", "sensor", "loadcell", "thermocouple", "strain",
        "gauge", "cap", "lvdt",
    ),
    "displacement": (
        "error", "err", "set", "setpoint", "target", "command", "commanded", "cmd", "des", "desired", "sp",
        "soll", "sollwert", "consigne", "trajectory", "profile", "wavelength", "step", "noise", "rms", "gap",
        "waist", "roughness", "range", "stroke",
    ),
    "reference": (),
}  # fmt: skip
# A name with such a word behind it is what a sensor measured; the name alone may be what was commanded.
MEASURED = ("actual", "act", "measured", "meas", "feedback", "fb")
# Columns of a PID controller, beside its setpoint.
PID = ("input", "output")
# What columns without names are.
UNNAMED = ("time", "voltage", "displacement")
# What stands in brackets behind a name; it is the number of an axis or a channel, no unit: 1, AO0, axis 2.
IN_BRACKETS, CHANNEL = re.compile(r".+[\[(]\s*(.+?)\s*[\])]"), re.compile(r"(?:(?!x\d)[a-z]+[ _]?)?\d+")
# Sentences have such words, names of columns have not.
LITTLE_WORDS = frozenset(
    ("a", "and", "are", "at", "by", "for", "from", "in", "is", "of", "on", "the", "to", "with", "und", "vs")
)
# Asked where all is in volts, as in the files of oscilloscopes.
OF_TWO_VOLTAGES = (
    ", and none is a displacement: name the stage's and the sensor's, and say what 1 in the sensor's column "
    "stands for, such as columns={{'voltage': '{0}', 'displacement': '{1}'}}, units={{'displacement': "
    "'0.2 µm'}}, or --columns 'voltage={0},displacement={1}' --units displacement='0.2 µm'"
)
# More than these are counted in a message, not listed.
MOST_LISTED = 40


class Column(NamedTuple):
    """A column that was chosen, and the factor that brings it to s, V or µm."""

    position: int
    title: str
    factor: float
    note: str


def choose(
    source: Source, wanted: tuple[str, ...], named: Mapping[str, str], units: Mapping[str, str]
) -> dict[str, Column]:
    """Columns of the wanted quantities, as given, else by name, else by unit."""
    for argument, given in (("columns", named), ("units", units)):
        if unknown := sorted(set(given) - set(NAMES)):
            raise LogError(f"{argument} has {unknown}: known are time, voltage and displacement")
    stated = {quantity: _stated_factor(quantity, text) for quantity, text in units.items()}
    if not source.titles and not named and source.width < len(wanted):
        without_time = source.width == len(wanted) - 1 and "time" in wanted
        raise LogError(
            f"{source.path}: {counted(source.width, 'column')} without a header, {len(wanted)} are needed: "
            f"{', '.join(wanted)}{'; without time give the sample rate' if without_time else ''}"
        )
    chosen: dict[str, Column] = {}
    for i, quantity in enumerate(wanted):
        if quantity in named:
            index = _find(source, quantity, named[quantity])
        elif source.titles or named:
            index = _guess(source, quantity)
        else:
            # Without a column of time wanted, one column more is still time.
            more = 0 if "time" in wanted else source.width - len(wanted)
            if more > 1:
                raise LogError(
                    f"{source.path}: {counted(source.width, 'column')} without a header: "
                    f"name {' and '.join(wanted)} by their numbers"
                )
            index = i + more
        title = source.titles[index] if source.titles else str(index + 1)
        taken = (1.0, "") if not source.titles and not named else None
        factor = stated.get(quantity) or taken or _factor(source, title, quantity)
        if quantity in stated and (unit := split_unit(title)[1]) and unit not in UNITS[quantity]:
            # Of 1 V and 1 mV one may be meant where the other is written.
            said = f"column {title!r}: 1 in it is taken as {factor[0]:g} {BASE_UNITS[quantity]}"
            factor = factor[0], said
        if source.titles and quantity not in named and not _names(title, quantity):
            said = f"column {title!r}: taken as the {quantity} by its unit"
            factor = factor[0], factor[1].replace(f"column {title!r}:", f"{said},") or said
        chosen[quantity] = Column(index, title, *factor)
    indices = [column.position for column in chosen.values()]
    for quantity, column in chosen.items():
        if indices.count(column.position) > 1:
            raise LogError(
                f"{source.path}: column {column.title!r} would be {quantity} and something else: "
                "name the columns"
            )
    return chosen


def has_column(source: Source, quantity: str) -> bool:
    """Whether a column of the quantity would be found by its name or unit."""
    try:
        return _guess(source, quantity) >= 0
    except LogError:
        return False


def _find(source: Source, quantity: str, name: str) -> int:
    several = 0
    for candidates in (source.names, source.titles, [split_unit(title)[0] for title in source.titles]):
        if candidates.count(name) == 1:
            return candidates.index(name)
        several = max(several, candidates.count(name))
    if several:
        raise LogError(
            f"{source.path}: {several} columns are called {name!r}: name the one for {quantity} by its "
            f"number, from 1 to {source.width}"
        )
    if name.isdigit() and 1 <= int(name) <= source.width:
        return int(name) - 1
    raise LogError(f"{source.path}: no column {name!r} for {quantity}; there {_listed(source)}")


def _guess(source: Source, quantity: str) -> int:
    names, units = zip(*map(split_unit, source.titles), strict=True) if source.titles else ((), ())
    called = [i for i, name in enumerate(names) if _is_called(name, quantity)]
    # A name may be that of two quantities, as output is: then the unit tells.
    found = [i for i in called if not units[i] or units[i] in UNITS[quantity]]
    if not called and quantity == "reference":
        return _guess(source, "displacement")
    if not found:
        others = [not set(re.split(r"\W+", name.lower())).isdisjoint(OTHERS[quantity]) for name in names]
        alike = [i for i, unit in enumerate(units) if unit in UNITS[quantity] and not others[i]]
        found = [i for i in alike if _quantity(source.titles[i]) == quantity] or called
    lower = [name.lower() for name in names]
    if len(found) == 1 and lower[found[0]] in PID and {*PID, "setpoint"}.issubset(lower):
        # To a PID controller its input is what the sensor says, to a model of the stage it is the voltage.
        found = [lower.index(name) for name in PID]
    if len(found) == 1 and called and quantity == "displacement":
        # Beside an actual position, the position may be the one that was commanded.
        found += [i for i, name in enumerate(names) if _is_measured(name, names[found[0]])]
    if len(found) == 1:
        return found[0]
    if found:
        titles = ", ".join(shown(source.names[i]) for i in found[:MOST_LISTED])
        both = quantity == "voltage" and "displacement" not in map(_quantity, source.titles)
        ending = OF_TWO_VOLTAGES.format(*(names[i] for i in found)) if both else ": name the one that is"
        if len({source.names[i] for i in found}) < len(found):
            ending = f": give the number of the one that is, {' or '.join(str(i + 1) for i in found)}"
        raise LogError(f"{source.path}: the columns {titles} could all be the {quantity}{ending}")
    if quantity == "time" and source.no_rate:
        raise LogError(
            f"{source.path}: {source.no_rate}; save voltage and displacement at one rate, or give the rate "
            "of both"
        )
    hint = " or give the sample rate" if quantity == "time" else ""
    raise LogError(f"{source.path}: no column for {quantity} found; there {_listed(source)}: name it{hint}")


def _listed(source: Source) -> str:
    if not source.titles:
        return f"are {source.width} columns without names"
    more = len(source.names) - MOST_LISTED
    ending = f" and {more} more" if more > 0 else ""
    return f"are the columns {', '.join(map(shown, source.names[:MOST_LISTED]))}{ending}"


def split_unit(title: str) -> tuple[str, str]:
    """Split ``drive_mV``, ``pos [nm]``, ``t (ms)``, ``x/µm`` into name and unit in lower case."""
    # MATLAB and R write brackets as _ and dots.
    plain = with_u(unicodedata.normalize("NFKC", with_u(title))).strip().rstrip("_.:*")
    match = re.fullmatch(r"(.+?)\s*(?:[\[({<]\s*(\w+)\s*[\])}>]|[-/_\s.]\s*([^\W_]+))", plain)
    if match is None:
        return plain, ""
    unit = next(group for group in match.groups()[1:] if group).lower()
    if any(unit in units for units in UNITS.values()):
        return match[1].replace("_", " ").strip(" ."), unit
    return plain.replace("_", " "), ""


def _may_state_a_unit(title: str) -> bool:
    """Whether something in a title, of which no unit was split off, is one: ``x_nm_raw``, ``u [counts]``."""
    plain = with_u(unicodedata.normalize("NFKC", with_u(title)))
    behind = IN_BRACKETS.fullmatch(plain.strip().lower())
    named = behind is None or CHANNEL.fullmatch(behind[1]) or quantities_called(behind[1])
    if re.search("[%°]", plain) or not named:
        return True
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain).lower().replace("_", " ")
    return any(word in SCALES and not quantities_called(word) for word in re.findall(r"[^\W\d]+", words))


def quantities_called(name: str) -> list[str]:
    """Quantities that have a name, in lower case."""
    return [quantity for quantity, names in NAMES.items() if name in names]


def names_columns(titles: list[str]) -> bool:
    """Whether titles are names of columns, and not the words of a sentence.

    They are if each is a quantity of its own, or if voltage and displacement are among them.
    """
    found = [_quantity(title) for title in titles]
    if None not in found and len(set(found)) == len(titles):
        return True
    return {"voltage", "displacement"}.issubset(found) and LITTLE_WORDS.isdisjoint(map(str.lower, titles))


def names_other_order(titles: list[str]) -> bool:
    """Whether two or more titles are a quantity each that stands elsewhere than in columns without names."""
    names = [split_unit(title)[0].lower() for title in titles]
    called = [next((each for each in NAMES if _is_called(name, each)), None) for name in names]
    places = {k: each for k, each in enumerate(called) if each is not None}
    usual = dict(enumerate(UNNAMED[-len(titles) :]))
    elsewhere = any(usual.get(k) != each for k, each in places.items())
    return elsewhere and len(set(places.values())) == len(places) > 1 and LITTLE_WORDS.isdisjoint(names)


def counted_names(cells: list[str], below: list[list[str]]) -> list[str] | None:
    """Names of columns that pandas only counts: none for 0, 1, 2; all if an index stands before them."""
    numbers = [str(k) for k in range(len(cells))]
    if not any("." in cell for row in below for cell in row):
        return None
    if cells[:1] == [""] and cells[1:] == numbers[:-1]:
        return cells
    return [] if cells == numbers else None


def _quantity(title: str) -> str | None:
    """Quantity that a title stands for, by its name or else by its unit."""
    name, unit = split_unit(title)
    by_name = (quantity for quantity in NAMES if _is_called(name, quantity))
    return next(by_name, next((quantity for quantity in NAMES if unit in UNITS[quantity]), None))


def _is_called(name: str, quantity: str) -> bool:
    """Whether the quantity is called so, or so with what it is of: ``position of axis 1``."""
    plain = name.lower().partition(" of ")[0]
    # What it counts in may be no unit that is known: then it is asked for.
    counts = IN_BRACKETS.fullmatch(plain)
    words = set(re.findall(r"[^\W\d]+|[%°.]", counts[1])) if counts else set[str]()
    if not words.isdisjoint(SCALES | set("%°.")):
        plain = re.sub(r"\s*[\[(][^\[(]*$", "", plain)
    return plain in NAMES[quantity]


def _is_measured(name: str, other: str) -> bool:
    """Whether a name is another one with a word that says it was measured: ``position_actual``."""
    first, _, last = name.lower().rpartition(" ")
    return first == other.lower() and last in MEASURED


def _names(title: str, quantity: str) -> bool:
    """Whether a word of a title is a name of the quantity."""
    words = re.findall(r"[^\W_]+", split_unit(title)[0].lower())
    return any(word in NAMES[quantity] for word in words) or _is_called(" ".join(words), quantity)


def titled(name: str, unit: str) -> str:
    """Name with the unit that the file states beside it, in place of one that the name states."""
    # Times of netCDF are in hours, or the like, since a date.
    unit, (plain, own) = unit.partition(" since ")[0], split_unit(name)
    return f"{plain if own else name} [{unit}]" if unit else name


def with_units(names: list[str], below: list[str]) -> list[str]:
    """Names with the units of the line below them; no names if that line holds anything else.

    Beside the units of two quantities there may be others, of columns that no log needs: N, °C, %.
    """
    units = [cell.strip(" []()") for cell in below]
    if len(names) != len(units) or not any(units):
        return []
    of = [quantity_of_unit(unit) for unit in units]
    two = len(set(of) - {None, ""}) > 1
    found = []
    for name, unit, quantity in zip(names, units, of, strict=True):
        if quantity is None and not (two and _is_other_unit(unit) and _quantity(name) is None):
            return []
        found.append(titled(name, unit if quantity else ""))
    return found


def _is_other_unit(text: str) -> bool:
    """Whether a text may be a unit of something else: short, without digits, and no name of a column."""
    return len(text) <= 3 and re.search(r"\d", text) is None and _quantity(text) is None


def quantity_of_unit(unit: str) -> str | None:
    """Quantity that a unit is of; empty for no unit, None for an unknown one."""
    plain = with_u(unit).lower()
    return next((quantity for quantity in NAMES if plain in UNITS[quantity]), None) if plain else ""


def with_u(text: str) -> str:
    """With u for the signs of micro, the first three of which are what a wrong encoding leaves of them."""
    return re.sub("\N{REPLACEMENT CHARACTER}|Âµ|Î¼|µ|μ", "u", text)


def _factor(source: Source, title: str, quantity: str) -> tuple[float, str]:
    """Factor to the base unit, and a note where one was applied or a unit assumed."""
    # Only mega would differ from milli by case, and no log has it: units are in lower case here.
    _, unit = split_unit(title)
    base = BASE_UNITS[quantity]
    if (unit and unit not in UNITS[quantity]) or (not unit and _may_state_a_unit(title)):
        raise LogError(
            f"{source.path}: column {title!r} has no unit of {quantity}, such as {base}: convert it, or say "
            f"what 1 in it stands for: units={{'{quantity}': '2 {base}'}}, or --units {quantity}='2 {base}'"
        )
    if not unit:
        for other, line in source.stated_units.items():
            if UNITS[quantity].get(other, 1.0) != 1.0:
                raise LogError(
                    f"{source.path}: column {title!r} has no unit, but beside the header stands "
                    f"{shown(line)!r}: say its unit: units={{'{quantity}': '{other}'}}, or "
                    f"--units {quantity}={other}"
                )
        return 1.0, f"column {title!r}: unit taken as {base}"
    return _said(UNITS[quantity][unit], f"column {title!r}", quantity)


def _stated_factor(quantity: str, text: str) -> tuple[float, str]:
    """Factor of a unit that was given, such as ``nm`` or, for a sensor's volts, ``0.2 um``."""
    match = re.fullmatch(
        r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)?\s*([^\W\d_]+)\s*", with_u(str(text))
    )
    known = UNITS[quantity]
    if match is None or match[2].lower() not in known:
        raise LogError(
            f"units has {text!r} for {quantity}: known are {', '.join(known)}, with a number before it "
            f"where the log counts in something else: '0.2 {next(iter(known))}'"
        )
    factor = float(match[1] or 1.0) * known[match[2].lower()]
    if not math.isfinite(factor) or factor == 0.0 or (quantity == "time" and factor < 0.0):
        raise LogError(f"units has {text!r} for {quantity}: the number must be finite and not zero")
    return _said(factor, quantity, quantity)


def _said(factor: float, what: str, quantity: str) -> tuple[float, str]:
    note = f"{what}: converted to {BASE_UNITS[quantity]} (factor {factor:g})"
    return factor, "" if factor == 1.0 else note
