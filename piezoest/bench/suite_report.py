"""A campaign for the terminal."""

from __future__ import annotations

from typing import Any

from piezoest.bench.campaign import OTHER_STAGE

Row = dict[str, Any]

KEY = (
    "Medians over the seeds, in the overview also over the scenarios. Settled: largest error of the last "
    "three periods; worst: after the change; both in % of the amplitude. Settles: until every further error "
    "is below 1.2 % of the amplitude; settled runs: those that did, of all. Cost: of the estimator in the "
    "ring, processor time of a sample."
)
HEADINGS = ("settled", "worst", "settles", "runs settled", "cost")
UNITS = ("%", "%", "s", "", "µs")


def print_overview(document: dict[str, Any], console: Any, *, scenarios: bool = False) -> None:
    """Print a row for each estimator.

    Parameters
    ----------
    document : dict
        From `piezoest.bench.suite.describe`.
    console : rich.console.Console
        To print on.
    scenarios : bool
        A table for each scenario too.
    """
    if scenarios:
        for name, said in document["scenarios"].items():
            rows = [row for row in document["summary"] if row["scenario"].removesuffix(OTHER_STAGE) == name]
            _print(console, f"{name}: {said}", [(row["estimator"], _scenario_cells(row)) for row in rows])
    title = f"{len(document['scenarios'])} scenarios, {len(document['seeds'])} seeds"
    _print(console, title, [(row["estimator"], _overview_cells(row)) for row in document["overview"]])
    machine = document["machine"]
    for line in (
        KEY,
        f"{document['runs']} runs at {document['settings']['sample_rate']:g} Hz, the dwell "
        f"{document['settings']['rest']:g} s and the drift {document['settings']['drift']:g} s long; "
        f"{machine['cpu']}, {machine['cores']} cores, {machine['python']}.",
    ):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    for failure in document["failures"]:
        console.print(f"failed: {failure}", style="red", highlight=False, markup=False, soft_wrap=True)


Table = tuple[list[str], list[list[str]]]


def overview_table(document: dict[str, Any]) -> Table:
    """Heading and a row for each estimator.

    Parameters
    ----------
    document : dict
        From `piezoest.bench.suite.describe`.
    """
    return _table([(row["estimator"], _overview_cells(row)) for row in document["overview"]])


def scenario_table(rows: list[Row]) -> Table:
    """Heading and a row for each estimator in one scenario.

    Parameters
    ----------
    rows : list of dict
        Those of the scenario, from `piezoest.bench.campaign.summarise`.
    """
    return _table([(row["estimator"], _scenario_cells(row)) for row in rows])


def described(document: dict[str, Any], scenario: str) -> str:
    """What a scenario of the summary is, on whichever stage.

    Parameters
    ----------
    document : dict
        From `piezoest.bench.suite.describe`.
    scenario : str
        As the summary's rows name it.
    """
    return str(document["scenarios"].get(scenario.removesuffix(OTHER_STAGE), ""))


def _table(rows: list[tuple[str, list[str]]]) -> Table:
    units = [f"{title}\n[{unit}]" if unit else title for title, unit in zip(HEADINGS, UNITS, strict=True)]
    return ["estimator", *units], [[name, *cells] for name, cells in rows]


def _print(console: Any, title: str, rows: list[tuple[str, list[str]]]) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, show_edge=False)
    table.add_column("estimator")
    for heading in HEADINGS:
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_row("", *UNITS, style="dim", end_section=True)
    for name, cells in rows:
        table.add_row(name, *cells)
    console.print(table)


def _overview_cells(row: Row) -> list[str]:
    return [
        percent(row["settled_max"]), percent(row["worst_error"]), number(row["settling_time"]),
        f"{row['settled']}/{row['runs']}", number(row["microseconds"]),
    ]  # fmt: skip


def _scenario_cells(row: Row) -> list[str]:
    amplitude = row["amplitude"]
    parts = [
        None if row[name]["median"] is None else row[name]["median"] / amplitude
        for name in ("settled_max", "worst_error")
    ]
    cost = row.get("microseconds", {"median": None})
    return [
        *map(percent, parts), number(row["settling_time"]["median"]),
        f"{row['settled']}/{row['runs']}", number(cost["median"]),
    ]  # fmt: skip


def percent(share: float | None) -> str:
    """A share in per cent, three significant digits; a dash for what is not known or infinite."""
    return number(None if share is None else 100.0 * share)


def number(value: float | None) -> str:
    """Three significant digits, as a plain number; a dash for what is not known or infinite."""
    if value is None:
        return "—"
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def print_changes(document: dict[str, Any], console: Any, *, everything: bool = False) -> None:
    """Print what `piezoest bench compare` found.

    Parameters
    ----------
    document : dict
        From `piezoest.bench.changes.compare`.
    console : rich.console.Console
        To print on.
    everything : bool
        What did not change too.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    shown = [row for row in document["rows"] if everything or row["verdict"] in ("better", "worse")]
    if shown:
        table = Table(title="B against A", title_justify="left", box=SIMPLE_HEAD, show_edge=False)
        for heading in ("scenario", "estimator", "number"):
            table.add_column(heading)
        for heading in ("changed", "B/A", "p", "q", "verdict"):
            table.add_column(heading, justify="right", no_wrap=True)
        for row in shown:
            style = {"better": "green", "worse": "red"}.get(row["verdict"])
            ratio = "—" if row["ratio"] is None else f"{row['ratio']:.3f}"
            chances = ("—" if row[name] is None else f"{row[name]:.2g}" for name in ("p", "q"))
            changed = f"{row['changed']}/{row['pairs']}"
            names = row["scenario"], row["estimator"], row["quantity"]
            table.add_row(*names, changed, ratio, *chances, row["verdict"], style=style)
        console.print(table)
    counts = ", ".join(f"{count} {verdict}" for verdict, count in document["counts"].items())
    for line in (
        f"{document['pairs']} pairs of runs; of {len(document['rows'])} comparisons {counts or 'none'}.",
        *document["notes"],
    ):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
