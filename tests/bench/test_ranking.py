"""The ranking: spaces and draws, tuning on some runs and judging on others, and what is made of it."""

from __future__ import annotations

import functools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from piezoest.bench import campaign, estimators, ranking, verdicts
from piezoest.bench.candidates import candidate
from piezoest.bench.cases import RIGHT_MODEL
from piezoest.bench.ranking import Budget
from piezoest.bench.runner import COLUMNS, Row, Settings
from piezoest.bench.scenarios import SCENARIOS
from piezoest.bench.store import Store
from piezoest.bench.tuning import Between, OneOf, Tunable, draws, tunables
from piezoest.cli import app

SMALL = Settings(2000.0, before=1, after=3, after_long=2, rest=0.2, drift=0.4, updates=20)
BUDGET = Budget(2, ("cold-start",), (1000,), (0, 1), (0,), SMALL, SMALL, ("cold-start",))

OWN = """
from piezoest import ColemanHodgdon

class Part:
    # As good as the part of the right model that it knows.
    tuning_space = {"part": (0.5, 1.0), "word": ["a", "b"]}
    model = None

    def __init__(self, sample_rate, initial_model, part=0.5, word="a"):
        right = ColemanHodgdon(0.021, 0.147, 0.00429).theta
        self.model = ColemanHodgdon.from_theta(part * right + (1.0 - part) * initial_model.theta)

    def step(self, u, x):
        pass

class Wrong(Part):
    tuning_space = {"part": 0.5}
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    name = f"own_estimators_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(OWN, encoding="utf-8")
    return name


# ---------------------------------------------------------------- spaces


def test_spaces() -> None:
    assert Between(0.01, 1.0).at(0.5) == 0.1
    assert Between(0.01, 1.0).at(0.0) == 0.01
    whole = [Between(6, 8, whole=True).at(part) for part in np.linspace(0.0, 0.999, 50)]
    assert whole == sorted(whole)
    assert set(whole) == {6, 7, 8}
    assert all(isinstance(value, int) for value in whole)
    assert [OneOf((False, True)).at(part) for part in (0.0, 0.49, 0.5, 0.99)] == [False, False, True, True]
    with pytest.raises(ValueError, match="high must be above low"):
        Between(1.0, 1.0)


@pytest.mark.parametrize("tunable", tunables(), ids=lambda tunable: tunable.name)
def test_every_draw_is_an_estimator(tunable: Tunable) -> None:
    drawn = draws(tunable, 8, 3)
    assert drawn == draws(tunable, 8, 3)
    assert drawn != draws(tunable, 8, 4)
    assert drawn[0] == tunable.default
    assert len(drawn) == len(set(drawn)) == 9
    assert set(drawn[1:]).isdisjoint(draws(tunable, 8, 4)[1:])
    for text in drawn:
        assert candidate(text)(2000.0, RIGHT_MODEL).model.is_admissible


def test_the_same_space_for_the_same_filter() -> None:
    spaces = {each.name: each.space for each in tunables()}
    assert spaces["FilterPyEKF"] == spaces["FilterPyUKF"] == spaces["HysteresisEKF"]
    assert all(spaces.values())


def test_draws_refuse() -> None:
    with pytest.raises(ValueError, match="power of two, got 12"):
        draws(tunables()[0], 12, 0)
    assert draws(Tunable("E", "E"), 8, 0) == ["E"]


def test_tunables_of_ones_own(own: str) -> None:
    mine, fixed = tunables([f"{own}:Part", f"{own}:Part(part=0.7)"], ["HysteresisEKF"])[1:]
    assert mine.space == {"part": Between(0.5, 1.0), "word": OneOf(("a", "b"))}
    assert mine.text([0.0, 0.9]) == f"{own}:Part(part=0.5, word='b')"
    assert fixed.space == {}
    with pytest.raises(ValueError, match=r"must be \(low, high\) or a list, got 0\.5"):
        tunables([f"{own}:Wrong"])
    with pytest.raises(ValueError, match="choose of"):
        tunables([], ["NoSuch"])
    with pytest.raises(ValueError, match="has no class"):
        tunables([f"{own}:Nobody"])


# ---------------------------------------------------------------- tuning and judging


def test_tuned_on_some_seeds_and_judged_on_others(own: str, tmp_path: Path) -> None:
    candidates = tunables([f"{own}:Part"], ["HysteresisEKF"])
    said: list[tuple[int, int]] = []

    def progress(done: int, of: int) -> None:
        said.append((done, of))

    with Store(tmp_path / "runs.jsonl") as store:
        tuned = ranking.tune(candidates, BUDGET, store, campaign.over_cores(1), progress)
        trained = len(store)
        rows = ranking.judge(tuned, BUDGET, store, campaign.over_cores(1), progress)
        seeds = {json.loads(line)["seed"] for line in Path("runs.jsonl").read_bytes().splitlines()[trained:]}
    assert trained == said[6][1] == 2 * 3 + 1  # linear feed-forward among them
    mine = tuned[1]
    assert len(mine["trials"]) == 3
    assert mine["chosen_score"] == min(trial["score"] for trial in mine["trials"])
    # The one that knows most of the right model.
    parts = [
        float(trial["estimator"].partition("part=")[2].partition(",")[0] or 0.5) for trial in mine["trials"]
    ]
    assert mine["chosen"] == mine["trials"][int(np.argmax(parts))]["estimator"]
    assert seeds == {0, 1}
    assert {row["estimator"] for row in rows} == {"linear feed-forward", "HysteresisEKF", f"{own}:Part"}
    assert len(rows) == 3 * 2 * (len(SCENARIOS) + 1)
    assert {row["stage"] for row in rows} == {"paper", "preisach"}


def test_slow_ones_are_judged_on_fewer_seeds(tmp_path: Path) -> None:
    tuned = [
        {"name": "quick", "chosen": "HysteresisEKF", "slow": False},
        {"name": "slow", "chosen": "HysteresisRLS", "slow": True},
    ]
    with Store(tmp_path / "runs.jsonl") as store:
        rows = ranking.judge(tuned, BUDGET, store, campaign.over_cores(1), lambda done, of: None)
    seeds = {name: {row["seed"] for row in rows if row["estimator"] == name} for name in ("quick", "slow")}
    assert seeds == {"quick": {0, 1}, "slow": {0}}


def test_seeds_are_not_used_twice() -> None:
    with pytest.raises(ValueError, match=r"seeds \[1000\] are tuned on: judge on others"):
        Budget(seeds=(1000, 1))


def row(estimator: str, seed: int, error: float | None, **values: Any) -> Row:
    numbers = dict.fromkeys(("mean_error", "settled_max", "worst_error", "settling_time"), error)
    known = {
        "scenario": "cold-start",
        "estimator": estimator,
        "seed": seed,
        "stage": "paper",
        "amplitude": 5.0,
    }
    return {**dict.fromkeys(COLUMNS), "diverged": False, **numbers, **known, "errors": [], **values}


def test_score() -> None:
    assert ranking.score([row("a", 0, 0.05), row("a", 1, 0.2)]) == pytest.approx(0.02)
    # What fails, or misses by more than there is to follow, counts as one that does not follow.
    failed = row("a", 1, None, failure="no", amplitude=None)
    assert ranking.score([row("a", 0, 0.05), failed]) == pytest.approx(0.1)
    assert ranking.score([row("a", 0, 0.05), row("a", 1, 1e9)]) == pytest.approx(0.1)


def test_costs_say_what_failed() -> None:
    tuned = [{"name": "E", "chosen": "HysteresisEKF(drift=-1.0)", "slow": False}]
    times = ranking.costs(tuned, BUDGET)
    assert "drift" in times["E"]["failure"]


# ---------------------------------------------------------------- what is made of it

SCENARIO_ERRORS = {"good": 0.01, "fair": 0.02, "poor": 0.5}
TIMES = {
    "good": {"step_microseconds": 50.0},
    "fair": {"step_microseconds": 5.0},
    "poor": {"step_microseconds": 9.0},
}


def some_rows() -> list[Row]:
    """Three estimators in two scenarios; poor never settles, and failed once."""
    rows = []
    for scenario in ("cold-start", "drift"):
        for name, error in SCENARIO_ERRORS.items():
            for seed in range(6):
                rows.append(row(name, seed, error * (1.0 + 0.01 * seed), scenario=scenario))
                if name == "poor":
                    rows[-1]["settling_time"] = None
        rows += [row("linear feed-forward", seed, 0.7, scenario=scenario) for seed in range(6)]
    rows[12] = row("poor", 0, None, failure="no")
    return rows


def test_overall() -> None:
    lines = verdicts.overall(some_rows(), TIMES)
    assert [line["name"] for line in lines] == ["good", "fair", "poor", "linear feed-forward"]
    good, fair, poor, linear = lines
    assert good["adapting"] == good["settled"] == good["worst"] == pytest.approx(0.01 * 1.02 / 5.0)
    assert [line["efficient"] for line in lines] == [True, True, False, False]
    assert (poor["runs"], poor["runs_settled"], poor["failures"]) == (12, 0, 1)
    assert poor["settling_time"] == math.inf
    assert (fair["step_microseconds"], linear["step_microseconds"]) == (5.0, None)


def test_efficient_is_what_nothing_dominates() -> None:
    points = np.random.default_rng(0).integers(0, 4, (30, 3)).astype(float)
    expected = [
        not any(
            all(other[k] <= point[k] for k in range(3)) and any(other[k] < point[k] for k in range(3))
            for other in points
        )
        for point in points
    ]
    assert verdicts.efficient(points) == expected
    assert 0 < sum(expected) < 30


def test_weaknesses() -> None:
    rows = some_rows()
    found = verdicts.weaknesses(rows, verdicts.overall(rows, TIMES))
    assert set(found) == {"good", "fair", "poor"}
    # Ten times the cost of the cheapest, and the best in all else.
    assert [(each["quantity"], each["ratio"], each["best_name"]) for each in found["good"]] == [
        ("step_microseconds", 10.0, "fair")
    ]
    assert {(each["scenario"], each["quantity"]) for each in found["poor"]} == {
        (scenario, quantity)
        for scenario in ("cold-start", "drift")
        for quantity in ("settled_max", "worst_error")
    }
    assert [each["ratio"] for each in found["poor"]] == sorted(
        (e["ratio"] for e in found["poor"]), reverse=True
    )


def test_decide() -> None:
    rows = some_rows()
    needs = {need["need"]: need for need in verdicts.decide(rows, verdicts.overall(rows, TIMES))}
    anything = needs["No idea what will come: all scenarios"]
    assert [each["name"] for each in anything["order"]] == ["good", "fair", "poor"]
    assert anything["linear"] == pytest.approx(0.14)
    assert anything["p"] < 0.01  # twelve of twelve runs
    cheap = needs["The same, in a loop of 50 kHz: 20 µs a sample"]
    assert [each["name"] for each in cheap["order"]] == ["fair", "poor"]
    assert needs["A noisy gauge"]["order"] == []


def test_needs_name_scenarios_that_are_run() -> None:
    budget = Budget()
    known = {*SCENARIOS, *(f"{name}, other stage" for name in budget.other_scenarios)}
    for need in verdicts.NEEDS:
        assert known.issuperset(need.scenarios)
        assert need.quantity in campaign.QUANTITIES


def test_command_end_to_end(own: str, monkeypatch: pytest.MonkeyPatch) -> None:
    small = functools.partial(Budget, training_scenarios=("noise",), training=SMALL, judging=SMALL)
    monkeypatch.setattr(ranking, "Budget", small)
    monkeypatch.setattr(estimators, "PASS_SECONDS", 1e-3)
    command = ["bench", "rank", "--only", "HysteresisEKF", "-e", f"{own}:Part", "--draws", "1", "--jobs", "1"]
    command += ["--training-seeds", "1", "--seeds", "2", "--json", "a.json", "--figures", "figures"]
    result = CliRunner().invoke(app, command, env={"COLUMNS": "100"})
    assert result.exit_code == 0, result.output
    for word in ("HysteresisEKF", "linear", "Tuned by 1 draws on 1 seeds, judged on 2 others"):
        assert word in result.stdout
    document = json.loads(Path("a.json").read_text(encoding="utf-8"))
    assert document["suite"] == "ranking"
    assert document["budget"]["training_seeds"] == [1000]
    assert document["budget"]["judging"]["stage"] == "paper"
    assert [each["name"] for each in document["candidates"]] == ["HysteresisEKF", f"{own}:Part"]
    assert {line["name"] for line in document["overall"]} == {
        "HysteresisEKF", f"{own}:Part", "linear feed-forward",
    }  # fmt: skip
    assert all(path.stat().st_size > 5000 for path in Path("figures").iterdir())
    assert {path.name for path in Path("figures").iterdir()} == {"pareto.png", "profile.png"}
    for wrong in (("--draws", "3"), ("--only", "NoSuch"), ("-e", f"{own}:Nobody")):
        assert CliRunner().invoke(app, ["bench", "rank", *wrong]).exit_code == 2
