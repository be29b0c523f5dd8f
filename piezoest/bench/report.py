"""The table of runs for the terminal and for pages: headings and cells, in 80 columns."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from piezoest._tables import Columns, cells_of, number, print_cells, say
from piezoest.bench.metrics import DIVERGED, SETTLED
from piezoest.bench.origin import machine_of
from piezoest.bench.recorded import LEARNT
from piezoest.records.source import counted

Document = dict[str, Any]  # from `piezoest.bench.table.describe`
Cells = list[str]
Table = tuple[Cells, list[Cells]]

KEY = (
    "Largest errors in % of the amplitude. settles: periods until every further error is below "
    f"{100.0 * SETTLED:g} %, the median, and the share of runs that settle. first: in the first period after "
    "the change. settled: in the "
    "last half of the periods; the same for references that do not repeat, and on stages of other families. "
    "Geometric means over the scenarios of the medians over the seeds. step: one sample from Python."
)
LOGS_KEY = (
    f"Learnt from the first {100.0 * LEARNT:g} % of each log; errors of the prediction of the rest, in % of "
    "the amplitude. first: in the first tenth of it; largest: in all of it. Geometric means over the logs."
)
SURE = 0.05


def percent(share: float | None) -> str:
    """A share in per cent; a dash for what is not known or infinite."""
    return number(None if share is None else 100.0 * share, 2)


def on_logs(document: Document) -> bool:
    """Whether all runs are on recorded logs, which have no stage."""
    return not any(cell["stage"] for cell in document["cells"])


def best_first(document: Document) -> list[Document]:
    """Rows of the overview, the estimator that adapts best first, and last those that nothing is known of."""
    return sorted(document["overview"], key=lambda row: row["typical"][0] if row["typical"] else math.inf)


def overview_table(document: Document) -> Table:
    """Heading and a row for each estimator, the one that adapts best first."""
    rows = best_first(document)
    if on_logs(document):
        return _predicted(document, rows)
    return cells_of(
        rows,
        {
            "estimator": partial(_name, document),
            "settles": lambda row: settles(row["settles"], row["settled_runs"], row["first_runs"]),
            "first": partial(_percent, "first"),
            "settled": partial(_percent, "settled"),
            "not\nrepeated": partial(_percent, "unrepeated"),
            "other\nstages": partial(_percent, "others"),
            "step\n[µs]": lambda row: number(document["estimators"][row["estimator"]].get("step_us"), 2),
        },
    )


def _name(document: Document, row: Document) -> str:
    return str(document["estimators"][row["estimator"]]["name"])


def _percent(quantity: str, row: Document) -> str:
    return percent(row[quantity][0] if row[quantity] else None)


def settles(quantiles: Sequence[float | None] | None, settled: int, runs: int) -> str:
    """Periods until a run settles, and how many of a hundred runs do."""
    median = "—" if quantiles is None or quantiles[0] is None else f"{quantiles[0]:.0f}"
    return f"{median} ({100 * settled // max(runs, 1)} %)"


def scenario_table(document: Document, scenario: str, stage: str) -> Table:
    """Heading and a row for each estimator in one scenario on one stage."""
    cells = [cell for cell in document["cells"] if cell["scenario"] == scenario and cell["stage"] == stage]
    cells.sort(key=lambda cell: cell["typical"][0])
    if not stage:
        return _predicted(document, cells)
    numbers = {name: partial(_percent, name) for name in ("first", "settled", "worst")}
    when = {"settles": lambda cell: settles(cell["settles"], cell["settled_runs"], cell["runs"])}
    return cells_of(cells, {"estimator": partial(_name, document), **when, **numbers})


def _predicted(document: Document, rows: Sequence[Document]) -> Table:
    """Heading and a row for each estimator, on one log or on all."""
    errors = {"first": partial(_percent, "first"), "largest": partial(_percent, "settled")}
    return cells_of(rows, {"estimator": partial(_name, document), **errors})


def needs_table(document: Document) -> Table:
    """Heading and a row for each need: what to take, and what cannot be told from it."""
    heading = ["you have or want", "take", "error\n[%]", "the next", "times\nas much"]
    body = []
    for need in document["needs"]:
        names = {row["estimator"]: document["estimators"][row["estimator"]]["name"] for row in need["order"]}
        best, *others = need["order"]
        # Who did not run everywhere is not named as being as good everywhere.
        alike = [names[row["estimator"]] for row in others if row["p"] >= SURE and row["everywhere"]]
        worse = [row for row in others if row["p"] < SURE and row["ratio"][0] >= 1.0]
        body.append(
            [
                need["words"],
                " or ".join([names[best["estimator"]], *alike]),
                percent(best["value"][0]),
                names[worse[0]["estimator"]] if worse else "—",
                number(worse[0]["ratio"][0] / best["ratio"][0], 2) if worse else "—",
            ]
        )
    return heading, body


def print_table(document: Document, console: Any) -> None:
    """Print a campaign."""
    plan, count = document["plan"], len(document["scenarios"])
    if logs := on_logs(document):
        title, rate = counted(count, "log"), ""
    else:
        title = f"{counted(count, 'scenario')}, {counted(plan['seeds'], 'seed')}, stage {plan['stages'][0]}"
        rate = f" at {document['conditions']['sample_rate']:g} Hz"
    print_cells(console, title, *overview_table(document))
    names = document["estimators"]
    say(
        console,
        LOGS_KEY if logs else KEY,
        f"{counted(document['runs'], 'run')}{rate}; {machine_of(document)}.",
        *(
            f"{names[row['estimator']]['name']}: {row['diverged']} of {row['runs']} runs diverge."
            for row in document["overview"]
            if row["diverged"]
        ),
    )
    if any(row["diverged"] for row in document["overview"]):
        say(
            console,
            f"A run diverges if it fails, or if its largest error exceeds {DIVERGED:g} times that of "
            + ("a straight line." if logs else "linear feed-forward after the first period."),
        )
    failed = [*document["failures"], *document["tracebacks"]]
    say(console, *(f"failed: {failure}" for failure in failed), style="red")


def print_changes(document: Document, console: Any, *, everything: bool = False) -> None:
    """Print what `piezoest bench compare` found. `document`: from `piezoest.bench.compare.compare`."""
    shown = [row for row in document["rows"] if everything or row["verdict"] in ("better", "worse")]
    if shown:
        columns: Columns = {
            "scenario, estimator": lambda row: f"{row['scenario']}, {row['estimator']}",
            "number": "quantity",
            "changed": lambda row: f"{row['changed']}/{row['pairs']}",
            "B/A": lambda row: number(row["ratio"]),
            "q": lambda row: number(row["q"], 2),
            "verdict": "verdict",
        }
        print_cells(console, "B against A", *cells_of(shown, columns))
    counts = ", ".join(f"{count} {verdict}" for verdict, count in document["counts"].items())
    pairs = f"{document['pairs']} pairs of runs; of {len(document['rows'])} comparisons {counts or 'none'}."
    say(console, pairs, *document["notes"])
