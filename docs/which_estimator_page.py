"""Tables and sentences of the pages `which_estimator` and `adaptation_speed`, from docs/data.

No number is typed by hand. Runs at the start of every Sphinx build; by itself:
python docs/which_estimator_page.py
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from page_parts import percent, replacements, short, table, write_pieces

from piezoest.bench.cases import Conditions

DOCS = Path(__file__).resolve().parent
DATA = DOCS / "data"
RANKING, SPEED = DOCS / "generated" / "which_estimator", DOCS / "generated" / "adaptation_speed"
LINEAR = "linear feed-forward"
SURE = 0.05  # p below which a first place is not shared with the second
WORST_SHOWN = 3

Document = dict[str, Any]


def write(app: Any = None) -> None:
    """Write what the pages include."""
    ranking, suite = (
        json.loads((DATA / f"{name}.json").read_text(encoding="utf-8")) for name in ("ranking", "suite")
    )
    write_pieces(RANKING, ranking_pieces(ranking))
    write_pieces(SPEED, speed_pieces(suite))


# ---------------------------------------------------------------- which estimator?


def ranking_pieces(document: Document) -> dict[str, str]:
    """Texts by the name of their file."""
    return {
        "short": "".join(f"- {sentence}\n" for sentence in in_short(document)),
        "needs": needs_table(document),
        "overall": overall_table(document),
        "bad_at": "".join(f"- {sentence}\n" for sentence in bad_at(document)),
        "tuned": tuned_table(document),
        "numbers": ranking_numbers(document),
    }


def in_short(document: Document) -> list[str]:
    """What the figures come down to."""
    lines = [line for line in document["overall"] if line["name"] != LINEAR]
    linear = next(line for line in document["overall"] if line["name"] == LINEAR)
    best = lines[0]
    cheapest = min(lines, key=lambda line: line["step_microseconds"] or float("inf"))
    close = min(
        (line for line in lines if line["step_microseconds"] <= 2.0 * cheapest["step_microseconds"]),
        key=lambda line: line["adapting"],
    )
    sentences = [
        f"``{best['name']}`` adapts best over all scenarios: a typical error of {percent(best['adapting'])} "
        f"of the amplitude, where linear feed-forward has {percent(linear['adapting'])}. A step takes "
        f"{short(best['step_microseconds'])} µs from Python."
    ]
    if close["name"] != best["name"]:
        sentences.append(
            f"``{close['name']}`` is the best of those that cost about as little as any, "
            f"{short(close['step_microseconds'])} µs a step, with {percent(close['adapting'])}."
        )
    behind = [line["name"] for line in lines if not line["efficient"]]
    if behind:
        sentences.append(
            "Another one is at least as good in every error and cheaper at the same time than "
            + listed([f"``{name}``" for name in behind])
            + "."
        )
    diverged = {line["name"]: line["diverged"] for line in lines if line["diverged"]}
    if diverged:
        said = listed([f"``{name}`` {count} times" for name, count in diverged.items()])
        sentences.append(
            f"Worse than one and a half times linear feed-forward, somewhere within a run: {said}. "
            "The supervisor of the ring was off."
        )
    return sentences


def needs_table(document: Document) -> str:
    """What to take when, with figures."""
    said = {"mean_error": "typical error", "settled_max": "settled error", "worst_error": "worst error"}
    body = []
    for need in document["needs"]:
        first, second = need["order"][0], need["order"][1]
        shared = need["p"] is None or need["p"] >= SURE
        body.append(
            [
                need["need"],
                f"``{first['name']}``" + (f" or ``{second['name']}``" if shared else ""),
                said[need["quantity"]],
                percent(first["value"]),
                f"{second['name']}: {percent(second['value'])}",
                percent(need["linear"]),
            ]
        )
    heading = ["you have or want", "take", "compared by", "it has", "the next", "linear"]
    return table("Errors in % of the amplitude", heading, body)


def overall_table(document: Document) -> str:
    """One row for each estimator."""
    heading = [
        "estimator", "typical", "settled", "worst", "settles, s", "runs that settle", "step, µs", "run, µs",
        "efficient",
    ]  # fmt: skip
    body = [
        [
            line["name"], percent(line["adapting"]), percent(line["settled"]), percent(line["worst"]),
            short(line["settling_time"]), f"{line['runs_settled']} of {line['runs']}",
            short(line["step_microseconds"]), short(line["run_microseconds"]),
            "yes" if line["efficient"] else "",
        ]
        for line in document["overall"]
    ]  # fmt: skip
    return table("Tuned, and judged on other seeds", heading, body)


def bad_at(document: Document) -> list[str]:
    """A sentence for each estimator."""
    said = {"settled_max": "settled error", "worst_error": "worst error"}
    sentences = []
    for name, all_of_them in document["weaknesses"].items():
        errors = [each for each in all_of_them if each["scenario"] is not None][:WORST_SHOWN]
        costs = [each for each in all_of_them if each["scenario"] is None]
        words = [
            f"*{each['scenario']}* ({said[each['quantity']]} {times(each['ratio'])} that of "
            f"``{each['best_name']}``)"
            for each in errors
        ]
        sentence = f"``{name}``: {listed(words)}" if words else f"``{name}``: nothing stands out"
        if costs:
            sentence += f"; a step costs {times(costs[0]['ratio'])} that of ``{costs[0]['best_name']}``"
        line = next(line for line in document["overall"] if line["name"] == name)
        if line["runs_settled"] < line["runs"]:
            sentence += f"; {line['runs'] - line['runs_settled']} of {line['runs']} runs never settle"
        sentences.append(f"{sentence}.")
    return sentences


def tuned_table(document: Document) -> str:
    """What was chosen for each."""
    body = [
        [
            each["name"], f"``{each['chosen']}``", percent(each["default_score"]),
            percent(each["chosen_score"]), str(len(each["trials"])),
        ]
        for each in document["candidates"]
    ]  # fmt: skip
    heading = ["estimator", "chosen", "default's typical error", "chosen one's", "tried"]
    return table("On the training runs", heading, body)


def ranking_numbers(document: Document) -> str:
    """Substitutions for numbers that stand in sentences."""
    budget, machine = document["budget"], document["machine"]
    judging, training = budget["judging"], budget["training"]
    return replacements(
        {
            "rank date": document["date"][:10],
            "rank machine": f"{machine['cpu']}, {machine['cores']} cores, {machine['python']}",
            "draws": budget["draws"],
            "training scenarios": listed([f"*{name}*" for name in budget["training_scenarios"]]),
            "training seeds": len(budget["training_seeds"]),
            "training periods": f"{training['after']} periods",
            "judged seeds": len(budget["seeds"]),
            "slow seeds": len(budget["slow_seeds"]),
            "slow ones": listed([f"``{each['name']}``" for each in document["candidates"] if each["slow"]]),
            "judged scenarios": len({row["scenario"] for row in document["summary"]}),
            "other scenarios": listed([f"*{name}*" for name in budget["other_scenarios"]]),
            "rank rate": f"{judging['sample_rate']:g} Hz",
            "rank update": f"{1e3 / (Conditions().frequency * judging['updates']):g} ms",
            "rank rest": f"{judging['rest']:g} s",
            "rank drift": f"{judging['drift']:g} s",
        }
    )


# ---------------------------------------------------------------- adaptation speed compared


def speed_pieces(document: Document) -> dict[str, str]:
    """Texts by the name of their file."""
    settings, machine = document["settings"], document["machine"]
    return {
        "times": times_table(document),
        "firsts": "".join(f"- {sentence}\n" for sentence in firsts(document)),
        "numbers": replacements(
            {
                "suite date": document["date"][:10],
                "suite machine": f"{machine['cpu']}, {machine['cores']} cores, {machine['python']}",
                "suite runs": document["runs"],
                "suite seeds": len(document["seeds"]),
                "suite rate": f"{settings['sample_rate']:g} Hz",
                "suite rest": f"{settings['rest']:g} s",
                "suite drift": f"{settings['drift']:g} s",
            }
        ),
    }


def times_table(document: Document) -> str:
    """Median settling time of each estimator in each scenario [s]."""
    names = [LINEAR, *(name for name in document["estimators"] if name != LINEAR)]
    values = {(row["scenario"], row["estimator"]): row for row in document["summary"]}
    body = []
    for name in names:
        cells = [name]
        for scenario in document["scenarios"]:
            row = values[scenario, name]
            cells.append(short(row["settling_time"]["median"]))
        body.append(cells)
    return table("Settling time [s], median over the seeds", ["estimator", *document["scenarios"]], body)


def firsts(document: Document) -> list[str]:
    """Who is best in each scenario, over its whole transient."""
    sentences = []
    for scenario, said in document["scenarios"].items():
        rows = [
            row for row in document["summary"] if row["scenario"] == scenario and row["estimator"] != LINEAR
        ]
        linear = next(
            row for row in document["summary"] if row["scenario"] == scenario and row["estimator"] == LINEAR
        )
        best = min(rows, key=lambda row: row["mean_error"]["median"] or float("inf"))
        value, of = best["mean_error"]["median"], linear["mean_error"]["median"]
        sentences.append(
            f"*{scenario}*. {said} ``{best['estimator']}``: {1e3 * value:.3g} nm typically, "
            f"linear feed-forward {1e3 * of:.3g} nm."
        )
    return sentences


# ---------------------------------------------------------------- words


def listed(words: Sequence[str]) -> str:
    """As in a sentence: a, b and c."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def times(ratio: float | None) -> str:
    """How many times as much."""
    return (
        "beyond all bounds of"
        if ratio is None
        else f"{ratio:.0f} times"
        if ratio >= 10
        else f"{ratio:.1f} times"
    )


if __name__ == "__main__":
    write()
