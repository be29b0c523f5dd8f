"""The page *Beyond the paper*: its verdicts follow from its data."""

from __future__ import annotations

import copy
import importlib
import json
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def criteria(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("beyond_criteria").criteria


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    return importlib.import_module("beyond_page")


def document() -> dict[str, Any]:
    return dict(json.loads((ROOT / "docs" / "data" / "beyond.json").read_text(encoding="utf-8")))


def verdict(found: list[dict[str, Any]], where: str, what: str) -> bool:
    return next(bool(each["met"]) for each in found if each["where"] == where and what in each["what"])


def test_verdicts_are_those_of_the_data(criteria: Any) -> None:
    assert document()["criteria"] == criteria(document())


def numbers(given: dict[str, Any], part: str, case: str) -> Any:
    return next(
        row["numbers"] for row in given[part] if row["case"] == case and row["stage"] == "PreisachStage"
    )


@pytest.mark.parametrize(
    ("part", "case", "name", "level", "bad", "what"),
    [
        ("settled", "PRBS", "PrandtlIshlinskiiRLS_left", "worst", 0.11, "PRBS"),
        ("settled", "triangle 5 µm 5 Hz", "PrandtlIshlinskiiRLS_left", "worst", 0.06, "triangle 5 µm 5 Hz"),
        ("scenarios", "prbs", "PrandtlIshlinskiiRLS_diverged", "sum", 1.0, "diverged"),
        ("scenarios", "gain-step", "PrandtlIshlinskiiRLS_late", "mean", 0.1, "gain-step"),
        ("faults", "spikes", "broken", "sum", 1.0, "out of bounds"),
        ("faults", "gap", "last_um", "worst", None, "can recover"),
    ],
)
def test_a_worse_number_turns_its_verdict(
    criteria: Any, part: str, case: str, name: str, level: str, bad: float | None, what: str
) -> None:
    given = document()
    assert verdict(criteria(given), "PreisachStage", what)
    changed = copy.deepcopy(given)
    numbers(changed, part, case)[name][level] = bad
    assert not verdict(criteria(changed), "PreisachStage", what)
    assert verdict(criteria(changed), "recording", "first half")


def test_the_page_says_what_the_data_say(page: Any) -> None:
    given = document()
    numbers(given, "settled", "PRBS")["PrandtlIshlinskiiRLS_left"]["worst"] = 0.123
    given["criteria"][0] |= {"met": False, "value": 0.5, "unit": "%"}
    made = page.pieces(given)
    assert '"87.7 %"' in made["settled"]
    assert '"50.0 %","**✗**"' in made["criteria"]
    text = (ROOT / "docs" / "beyond.rst").read_text(encoding="utf-8")
    for name in made:
        assert f"generated/beyond/{name}.inc" in text
    for line in made["numbers"].splitlines():
        assert line.split("|")[1] in " ".join(text.split())
