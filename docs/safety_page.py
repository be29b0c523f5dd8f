"""Tables and sentences of the page `safety`, from docs/data/safety.json; no number is typed by hand.

Runs at the start of every Sphinx build; by itself: python docs/safety_page.py
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from paper_page import table, write_pieces
from safety_more_page import besides, dwell, of_all, places, singles, told
from which_estimator_page import listed, percent, replacements, short

DOCS = Path(__file__).resolve().parent
SOURCE = DOCS / "data" / "safety.json"
TARGET = DOCS / "generated" / "safety"

Document = dict[str, Any]

GROUPS = {"all": "all", "healthy": "healthy", "often": "called often"}
WHO = {
    "controller": "controller", "no_corridor": "without corridor", "line": "without candidates",
    "parts": "by hand",
}  # fmt: skip
CRITERIA = {
    "failed": "raised an error",
    "not finite": "a voltage that is not finite",
    "outside the limits": "a voltage outside its limits",
    "rests at a limit": "rests at a limit without need",
    "ratio": "ratio above 1",
    "cycle_ratio": "ratio above 1 in any one cycle",
    "last_ratio": "ratio above 1 in the last cycle",
}
RATIOS = {"ratio": "after two swings", "cycle_ratio": "any one cycle", "last_ratio": "last cycle"}
FAMILIES = {
    "backlash": "a play, and a dead zone behind it",
    "bouc-wen": "Bouc-Wen, with the power and the roundness of its loop drawn",
    "coleman-hodgdon": "Coleman-Hodgdon",
    "duhem": "Duhem, another law up than down",
    "paper": "the plays of :class:`PaperStage`, stretched",
    "preisach": "plays under a bell, as :class:`PreisachStage`",
    "relays": "a Preisach plane of relays, whose density does not separate",
}
# Whose estimators learn the very model; the others are nobody's.
RELATED = {
    "coleman-hodgdon": "Coleman-Hodgdon estimators",
    "paper": "play estimators",
    "preisach": "play estimators",
}
FAULTS = {
    "none": "a healthy rig",
    "amplifier-frozen": "the amplifier holds its last voltage",
    "stage-stuck": "the stage stands still",
    "sensor-constant": "the gauge repeats its last reading",
    "sensor-noise": "the gauge gives nothing but noise",
    "sensor-saturated": "the gauge ends inside the swing",
    "sensor-factor": "the gauge reads a thousand times too much or too little, or with the wrong sign",
    "zero-off": "the gauge's zero is off by 20 µm or the whole stroke",
    "zero-off-shifted": "the same, and the reference goes along",
    "spikes": "single readings that are far off",
    "dropouts": "readings that are missing here and there",
    "gap": "no readings at all",
    "hum": "50 Hz on the readings",
    "drift": "the stage drifts",
    "gain-step": "the stage's gain changes by 30 %",
    "amplitude-drop": "the reference becomes small",
    "glitch": "the very first reading is wrong",
    "dwell": "the reference rests",
}  # fmt: skip
FEWEST = 5  # runs of which a share says something
NAMED = 3  # of what fails most


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(json.loads(SOURCE.read_text(encoding="utf-8"))))


def pieces(document: Document) -> dict[str, str]:
    """Texts by the name of their file."""
    return {
        "numbers": numbers(document),
        "families": families(document),
        "drawn": drawn(document),
        "verdict": "".join(f"- {sentence}\n" for sentence in verdict(document)),
        "violations": violations(document),
        "quantiles": quantiles(document),
        "faults": faults(document),
        "told": told(document),
        "map": places(document, "by_family", "family"),
        "places": places(document, "by_place", "amplitude", "frequency"),
        "other_places": places(document, "other_places", "amplitude", "frequency"),
        "singles": singles(document),
        "dwell": dwell(document),
        "controller": crossed(document, "controller"),
        "line": crossed(document, "line"),
        "mechanics": mechanics(document),
        "worst": worst(document),
        "show": show(document),
    }


def numbers(document: Document) -> str:
    """Numbers that stand in sentences."""
    machine, criteria = document["machine"], document["criteria"]
    first, runs = document["seed"], document["runs"]
    return replacements(
        {
            "safety runs": runs,
            "safety seeds": f"{first} to {first + runs - 1}",
            "safety families": len(document["drawn"]["family"]),
            "safety date": document["date"][:10],
            "safety machine": f"{machine['cpu']}, {machine['cores']} cores, {machine['python']}",
            "safety line": f"{criteria['line']:g}",
            "safety noise": f"{criteria['noise']:g}",
            "safety swing": f"{100.0 * criteria['swing']:g} %",
            "safety calls": f"{criteria['calls']:g}",
            "safety late": f"1/{1.0 / criteria['late']:g}",
            "safety others": document["others"],
            "safety back": f"{criteria['back']:g}",
            "safety soon": criteria["soon"],
            "safety settled": percent(criteria["settled"]),
            "safety slow": percent(criteria["slow"]),
            "safety large": f"{criteria['large']:g}",
        }
    )


def families(document: Document) -> str:
    """Families of the hysteresis, and which estimators know them."""
    body = [
        [name, FAMILIES.get(name, ""), RELATED.get(name, "none"), str(runs)]
        for name, runs in document["drawn"]["family"].items()
    ]
    return table("Families of the hysteresis", ["family", "what it is", "of the family of", "runs"], body)


def drawn(document: Document) -> str:
    """Everything else that is drawn."""
    of = document["drawn"]
    units = {
        "amplitude": ("amplitude of the reference", "µm"), "frequency": ("its frequency", "Hz"),
        "gain": ("gain", "µm/V"), "width": ("width of the loop over the reach, of its stroke", ""),
        "sample_rate": ("sample rate", "Hz"), "delay": ("delay of the readings", "samples"),
        "block": ("samples handed over at a time", ""), "sensor_noise": ("noise of the readings", "µm"),
        "creep": ("creep in a decade of time, of the displacement", ""),
    }  # fmt: skip
    names = {
        "limits": "limits of the voltage [V]", "mechanics": "mechanics", "reference": "reference",
        "mode": "fault there",
    }  # fmt: skip
    body = [
        [title, "; ".join(f"{each}: {runs}" for each, runs in of[name].items())]
        for name, title in names.items()
    ]
    body += [
        [title, f"{short(of['spans'][name][0])} to {short(of['spans'][name][1])} {unit}".strip()]
        for name, (title, unit) in units.items()
    ]
    return table("What else was drawn: names with their runs, numbers from least to largest",
                 ["what", "drawn"], body)  # fmt: skip


def share(row: Document) -> float | None:
    """Part of the judged runs with a ratio above 1."""
    return row["over"] / row["judged"] if row["judged"] else None


def verdict(document: Document) -> list[str]:
    """Whether the promise is kept and where it is not, in sentences."""
    mine = document["controller"]
    said = [hard(mine["all"])]
    over = mine["all"]["violations"]["ratio"]
    if not over:
        said.append(
            f"No ratio of the {mine['all']['judged']} runs that are judged is above 1: as to errors the "
            "promise is kept here. That is no proof for rigs that were not drawn."
        )
        return said + besides(document)
    counts = {name: of_all(mine[name]["violations"]["ratio"], mine[name]["judged"]) for name in GROUPS}
    said.append(
        f"**The promise is not kept yet.** The ratio is above 1 in {counts['all']} runs; on healthy rigs in "
        f"{counts['healthy']}, and where the controller is called often in {counts['often']}. The largest "
        f"ratio is {short(mine['all']['quantiles']['ratio']['100 %'])}."
    )
    said.append(
        "What counts in the long run is the last cycle: there it is above 1 in "
        f"{of_all(mine['all']['violations']['last_ratio'], mine['all']['judged'])} runs, on healthy rigs in "
        f"{of_all(mine['healthy']['violations']['last_ratio'], mine['healthy']['judged'])}."
    )
    others = [
        f"{title} in {of_all(document[who]['all']['violations']['ratio'], document[who]['all']['judged'])}"
        for who, title in WHO.items()
        if who != "controller"
    ]
    said.append(f"Of the others the ratio is above 1: {listed(others)}.")
    for title, column in (
        ("fault", "fault"), ("family", "family"), ("reference", "reference"), ("mechanics", "mechanics"),
    ):  # fmt: skip
        if found := most([row for row in mine[f"by_{column}"] if row[column] != "none"], column):
            said.append(f"By {title} it fails most often with {listed(found)}.")
    return said + besides(document)


def hard(group: Document) -> str:
    """What must never happen, of a group of runs."""
    broken = group["violations"]
    hard = ("failed", "not finite", "outside the limits", "rests at a limit")
    found = [f"{CRITERIA[name]}: {broken[name]}" for name in hard if broken[name]]
    if found:
        return f"Of {group['runs']} runs some broke what must never break: {listed(found)}."
    return (
        f"In all {group['runs']} runs the voltage is finite and within its limits, rests at none of them "
        "without need, and no error is raised."
    )


def most(rows: Sequence[Document], column: str) -> list[str]:
    """Where the share above 1 is largest, of what has been drawn a few times."""
    known = [row for row in rows if row["judged"] >= FEWEST and row["over"]]
    known.sort(key=lambda row: row["over"] / row["judged"], reverse=True)
    return [f"*{row[column]}* ({row['over']} of {row['judged']})" for row in known[:NAMED]]


def violations(document: Document) -> str:
    """Counts of each criterion."""
    body = []
    for who, title in WHO.items():
        for group, which in GROUPS.items():
            of = document[who][group]
            counts = (
                f"{of['violations'][name]}/{of['judged' if 'ratio' in name else 'runs']}" for name in CRITERIA
            )
            body.append([title, which, *counts])
    heading = ["", "runs", *CRITERIA.values()]
    return table("Runs that violate a criterion, of all that are judged by it", heading, body)


def quantiles(document: Document) -> str:
    """Quantiles of the ratio, and of that of the last cycle."""
    body = [
        [WHO[who], GROUPS[group], title, *map(short, document[who][group]["quantiles"][name].values())]
        for who in WHO
        for group in GROUPS
        for name, title in RATIOS.items()
    ]
    levels = list(document["controller"]["all"]["quantiles"]["ratio"])
    return table("Quantiles of the ratio", ["", "runs", "ratio", *levels], body)


def faults(document: Document) -> str:
    """Median and share above 1 for each fault, and when it came."""
    modes = {(row["fault"], row["mode"]): row for row in document["controller"]["by_mode"]}
    line = {row["fault"]: row for row in document["line"]["by_fault"]}
    body = []
    for row in document["controller"]["by_fault"]:
        name = row["fault"]
        body.append(
            [
                name, FAULTS.get(name, ""), str(row["judged"]), short(row["median"]), percent(share(row)),
                *(counted(modes.get((name, mode))) for mode in ("from-start", "transient", "permanent")),
                cell(line.get(name)),
            ]
        )  # fmt: skip
    heading = [
        "fault", "what it is", "runs", "median", "above 1", "from the start", "for a time", "for good",
        "line: median; above 1",
    ]  # fmt: skip
    return table("By fault: median of the ratio, and runs above 1", heading, body)


def counted(row: Document | None) -> str:
    return f"{row['over']}/{row['judged']}" if row and row["judged"] else "—"


def crossed(document: Document, who: str) -> str:
    """Median, and share above 1, for each family under each reference."""
    rows = {
        (row["family"], row["reference"]): row for row in document[who]["by_family_and_reference"]
    }  # fmt: skip
    totals = {row["family"]: row for row in document[who]["by_family"]}
    below = {row["reference"]: row for row in document[who]["by_reference"]}
    references = list(below)
    body = [
        [family, *(cell(rows.get((family, each))) for each in references), cell(totals[family])]
        for family in totals
    ]
    body.append(["all", *(cell(below[each]) for each in references), ""])
    title = f"By family and reference, {WHO[who]}: median of the ratio; runs above 1"
    return table(title, ["family", *references, "all"], body)


def cell(row: Document | None) -> str:
    return f"{short(row['median'])}; {counted(row)}" if row and row["judged"] else "—"


def mechanics(document: Document) -> str:
    """Median and share above 1 for each kind of mechanics, and by how often the controller is called."""
    body = []
    for column, title in (("mechanics", "mechanics: {}"), ("often", "called often: {}")):
        line = {row[column]: row for row in document["line"][f"by_{column}"]}
        for row in document["controller"][f"by_{column}"]:
            word = {True: "yes", False: "no"}.get(row[column], row[column])
            body.append([title.format(word), cell(row), percent(share(row)), cell(line.get(row[column]))])
    heading = ["runs with", "median; above 1", "above 1", "line: median; above 1"]
    return table("By mechanics, and by how often the controller is called", heading, body)


def worst(document: Document) -> str:
    """The worst runs, with their seeds."""
    body = [
        [
            str(row["seed"]), row["family"], row["reference"],
            row["fault"] if row["fault"] == "none" else f"{row['fault']}, {row['mode']}",
            *(short(row[name]) for name in ("ratio", "last_ratio", "after_ratio", "rail")),
            row["driver"] or "—", row["failure"] or "",
        ]
        for row in document["controller"]["worst"]
    ]  # fmt: skip
    heading = [
        "seed", "family", "reference", "fault", "ratio", "last cycle", "after the fault",
        "at a limit [quarter swings]", "drove last", "error",
    ]  # fmt: skip
    others = "".join(
        f"- {title}: "
        + ", ".join(f"{row['seed']} ({short(row['ratio'])})" for row in document[who]["worst"])
        + "\n"
        for who, title in WHO.items()
        if who != "controller"
    )
    mine = table(f"The worst {len(body)} runs of the controller", heading, body)
    return f"{mine}\nThe worst of the others, seeds with their ratios:\n\n{others}"


def show(document: Document) -> str:
    """The command that draws the worst run."""
    seed = document["controller"]["worst"][0]["seed"]
    return f".. code-block:: bash\n\n   piezoest bench safety --show {seed}\n"


if __name__ == "__main__":
    write()
