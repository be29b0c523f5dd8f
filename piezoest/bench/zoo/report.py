"""Runs on the zoo for the terminal."""

from typing import Any

from piezoest._tables import print_cells, say
from piezoest.bench.zoo.dwelling import WAYS
from piezoest.bench.zoo.settling import SEGMENTS
from piezoest.bench.zoo.summary import ENOUGH, SOON

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
    print_cells(
        console, "Violations",
        ("criterion", f"of {summary['runs']}", f"of {summary['healthy_runs']} healthy"),
        [(name, count, summary["healthy"][name]) for name, count in summary["violations"].items()],
    )  # fmt: skip
    quantiles = summary["quantiles"]
    print_cells(
        console, "Ratios", ("", *next(iter(quantiles.values()))),
        [(name, *map(number, each.values())) for name, each in quantiles.items()],
    )  # fmt: skip
    _crossed(console, summary["by_family"])
    faults = [(", ".join(dict.fromkeys([row["fault"], row["mode"]])), row) for row in summary["by_fault"]]
    print_cells(
        console, "By fault: runs with a ratio above 1, in the last cycle, or at a limit",
        ("fault", "runs", "over", "last", "limit", "median"),
        [
            (name, row["runs"], row["over"], row["over_last"], row["at_limit"], number(row["ratio"]))
            for name, row in faults
        ],
    )  # fmt: skip
    print_cells(
        console, "Faults named, in how many periods; as good as before within three cycles",
        ("fault", "named", "in", "back"),
        [
            (name, _of(row["named"], row["to_name"]), number(row["named_periods"]),
             _of(row["recovered_soon"], row["to_recover"]))
            for name, row in faults if row["to_name"] or row["to_recover"]
        ],
    )  # fmt: skip
    timed = f"Controller: {number(summary['microseconds'])} µs per sample, median."
    say(console, "The worst:", *map(_told, summary["worst"]), KEY, timed)


def _told(row: dict[str, Any]) -> str:
    """A run in a line, its seed first."""
    what = f"  {row['seed']:>6} {row['family']}, {row['reference']}, fault {row['fault']} {row['mode']}"
    if row["failure"] is not None:
        return f"{what}: {row['failure']}"
    numbers = ("ratio", "last_ratio", "after_ratio", "rail")
    said = ", ".join(f"{name.replace('_', ' ')} {number(row[name])}" for name in numbers)
    return f"{what}: {said}; {row['driver'] or 'nobody'} drove"


def _of(count: int, runs: int) -> str:
    return f"{count}/{runs}" if runs else ""


def _crossed(console: Any, groups: list[dict[str, Any]]) -> None:
    """Families by references: runs with a ratio above 1, of all."""
    references = sorted({row["reference"] for row in groups})
    families = sorted({row["family"] for row in groups})
    cells = {(row["family"], row["reference"]): f"{row['over']}/{row['runs']}" for row in groups}
    print_cells(
        console, "Runs with a ratio above 1, of all", ("family", *map(_narrow, references)),
        [(_narrow(family), *(cells.get((family, each), "") for each in references)) for family in families],
    )  # fmt: skip


def _narrow(name: str) -> str:
    """A name with a line for each of its parts: a terminal has 80 columns."""
    return name.replace("-", "-\n")


def print_map(summary: dict[str, Any], console: Any) -> None:
    """Print shares of runs that settled within two periods, of those that are asked for."""
    changes = [name for name, _, _ in SEGMENTS]
    cells = summary["cells"]
    kept = ", ".join(f"{name} {cells['kept'][name]}" for name in changes)
    say(
        console,
        f"Cells with at least {100.0 * ENOUGH:g} % of the runs settled within {SOON} periods, of "
        f"{cells['asked']} that are asked for: {kept}. All others: {summary['others']} runs.",
    )
    for title, names in (("by_family", ("family",)), ("by_place", ("amplitude", "frequency"))):
        print_cells(
            console, f"Settled within two periods [%], and median of the periods, {title.replace('_', ' ')}",
            (*names, *changes),
            [
                (*(number(row[name]) for name in names), *(
                    f"{_percent(row[change])} ({number(row[f'{change} periods'])})" for change in changes
                ))
                for row in summary[title]
            ],
        )  # fmt: skip
    say(console, f"{summary['runs']} runs, {summary['failures']} failed.")


def print_contest(summary: dict[str, Any], console: Any) -> None:
    """Print settled errors relative to those of the best single estimator."""
    print_cells(
        console,
        f"Median settled error of {summary['seeds']} seeds [% of the amplitude], that of the best single "
        "estimator, and their ratio",
        ("family", "reference", "error", "best", "single estimator", "ratio"),
        [
            (row["family"], row["reference"], number(_hundredfold(row["settled"])),
             number(_hundredfold(row["best_settled"])), row["best"] or "", number(row["ratio"]))
            for row in summary["cells"]
        ],
    )  # fmt: skip
    say(
        console,
        f"{summary['kept']} of {len(summary['cells'])} cells within {summary['allowed']:g}; "
        f"{summary['runs']} runs, {summary['failures']} failed.",
    )


def print_dwells(summary: dict[str, Any], console: Any) -> None:
    """Print how a controller goes on after a long rest."""
    numbers = ("first", "second", "third", "largest", "excursion", "farthest")
    heads = ("runs", "kept", "first", "second", "third", "largest", "way", "longest")
    for title, names in (("groups", WAYS), ("by_family", ("family",))):
        print_cells(
            console,
            f"After a rest of {summary['duration']:g} s: largest errors over what is allowed, medians; way "
            "of the voltage in it over its swing",
            (*names, *heads),
            [
                (*(str(row[name]) for name in names), row["runs"], row["kept"],
                 *(number(row[name]) for name in numbers))
                for row in summary[title]
            ],
        )  # fmt: skip
    for row in summary["worst"]:
        with_feedback = "with" if row["feedback"] else "without"
        say(console, f"  {row['seed']} {with_feedback} feedback: {number(row['ratio'])}")
    say(
        console,
        f"As before in the first period: {summary['kept']} of {summary['runs']} runs, "
        f"{summary['failures']} failed.",
    )


def _hundredfold(value: float | None) -> float | None:
    return None if value is None else 100.0 * value


def _percent(share: float | None) -> str:
    return "—" if share is None else f"{100.0 * share:.0f}"


def number(value: Any) -> str:
    """A value with three digits; a dash for none."""
    if value is None:
        return "—"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
