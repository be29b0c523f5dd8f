"""Results of a benchmark as one page of HTML with interactive plots, from the JSON alone."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from piezoest import _extras
from piezoest._checks import dictionary
from piezoest.bench import adaptation_report, paper_report, suite_report
from piezoest.bench.adaptation import SOON
from piezoest.report import Page

Document = dict[str, Any]
Row = dict[str, Any]

# Colours that stay apart for those who see few of them (Okabe and Ito), behind them plotly's own.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8B4513", "#000000")
REFERENCE = "linear feed-forward"


def write_html(document: Document, path: str | Path) -> None:
    """Write a result of `piezoest bench` as one page that needs no network.

    Parameters
    ----------
    document : dict
        What the command writes with ``--json``. Suites without a page of their own are shown by their rows.
    path : str or Path
        File to write; an existing one is replaced.

    Raises
    ------
    ValueError
        If the document names no suite.
    ImportError
        If plotly, of the extra ``report``, is not installed.
    OSError
        If the file cannot be written.
    """
    suite = document.get("suite")
    if suite is None:
        raise ValueError("document has no suite: pass what piezoest bench writes with --json")
    suite = str(suite)
    page = Page(TITLES.get(suite, f"piezoest bench {suite}"), _origin(document))
    PAGES.get(suite, _any)(page, document)
    versions = ", ".join(f"{name} {version}" for name, version in document.get("versions", {}).items())
    page.footer(f"{_origin(document)} {versions}")
    page.write(path)


def _origin(document: Document) -> str:
    machine, seeds = document.get("machine", {}), document.get("seeds")
    parts = [
        str(document.get("date", ""))[:10],
        str(machine.get("cpu", "")),
        f"{machine['cores']} cores" if "cores" in machine else "",
        str(machine.get("python", "")),
        "" if seeds is None else f"seeds: {len(seeds) if hasattr(seeds, '__len__') else seeds}",
        f"{document['seconds']:.0f} s" if "seconds" in document else "",
    ]
    return ", ".join(text for text in parts if text) + "."


def _go() -> Any:
    return _extras.load("plotly.graph_objects", "report", "an HTML report")


def _colours(names: Iterable[str]) -> dict[str, str]:
    """One colour for each name, grey for linear feed-forward."""
    distinct = [name for name in dict.fromkeys(names) if name != REFERENCE]
    return {REFERENCE: "#8a8f98", **dict(zip(distinct, itertools.cycle(COLOURS), strict=False))}


# ---------------------------------------------------------------- adaptation


def _adaptation(page: Page, document: Document) -> None:
    rows, criteria = document["summary"], document["criteria"]
    if criteria:
        met = sum(bool(criterion["met"]) for criterion in criteria)
        page.cards([(f"{met} of {len(criteria)}", "criteria of the default estimator met")])
    colours = _colours(row["estimator"] for row in rows)
    page.heading("Error against cost in transients")
    page.text(
        "Of each estimator and scenario the medians over the seeds: farther left is better once settled, "
        "farther down is better on the way."
    )
    page.plot(
        _scatter(rows, colours, "settled_max", "worst_error", "settled error [µm]", "worst error [µm]"), 460
    )
    for name in dict.fromkeys(row["scenario"] for row in rows):
        page.heading(name)
        page.text(document["scenarios"].get(name, ""))
        mine = [row for row in rows if row["scenario"] == name]
        if any(row.get("transient") for row in mine):
            page.plot(_transients(mine, colours), 380)
        _summary_table(page, mine)
    page.heading("What is asked of the default estimator")
    page.table(
        ("criterion", "value", "bound", "met"),
        [
            (
                criterion["what"],
                "none" if criterion["value"] is None else f"{criterion['value']:.3g}",
                f"{'≥' if criterion['least'] else '≤'} {criterion['bound']:g}",
                "✓" if criterion["met"] else "✗",
            )
            for criterion in criteria
        ],
    )
    page.advice(f"Failed: {failure}" for failure in document["failures"])
    page.text("Of each number in the tables the median and the 95 % quantile over the seeds.")
    page.text(adaptation_report.KEY[1])


def _summary_table(page: Page, rows: Sequence[Row]) -> None:
    heading = ["estimator", f"settled\n≤ {SOON} periods"]
    heading += [title for title, _, _ in adaptation_report.COLUMNS] + ["diverged"]
    page.table(
        heading, [[cell.replace("\n", " · ") for cell in adaptation_report.cells(row)] for row in rows]
    )


def _scatter(
    rows: Sequence[Row], colours: dict[str, str], across: str, up: str, x_title: str, y_title: str
) -> Any:
    figure = _go().Figure()
    for estimator in dict.fromkeys(row["estimator"] for row in rows):
        mine = [row for row in rows if row["estimator"] == estimator and row[across]["median"]]
        figure.add_scatter(
            x=[row[across]["median"] for row in mine],
            y=[row[up]["median"] for row in mine],
            text=[row["scenario"] for row in mine],
            mode="markers",
            marker={"size": 10, "color": colours[estimator]},
            name=estimator,
            hovertemplate="%{text}<br>%{x:.3g}, %{y:.3g}<extra>" + estimator + "</extra>",
        )
    _logarithmic(figure.update_xaxes, x_title)
    _logarithmic(figure.update_yaxes, y_title)
    return figure


def _transients(rows: Sequence[Row], colours: dict[str, str]) -> Any:
    figure = _go().Figure()
    for row in rows:
        errors = row.get("transient") or []
        figure.add_scatter(
            x=list(range(1, len(errors) + 1)),
            y=[value if value and math.isfinite(value) else None for value in errors],
            mode="lines+markers",
            marker={"size": 5},
            line={"color": colours[row["estimator"]], "width": 2, "dash": row.get("dash", "solid")},
            name=row["estimator"],
        )
    longest = max((len(row.get("transient") or []) for row in rows), default=0)
    figure.update_xaxes(title_text="period", tickformat="d", dtick=1 if longest <= 20 else None)
    _logarithmic(figure.update_yaxes, "largest error [µm]")
    return figure


def _logarithmic(update: Callable[..., Any], title: str) -> None:
    # With a format of its own a tick between decades shows its number, not its first digit alone.
    update(type="log", title_text=title, dtick="D2", tickformat="~g")


# ---------------------------------------------------------------- the suite


def _campaign(page: Page, document: Document) -> None:
    rows = document["summary"]
    page.text(
        f"{document['runs']} runs at {document['settings']['sample_rate']:g} Hz on the "
        f"{document['settings']['stage']} stage."
    )
    page.table(*suite_report.overview_table(document))
    page.text(suite_report.KEY)
    page.advice(f"Failed: {failure}" for failure in document["failures"])
    colours = _colours(row["estimator"] for row in rows)
    page.heading("Error against cost")
    page.text(
        "Medians over scenarios and seeds: farther left is cheaper, farther down is better once settled."
    )
    page.plot(_costs(document["overview"], colours), 460)
    page.heading("Error settled against error in transients")
    page.text("Of each estimator and scenario the medians over the seeds. A click on a name hides it.")
    page.plot(
        _scatter(rows, colours, "settled_max", "worst_error", "settled error [µm]", "worst error [µm]"), 460
    )
    for name in dict.fromkeys(row["scenario"] for row in rows):
        mine = [row for row in rows if row["scenario"] == name]
        page.heading(name)
        page.text(suite_report.described(document, name))
        if any(row["transient"] for row in mine):
            page.plot(_transients(mine, colours), 420)
        page.table(*suite_report.scenario_table(mine))


def _costs(overview: Sequence[Row], colours: dict[str, str]) -> Any:
    """Of each estimator whose cost and error are known; linear feed-forward has none."""
    figure = _go().Figure()
    for row in overview:
        if row["microseconds"] and row["settled_max"]:
            figure.add_scatter(
                x=[row["microseconds"]], y=[100.0 * row["settled_max"]], mode="markers",
                name=row["estimator"], marker={"size": 12, "color": colours[row["estimator"]]},
            )  # fmt: skip
    _logarithmic(figure.update_xaxes, "a sample [µs]")
    _logarithmic(figure.update_yaxes, "settled error [% of the amplitude]")
    return figure


# ---------------------------------------------------------------- estimators


def _estimators(page: Page, document: Document) -> None:
    rows = [row for row in document["rows"] if row["failure"] is None]
    scenario = document["scenario"]
    page.text(
        f"{scenario['stage']}: a {scenario['signal']} of {scenario['amplitude_um']:g} µm at "
        f"{scenario['frequency_hz']:g} Hz for {scenario['seconds']:g} s, all at "
        f"{scenario['sample_rate']:g} Hz, from the same wrong parameters."
    )
    page.table(
        (
            "estimator",
            "settled\n[µm]",
            "settles\n[periods]",
            "run\n[µs]",
            "step\n[µs]",
            "longest\n[µs]",
            "kB",
        ),
        [
            (
                row["name"],
                f"{row['settled_error']:.4f}",
                "never" if row["settling_periods"] is None else f"{row['settling_periods']}",
                *(_short(row[f"{what}_microseconds"]) for what in ("run", "step", "longest_step")),
                _short(None if row["memory_bytes"] is None else row["memory_bytes"] / 1e3),
            )
            for row in rows
        ],
    )
    page.advice(f"{row['name']} failed: {row['failure']}" for row in document["rows"] if row["failure"])
    colours = _colours(row["name"] for row in rows)
    page.heading("Error against cost")
    cost = _go().Figure()
    for row in rows:
        cost.add_scatter(
            x=[row["step_microseconds"]], y=[row["settled_error"]], mode="markers", name=row["name"],
            marker={"size": 12, "color": colours[row["name"]]},
        )  # fmt: skip
    _logarithmic(cost.update_xaxes, "one step [µs]")
    _logarithmic(cost.update_yaxes, "settled error [µm]")
    page.plot(cost, 460)
    page.heading("Adaptation")
    page.plot(
        _transients([{"estimator": row["name"], "transient": row["errors"]} for row in rows], colours), 440
    )


# ---------------------------------------------------------------- paper


def _paper(page: Page, document: Document) -> None:
    for sentence in paper_report.verdict(document["tables"]):
        page.text(sentence)
    page.heading("Ours over the paper's")
    page.plot(_ratios(document["tables"]), 440)
    for number, title in paper_report.TITLES.items():
        page.heading(title)
        page.table(*paper_report.table(document["tables"], number))
    page.text(paper_report.KEY)
    page.heading(paper_report.TRANSIENTS)
    names = [f"{run['row']}, {run['compensation']}" for run in document["adaptation"]]
    lines = [
        {
            "estimator": name,
            "transient": run["max_error_um"],
            "dash": "dot" if run["compensation"] == "linear" else "solid",
        }
        for name, run in zip(names, document["adaptation"], strict=True)
    ]
    rows = _colours(run["row"] for run in document["adaptation"])
    colours = {name: rows[name.rsplit(", ", 1)[0]] for name in names}
    page.plot(_transients(lines, colours), 460)
    page.table(*paper_report.transients(document["adaptation"]))
    if document["memory"]:
        page.heading("Memory of the estimator")
        figure = _go().Figure()
        figure.add_scatter(
            x=[run["memory_s"] for run in document["memory"]],
            y=[run["stationary_max_error_um"] for run in document["memory"]],
            mode="lines+markers", line={"color": COLOURS[0]}, name="largest stationary error",
        )  # fmt: skip
        _logarithmic(figure.update_xaxes, "memory [s]")
        _logarithmic(figure.update_yaxes, "largest error [µm]")
        page.plot(figure, 380)
        page.table(*paper_report.memories(document["memory"]))


def _ratios(entries: Sequence[Row]) -> Any:
    figure = _go().Figure()
    for i, held_out in enumerate((False, True)):
        mine = [entry for entry in entries if entry["held_out"] == held_out and entry["ratio"]]
        figure.add_scatter(
            x=[entry["ratio"] for entry in mine],
            y=[paper_report.HEADINGS[entry["quantity"]].replace("\n", " ") for entry in mine],
            text=[f"Table {entry['table']}, {entry['row']}" for entry in mine],
            mode="markers",
            marker={"size": 9, "color": COLOURS[i], "symbol": "diamond" if held_out else "circle"},
            name=paper_report.HELD_OUT if held_out else paper_report.CALIBRATION,
        )
    figure.add_vline(x=1.0, line_color="#8a8f98")
    figure.update_xaxes(title_text="ours / the paper's")
    return figure


# ---------------------------------------------------------------- suites without a page of their own


def _any(page: Page, document: Document) -> None:
    """Every list of flat rows as a table, and as bars of its first number by its first words."""
    for key, rows in document.items():
        match rows:
            case [{**first}, *rest] if all(map(dictionary, rest)):
                sorts = {str(name): _sort(value) for name, value in first.items()}
            case _:
                continue
        columns = [name for name, sort in sorts.items() if sort != "nested"]
        words = [name for name in columns if sorts[name] == "word"]
        numbers = [name for name in columns if sorts[name] == "number"]
        page.heading(key.replace("_", " "))
        if words and numbers:
            figure = _go().Figure()
            figure.add_bar(
                x=[" · ".join(str(row.get(name, "")) for name in words[:2]) for row in rows],
                y=[row.get(numbers[0]) for row in rows],
                marker_color=COLOURS[0],
                name=numbers[0],
            )
            figure.update_yaxes(title_text=numbers[0].replace("_", " "))
            page.plot(figure, 380)
        page.table(
            [name.replace("_", " ") for name in columns],
            [[_cell(row.get(name)) for name in columns] for row in rows],
        )


def _sort(value: Any) -> str:
    """What a value of JSON is to a table."""
    match value:
        case dict() | list():
            return "nested"
        case str():
            return "word"
        case None | bool():
            return "mark"
    return "number"


def _cell(value: Any) -> str:
    if _sort(value) == "mark":
        return {None: "—", True: "✓", False: "✗"}[value]
    return _short(value) if _sort(value) == "number" else str(value)


def _short(value: float | None) -> str:
    """Three significant digits, and whole numbers in full."""
    if value is None or not math.isfinite(value):
        return "—"
    return f"{value:.0f}" if type(value) is int or abs(value) >= 100.0 else f"{value:.3g}"


PAGES: dict[str, Callable[[Page, Document], None]] = {
    "adaptation": _adaptation,
    "campaign": _campaign,
    "estimators": _estimators,
    "paper": _paper,
}
TITLES = {"campaign": "piezoest bench"}
