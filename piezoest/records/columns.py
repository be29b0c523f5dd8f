"""Which column holds what: names, numbers and units, as given or guessed."""

import math
import re
from collections.abc import Mapping
from typing import NamedTuple

from piezoest.records.source import LogError, Source, counted, shown
from piezoest.records.titles import (
    BASE_UNITS,
    FACTOR,
    NAMES,
    PLAIN,
    UNITS,
    is_called,
    is_named,
    is_other,
    is_rival,
    may_state_a_unit,
    quantity_of,
    split_unit,
    with_u,
    words_of,
)

# Columns of a PID controller, beside its setpoint.
PID = ("input", "output")
# Words of a voltage that an amplifier takes, or divides.
OF_AMPLIFIER = {"vin", "monitor", "mon", "amplifier", "dac"}
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
        plain = not source.titles and not named and not _stated_beside(source, quantity)
        factor = stated.get(quantity) or ((1.0, "") if plain else _factor(source, title, quantity))
        if quantity in stated and (unit := split_unit(title)[1]) and unit not in UNITS[quantity]:
            # Of 1 V and 1 mV one may be meant where the other is written.
            said = f"column {title!r}: 1 in it is taken as {factor[0]:g} {BASE_UNITS[quantity]}"
            factor = factor[0], said
        if quantity == "voltage" and quantity not in stated and not OF_AMPLIFIER.isdisjoint(words_of(title)):
            factor = _also(factor, title, "if the stage has another voltage, say by units= what 1 in it is")
        if source.titles and quantity not in named and not is_named(title, quantity):
            factor = _also(factor, title, f"taken as the {quantity} by its unit")
        if source.titles and quantity not in named and (others := _others(source, quantity, index)):
            factor = _also(factor, title, f"taken as the {quantity}, and not {others}")
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
    called = [i for i, name in enumerate(names) if is_called(name, quantity)]
    # A name may be that of two quantities, as output is: then the unit tells.
    found = [i for i in called if not units[i] or units[i] in UNITS[quantity]]
    if len(found) > 1:
        # ``v [µm/s]`` is no voltage, if another column may be it.
        found = [i for i in found if units[i] or not may_state_a_unit(source.titles[i])] or found
    if not called and quantity == "reference":
        return _guess(source, "displacement")
    if not found:
        alike = [i for i, unit in enumerate(units) if unit in UNITS[quantity]]
        alike = [i for i in alike if not is_other(names[i], quantity)]
        found = [i for i in alike if quantity_of(source.titles[i]) == quantity] or called
    lower = [name.lower() for name in names]
    if len(found) == 1 and lower[found[0]] in PID and {*PID, "setpoint"}.issubset(lower):
        # To a PID controller its input is what the sensor says, to a model of the stage it is the voltage.
        found = [lower.index(name) for name in PID]
    if len(found) == 1 and called:
        # Beside an actual position, the position may be the one that was commanded.
        chosen = names[found[0]]
        found += [i for i, name in enumerate(names) if is_rival(name, units[i], quantity, chosen)]
    if len(found) == 1:
        return found[0]
    if found:
        titles = ", ".join(shown(source.names[i]) for i in found[:MOST_LISTED])
        both = quantity == "voltage" and "displacement" not in map(quantity_of, source.titles)
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


def _others(source: Source, quantity: str, index: int) -> str:
    """The first other column that has a unit of the quantity, and may be it; empty if none has."""
    for i, title in enumerate(source.titles if quantity in PLAIN else []):
        name, unit = split_unit(title)
        alike = unit in UNITS[quantity] and quantity_of(title) == quantity
        if alike and i != index and not is_other(name, quantity):
            return shown(title)
    return ""


def _also(factor: tuple[float, str], title: str, said: str) -> tuple[float, str]:
    """A factor whose note says something else first."""
    rest = factor[1].removeprefix(f"column {title!r}: ")
    return factor[0], f"column {title!r}: {said}{', ' + rest if rest else ''}"


def _listed(source: Source) -> str:
    if not source.titles:
        return f"are {source.width} columns without names"
    more = len(source.names) - MOST_LISTED
    ending = f" and {more} more" if more > 0 else ""
    return f"are the columns {', '.join(map(shown, source.names[:MOST_LISTED]))}{ending}"


def _factor(source: Source, title: str, quantity: str) -> tuple[float, str]:
    """Factor to the base unit, and a note where one was applied or a unit assumed."""
    # Only mega would differ from milli by case, and no log has it: units are in lower case here.
    _, unit = split_unit(title)
    base = BASE_UNITS[quantity]
    if (unit and unit not in UNITS[quantity]) or (not unit and may_state_a_unit(title)):
        raise LogError(
            f"{source.path}: column {title!r} has no unit of {quantity}, such as {base}: convert it, or say "
            f"what 1 in it stands for: units={{'{quantity}': '2 {base}'}}, or --units {quantity}='2 {base}'"
        )
    if FACTOR.search(title) and re.search(r"[^\W\d_]", title):
        raise LogError(
            f"{source.path}: the name of column {title!r} states a factor: say what 1 in the column stands "
            f"for: units={{'{quantity}': '10 {base}'}}, or --units {quantity}='10 {base}'"
        )
    if not unit:
        if other := _stated_beside(source, quantity):
            raise LogError(
                f"{source.path}: column {title!r} has no unit, but beside the columns stands "
                f"{shown(source.stated_units[other])!r}: say its unit: units={{'{quantity}': '{other}'}}, or "
                f"--units {quantity}={other}"
            )
        return 1.0, f"column {title!r}: unit taken as {base}"
    return _said(UNITS[quantity][unit], f"column {title!r}", quantity)


def _stated_beside(source: Source, quantity: str) -> str:
    """Unit of the quantity that stands beside the columns and is not the base unit; empty if none does."""
    return next((unit for unit in source.stated_units if UNITS[quantity].get(unit, 1.0) != 1.0), "")


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
