"""Programs that judge: the data of *Safety on unknown rigs*, and fits to logs; what they count."""

import importlib
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
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


def test_plays_by_least_squares_find_a_stage_made_of_plays(judging: Any) -> None:
    u = voltage()
    thresholds = 0.5 * np.ptp(u[:TRAINED]) * np.array([2, 5, 11]) / judging.PLAYS
    # From plays that begin at the first voltage.
    truth = pz.PrandtlIshlinskii(0.3, thresholds, [0.1, 0.05, 0.08], offset=-7.0).simulate(u - u[0])
    x = truth + np.random.default_rng(0).normal(0.0, 0.02, N)
    x[100:150] = np.nan
    assert judging.rms((judging.by_plays(u, x, TRAINED) - truth)[TRAINED:]) < 0.2 * 0.02
    assert judging.rms((judging.by_line(u, x, TRAINED) - truth)[TRAINED:]) > 1.0 * 0.02


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


def test_a_row_holds_the_chosen_the_best_and_scores_or_what_failed(judging: Any, monkeypatch: Any) -> None:
    model = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
    one = log(family="coleman-hodgdon", model=model)
    monkeypatch.setattr(judging, "draw", lambda seed: one)
    found = judging.Found(
        "a", {"a": one.truth + 0.3, "b": one.truth + 0.1, "c": one.truth + 9.0},
        {"a": 0.5, "b": 0.2, "c": 0.9}, one.truth - 1.0, one.truth + 1.0,
        errors={"alpha": 0.001, "beta": 0.01, "gamma": 0.0, "offset": 1.0},
        theta=model.theta + np.array([0.002, -0.01, 0.1]),
    )  # fmt: skip
    monkeypatch.setattr(judging, "fitted", lambda log: found)
    row = judging.judge(1)
    assert row["failure"] is None
    assert (row["chosen"], row["best"], row["own"], row["coverage"]) == pytest.approx((0.3, 0.1, 0.5, 1.0))
    assert (row["chosen_name"], row["best_name"]) == ("a", "b")
    assert row["z"] == [pytest.approx(2.0), pytest.approx(-1.0), None]
    found.predictions["a"][:] = np.nan
    assert judging.judge(1)["failure"]
