"""The benchmark of adaptation for the terminal."""

from __future__ import annotations

from typing import Any

from piezoest.bench.adaptation import SOON

Row = dict[str, Any]

COLUMNS = (
    ("settles", "settling_periods", 0),
    ("worst", "worst_error", 2),
    ("settled", "settled_max", 4),
    ("/linear", "ratio", 3),
    ("/linear", "worst_ratio", 2),
    ("moved", "excursion", 2),
)
UNITS = ("", f"≤ {SOON}", "periods", "µm", "µm", "settled", "worst", "", "")
KEY = (
    "Of each number the median and below it the 95 % quantile over the seeds.",
    f"≤ {SOON}: part of the runs that settled within so many periods. Settles: periods until every "
    "further error is below 1.2 % of the amplitude. Worst: largest error after the change. Settled: that "
    "of the last three periods. /linear: over linear feed-forward's in the same run; settled, and in the "
    "worst period but the first. Moved: largest deviation of a parameter from its final value, relative to "
    "it. Diverged: largest error after the first period above 1.5 times linear feed-forward's.",
)


def print_report(document: dict[str, Any], console: Any) -> None:
    """Print a table for each scenario, and the criteria.

    Parameters
    ----------
    document : dict
        What `piezoest bench adaptation --json` writes.
    console : rich.console.Console
        To print on.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    for name in dict.fromkeys(row["scenario"] for row in document["summary"]):
        title = f"{name}: {document['scenarios'][name]}"
        table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=0, show_edge=False)
        table.add_column("estimator", no_wrap=True)
        for heading in ("settled", *(column[0] for column in COLUMNS), "diverged"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_row(*UNITS, style="dim", end_section=True)
        for row in document["summary"]:
            if row["scenario"] == name:
                table.add_row(*cells(row))
        console.print(table)
    for line in (
        *KEY,
        f"{document['seeds']} seeds at {document['conditions'].get('sample_rate', 50e3):g} Hz; "
        f"{document['machine']['cpu']}, {document['machine']['cores']} cores, "
        f"{document['machine']['python']}; {document['seconds']:.0f} s.",
    ):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    for criterion in document["criteria"]:
        console.print(_sentence(criterion), highlight=False, soft_wrap=True)
    for failure in document["failures"]:
        console.print(f"failed: {failure}", style="red", highlight=False, markup=False, soft_wrap=True)


def cells(row: Row) -> list[str]:
    """Cells of a scenario's row in the table."""
    numbers = [_pair(row[quantity], digits) for _, quantity, digits in COLUMNS]
    settled = f"{100.0 * row['settled_soon']:.0f} %"
    # Two lines each, so there is room for the arguments below the name.
    name = row["estimator"].replace("(", "\n(", 1)
    return [name, settled, *numbers, f"{row['diverged']}/{row['runs']}"]


def _pair(values: dict[str, float | None], digits: int) -> str:
    return "\n".join("—" if value is None else _number(value, digits) for value in values.values())


def _number(value: float, digits: int) -> str:
    """With so many digits after the point, fewer where it is large: six characters at most."""
    if value >= 1e4:
        return f"{value:.0e}"
    return f"{value:.{min(digits, 4 if value < 10.0 else 2 if value < 1000.0 else 0)}f}"


def _sentence(criterion: Row) -> str:
    mark = "[green]✓[/green]" if criterion["met"] else "[bold red]✗[/bold red]"
    value = "none" if criterion["value"] is None else f"{criterion['value']:.3g}"
    side = "at least" if criterion["least"] else "at most"
    return f"{mark} {criterion['what']}: {value} ({side} {criterion['bound']:g})"
