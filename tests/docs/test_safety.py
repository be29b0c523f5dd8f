"""The page *On anybody's rig*: what it says follows from its data, and its data from the runs."""

import copy
import importlib
import json
import re
from pathlib import Path
from typing import Any

import pytest

from piezoest.bench.zoo.families import FAMILIES
from piezoest.bench.zoo.faults import FAULTS

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("safety")


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    return importlib.import_module("safety_page")


@pytest.fixture
def document() -> dict[str, Any]:
    return dict(json.loads((ROOT / "docs" / "data" / "safety.json").read_text(encoding="utf-8")))


def row(seed: int, ratio: float | None = 0.5, **given: Any) -> dict[str, Any]:
    """A row with what is summed up."""
    numbers = dict.fromkeys(("amplitude", "gain", "width", "sensor_noise", "creep"), 1.0)
    return {
        **numbers, "seed": seed, "family": "duhem", "reference": "sine", "fault": "none", "mode": "none",
        "mechanics": "none", "sample_rate": 1000.0, "frequency": 5.0, "block": 1, "delay": 0, "low": 0.0,
        "high": 100.0, "failure": None, "finite": True, "within_limits": True, "rail": 0.0,
        "rests_at_rail": False, "ratio": ratio, "last_ratio": ratio, "cycle_ratio": ratio,
        "named_right": None, "recovery": False, "recovered": None, **given,
    }  # fmt: skip


def test_often_counts_calls_in_half_a_wave_and_the_delay(program: Any) -> None:
    # 100 samples in a leg: 6 in a block are 16.7 calls, 7 are 14.3; 6 samples late is below a sixteenth.
    assert program.often(row(0, block=6, delay=6))
    assert not program.often(row(0, block=7))
    assert not program.often(row(0, delay=7))


def test_sums_count_what_is_judged_only(program: Any) -> None:
    rows = [
        row(0), row(1, 2.0, fault="gap", mode="permanent"), row(2, None, fault="gap", mode="from-start"),
        row(3, 3.0, block=50), row(4, None),
    ]  # fmt: skip
    found = program.summed_up(rows)
    assert found["all"]["runs"] == 5
    assert found["all"]["judged"] == 3
    assert found["all"]["violations"]["ratio"] == 2
    assert found["all"]["quantiles"]["ratio"]["100 %"] == 3.0
    assert found["all"]["curve"][0] == 0.5
    assert len(found["all"]["curve"]) == len(program.LEVELS)
    assert found["healthy"]["runs"] == 3
    assert found["often"]["runs"] == 4
    assert [(each["fault"], each["judged"], each["over"]) for each in found["by_fault"]] == [
        ("gap", 1, 1), ("none", 2, 1),
    ]  # fmt: skip
    assert [each["seed"] for each in found["worst"]][:2] == [3, 1]
    assert program.drawn(rows)["fault"] == {"gap": 2, "none": 3}


def test_faults_that_were_named_and_forgotten_are_counted(program: Any, page: Any) -> None:
    stuck: dict[str, Any] = {"fault": "stage-stuck", "mode": "transient"}
    rows = [
        row(0, **stuck, named_right=True, named_periods=2.0, recovery=True, recovered=1),
        row(1, **stuck, named_right=True, named_periods=4.0, recovery=True, recovered=3),
        row(2, **stuck, named_right=False, named_periods=None, recovery=True, recovered=None),
        row(3, fault="hum", mode="permanent"),
    ]
    found = program.summed_up(rows)["by_mode"]
    assert [each["fault"] for each in found] == ["hum", "stage-stuck"]
    expected = {
        **stuck, "to_name": 3, "named": 2, "named_periods": 3.0, "to_recover": 3, "recovered_first": 1,
        "recovered_soon": 2,
    }  # fmt: skip
    assert expected.items() <= found[1].items()
    told = page.told(found)
    assert '"stage-stuck","transient","2 of 3 (66.7 %)","3","1 of 3 (33.3 %)","2 of 3 (66.7 %)"' in told
    assert "hum" not in told


def test_the_others_are_the_default_controller_without_its_parts(program: Any, page: Any) -> None:
    from piezoest.bench.zoo.contenders import contender

    assert list(program.CONTROLLERS) == list(program.COLOURS) == list(program.NAMES) == list(page.WHO)
    assert all(callable(contender(name)) for name in program.CONTROLLERS.values())


def test_everything_drawn_is_described() -> None:
    text = (ROOT / "docs" / "safety.rst").read_text(encoding="utf-8")
    described = set(re.findall(r"^   \* - ``([\w-]+)``$", text, re.M))
    assert described == {*FAMILIES, *FAULTS}


def test_the_page_includes_every_table_and_number(page: Any, document: dict[str, Any]) -> None:
    text = (ROOT / "docs" / "safety.rst").read_text(encoding="utf-8")
    made = page.pieces(document)
    assert set(re.findall(r"generated/safety/(\w+)\.inc", text)) == set(made)
    defined = set(re.findall(r"^\.\. \|([^|]+)\|", made["numbers"], re.M))
    assert set(re.findall(r"\|(safety\s[^|]+)\|", " ".join(text.split()))) == defined


def test_the_tables_show_the_data(page: Any, document: dict[str, Any]) -> None:
    changed = copy.deepcopy(document)
    changed["controller"]["healthy"]["violations"]["ratio"] = 7
    changed["controller"]["healthy"]["judged"] = 1234
    changed["controller"]["by_fault"][0].update(ratio=0.125, over=3, judged=21)
    made = page.pieces(changed)
    assert '"7/1234"' in made["violations"]
    assert '"0.125; 3/21"' in made["by_fault"]


def test_pieces_hold_for_few_runs(page: Any, program: Any, document: dict[str, Any]) -> None:
    """Also where most of the kinds have not been drawn, and a run raised."""
    rows = [row(0), row(1, None, failure="ValueError: no", finite=None, within_limits=None)]
    summed = dict.fromkeys(program.CONTROLLERS, program.summed_up(rows))
    unplayed = {"map": None, "singles": None, "dwell": None}
    texts = page.pieces({**document, "runs": 2, "drawn": program.drawn(rows), **summed, **unplayed})
    assert "ValueError: no" in texts["worst"]
    for name in ("map_by_family", "singles", "dwell"):
        assert "csv-table" not in texts[name]


def test_rests_are_shown(page: Any, document: dict[str, Any]) -> None:
    from piezoest.bench.zoo.dwelling import summarise_dwells

    rest = {"family": "paper", "duration": 60.0, "creep": 0.0, "setpoint_noise": 0.0, "allowed": 1.0,
            "second": 0.5, "third": 0.5, "excursion": 0.125, "failure": None}  # fmt: skip
    rows = [
        {**rest, "seed": 1, "feedback": 0.0, "first": 0.75, "kept": True},
        {**rest, "seed": 1, "feedback": 2.0, "first": 1.5, "kept": False},
    ]
    played = {**document, "dwell": summarise_dwells(rows)}
    shown = page.pieces(played)["dwell"]
    assert '"no","no","no","1 of 1 (100 %)","0.75","0.5","0.5","0.75","0.125","0.125"' in shown
    assert '"no","yes","no","0 of 1 (0 %)","1.5"' in shown
    assert (
        '"errors as before in the first period after a rest","1 of 2 (50 %)"' in page.pieces(played)["found"]
    )


def test_the_figure_is_drawn(program: Any, document: dict[str, Any], tmp_path: Path) -> None:
    program.draw(document, tmp_path / "figures" / "safety.png")
    assert 10_000 < (tmp_path / "figures" / "safety.png").stat().st_size < 120_000
