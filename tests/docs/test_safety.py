"""The data of *Safety on unknown rigs*: what is counted of the runs, and that all of it is described."""

import importlib
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
    every = found["all"]
    assert (every["runs"], every["judged"], every["violations"]["ratio"]) == (5, 3, 2)
    assert (every["quantiles"]["ratio"]["100 %"], every["curve"][0]) == (3.0, 0.5)
    assert len(every["curve"]) == len(program.LEVELS)
    assert (found["healthy"]["runs"], found["often"]["runs"]) == (3, 4)
    by_fault = [(each["fault"], each["judged"], each["over"]) for each in found["by_fault"]]
    assert by_fault == [("gap", 1, 1), ("none", 2, 1)]
    assert [each["seed"] for each in found["worst"]][:2] == [3, 1]
    assert program.drawn(rows)["fault"] == {"gap": 2, "none": 3}


def test_everything_drawn_is_described() -> None:
    text = (ROOT / "docs" / "safety.rst").read_text(encoding="utf-8")
    described = set(re.findall(r"^   \* - ``([\w-]+)``$", text, re.M))
    assert described == {*FAMILIES, *FAULTS}
