"""Runs on the zoo for the terminal."""

from functools import partial
from typing import Any

from piezoest._tables import Columns, print_rows, say, shown
from piezoest.bench.zoo.settling import ENOUGH, SEGMENTS, SOON
from piezoest.bench.zoo.words import CHANGES, CRITERIA, RATIOS, fault

KEY = (
    "Ratio: largest error from two swings after the start, divided by the largest of 1.5 times the error "
    "of the straight line, three times the noise and 0.2 % of the swing. Any cycle: the largest of the "
    "ratios of single cycles, each with the line's error in that cycle. After a fault: from two swings "
    "after the end of a temporary fault, or after the beginning of one that stays. The line is the worse "
    "of two: the best in hindsight, and one that is learnt from leg to leg. At a limit: the voltage rests "
    "there for more than a quarter of a swing although the line's voltage is well within."
)
WAYS = {"creep": "creep", "feedback": "feed-\nback", "noise": "noise"}
UNITS = {"amplitude": "amplitude\n[µm]", "frequency": "frequency\n[Hz]"}


def _percent(column: str, row: dict[str, Any]) -> float | None:
    return None if row[column] is None else round(100.0 * row[column], 1)


WORST: Columns = {
    "seed": lambda row: str(row["seed"]), "rig": lambda row: f"{row['family']}, {row['reference']}",
    "fault": fault, "ratio": "ratio", "last\ncycle": "last_ratio", "at a\nlimit": "rail",
    "drove\nlast": lambda row: row["failure"] or row["driver"] or "nobody",
}  # fmt: skip
DWELLS: Columns = {
    "runs": "runs", "as\nbefore": "kept", "first": "first", "second": "second",
    "largest\nfirst": "largest", "moved\n[%]": partial(_percent, "excursion"),
    "most\n[%]": partial(_percent, "farthest"),
}  # fmt: skip


def print_summary(summary: dict[str, Any], console: Any) -> None:
    """Print what runs say together. `summary`: from `piezoest.bench.zoo.summary.summarise`."""
    healthy, heads = summary["healthy"], (f"of {summary['runs']}", f"of {summary['healthy_runs']} healthy")
    violations = [
        {"criterion": said, heads[0]: summary["violations"][name], heads[1]: healthy[name]}
        for name, said in CRITERIA.items()
    ]
    print_rows(console, "Violations", violations)
    ratios = [{"ratio": said, **summary["quantiles"][name]} for name, said in RATIOS.items()]
    print_rows(console, "Quantiles of the ratio", ratios)
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
        {"fault": fault, "runs": "runs", "ratio\nabove 1": "over", "last\ncycle": "over_last",
         "at a\nlimit": "at_limit", "median\nratio": "ratio"},
    )  # fmt: skip
    print_rows(
        console, "Faults named, in how many periods; as good as before within three cycles",
        [row for row in summary["by_fault"] if row["to_name"] or row["to_recover"]],
        {"fault": fault, "right\nname": lambda row: _of(row["named"], row["to_name"]),
         "after\n[periods]": "named_periods",
         "as\nbefore": lambda row: _of(row["recovered_soon"], row["to_recover"])},
    )  # fmt: skip
    print_rows(console, "The worst", summary["worst"], WORST)
    say(console, KEY, f"Controller: {shown(summary['microseconds'])} µs per sample, median.")


def _of(count: int, runs: int) -> str:
    return f"{count}/{runs}" if runs else ""


def _narrow(name: str) -> str:
    """A name with a line for each of its parts: a terminal has 80 columns."""
    return name.replace("-", "-\n")


def print_map(summary: dict[str, Any], console: Any) -> None:
    """Print shares of runs that settled soon, of those that are asked for."""
    cells = summary["cells"]
    said = {name: CHANGES[name].replace(" %", "\N{NO-BREAK SPACE}%") for name, _, _ in SEGMENTS}
    changes = {each.replace(" ", "\n"): name for name, each in said.items()}
    title = f"Cells with at least {100.0 * ENOUGH:g} % of the runs settled within {SOON} periods"
    kept = {head: cells["kept"][name] for head, name in changes.items()}
    print_rows(console, title, [{"required": cells["asked"], **kept}])
    for table, names in (("by_family", ("family",)), ("by_place", ("amplitude", "frequency"))):
        columns: Any = {UNITS.get(name, name): name for name in names}
        columns |= {head: partial(_settled, name) for head, name in changes.items()}
        title = f"Settled within {SOON} periods [%], and median of the periods"
        print_rows(console, title, summary[table], columns)
    _print_runs(summary, console, **{"not required": "others"})


def _settled(change: str, row: dict[str, Any]) -> str:
    return f"{100.0 * row[change]:.0f} ({shown(row[f'{change} periods'])})"


def print_contest(summary: dict[str, Any], console: Any) -> None:
    """Print settled errors relative to those of the best single estimator."""
    print_rows(
        console,
        "Median settled error relative to the amplitude, that of the best single estimator, and their ratio",
        summary["cells"],
        {"family": "family", "reference": "reference", "settled": "settled", "best one": "best",
         "its error": "best_settled", "ratio": "ratio"},
    )  # fmt: skip
    _print_runs(summary, console, **{"seeds": "seeds", f"ratio of at most {summary['allowed']:g}": "kept"})


def print_dwells(summary: dict[str, Any], console: Any) -> None:
    """Print how a controller goes on after a long rest."""
    title = (
        f"After a rest of {summary['duration']:g} s: largest error of each period, relative to its bound "
        "(medians), and how far the voltage moved during the rest, in % of its swing"
    )
    for table, names in (("groups", tuple(WAYS)), ("by_family", ("family",))):
        print_rows(
            console, title, summary[table], {**{WAYS.get(name, name): name for name in names}, **DWELLS}
        )
    print_rows(console, "The worst", summary["worst"])
    _print_runs(summary, console, **{"as before": "kept"})


def _print_runs(summary: dict[str, Any], console: Any, **more: str) -> None:
    """How many runs there were, and some more numbers by what they are called."""
    said = {"runs": "runs", "error raised": "failures", **more}
    print_rows(console, "Runs", [{head: summary[name] for head, name in said.items()}])
