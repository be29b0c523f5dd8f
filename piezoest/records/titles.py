"""What the titles of columns say: a quantity, a unit."""

import re
import unicodedata

# Names by which logs call the quantities, in lower case; the unit stands beside them.
NAMES = {
    "time": (
        "time", "t", "timestamp", "time stamp", "datetime", "seconds", "elapsed", "elapsed time", "zeit",
        "temps", "tiempo", "tempo", "время", "时间", "時間",
    ),
    "voltage": (
        "voltage", "u", "v", "volt", "volts", "vin", "drive", "input", "control voltage", "output voltage",
        "piezo voltage", "drive voltage", "command voltage", "applied voltage", "spannung",
        "tension", "voltaje", "tensión", "tensione", "напряжение", "电压", "電圧",
    ),
    "displacement": (
        "displacement", "x", "y", "w", "disp", "position", "pos", "measured", "measurement", "output",
        "sensor", "gauge", "weg", "actual position", "current position", "measured position",
        "measured displacement", "sensor position", "stage position",
        "déplacement", "deplacement", "desplazamiento", "posición", "spostamento", "posizione", "перемещение",
        "смещение", "位移", "変位",
    ),
    "reference": (
        "reference", "ref", "r", "setpoint", "target", "desired", "target position", "commanded position",
    ),
}  # fmt: skip
UNITS = {
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0,
             "msec": 1e-3, "usec": 1e-6, "h": 3600.0, "hr": 3600.0, "second": 1.0, "seconds": 1.0,
             "milliseconds": 1e-3, "microseconds": 1e-6, "minutes": 60.0, "hours": 3600.0, "days": 86_400.0,
             "с": 1.0, "мс": 1e-3, "мкс": 1e-6, "秒": 1.0, "毫秒": 1e-3,
             "nanoseconds": 1e-9, "millisecond": 1e-3, "microsecond": 1e-6, "nanosecond": 1e-9},
    "voltage": {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3, "uv": 1e-6, "kv": 1e3, "millivolts": 1e-3,
                "microvolts": 1e-6, "kilovolts": 1e3, "millivolt": 1e-3, "microvolt": 1e-6, "kilovolt": 1e3,
                "в": 1.0, "мв": 1e-3, "伏": 1.0},
    "displacement": {"um": 1.0, "micron": 1.0, "microns": 1.0, "nm": 1e-3, "pm": 1e-6, "mm": 1e3, "m": 1e6,
                     "micrometer": 1.0, "micrometers": 1.0, "micrometre": 1.0, "micrometres": 1.0,
                     "nanometers": 1e-3, "nanometres": 1e-3, "millimeters": 1e3, "millimetres": 1e3,
                     "nanometer": 1e-3, "nanometre": 1e-3, "millimeter": 1e3, "millimetre": 1e3,
                     "angstrom": 1e-4, "angstroms": 1e-4, "å": 1e-4, "cm": 1e4, "centimeters": 1e4,
                     "centimetres": 1e4, "meter": 1e6, "meters": 1e6, "metre": 1e6, "metres": 1e6, "мкм": 1.0,
                     "нм": 1e-3, "мм": 1e3, "微米": 1.0, "纳米": 1e-3},
}  # fmt: skip
UNITS["reference"] = UNITS["displacement"]
BASE_UNITS = {"time": "s", "voltage": "V", "displacement": "µm", "reference": "µm"}
# Words that say in what a column counts: units of more than one letter, and what is none.
SCALES = {unit for units in UNITS.values() for unit in units if len(unit) > 1} | {
    "count", "counts", "code", "codes", "adc", "dac", "lsb", "percent", "pct", "inch", "inches",
}  # fmt: skip
OTHER_UNITS = ("degc", "counts", "codes", "percent", "ohm", "mbar", "mrad", "urad", "rpm")
# Words of other quantities that have the same units.
OTHERS = {
    "time": ("exposure", "delay", "period", "lag", "jitter", "latency", "cpu", "settle", "settling"),
    "voltage": (
        "supply", "photodiode", "pd", "noise", "rms", "error", "sensor", "loadcell", "thermocouple", "strain",
        "gauge", "cap", "lvdt",
    ),
    "displacement": (
        "error", "err", "set", "setpoint", "target", "command", "commanded", "cmd", "des", "desired", "sp",
        "soll", "sollwert", "consigne", "trajectory", "profile", "ref", "reference", "nominal", "demand",
        "demanded", "requested", "wavelength", "step", "noise", "rms", "gap", "waist", "roughness", "range",
        "stroke",
    ),
    "reference": (),
}  # fmt: skip
# Names of what may also have been commanded, or of an amplifier's input, where another column has one of the
# words that say that it was measured, or is the amplifier's output.
PLAIN = {
    "voltage": (
        "voltage", "u", "v", "volt", "volts", "vin", "input", "control voltage", "command voltage", "drive",
        "drive voltage", "output voltage", "spannung",
    ),
    "displacement": ("displacement", "x", "y", "w", "disp", "position", "pos"),
}  # fmt: skip
MEASURED = {
    "voltage": (
        "piezo", "hv", "high", "amplifier", "amp", "amplified", "out", "output", "monitor", "mon", "meas",
        "measured", "actual", "piezospannung",
    ),
    "displacement": (
        "actual", "act", "measured", "meas", "feedback", "fb", "readback", "real", "ist", "istwert", "sensor",
        "encoder", "gauge", "laser", "interferometer", "vibrometer", "capacitive",
    ),
}  # fmt: skip
# ``voltage/10``, ``monitor x10``, ``position*1e6``, ``1:20``; but not ``Dev1/ai0``.
FACTOR = re.compile(
    r"\S\s*[*×÷]\s*[-+]?\d|\S\s*/\s*\d\d|\d\s*[:/]\s*\d|\d\s*[*×]\s*\w|^\d+\s*x\s|"
    r"[\W_]x\s*\d\d|\^|\b(?:log|sqrt)\b",
    re.IGNORECASE,
)
# ``amplifier gain: 20 V/V``, ``sensitivity 10 µm/V``, ``monitor 1:20``.
STATED_FACTOR = re.compile(
    r"(?:gain|amplif|verst[äa]rk|sensitivity|empfindlich|monitor|scal(?:e|ing)|factor|faktor)"
    r"\D{0,40}?([\d.]+)|"
    r"([\d.]+)\s*(?:[unpm]?m|m?V)\s*/\s*m?V\b",
    re.IGNORECASE,
)
# Before a capital a word begins: ``ActualPos``.
CAPITAL = re.compile(r"(?<=[a-z])(?=[A-Z])")
# What columns without names are.
UNNAMED = ("time", "voltage", "displacement")
# What stands in brackets behind a name; it is the number of an axis or a channel, no unit: 1, AO0, axis 2.
IN_BRACKETS, CHANNEL = re.compile(r".+[\[(]\s*(.+?)\s*[\])]"), re.compile(r"(?:(?!x\d)[a-z]+[ _]?)?\d+")
# How times are written, in place of a unit: ``HH:MM:SS.fff``; and what stands before a unit.
TIME_FORM = re.compile(r"[yYmMdDhHsSfTz .,:/+-]*(?:HH?|hh?):(?:mm|MM|nn)[yYmMdDhHsSfTz .,:/+-]*")
UNIT_IS = re.compile(r"^\s*units?\s*[:=]\s*(?=\S)", re.IGNORECASE)
# Sentences have such words, names of columns have not.
LITTLE_WORDS = frozenset(
    ("and", "are", "at", "by", "for", "from", "in", "is", "of", "on", "the", "to", "with", "und", "vs")
)


def split_unit(title: str) -> tuple[str, str]:
    """Split ``drive_mV``, ``pos [nm]``, ``t (ms)``, ``x/µm`` into name and unit in lower case."""
    # MATLAB and R write brackets as _ and dots.
    plain = with_u(unicodedata.normalize("NFKC", with_u(title))).strip().rstrip("_.:*")
    match = re.fullmatch(r"(.+?)\s*(?:[\[({<]\s*(\w+)\.?\s*[\])}>]|[-/_\s.]\s*([^\W_]+))", plain)
    if match is None:
        return plain, ""
    unit = next(group for group in match.groups()[1:] if group).lower()
    if any(unit in units for units in UNITS.values()):
        return match[1].replace("_", " ").strip(" ."), unit
    return plain.replace("_", " "), ""


def may_state_a_unit(title: str) -> bool:
    """Whether something in a title, of which no unit was split off, is one: ``x_nm_raw``, ``u [counts]``."""
    plain = with_u(unicodedata.normalize("NFKC", with_u(title)))
    behind = IN_BRACKETS.fullmatch(plain.strip().lower())
    named = behind is None or CHANNEL.fullmatch(behind[1]) or quantities_called(behind[1])
    if re.search("[%°]", plain) or not named:
        return True
    words = CAPITAL.sub(" ", plain).lower().replace("_", " ")
    return any(word in SCALES and not quantities_called(word) for word in re.findall(r"[^\W\d]+", words))


def quantities_called(name: str) -> list[str]:
    """Quantities that have a name, in lower case."""
    return [quantity for quantity, names in NAMES.items() if name in names]


def names_columns(titles: list[str]) -> bool:
    """Whether titles are names of columns, and not the words of a sentence.

    They are if each is a quantity of its own, or if voltage and displacement are among them.
    """
    found = [quantity_of(title) for title in titles]
    if None not in found and len(set(found)) == len(titles):
        return True
    return {"voltage", "displacement"}.issubset(found) and LITTLE_WORDS.isdisjoint(map(str.lower, titles))


def names_other_order(titles: list[str]) -> bool:
    """Whether two or more titles are a quantity each that stands elsewhere than in columns without names."""
    names = [split_unit(title)[0].lower() for title in titles]
    called = [next((each for each in NAMES if is_called(name, each)), None) for name in names]
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


def quantity_of(title: str) -> str | None:
    """Quantity that a title stands for, by its name or else by its unit."""
    name, unit = split_unit(title)
    by_name = (quantity for quantity in NAMES if is_called(name, quantity))
    return next(by_name, next((quantity for quantity in NAMES if unit in UNITS[quantity]), None))


def is_called(name: str, quantity: str) -> bool:
    """Whether the quantity is called so, or so with what it is of: ``position of axis 1``."""
    plain = name.lower().partition(" of ")[0]
    # What it counts in may be no unit that is known: then it is asked for.
    counts = IN_BRACKETS.fullmatch(plain)
    words = set(re.findall(r"[^\W\d]+|[%°.]", counts[1])) if counts else set[str]()
    if not words.isdisjoint(SCALES | set("%°.")):
        plain = re.sub(r"\s*[\[(][^\[(]*$", "", plain)
    return plain in NAMES[quantity]


def is_rival(name: str, unit: str, quantity: str, chosen: str) -> bool:
    """Whether a column may be what another one only seems to be: ``actual`` beside ``position``."""
    plain = chosen.lower().partition(" of ")[0]
    if plain not in PLAIN.get(quantity, ()) or name.lower() == chosen.lower():
        return False
    words = words_of(name)
    if words[:1] == [plain] and words[-1] in MEASURED[quantity]:
        return not unit or unit in UNITS[quantity]
    # ``xm`` and ``xmeas`` of ``x``, ``vhv`` of ``vin``.
    told = {*words, name.lower()[1:] if name.lower()[:1] == plain[0] else ""} & {"m", *MEASURED[quantity]}
    return bool(told) and unit in UNITS[quantity] and not is_other(name, quantity)


def is_other(name: str, quantity: str) -> bool:
    """Whether a name says that it is of another quantity, with the same units."""
    return not set(words_of(name)).isdisjoint(OTHERS[quantity])


def states_factor(line: str) -> bool:
    """Whether a line states a gain or a sensitivity other than 1."""
    found = STATED_FACTOR.search(with_u(line))
    return found is not None and (found[1] or found[2]).strip(".") != "1"


def words_of(name: str) -> list[str]:
    """Words of a name in lower case: ``ActualPos`` has two."""
    return re.findall(r"[^\W_]+", CAPITAL.sub(" ", name).lower())


def is_named(title: str, quantity: str) -> bool:
    """Whether a word of a title is a name of the quantity."""
    words = re.findall(r"[^\W_]+", split_unit(title)[0].lower())
    return any(word in NAMES[quantity] for word in words) or is_called(" ".join(words), quantity)


def titled(name: str, unit: str) -> str:
    """Name with the unit that the file states beside it, in place of one that the name states."""
    # Times of netCDF are in hours, or the like, since a date.
    unit, (plain, own) = unit.partition(" since ")[0], split_unit(name)
    return f"{plain if own else name} [{unit}]" if unit else name


def with_units(names: list[str], below: list[str]) -> list[str]:
    """Names with the units of the line below them; no names if that line holds anything else.

    Beside the units of two quantities there may be others, of columns that no log needs: N, °C, %.
    """
    units = [re.sub(UNIT_IS, "", "" if TIME_FORM.fullmatch(cell) else cell).strip(" []()") for cell in below]
    if len(names) != len(units) or not any(units):
        return []
    of = [quantity_of_unit(unit) for unit in units]
    two = len(set(of) - {None, ""}) > 1
    found = []
    for name, unit, quantity in zip(names, units, of, strict=True):
        if quantity is None and not (two and _is_other_unit(unit) and not split_unit(name)[1]):
            return []
        found.append(titled(name, unit))
    return found


def _is_other_unit(text: str) -> bool:
    """Whether a text may be a unit of something else: short, without digits, and no name of a column."""
    short = len(text) <= 3 or "/" in text or text.lower().replace(" ", "") in OTHER_UNITS
    return short and len(text) <= 8 and re.search(r"\d", text) is None and quantity_of(text) is None


def quantity_of_unit(unit: str) -> str | None:
    """Quantity that a unit is of; empty for no unit, None for an unknown one."""
    plain = with_u(unit).lower()
    return next((quantity for quantity in NAMES if plain in UNITS[quantity]), None) if plain else ""


def with_u(text: str) -> str:
    """With u for the signs of micro, the first ones of which are what a wrong encoding leaves of them."""
    return re.sub("(?:\N{REPLACEMENT CHARACTER}|Âµ|Î¼|¦Ì|æ(?=m\\b)|µ|μ|\\$?\\\\mu\\$?) ?(?=m?)", "u", text)
