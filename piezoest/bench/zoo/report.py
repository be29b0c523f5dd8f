"""Runs on the zoo for the terminal."""

from functools import partial
from typing import Any

from piezoest._tables import print_rows, say, shown
from piezoest.bench.zoo.settling import ENOUGH, SEGMENTS, SOON

KEY = (
    "Ratio: largest error after two swings, over the largest of 1.5 times that of the straight line, three "
    "times the noise and 0.2 % of the swing; rms: the same of root mean squares; cycle: the largest of all "
    "cycles, each with the line's error in that very cycle; last: of the last cycle; "
    "after: from two swings after a transient fault, or after the beginning of one that stays. The line is "
    "the worse one of two: that drawn in hindsight, and that learnt leg by leg. At a limit: the voltage "
    "rests there for more than a quarter swing though the line's lies well within."
)


def print_summary(summary: dict[str, Any], console: Any) -> None:
    """Print what runs say together. `summary`: from `piezoest.bench.zoo.summary.summarise`."""
    healthy, heads = summary["healthy"], (f"of {summary['runs']}", f"of {summary['healthy_runs']} healthy")
    violations = [
        {"criterion": name, heads[0]: count, heads[1]: healthy[name]}
        for name, count in summary["violations"].items()
    ]
    print_rows(console, "Violations", violations)
    print_rows(console, "Ratios", [{"": name, **each} for name, each in summary["quantiles"].items()])
    references = sorted({row["reference"] for row in summary["by_family"]})
    crossed: dict[str, dict[str, str]] = {}
    for row in summary["by_family"]:
        cells = crossed.setdefault(
            row["family"], {"family": _narrow(row["family"]), **dict.fromkeys(references, "")}
        )
        cells[row["reference"]] = _of(row["over"], row["runs"])
    columns = {_narrow(name): name for name in ("family", *references)}
    print_rows(console, "Runs with a ratio above 1, of all", crossed.values(), columns)
    print_rows(
        console, "By fault: runs with a ratio above 1, in the last cycle, or at a limit", summary["by_fault"],
        {"fault": _fault, "runs": "runs", "over": "over", "last": "over_last", "limit": "at_limit",
         "median": "ratio"},
    )  # fmt: skip
    print_rows(
        console, "Faults named, in how many periods; as good as before within three cycles",
        [row for row in summary["by_fault"] if row["to_name"] or row["to_recover"]],
        {"fault": _fault, "named": lambda row: _of(row["named"], row["to_name"]), "in": "named_periods",
         "back": lambda row: _of(row["recovered_soon"], row["to_recover"])},
    )  # fmt: skip
    print_rows(
        console, "The worst", summary["worst"],
        {"seed": lambda row: str(row["seed"]), "rig": lambda row: f"{row['family']}, {row['reference']}",
         "fault": _fault, "ratio": "ratio", "last": "last_ratio", "limit": "rail",
         "drove": lambda row: row["failure"] or row["driver"] or "nobody"},
    )  # fmt: skip
    say(console, KEY, f"Controller: {shown(summary['microseconds'])} µs per sample, median.")


def _fault(row: dict[str, Any]) -> str:
    """Its kind and its time."""
    return ", ".join(dict.fromkeys([row["fault"], row["mode"]]))


def _of(count: int, runs: int) -> str:
    return f"{count}/{runs}" if runs else ""


def _narrow(name: str) -> str:
    """A name with a line for each of its parts: a terminal has 80 columns."""
    return name.replace("-", "-\n")


def print_map(summary: dict[str, Any], console: Any) -> None:
    """Print shares of runs that settled soon, of those that are asked for."""
    changes = [name for name, _, _ in SEGMENTS]
    cells = summary["cells"]
    title = f"Cells with at least {100.0 * ENOUGH:g} % of the runs settled within {SOON} periods"
    print_rows(console, title, [{"asked for": cells["asked"], **cells["kept"]}])
    for table, names in (("by_family", ("family",)), ("by_place", ("amplitude", "frequency"))):
        columns: Any = {name: name for name in names} | {name: partial(_settled, name) for name in changes}
        title = f"Settled within {SOON} periods [%], and median of the periods"
        print_rows(console, title, summary[table], columns)
    _print_runs(summary, console, "others")


def _settled(change: str, row: dict[str, Any]) -> str:
    return f"{100.0 * row[change]:.0f} ({shown(row[f'{change} periods'])})"


def print_contest(summary: dict[str, Any], console: Any) -> None:
    """Print settled errors relative to those of the best single estimator."""
    print_rows(
        console,
        "Median settled error relative to the amplitude, that of the best single estimator, and their ratio",
        summary["cells"],
    )
    _print_runs(summary, console, "seeds", "kept", "allowed")


def print_dwells(summary: dict[str, Any], console: Any) -> None:
    """Print how a controller goes on after a long rest."""
    for table in ("groups", "by_family"):
        print_rows(
            console,
            f"After a rest of {summary['duration']:g} s: largest errors over what is allowed, medians; way "
            "of the voltage in it over its swing",
            summary[table],
        )
    print_rows(console, "The worst", summary["worst"])
    _print_runs(summary, console, "kept")


def _print_runs(summary: dict[str, Any], console: Any, *names: str) -> None:
    """How many runs there were, and some more numbers."""
    print_rows(console, "Runs", [{name: summary[name] for name in ("runs", "failures", *names)}])
