"""Programs that judge: the data of *Safety on unknown rigs*, and fits to logs; what they count."""

import importlib
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from piezoest.bench.zoo.families import FAMILIES
from piezoest.bench.zoo.faults import FAULTS
from piezoest.bench.zoo.logs import Log

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def _benchmarks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))


@pytest.fixture
def program() -> Any:
    return importlib.import_module("safety")


@pytest.fixture
def judging() -> Any:
    return importlib.import_module("log_judging")


def row(seed: int, ratio: float | None = 0.5, **given: Any) -> dict[str, Any]:
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


N, TRAINED = 4000, 2000


def voltage() -> Any:
    t = np.arange(N) / N
    return 5.0 + 5.0 * (0.6 * np.sin(80.0 * t) + 0.4 * np.sin(190.0 * t))


def log(**given: Any) -> Log:
    """A stage that is a line."""
    truth, zeros = 2.0 * voltage(), np.zeros(N)
    mine = {"truth": truth, "x": truth.copy(), "jumps": zeros, "spikes": zeros > 0.0, "u": voltage(), **given}
    return Log(
        **{"seed": 1, "sample_rate": 1000.0, "family": "paper", "model": None, "voltage": "sine",
           "stroke": 20.0, "added": {"noise": 1e-3}, **mine}
    )  # fmt: skip


def test_coverage_counts_readings_without_spikes_and_later_jumps(judging: Any) -> None:
    one = log(jumps=1.5 * (np.arange(N) >= 500) + 4.0 * (np.arange(N) >= 3000))
    # Jumps count up to the end of the fitted part.
    np.testing.assert_array_equal(judging.expected(one, TRAINED), one.truth[TRAINED:] + 1.5)
    one = log()
    one.jumps[3000:] = 4.0
    one.x[3000:] += 4.0
    one.x[TRAINED : TRAINED + 500] = np.nan
    one.spikes[3500:] = True
    one.x[3500:] += 50.0
    lower, upper = one.truth - 1.0, one.truth + 1.0
    assert judging.coverage(one, TRAINED, lower, upper) == 1.0
    # Of 1000 that count, 250 are below.
    lower[3250:] += 3.0
    assert judging.coverage(one, TRAINED, lower, upper) == 0.75
