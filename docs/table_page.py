"""Tables of the pages about estimators, from docs/data; no number is typed by hand."""

import re

from page_parts import NEEDS, SPEED, Document, part_of, replacements, table

from piezoest.bench import report
from piezoest.bench.scenarios import UNREPEATED

SOURCES = ("table", "policies")


def pieces(runs: Document, policies: Document) -> dict[str, str]:
    return {
        "numbers": substitutions("table", runs) + substitutions("policies", policies),
        "overview": linked(report.overview_table(runs)),
        "speed": linked(part_of(report.overview_table(runs), SPEED)),
        "needs": linked(part_of(report.needs_table(runs), NEEDS)),
        "margins": linked(report.needs_table(runs)),
        "settles": linked(settles(runs)),
        "scenarios": table("", ["scenario", "what happens"], runs["scenarios"].items()),
        "stages": linked(stages(runs)),
        "tuned": linked(tuned(runs)),
        "policies": linked(settles(policies)),
    }


def linked(of: report.Table) -> str:
    """A table whose estimators are links, but not within code; no line ends before a bracket."""
    names = re.compile(r"\b(AdaptiveFeedforward|BatchFit|MovingHorizon|\w+(?:RLS|EKF|UKF))\b")
    body = [
        [
            c if "``" in c else names.sub(r":class:`~piezoest.\1`", c).replace(" (", "\N{NO-BREAK SPACE}(")
            for c in row
        ]
        for row in of[1]
    ]
    return table("", of[0], body)


def names(document: Document) -> list[str]:
    """Estimators, the one that adapts best first."""
    return [row["estimator"] for row in report.best_first(document) if row["typical"]]


def settles(document: Document) -> report.Table:
    """Periods until each estimator settles, in each scenario on the first stage."""
    scenarios, stage = list(document["scenarios"]), document["plan"]["stages"][0]
    mine = [cell for cell in document["cells"] if cell["stage"] == stage]
    cells = {(cell["scenario"], cell["estimator"]): cell for cell in mine}
    body = []
    for name in names(document):
        row = [short(document["estimators"][name]["name"])]
        for scenario in scenarios:
            cell = cells.get((scenario, name))
            row.append("" if cell is None else periods(cell["settles"]))
        body.append(row)
    return ["estimator", *scenarios], body


def short(name: str) -> str:
    """Arguments alone, where a name is a call of the estimator that all others are too."""
    call = name.removeprefix("HysteresisRLS(")
    return name if call == name else f"``{call.removesuffix(')').replace(',', ', ')}``"


def periods(quantiles: list[float | None]) -> str:
    """Median, and in parentheses what 95 % of the runs keep."""
    median, _, late = ("—" if value is None else f"{value:.0f}" for value in quantiles)
    return median if median == late else f"{median} ({late})"


def stages(document: Document) -> report.Table:
    """Settled error of each estimator on each stage, over the scenarios that repeat."""
    plan = document["plan"]
    body = []
    for name in names(document):
        row = [document["estimators"][name]["name"]]
        for stage in plan["stages"]:
            mine = [
                cell["settled"][0]
                for cell in document["cells"]
                if cell["stage"] == stage and cell["estimator"] == name and cell["scenario"] not in UNREPEATED
            ]
            row.append(report.percent(sorted(mine)[len(mine) // 2]) if mine else "")
        body.append(row)
    return ["estimator", *plan["stages"]], body


def tuned(document: Document) -> report.Table:
    """What tuning chose, and what it gained on other seeds."""
    overview = {row["estimator"]: row for row in document["overview"]}
    body = []
    for each in document["tuned"]:
        before, after = (overview[each[which]]["typical"] for which in ("default", "chosen"))
        settings = each["chosen"] if each["chosen"] != each["default"] else "the default"
        body.append(
            [
                document["estimators"][each["default"]]["name"], report.percent(before[0]),
                report.percent(after[0]), f"``{settings}``",
            ]
        )  # fmt: skip
    return ["estimator", "typical error, default", "tuned", "settings"], body


def substitutions(prefix: str, document: Document) -> str:
    plan, conditions = document["plan"], document["conditions"]
    values = {
        "minutes": f"{document['seconds'] / 60.0:.0f} minutes",
        "runs": document["runs"],
        "seeds": plan["seeds"],
        "slow": plan["slow_seeds"],
        "rate": f"{conditions['sample_rate']:g} Hz",
        "stages": ", ".join(plan["stages"][1:]) or "none",
        "rest": f"{conditions['rest']:g} s",
        "drift": f"{conditions['drift']:g} s",
    }
    return replacements(prefix, values, document)
