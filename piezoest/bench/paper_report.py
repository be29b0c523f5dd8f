"""The paper's tables beside ours, for the terminal and as rows of text for the documentation."""

from collections.abc import Iterable, Sequence
from typing import Any

from piezoest._tables import print_cells, say
from piezoest.bench.origin import machine_of
from piezoest.bench.report import Table

Entry = dict[str, Any]  # an entry of "tables" in the JSON

TITLES = {
    "I": "Table I: identified parameters for the stationary response",
    "II": "Table II: largest stationary error, linear feed-forward and hysteresis compensation",
    "III": "Table III: largest stationary error with the parameters of another amplitude",
}
WITHIN = "Numbers within their bounds"
TRANSIENTS = "Adaptation: largest error [µm] of each period, and periods until it is stationary"
HEADINGS = {
    "alpha": "α\n[1/V]", "beta": "β\n[µm/V]", "gamma": "γ\n[µm/V²]", "K": "K\n[µm/V]",
    "linear_max_error": "linear\n[µm]", "linear_relative_error": "linear\n[%]",
    "compensated_max_error": "comp.\n[µm]", "compensated_relative_error": "comp.\n[%]",
    "error_reduction": "reduction\n[%]",
}  # fmt: skip
CALIBRATION, HELD_OUT = "calibration", "held out"
KEY = "✓: the deviation from the paper is within the bound in the line below, ✗: it is not."


def use_of(entry: Entry) -> str:
    """Whether the calibration of the stage saw the number."""
    return HELD_OUT if entry["held_out"] else CALIBRATION


def table(entries: Iterable[Entry], number: str) -> Table:
    """Heading and body of Table I, II or III: for each row lines of the paper, of ours, of ratios and bounds.

    `number`: ``"I"``, ``"II"`` or ``"III"``.
    """
    mine = [entry for entry in entries if entry["table"] == number]
    quantities = list(dict.fromkeys(entry["quantity"] for entry in mine))
    body = []
    for row in dict.fromkeys(entry["row"] for entry in mine):
        cells = {entry["quantity"]: entry for entry in mine if entry["row"] == row}
        first = next(iter(cells.values()))
        ordered = [cells[quantity] for quantity in quantities]
        body += [
            [row, "paper", *(f"{entry['value']:g}" for entry in ordered)],
            [use_of(first), "ours", *(_digits(entry["ours"]) for entry in ordered)],
            ["", "ratio", *(_ratio(entry) for entry in ordered)],
            ["", "bound", *(_bound(entry) for entry in ordered)],
        ]
    return ["reference", "", *(HEADINGS[quantity] for quantity in quantities)], body


def verdict(entries: Sequence[Entry]) -> Table:
    """How many numbers are within their bounds."""
    uses = [(use_of(entry), entry["within"]) for entry in entries if entry["within"] is not None]
    body = [
        [use, str(sum(each == use for each, _ in uses)), str(sum(each == use and met for each, met in uses))]
        for use in (CALIBRATION, HELD_OUT)
    ]
    return ["rows", "numbers with a bound", "within it"], body


def transients(adaptation: Iterable[dict[str, Any]]) -> Table:
    """Largest error of the first periods, and when a row is stationary."""
    body = [
        [run["row"], run["compensation"], *(f"{error:.3f}" for error in run["max_error_um"][:3]),
         f"{run['stationary_max_error_um']:.3f}", _settling(run)]
        for run in adaptation
    ]  # fmt: skip
    return ["reference", "", "first", "second", "third", "stationary", "stationary\nafter"], body


def memories(runs: Iterable[dict[str, Any]]) -> Table:
    """What the memory of the estimator does to error and settling."""
    body = [
        [f"{run['memory_s']:g}", f"{run['memory_s'] / run['period_s']:g}",
         _digits(run["stationary_max_error_um"]), _settling(run), *map(_digits, run["parameters"])]
        for run in runs
    ]  # fmt: skip
    return ["memory\n[s]", "in\nperiods", "largest\nerror [µm]", "stationary\nafter", *"αβγ"], body


def _settling(run: dict[str, Any]) -> str:
    periods = run["settling_periods"]
    return "—" if periods is None else f"{periods} ({run['settling_s']:.1f} s)"


def print_report(document: dict[str, Any], console: Any) -> None:
    """Print the tables, the transients, the sweep and how many numbers are within their bounds."""
    for number, title in TITLES.items():
        heading, body = table(document["tables"], number)
        print_cells(console, title, heading, body, texts=(0, 1), group=4, style=_style)
    say(console, KEY)
    print_cells(console, TRANSIENTS, *transients(document["adaptation"]), texts=(0, 1))
    if document["memory"]:
        title = f"Memory of the estimator: {document['memory'][0]['row']}, hysteresis compensation"
        print_cells(console, title, *memories(document["memory"]), texts=(0, 1))
    print_cells(console, WITHIN, *verdict(document["tables"]))
    conditions = document["conditions"]
    say(
        console,
        f"Memory {conditions['memory_s']:g} s, {conditions['sample_rate_hz']:g} Hz, "
        f"seed {conditions['seed']}; {machine_of(document)}; {document['seconds']:.0f} s.",
    )


def _style(cell: str) -> str:
    ends = {"✗": "bold red", "✓": "green"}
    return ends.get(cell[-1:], "italic" if cell in (CALIBRATION, HELD_OUT) else "")


def _digits(value: float) -> str:
    """Three digits, as the paper prints them."""
    return f"{value:#.3g}".rstrip(".")


def _bound(entry: Entry) -> str:
    """Largest deviation that passes; points are those of a number in per cent."""
    bound = entry["bound"]
    if bound is None:
        return ""
    return f"±{bound:g} points" if entry["quantity"] == "error_reduction" else f"±{100.0 * bound:g} %"


def _ratio(entry: Entry) -> str:
    mark = {None: "", True: " ✓", False: " ✗"}[entry["within"]]
    return f"{entry['ratio']:.2f}{mark}"
