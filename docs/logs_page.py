"""Tables of the page `simulated_logs`, from docs/data/logs.json; no number is typed by hand.

Runs at the start of every Sphinx build.
"""

from collections.abc import Sequence
from typing import Any

from page_parts import DOCS, Document, made, percent, read, replacements, short, table, table_of, write_pieces

ADDED = {
    "noise": "noise",
    "creep": "creep",
    "drift": "drift",
    "jumps": "one or two jumps",
    "spikes": "spikes",
    "dropouts": "missing readings",
    "rows": "missing voltages",
    "rest": "a rest at the start",
    "delay": "a delay",
    "cycled": "a stage that was moved before",
    "beyond": "a second half of larger voltages",
}
RATIOS = {
    "best": "error / best candidate's",
    "nnls": "error / NNLS's",
    "line": "error / line's",
    "stroke": "error / stroke",
    "noise": "error / noise",
}
PART = ("near_best", "beats_nnls", "beats_line")
HEADING = [
    "logs", "refused", "near the best", "no worse than NNLS", "no worse than a line", "median error / NNLS's",
    "median error / stroke", "median coverage", "median time [s]",
]  # fmt: skip


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(DOCS / "generated" / "logs", pieces(read("logs")))


def pieces(document: Document) -> dict[str, str]:
    """Texts by the name of their file."""
    families = [{"name": "all", **document["all"]}, *document["by_family"]]
    return {
        "numbers": numbers(document),
        "families": grouped("By family of the hysteresis", "family", families),
        "voltages": grouped("By voltage", "voltage", document["by_voltage"]),
        "chosen": grouped("By the model that was chosen", "model", document["by_chosen"]),
        "added": added(document),
        "quantiles": quantiles(document),
        "coverage": coverage(document),
        "scores": scores(document),
        "worst": worst(document),
        "failures": failures(document),
    }


def numbers(document: Document) -> str:
    """Numbers that stand in sentences."""
    criteria, first = document["criteria"], document["seed"]
    return replacements(
        {
            **made("logs", document),
            "logs count": document["logs"],
            "logs clean": document["clean"],
            "logs seeds": f"{first} to {first + document['logs'] - 1}",
            "logs near": f"{criteria['near']:g}",
            "logs plays": criteria["plays"],
            "logs negligible": percent(criteria["negligible"]),
            "logs train": percent(criteria["train"]),
            "logs within": percent(least_within(document)),
        }
    )


def least_within(document: Document) -> float:
    """Part of the clean logs whose parameters are within two standard errors: of the worst parameter."""
    rows = [row["within_2"] or 0.0 for row in document["scores"] if row["logs_with"] == "clean"]
    return float(min(rows, default=0.0))


def cells(row: Document) -> list[str]:
    """What is said of a group of logs."""
    return [
        str(row["logs"]), str(row["failed"]), *(percent(row[name]) for name in PART),
        short(row["median_nnls"]), percent(row["median_stroke"]), percent(row["covered"]),
        short(row["seconds"]),
    ]  # fmt: skip


def grouped(title: str, of: str, rows: Sequence[Document]) -> str:
    """A line for each group."""
    return table(title, [of, *HEADING], [[row["name"], *cells(row)] for row in rows])


def added(document: Document) -> str:
    """With each thing that was added, and without it."""
    body = []
    for row in document["by_added"]:
        body.append([ADDED[row["name"]], *cells(row)])
        body.append(["without it", *cells(row["without"])])
    return table("By what was added", ["with", *HEADING], body)


def quantiles(document: Document) -> str:
    """Of each ratio, and of the time."""
    rows = {
        **{RATIOS[name]: each for name, each in document["quantiles"].items()},
        "time [s]": document["seconds"],
    }
    levels = list(document["seconds"])
    body = [[name, *(short(each.get(level)) for level in levels)] for name, each in rows.items()]
    return table("Quantiles over the logs", ["", *levels], body)


def coverage(document: Document) -> str:
    """Logs by the part of the readings within the interval of 95 %."""
    counts = (document["coverage"] or {"counts": {}})["counts"]
    heading = ["part of the held-out readings", "logs"]
    return table("Readings within the interval of 95 %", heading, counts.items())


def scores(document: Document) -> str:
    """Errors of parameters by their standard errors."""
    names = {"clean": "nothing that the model lacks", "all": "anything"}
    body = [
        [
            names[row["logs_with"]], row["parameter"], str(row["logs"]), percent(row["within_2"]),
            short(row["median"]), short(row["largest"]),
        ]
        for row in document["scores"]
    ]  # fmt: skip
    heading = ["added", "parameter", "logs", "within 2 standard errors", "median", "largest"]
    return table("Coleman-Hodgdon stages: errors of the parameters by their standard errors", heading, body)


def worst(document: Document) -> str:
    """The worst logs, with their seeds."""
    body = [
        [
            str(row["seed"]), row["family"], row["voltage"],
            ", ".join(f"{name} {size:.2g}" for name, size in row["added"].items()),
            row["chosen_name"], row["best_name"], *(short(row[name]) for name in ("best", "nnls", "line")),
            percent(row["stroke"]),
        ]
        for row in document["worst"]
    ]  # fmt: skip
    heading = ["seed", "family", "voltage", "added", "chosen", "best", *list(RATIOS.values())[:4]]
    return table(f"The worst {len(body)} logs", heading, body)


def failures(document: Document) -> str:
    """Logs that were refused."""
    return table_of("Logs that were refused", document["failures"], {"seed": "seed", "message": "text"})
