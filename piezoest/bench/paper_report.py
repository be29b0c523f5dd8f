"""The paper's tables beside ours, for the terminal and as rows of text for the documentation."""

from collections.abc import Iterable
from typing import Any

from piezoest._tables import print_cells, say
from piezoest.bench.report import Cells

Entry = dict[str, Any]  # an entry of "tables" in the JSON

TITLES = {
    "I": "Table I: identified parameters for the stationary response",
    "II": "Table II: largest stationary error, linear feed-forward and hysteresis compensation",
    "III": "Table III: largest stationary error with the parameters of another amplitude",
}
TRANSIENTS = "Adaptation: largest error [µm] of each period, and periods until it is settled"
HEADINGS = {
    "alpha": "α\n[1/V]", "beta": "β\n[µm/V]", "gamma": "γ\n[µm/V²]", "K": "K\n[µm/V]",
    "linear_max_error": "linear\n[µm]", "linear_relative_error": "linear\n[%]",
    "compensated_max_error": "comp.\n[µm]", "compensated_relative_error": "comp.\n[%]",
    "error_reduction": "reduction\n[%]",
}  # fmt: skip
CALIBRATION, HELD_OUT = "calibration", "held out"
KEY = "✓ within its bound, ✗ outside; numbers without a mark have none."


def use_of(entry: Entry) -> str:
    """Whether the calibration of the stage saw the number."""
    return HELD_OUT if entry["held_out"] else CALIBRATION


def table(entries: Iterable[Entry], number: str) -> tuple[Cells, list[Cells]]:
    """Heading and body of Table I, II or III: for each row a line of the paper, of ours, of the ratios.

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
        ]
    return ["reference", "", *(HEADINGS[quantity] for quantity in quantities)], body


def verdict(entries: list[Entry]) -> list[str]:
    """How many numbers are within their bounds, and which are not, as sentences."""
    sentences = []
    for name in (CALIBRATION, HELD_OUT):
        bounded = [entry for entry in entries if entry["within"] is not None and use_of(entry) == name]
        met = sum(entry["within"] for entry in bounded)
        sentences.append(f"{name.capitalize()}: {met} of {len(bounded)} numbers within their bounds.")
    sentences += [_miss(entry) for entry in entries if entry["within"] is False]
    return sentences


def transients(adaptation: Iterable[dict[str, Any]]) -> tuple[Cells, list[Cells]]:
    """Heading and body: largest error of the first periods, and when a row has settled."""
    heading = ["reference", "", "first", "second", "third", "stationary", "settled\nafter"]
    body = [
        [
            run["row"],
            run["compensation"],
            *(f"{error:.3f}" for error in run["max_error_um"][:3]),
            f"{run['stationary_max_error_um']:.3f}",
            _settling(run),
        ]
        for run in adaptation
    ]
    return heading, body


def memories(runs: Iterable[dict[str, Any]]) -> tuple[Cells, list[Cells]]:
    """Heading and body: what the memory of the estimator does to error and settling."""
    heading = ["memory\n[s]", "in\nperiods", "largest\nerror [µm]", "settled\nafter", "α", "β", "γ"]
    body = [
        [
            f"{run['memory_s']:g}",
            f"{run['memory_s'] / run['period_s']:g}",
            _digits(run["stationary_max_error_um"]),
            _settling(run),
            *(_digits(value) for value in run["parameters"]),
        ]
        for run in runs
    ]
    return heading, body


def _settling(run: dict[str, Any]) -> str:
    periods = run["settling_periods"]
    return "—" if periods is None else f"{periods} ({run['settling_s']:.1f} s)"


def print_report(document: dict[str, Any], console: Any) -> None:
    """Print the tables, the transients, the sweep and the verdict."""
    for number, title in TITLES.items():
        heading, body = table(document["tables"], number)
        print_cells(console, title, heading, body, texts=(0, 1), group=3, style=_style)
    say(console, KEY)
    print_cells(console, TRANSIENTS, *transients(document["adaptation"]), texts=(0, 1))
    if document["memory"]:
        title = f"Memory of the estimator: {document['memory'][0]['row']}, hysteresis compensation"
        print_cells(console, title, *memories(document["memory"]), texts=(0, 1))
    conditions, machine = document["conditions"], document["machine"]
    say(
        console,
        *verdict(document["tables"]),
        f"Memory {conditions['memory_s']:g} s, {conditions['sample_rate_hz']:g} Hz, "
        f"seed {conditions['seed']}; {machine['cpu']}, {machine['cores']} cores, {machine['python']}; "
        f"{document['seconds']:.0f} s.",
    )


def _style(cell: str) -> str:
    ends = {"✗": "bold red", "✓": "green"}
    return ends.get(cell[-1:], "italic" if cell in (CALIBRATION, HELD_OUT) else "")


def _digits(value: float) -> str:
    """Three digits, as the paper prints them."""
    return f"{value:#.3g}".rstrip(".")


def _ratio(entry: Entry) -> str:
    mark = {None: "", True: " ✓", False: " ✗"}[entry["within"]]
    return f"{entry['ratio']:.2f}{mark}"


def _miss(entry: Entry) -> str:
    bound, deviation = entry["bound"], entry["deviation"]
    if entry["quantity"] == "error_reduction":
        size = f"{deviation:+.1f} points, bound {bound:g}"
    else:
        size = f"{100.0 * deviation:+.0f} %, bound {100.0 * bound:g} %"
    heading = HEADINGS[entry["quantity"]].split("\n")[0]
    return f"Outside ({use_of(entry)}): {entry['row']}, {heading}: {size}."
