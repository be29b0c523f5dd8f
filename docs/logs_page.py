"""Tables of the page `simulated_logs`, from docs/data/logs.json; no number is typed by hand."""

from page_parts import Document, percent, replacements, table, table_of

from piezoest._tables import Columns

ADDED = {
    "noise": "noise", "creep": "creep", "drift": "drift", "jumps": "one or two jumps", "spikes": "spikes",
    "dropouts": "missing readings", "rows": "missing voltages", "rest": "a rest at the start",
    "delay": "a delay", "cycled": "a stage that was moved before",
    "beyond": "a second half of larger voltages",
}  # fmt: skip
RATIOS = {
    "best": "error / best candidate's", "nnls": "error / NNLS's", "line": "error / line's",
    "stroke": "error / stroke", "noise": "error / noise",
}  # fmt: skip
# What is said of a group of logs.
PART: Columns = {
    "logs": "logs",
    "refused": "failed",
    "near the best": lambda row: percent(row["near_best"]),
    "no worse than NNLS": lambda row: percent(row["beats_nnls"]),
    "no worse than a line": lambda row: percent(row["beats_line"]),
    "median error / NNLS's": "median_nnls",
    "median error / stroke": lambda row: percent(row["median_stroke"]),
    "median coverage": lambda row: percent(row["covered"]),
    "median time [s]": "seconds",
}
TIMES: Columns = {
    "fit": "fit",
    "time [s]": lambda row: f"{row['seconds']:.3g}{' ✗' * (row['seconds'] > row['asked'])}",
    "target [s]": lambda row: f"at most {row['asked']:g}",
}
GROUPS = {"clean": "nothing that the model lacks", "all": "anything"}
SCORES: Columns = {
    "added": lambda row: GROUPS[row["logs_with"]],
    "parameter": "parameter",
    "logs": "logs",
    "within 2 standard errors": lambda row: percent(row["within_2"]),
    "median": "median",
    "largest": "largest",
}
WORST: Columns = {
    "seed": "seed", "stage, voltage": lambda row: f"{row['family']}, {row['voltage']}",
    "added": lambda row: ", ".join(f"{name} {size:.2g}" for name, size in row["added"].items()),
    "chosen": "chosen_name", "best": "best_name",
    RATIOS["best"]: "best",
    RATIOS["stroke"]: lambda row: percent(row["stroke"]),
}  # fmt: skip


def pieces(document: Document) -> dict[str, str]:
    scores = "Coleman-Hodgdon stages: errors of the parameters by their standard errors"
    quantiles = {RATIOS[name]: each for name, each in document["quantiles"].items()}
    quantiles["time [s]"] = document["seconds"]
    levels = list(document["seconds"])
    return {
        "numbers": numbers(document),
        "quantiles": table(
            "Quantiles over the logs",
            ["", *levels],
            ([name, *map(each.get, levels)] for name, each in quantiles.items()),
        ),
        "coverage": table(
            "Readings within the interval of 95 %",
            ["part of the held-out readings", "logs"],
            (document["coverage"] or {"counts": {}})["counts"].items(),
        ),
        "scores": table_of(scores, document["scores"], SCORES),
        "times": table_of("Time of a fit of 50 000 samples, on one core", document["times"], TIMES),
        "worst": table_of(f"The worst {len(document['worst'])} logs", document["worst"], WORST),
        "failures": table_of(
            "Logs that were refused", document["failures"], {"seed": "seed", "message": "text"}
        ),
        **groups(document),
    }


def groups(document: Document) -> dict[str, str]:
    """Tables of parts of the logs."""
    families = [{"name": "all", **document["all"]}, *document["by_family"]]
    added = [
        {**part, "name": name}
        for row in document["by_added"]
        for name, part in ((ADDED[row["name"]], row), ("without it", row["without"]))
    ]
    parts = {
        "families": ("By family of the hysteresis", "family", families),
        "voltages": ("By voltage", "voltage", document["by_voltage"]),
        "chosen": ("By the model that was chosen", "model", document["by_chosen"]),
        "added": ("By what was added", "with", added),
    }
    return {name: table_of(title, rows, {of: "name", **PART}) for name, (title, of, rows) in parts.items()}


def numbers(document: Document) -> str:
    criteria, first = document["criteria"], document["seed"]
    # Of the clean logs, whose parameters are within two standard errors: of the worst parameter.
    within = [row["within_2"] or 0.0 for row in document["scores"] if row["logs_with"] == "clean"]
    values = {
        "count": document["logs"],
        "clean": document["clean"],
        "seeds": f"{first} to {first + document['logs'] - 1}",
        "near": f"{criteria['near']:g}",
        "plays": criteria["plays"],
        "negligible": percent(criteria["negligible"]),
        "train": percent(criteria["train"]),
        "within": percent(min(within, default=0.0)),
    }
    return replacements("logs", values, document)
