"""Tables and numbers of the page `safety`, from docs/data/safety.json."""

from page_parts import Document, of_all, percent, replacements, shown, table, table_of

from piezoest._tables import Columns
from piezoest.bench.zoo.report import DWELLS, WORST
from piezoest.bench.zoo.words import CHANGES, CRITERIA, DRAWN, MODES, SPANS, fault

GROUPS = {"all": "all", "healthy": "healthy", "often": "called often"}
WHO = {
    "controller": "controller", "no_corridor": "without corridor", "line": "without candidates",
    "parts": "by hand",
}  # fmt: skip
PLACE = {"amplitude [µm]": "amplitude", "frequency [Hz]": "frequency"}

NO_RUN = "no such run."

TOLD: Columns = {
    "fault": fault,
    "right name": lambda row: of_all(row["named"], row["to_name"]),
    "after [periods]": "named_periods",
    "as before in the first cycle": lambda row: of_all(row["recovered_first"], row["to_recover"]),
    "in the first three": lambda row: of_all(row["recovered_soon"], row["to_recover"]),
}
DWELL: Columns = {"creep": "creep", "feedback": "feedback", "noise": "noise", **DWELLS}


def pieces(document: Document) -> dict[str, str]:
    mine = document["controller"]
    return {
        "numbers": numbers(document),
        "drawn": drawn(document["drawn"]),
        "violations": violations(document),
        "quantiles": quantiles(document),
        "found": found(document),
        "by_fault": by(document, "fault", "fault", modes(mine["by_mode"])),
        "by_mechanics": by(document, "mechanics", "mechanics"),
        "by_often": by(document, "often", "called often"),
        "crossed": crossed(mine),
        "worst": table_of("The worst runs of the controller", mine["worst"], WORST),
        "told": table_of(
            "Faults that got their right name, and errors that were as before",
            (row for row in mine["by_mode"] if row["to_name"] or row["to_recover"]),
            TOLD,
            "it is not judged: a fault without a name, one that lasts until the end, or too few cycles.",
        ),
        **settling(document),
        "singles": singles(document["singles"]),
        "dwell": table_of("After a long rest", (document["dwell"] or {"groups": []})["groups"], DWELL),
    }


def numbers(document: Document) -> str:
    criteria, first, runs = document["criteria"], document["seed"], document["runs"]
    broken = document["controller"]["all"]["violations"]
    values = {
        "share": percent(broken["ratio"] / runs),
        "share at the end": percent(broken["last_ratio"] / runs),
        "runs": runs,
        "others": document["others"],
        "seeds": f"{first} to {first + runs - 1}",
        "worst seed": document["controller"]["worst"][0]["seed"],
        "late": f"1/{1.0 / criteria['late']:g}",
        **{name: percent(criteria[name]) for name in ("swing", "settled", "slow", "enough")},
        **{name: f"{criteria[name]:g}" for name in ("line", "noise", "calls", "back", "soon", "large")},
    }
    return replacements("safety", values, document)


def drawn(of: Document) -> str:
    """Names with their runs, and spans of numbers."""
    body = [
        (title, "; ".join(f"{MODES.get(each, each)} {n}" for each, n in of[name].items()))
        for name, title in DRAWN.items()
    ]
    body += [(title, " to ".join(map(shown, of["spans"][name]))) for name, title in SPANS.items()]
    title = "What is drawn: names with their runs, or smallest and largest number"
    return table(title, ["quantity", "drawn"], body)


def groups(document: Document) -> list[tuple[list[str], Document]]:
    """Whose runs are shown, and what is said of them."""
    shown = [("controller", name) for name in GROUPS] + [(who, "all") for who in list(WHO)[1:]]
    return [([WHO[who], GROUPS[name]], document[who][name]) for who, name in shown]


def violations(document: Document) -> str:
    """Counts of each criterion that some run breaks."""
    broken = [name for name in CRITERIA if any(of["violations"][name] for _, of in groups(document))]
    body = [
        who + [f"{of['violations'][name]}/{of['judged' if 'ratio' in name else 'runs']}" for name in broken]
        for who, of in groups(document)
    ]
    title = "Runs that break a promise, of the runs that are judged by it"
    return table(title, ["", "runs", *(CRITERIA[name] for name in broken)], body)


def quantiles(document: Document) -> str:
    """Quantiles of the ratio over the whole run and of that of the last cycle."""
    body = [
        [*who, title, *of["quantiles"][name].values()]
        for who, of in groups(document)
        for name, title in (("ratio", "whole run"), ("last_ratio", "last cycle"))
    ]
    levels = document["controller"]["all"]["quantiles"]["ratio"]
    return table("Quantiles of the ratio", ["", "runs", "ratio", *levels], body)


def cell(row: Document | None) -> str:
    """Median of the ratio, and runs above 1."""
    return f"{shown(row['ratio'])}; {row['over']}/{row['judged']}" if row and row["judged"] else "—"


def above(row: Document | None) -> str:
    """Share of runs above 1, without its unit."""
    return f"{100.0 * row['over'] / row['judged']:.0f}" if row and row["judged"] else "—"


def by(document: Document, column: str, name: str, more: Columns | None = None) -> str:
    """The controller beside the straight line alone."""
    line = {row[column]: row for row in document["line"][f"by_{column}"]}
    beside = {"without candidates": lambda row: cell(line.get(row[column]))}
    columns = {name: column, "controller": cell, **(more or {}), **beside}
    title = f"By {name}: median of the ratio; runs above 1"
    return table_of(title, document["controller"][f"by_{column}"], columns, NO_RUN)


def modes(rows: list[Document]) -> Columns:
    """A column of the controller's ratio for each time of a fault."""
    cells = {(row["fault"], row["mode"]): cell(row) for row in rows}
    return {said: lambda row, mode=mode: cells.get((row["fault"], mode), "—") for mode, said in MODES.items()}


def crossed(mine: Document) -> str:
    """Share of runs above 1 of each family with each reference."""
    rows = {(row["family"], row["reference"]): row for row in mine["by_family_and_reference"]}
    below = {row["reference"]: row for row in mine["by_reference"]}
    body = [
        [row["family"], *(above(rows.get((row["family"], each))) for each in below), above(row)]
        for row in mine["by_family"]
    ]
    last = [
        "all",
        *map(above, below.values()),
        above(mine["all"] | {"over": mine["all"]["violations"]["ratio"]}),
    ]
    title = "By family and reference: runs with a ratio above 1, in % of all"
    return table(title, ["family", *below, "all"], [*body, last], NO_RUN)


def found(document: Document) -> str:
    """One line for each of the other questions."""
    rows = document["controller"]["by_mode"]
    asked, named, left, recovered = (
        sum(row[name] for row in rows) for name in ("to_name", "named", "to_recover", "recovered_soon")
    )
    lines = {
        "faults that got their right name": (named, asked),
        "errors as before within three cycles after a fault": (recovered, left),
    }
    if rested := document["dwell"]:
        lines["errors as before in the first period after a rest"] = rested["kept"], rested["runs"]
    if alone := document["singles"]:
        title = f"cells with a settled error of at most {alone['allowed']:g} times that of the best estimator"
        lines[title] = alone["kept"], len(alone["cells"])
    if cells := document["map"] and document["map"]["cells"]:
        kept = {f"cells that settle soon: {title}": cells["kept"][name] for name, title in CHANGES.items()}
        lines |= {title: (count, cells["asked"]) for title, count in kept.items()}
    return table(
        "The other questions, in short", ["", "yes"], ([name, of_all(*of)] for name, of in lines.items())
    )


def settling(document: Document) -> dict[str, str]:
    """Share of runs that settled soon after each change, by family and by place of the map."""
    shares: Columns = {each: lambda row, name=name: percent(row[name]) for name, each in CHANGES.items()}
    texts = {}
    for part in ("by_family", "by_place", "other_places"):
        rows = document["map"][part] if document["map"] else []
        asked = "not required" if part == "other_places" else "required"
        title = f"Runs that settled within {document['criteria']['soon']} periods, where this is {asked}"
        names = {"family": "family"} if part == "by_family" else PLACE
        texts[f"map_{part}"] = table_of(title, rows, {**names, "runs": "runs", **shares})
    return texts


def singles(alone: Document | None) -> str:
    """Settled errors, and their ratios to those of the best single estimator."""
    cells = {
        (row["family"], row["reference"]): f"{percent(row['settled'])}; {shown(row['ratio'])}"
        for row in (alone["cells"] if alone else [])
    }
    families, references = (list(dict.fromkeys(key[k] for key in cells)) for k in (0, 1))
    body = [[family, *(cells.get((family, each), "—") for each in references)] for family in families]
    title = (
        "Settled error (last three cycles) relative to the amplitude; its ratio to that of the best estimator"
    )
    return table(title, ["family", *references], body, NO_RUN)
