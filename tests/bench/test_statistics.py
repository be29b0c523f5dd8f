"""Orders, intervals and tests, on runs whose truth is known."""

from itertools import product

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


def runs(factors: dict[str, float], seeds: int = SEEDS) -> pd.DataFrame:
    """Runs of estimators whose errors are multiples of each other, but for a scatter of their own."""
    rng = np.random.default_rng(5)
    rows = []
    for stage, scenario, seed in product(("paper", "duhem"), ("cold-start", "drift"), range(seeds)):
        shared = 0.25 * np.exp(rng.normal(0.0, 1.0))
        where = {"stage": stage, "scenario": scenario, "seed": seed, "key": f"{seed}", "amplitude": 5.0}
        for name, factor in factors.items():
            error = shared * factor * np.exp(rng.normal(0.0, 0.2))
            errors = dict.fromkeys(("typical", "settled", "first", "worst", "settled_rms"), error)
            rows.append({**where, "estimator": name, "diverged": False, "settles": 2, **errors})
    return table_of(rows, COLUMNS)


def test_estimators_are_put_in_order_and_what_chance_can_do_is_said() -> None:
    frame = relative(runs({"linear feed-forward": 9.0, "good": 1.0, "as good": 1.01, "bad": 2.0}))
    best, other, bad = order(frame, Need("anything", "typical"), ("paper", "duhem"))
    assert {best["estimator"], other["estimator"]} == {"good", "as good"}
    assert bad["estimator"] == "bad"
    assert best["ratio"][0] == best["p"] == 1.0
    assert bad["p"] < 0.01 < 0.05 < other["p"]
    _, low, high = bad["ratio"]
    assert low < 2.0 < high
    assert best["everywhere"]


def test_an_estimator_of_fewer_runs_is_compared_by_those_it_shares() -> None:
    frame = relative(runs({"fast": 1.0, "slow": 0.5}))
    few = frame[(frame["estimator"] == "fast") | ((frame["stage"] == "paper") & (frame["seed"] < 6))]
    found = {row["estimator"]: row for row in order(few, Need("x", "settled"), ("paper", "duhem"))}
    assert not found["slow"]["everywhere"]
    assert found["slow"]["ratio"][0] == pytest.approx(0.5, rel=0.2)
    assert found["fast"]["ratio"][0] == 1.0


def test_an_interval_holds_the_truth_about_as_often_as_it_says() -> None:
    covered = []
    where = {"stage": "paper", "scenario": "drift", "estimator": "e", "amplitude": 1.0}
    for seed in range(60):
        errors = np.exp(np.random.default_rng(seed).normal(0.0, 0.5, 30))
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


def test_holm_and_signed_rank_are_those_of_textbooks() -> None:
    assert holm([0.01, 0.04, 0.03, 1.0]) == pytest.approx([0.03, 0.06, 0.06, 1.0])
    assert holm([1.0]) == [1.0]
    few = np.random.default_rng(0).normal(0.5, 1.0, 9)
    assert signed_rank(few) == pytest.approx(wilcoxon(few, method="exact").pvalue)
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
    def verdicts(seeds: int) -> set[str]:
        before, after = (runs(dict.fromkeys(names, 1.0), seeds) for names in (("e", "o"), ("o", "e")))
        rows = comparison.compare(before, after)["rows"]
        return {row["verdict"] for row in rows if row["scenario"] != comparison.ALL}

    assert verdicts(SEEDS) <= {"within noise", "same"}
    assert verdicts(3) == {"too few seeds", "same"}


def test_what_settles_no_longer_is_worse_and_failures_are_named() -> None:
    before, after = runs({"e": 1.0}), runs({"e": 1.0})
    after["settles"] = pd.NA
    after.loc[0, "failure"] = "ValueError: no"
    found = comparison.compare(before, after.iloc[:-1])
    settles = [row for row in found["rows"] if row["quantity"] == "settles"]
    assert {(row["verdict"], row["ratio"]) for row in settles} == {("worse", None)}
    assert len(found["notes"]) == 2
