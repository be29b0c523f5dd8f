"""The judge of fits to logs: its own fits, what it judges against, what it counts, and the page's tables."""

import importlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench.zoo.logs import ADDED, Log

ROOT = Path(__file__).resolve().parents[2]
N, TRAINED = 4000, 2000


@pytest.fixture(autouse=True)
def _paths(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    monkeypatch.syspath_prepend(str(ROOT / "docs"))


@pytest.fixture
def judging() -> Any:
    return importlib.import_module("log_judging")


@pytest.fixture
def program() -> Any:
    return importlib.import_module("logs")


@pytest.fixture
def page() -> Any:
    return importlib.import_module("logs_page")


def voltage() -> Any:
    t = np.arange(N) / N
    return 5.0 + 5.0 * (0.6 * np.sin(80.0 * t) + 0.4 * np.sin(190.0 * t))


def log(**given: Any) -> Log:
    """A stage that is a line."""
    u = voltage()
    truth = 2.0 * u
    nothing = {"truth": truth, "x": truth.copy(), "jumps": np.zeros(N), "spikes": np.zeros(N, bool)}
    return Log(
        **{
            "seed": 1, "u": u, "sample_rate": 1000.0, "family": "paper", "model": None, "voltage": "sine",
            "stroke": 20.0, "added": {"noise": 1e-3}, **nothing, **given,
        }
    )  # fmt: skip


def test_plays_by_least_squares_find_a_stage_made_of_plays(judging: Any) -> None:
    u, rng = voltage(), np.random.default_rng(0)
    thresholds = 0.5 * np.ptp(u[:TRAINED]) * np.array([2, 5, 11]) / judging.PLAYS
    model = pz.PrandtlIshlinskii(0.3, thresholds, [0.1, 0.05, 0.08], offset=-7.0)
    # From plays that begin at the first voltage.
    truth = 0.3 * u + judging.plays(u, thresholds) @ model.weights - 7.0
    x = truth + rng.normal(0.0, 0.02, N)
    x[100:150] = np.nan
    missed = judging.by_plays(u, x, TRAINED) - truth
    assert judging.rms(missed[TRAINED:]) < 0.2 * 0.02
    assert judging.rms((judging.by_line(u, x, TRAINED) - truth)[TRAINED:]) > 1.0 * 0.02


def test_plays_that_hardly_move_in_the_fitted_part_are_left_out(judging: Any) -> None:
    # From the middle of the range the widest play moves by nothing to speak of; in the second half it does.
    u = np.concatenate((np.sin(np.arange(TRAINED) / 50.0), 3.0 * np.sin(np.arange(N - TRAINED) / 50.0)))
    truth = 2.0 * u + 1.0
    x = truth + np.random.default_rng(0).normal(0.0, 0.01, N)
    assert judging.rms((judging.by_plays(u, x, TRAINED) - truth)[TRAINED:]) < 0.1


def test_plays_are_those_of_the_library(judging: Any) -> None:
    thresholds = np.array([1.0, 2.5])
    u = voltage() - voltage()[0]
    x = pz.PrandtlIshlinskii(1e-9, thresholds, [1.0, 0.5]).simulate(u)
    np.testing.assert_allclose(judging.plays(u, thresholds) @ [1.0, 0.5], x, atol=1e-7)


def test_jumps_count_up_to_the_end_of_the_fitted_part(judging: Any) -> None:
    jumps = np.zeros(N)
    jumps[500:] += 1.5
    jumps[3000:] += 4.0
    one = log(jumps=jumps)
    np.testing.assert_array_equal(judging.expected(one, TRAINED), one.truth[TRAINED:] + 1.5)


def test_coverage_counts_readings_without_spikes_and_later_jumps(judging: Any) -> None:
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


def test_the_chosen_and_the_best_are_judged_alike(judging: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    one = log()
    predictions = {"a": one.truth + 0.3, "b": one.truth + 0.1, "c": one.truth + 9.0}
    found = judging.Found("a", predictions, {"a": 0.5, "b": 0.2, "c": 0.9}, one.truth - 1.0, one.truth + 1.0)
    monkeypatch.setattr(judging, "draw", lambda seed: one)
    monkeypatch.setattr(judging, "fitted", lambda log: found)
    row = judging.judge(1)
    assert row["failure"] is None
    assert (row["chosen"], row["best"]) == pytest.approx((0.3, 0.1))
    assert (row["chosen_name"], row["best_name"], row["own"]) == ("a", "b", 0.5)
    assert row["coverage"] == 1.0
    assert row["line"] == pytest.approx(0.0, abs=1e-9)


def test_errors_are_rows_too(judging: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(log: Log) -> Any:
        raise ValueError("too little excitation")

    monkeypatch.setattr(judging, "draw", lambda seed: log())
    monkeypatch.setattr(judging, "fitted", refuse)
    assert judging.judge(1)["failure"] == "ValueError: too little excitation"
    one = log()
    found = judging.Found("a", {"a": np.full(N, np.nan)}, {"a": 0.5})
    monkeypatch.setattr(judging, "fitted", lambda log: found)
    assert "not finite" in judging.judge(1)["failure"]
    assert one.noise == pytest.approx(0.02)


def test_parameters_are_compared_with_their_standard_errors(judging: Any) -> None:
    model = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
    one = log(family="coleman-hodgdon", model=model)
    found = judging.Found(
        "a", {"a": one.truth}, {"a": 0.1}, theta=model.theta + np.array([0.002, -0.01, 0.1]),
        errors={"alpha": 0.001, "beta": 0.01, "gamma": 0.0, "offset": 1.0},
    )  # fmt: skip
    row = judging.judged(one, TRAINED, found)
    assert row["z"] == [pytest.approx(2.0), pytest.approx(-1.0), None]
    assert "z" not in judging.judged(log(model=model), TRAINED, found)


def test_the_adapter_predicts_what_the_stage_does(judging: Any) -> None:
    u = pz.signals.multi_amplitude([10.0, 20.0, 30.0, 20.0, 30.0], 2.0, 3, 500.0).values
    model = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
    truth = model.simulate(u)
    x = truth + np.random.default_rng(0).normal(0.0, 0.003, u.size)
    one = log(
        u=u, x=x, truth=truth, sample_rate=500.0, family="coleman-hodgdon", model=model,
        jumps=np.zeros(u.size), spikes=np.zeros(u.size, bool),
    )  # fmt: skip
    found = judging.fitted(one)
    row = judging.judged(one, u.size // 2, found)
    assert row["chosen"] < 0.02
    assert row["best"] <= row["chosen"]
    assert len(row["z"]) == 3
    assert set(found.held_out) == set(found.predictions)


def row(seed: int, chosen: float = 1.0, **given: Any) -> dict[str, Any]:
    """A row as `judge` makes it."""
    return {
        "seed": seed, "family": "duhem", "voltage": "sine", "samples": 5000, "sample_rate": 1000.0,
        "stroke": 100.0, "noise": 0.1, "added": {"noise": 1e-3}, "nnls": 1.0, "line": 2.0, "failure": None,
        "seconds": 3.0, "chosen": chosen, "best": 0.5, "chosen_name": "plays", "best_name": "line",
        "level": 0.1, "own": 1.0, **given,
    }  # fmt: skip


def refused(seed: int) -> dict[str, Any]:
    """A row of an error."""
    whole = row(seed, failure="ValueError: no")
    return {
        name: whole[name] for name in whole if name not in ("chosen", "best", "chosen_name", "level", "own")
    }


def test_a_summary_counts(program: Any) -> None:
    rows = [
        row(0, 0.5, coverage=0.95), row(1, 0.7, coverage=0.4),
        row(2, 3.0, added={"noise": 1e-3, "creep": 0.01}), refused(3),
        row(4, 0.004, best=0.001, nnls=0.002, samples=30_000, family="paper", coverage=0.98),
    ]  # fmt: skip
    found = program.summarise(rows)
    every = found["all"]
    # 0.5/0.5 and two that are far below the noise; 0.7/0.5 and 3/0.5 are not near.
    assert (every["logs"], every["failed"], every["near_best"]) == (5, 1, 0.4)
    assert (every["beats_nnls"], every["beats_line"]) == (0.6, 0.6)
    assert every["covered"] == 0.95
    assert {each["name"]: each["logs"] for each in found["by_family"]} == {"duhem": 4, "paper": 1}
    assert {each["name"]: each["logs"] for each in found["by_size"]} == {"short": 4, "long": 1}
    assert [(each["name"], each["logs"], each["without"]["logs"]) for each in found["by_added"]] == [
        ("creep", 1, 4)
    ]
    assert found["coverage"]["counts"] == {
        "below 50 %": 1, "50 to 90 %": 0, "90 to 98 %": 1, "above 98 %": 1,
    }  # fmt: skip
    assert [each["seed"] for each in found["worst"]] == [2, 1, 0, 4]
    assert found["worst"][0]["best"] == 6.0
    assert found["failures"] == [{"seed": 3, "text": "ValueError: no"}]
    assert found["quantiles"]["nnls"]["100 %"] == 3.0


def test_scores_of_clean_logs_stand_apart(program: Any) -> None:
    rows = [row(0, z=[1.0, -3.0, None]), row(1, z=[5.0, 1.0, 1.0]), row(2)]
    clean = [{"seed": 0, "z": [0.5, -1.0, None]}, {"seed": 1, "z": None}]
    found = {(each["logs_with"], each["parameter"]): each for each in program.scores(rows, clean)}
    assert (found["clean", "alpha"]["logs"], found["clean", "alpha"]["median"]) == (1, 0.5)
    assert found["clean", "gamma"]["logs"] == 0
    assert (found["all", "alpha"]["logs"], found["all", "alpha"]["within_2"]) == (2, 0.5)
    assert found["all", "beta"]["largest"] == 3.0


def test_tables_hold_for_few_logs(page: Any, program: Any) -> None:
    document = json.loads((ROOT / "docs" / "data" / "logs.json").read_text(encoding="utf-8"))
    for rows in ([refused(3)], [row(0, coverage=0.5, z=[1.0, 1.0, None]), refused(3)]):
        texts = page.pieces({**document, **program.summarise(rows)})
        assert "ValueError: no" in texts["failures"]
        assert '"all"' in texts["families"]
    assert '"0","duhem","sine"' in texts["worst"]


def test_the_page_names_all_and_is_small(page: Any, program: Any) -> None:
    assert set(page.ADDED) == set(ADDED)
    assert set(page.RATIOS) == set(program.RATIOS)
    assert (ROOT / "docs" / "data" / "logs.json").stat().st_size < 60_000
