"""The page *Real data*: what it includes is made of its data, and all of that is on the page."""

from __future__ import annotations

import copy
import importlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(autouse=True)
def _paths(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))


def document() -> dict[str, Any]:
    return dict(json.loads((DOCS / "data" / "real_data.json").read_text(encoding="utf-8")))


def text() -> str:
    return (DOCS / "real_data.rst").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["real_data", "logs"])
def test_the_page_includes_every_piece_and_no_other(name: str) -> None:
    page = importlib.import_module(f"{name}_page")
    made = page.pieces(json.loads((DOCS / "data" / f"{name}.json").read_text(encoding="utf-8")))
    assert set(re.findall(rf"generated/{name}/(\w+)\.inc", text())) == set(made)
    defined = set(re.findall(r"^\.\. \|([^|]+)\|", made["numbers"], re.M))
    first = next(iter(defined)).split()[0]
    assert set(re.findall(rf"\|({first}\s[^|]+)\|", " ".join(text().split()))) == defined


def test_the_page_says_what_the_data_say() -> None:
    page, given = importlib.import_module("real_data_page"), document()
    given["identify"]["held_out"]["rms_um"] = 7.654
    given["other"]["without_mean"]["rms_um"] = 8.764
    given["identify"]["table"] = [["gain", 3.21, 0.0, "µm/V"]]
    for each in given["identify"]["candidates"]:
        each["chosen"] = each["name"] == "line"
    made = page.pieces(given)
    assert "|recording held| replace:: 7.65 µm" in made["numbers"]
    assert "|recording other without mean| replace:: 8.76 µm" in made["numbers"]
    assert '"gain","3.21","—","µm/V"' in made["parameters"]
    assert made["models"].count("▸") == 1
    assert '"▸ straight line"' in made["models"]


def test_the_data_are_those_of_the_log_that_comes_with_the_package() -> None:
    found, record = document(), pz.read_record(pz.records.example_log())
    assert (found["samples"], found["sample_rate_Hz"]) == (len(record), record.sample_rate)
    assert found["displacement_um"] == pytest.approx(float(np.ptp(record.displacement)))
    kinds = {each["name"]: each["held_out"]["rms_um"] for each in found["identify"]["candidates"]}
    assert kinds["line"] == found["identify"]["line_held_out"]["rms_um"]
    assert sum(each["chosen"] for each in found["identify"]["candidates"]) == 1


def test_without_the_other_log_what_is_said_of_it_stays(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    program = importlib.import_module("real_data")
    old = copy.deepcopy(document())
    path = tmp_path / "real_data.json"
    path.write_text(json.dumps(old), encoding="utf-8")
    arguments = ["real_data.py", "--data", str(tmp_path), "--json", str(path), "--figures", str(tmp_path)]
    monkeypatch.setattr("sys.argv", arguments)
    program.main()
    new = json.loads(path.read_text(encoding="utf-8"))
    assert new["other"] == old["other"]
    assert 0.0 < new["identify"]["covered"] <= 1.0
    assert (tmp_path / "real_data.png").stat().st_size > 10_000
