"""Orders, intervals and tests, on runs whose truth is known."""

from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import wilcoxon

from piezoest.bench import compare as comparison
from piezoest.bench.run import COLUMNS
from piezoest.bench.statistics import Need, holm, interval, order, over_scenarios, relative, signed_rank
from piezoest.bench.tables import table_of

SEEDS = 9


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("piezoest.bench.statistics.RESAMPLED", 300)


def runs(factors: dict[str, float], scatter: float = 0.2, seeds: int = SEEDS, **change: Any) -> pd.DataFrame:
    """Runs of estimators whose errors are multiples of each other, but for a scatter of their own."""
    rng = np.random.default_rng(5)
    rows = []
    for stage, scenario, seed in product(("paper", "duhem"), ("cold-start", "drift"), range(seeds)):
        shared = 0.05 * np.exp(rng.normal(0.0, 1.0))
        for name, factor in factors.items():
            error = 5.0 * shared * factor * np.exp(rng.normal(0.0, scatter))
            errors = dict.fromkeys(("typical", "settled", "first", "worst", "settled_rms"), error)
            row = {"stage": stage, "scenario": scenario, "estimator": name, "seed": seed, "diverged": False}
            rows.append({**row, "key": f"{seed}", "amplitude": 5.0, "settles": 2, **errors, **change})
    return table_of(rows, COLUMNS)


def test_estimators_are_put_in_order_and_what_chance_can_do_is_said() -> None:
    frame = relative(runs({"linear feed-forward": 9.0, "good": 1.0, "as good": 1.01, "bad": 2.0}))
    found = order(frame, Need("anything", "typical"), ("paper", "duhem"))
    assert [row["estimator"] for row in found][-1] == "bad"
    by_name = {row["estimator"]: row for row in found}
    assert set(by_name) == {"good", "as good", "bad"}
    best = found[0]["estimator"]
    assert by_name[best]["ratio"][0] == by_name[best]["p"] == 1.0
    other = "as good" if best == "good" else "good"
    assert by_name[other]["p"] > 0.05
    assert by_name["bad"]["p"] < 0.01
    low, high = by_name["bad"]["ratio"][1:]
    assert low < 2.0 < high
    assert by_name["good"]["everywhere"]


def test_an_estimator_of_fewer_runs_is_compared_by_those_it_shares() -> None:
    frame = relative(runs({"fast": 1.0, "slow": 0.5}))
    few = frame[(frame["estimator"] == "fast") | ((frame["stage"] == "paper") & (frame["seed"] < 6))]
    found = {row["estimator"]: row for row in order(few, Need("x", "settled"), ("paper", "duhem"))}
    assert not found["slow"]["everywhere"]
    assert found["slow"]["others"] is None
    assert found["slow"]["ratio"][0] == pytest.approx(0.5, rel=0.2)
    assert found["fast"]["ratio"][0] == 1.0


def test_an_interval_holds_the_truth_about_as_often_as_it_says() -> None:
    covered = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        errors = np.exp(rng.normal(0.0, 0.5, 30))
        where = {"stage": "paper", "scenario": "drift", "estimator": "e", "amplitude": 1.0}
        rows = [{**where, "seed": k, "typical": e} for k, e in enumerate(errors)]
        _, low, high = interval(relative(table_of(rows, COLUMNS)), "typical")
        covered.append(low <= 1.0 <= high)
    assert 0.85 <= np.mean(covered) <= 1.0


def test_a_run_that_failed_counts_as_a_large_error() -> None:
    frame = runs({"e": 1.0}, seeds=3)
    frame.loc[0, ["typical", "failure"]] = [pd.NA, "ValueError: no"]
    worse = relative(frame)
    assert np.isfinite(over_scenarios(worse, "typical"))
    assert worse["typical"].max() == 10.0


def test_holm() -> None:
    assert holm([0.01, 0.04, 0.03, 1.0]) == pytest.approx([0.03, 0.06, 0.06, 1.0])
    assert holm([1.0]) == [1.0]


@pytest.mark.parametrize("seed", range(3))
def test_signed_rank_of_few_is_the_exact_one(seed: int) -> None:
    d = np.random.default_rng(seed).normal(0.5, 1.0, 9)
    assert signed_rank(d) == pytest.approx(wilcoxon(d, method="exact").pvalue)
    assert signed_rank(np.array([0.0, 0.0, 1.0])) == 1.0
    assert signed_rank(np.full(20, np.inf)) < 1e-3


@pytest.mark.parametrize(("factor", "verdict"), [(1.2, "worse"), (1.0, "same"), (1.001, "negligible")])
@pytest.mark.slow_but_first
def test_a_change_of_every_seed_is_found(factor: float, verdict: str) -> None:
    found = comparison.compare(runs({"e": 1.0}), runs({"e": factor}))
    assert {row["verdict"] for row in found["rows"] if row["quantity"] == "typical"} == {verdict}
    assert found["pairs"] == 4 * SEEDS


@pytest.mark.slow
def test_noise_is_noise_and_few_seeds_tell_nothing() -> None:
    def verdicts(seeds: int) -> list[str]:
        before, after = (runs(dict.fromkeys(names, 1.0), seeds=seeds) for names in (("e", "o"), ("o", "e")))
        rows = comparison.compare(before, after)["rows"]
        return [row["verdict"] for row in rows if row["scenario"] != comparison.ALL]

    assert set(verdicts(SEEDS)) <= {"within noise", "same"}
    assert set(verdicts(3)) == {"too few seeds", "same"}


def test_what_settles_no_longer_is_worse_and_failures_are_named() -> None:
    before, after = runs({"e": 1.0}), runs({"e": 1.0})
    after["settles"] = pd.NA
    after.loc[0, "failure"] = "ValueError: no"
    found = comparison.compare(before, after.iloc[:-1])
    settles = [row for row in found["rows"] if row["quantity"] == "settles"]
    assert {row["verdict"] for row in settles} == {"worse"}
    assert all(row["ratio"] is None for row in settles)
    assert len(found["notes"]) == 2


def test_conditions_have_to_be_the_same() -> None:
    with pytest.raises(ValueError, match="rest is 5 in A and 6 in B"):
        comparison.check_conditions({"conditions": {"rest": 5}}, {"conditions": {"rest": 6}})
