"""Tables of the pages about estimators, from docs/data; no number is typed by hand."""

import re

from page_parts import NEEDS, UNSETTLED, Document, cold_start, part_of, replacements, speed_table, table

from piezoest._tables import Columns, cells_of
from piezoest.bench import report
from piezoest.bench.metrics import SETTLED
from piezoest.bench.scenarios import UNREPEATED

SOURCES = ("table", "policies")
LATE = "fewer than half of the runs settle; in parentheses, fewer than 95 % of them."


def pieces(runs: Document, policies: Document) -> dict[str, str]:
    return {
        "numbers": substitutions("table", runs)
        + substitutions("policies", policies)
        + replacements("cold", {"start": f"{cold_start(runs)} %"}),
        "overview": linked(report.overview_table(runs), UNSETTLED),
        "speed": linked(speed_table(runs), UNSETTLED),
        "needs": linked(part_of(report.needs_table(runs), NEEDS)),
        "margins": linked(report.needs_table(runs)),
        "settles": linked(settles(runs), f"{LATE} Empty: not run."),
        "scenarios": table("", ["scenario", "what happens"], runs["scenarios"].items()),
        "stages": linked(stages(runs)),
        "tuned": linked(tuned(runs)),
        "policies": linked(settles(policies), LATE),
    }


def linked(of: report.Table, dash: str = "") -> str:
    """A table whose estimators are links, but not within code; no line ends before a bracket."""
    names = re.compile(r"\b(AdaptiveFeedforward|BatchFit|MovingHorizon|\w+(?:RLS|EKF|UKF))\b")

    def link(cell: str) -> str:
        if "``" in cell:
            return cell
        return names.sub(r":class:`~piezoest.\1`", cell).replace(" (", "\N{NO-BREAK SPACE}(")

    return table("", of[0], (map(link, row) for row in of[1]), dash)


def by_estimator(document: Document, columns: list[str], cells: dict[tuple[str, str], str]) -> report.Table:
    """Cells by estimator and column, the estimator that adapts best first."""
    body = [
        [short(document["estimators"][name]["name"]), *(cells.get((name, column), "") for column in columns)]
        for name in (row["estimator"] for row in report.best_first(document) if row["typical"])
    ]
    return ["estimator", *columns], body


def settles(document: Document) -> report.Table:
    """Periods until each estimator settles, in each scenario on the first stage."""
    cells = {
        (cell["estimator"], cell["scenario"]): periods(cell["settles"])
        for cell in document["cells"]
        if cell["stage"] == document["plan"]["stages"][0]
    }
    return by_estimator(document, list(document["scenarios"]), cells)


def short(name: str) -> str:
    """Memory and policies alone, where a name is a call of the estimator that all others are too."""
    call = name.removeprefix("HysteresisRLS(")
    if call == name:
        return name
    given = call.removesuffix(")").replace("policies=(", "").replace("offset=True", "").replace("()", "")
    given = re.sub(r"\)$", "", given) if "policies=(" in call else given
    return f"``{', '.join(part for part in given.split(',') if part)}``"


def periods(quantiles: list[float | None]) -> str:
    """Median, and in parentheses what 95 % of the runs keep."""
    median, _, late = ("—" if value is None else f"{value:.0f}" for value in quantiles)
    return median if median == late else f"{median} ({late})"


def stages(document: Document) -> report.Table:
    """Settled error of each estimator on each stage, over the scenarios that repeat."""
    errors: dict[tuple[str, str], list[float]] = {}
    for cell in document["cells"]:
        if cell["scenario"] not in UNREPEATED:
            errors.setdefault((cell["estimator"], cell["stage"]), []).append(cell["settled"][0])
    cells = {key: report.percent(sorted(found)[len(found) // 2]) for key, found in errors.items()}
    return by_estimator(document, document["plan"]["stages"], cells)


def tuned(document: Document) -> report.Table:
    """What tuning chose, and what it gained on other seeds."""
    typical = {row["estimator"]: row["typical"] for row in document["overview"]}
    columns: Columns = {
        "estimator": lambda each: document["estimators"][each["default"]]["name"],
        "typical error, default": lambda each: report.percent(typical[each["default"]][0]),
        "tuned": lambda each: report.percent(typical[each["chosen"]][0]),
        "settings": lambda each: (
            f"``{'the default' if each['chosen'] == each['default'] else each['chosen']}``"
        ),
    }
    return cells_of(document["tuned"], columns)


def substitutions(prefix: str, document: Document) -> str:
    plan, conditions = document["plan"], document["conditions"]
    values = {
        "runs": document["runs"],
        "seeds": plan["seeds"],
        "level": report.percent(SETTLED) + " %",
        "slow": plan["slow_seeds"],
        "rate": f"{conditions['sample_rate']:g} Hz",
        "stages": ", ".join(plan["stages"][1:]) or "none",
        "rest": f"{conditions['rest']:g} s",
        "drift": f"{conditions['drift']:g} s",
    }
    return replacements(prefix, values, document)
