"""What changed between two campaigns, told from noise."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import rankdata

from piezoest.bench.changes import ALL, check_settings, compare, logarithms, signed_rank
from piezoest.bench.runner import COLUMNS, Row


def row(seed: int, *, scenario: str = "noise", estimator: str = "E", **values: Any) -> Row:
    numbers = {"mean_error": 0.1, "settled_max": 0.05, "worst_error": 0.3, "settling_time": 0.4}
    known = {"scenario": scenario, "estimator": estimator, "seed": seed, "stage": "paper"}
    return {**dict.fromkeys(COLUMNS), **numbers, **known, **values}


def rows(factors: list[float], **values: Any) -> list[Row]:
    """Each seed has its own level, which both sides share."""
    return [
        row(seed, settled_max=factor * 0.01 * (seed + 1), **values) for seed, factor in enumerate(factors)
    ]


def verdicts(document: dict[str, Any]) -> dict[str, str]:
    return {row["quantity"]: row["verdict"] for row in document["rows"]}


def test_the_same_runs_are_the_same() -> None:
    document = compare(rows([1.0] * 4), rows([1.0] * 4))
    assert document["counts"] == {"same": 4}
    assert {(each["p"], each["q"], each["ratio"]) for each in document["rows"]} == {(None, None, 1.0)}
    assert document["notes"] == []
    assert compare([], [])["counts"] == {}


@pytest.mark.parametrize(("factor", "verdict"), [(0.9, "better"), (1.1, "worse"), (1.001, "negligible")])
def test_a_change_of_every_seed_is_found(factor: float, verdict: str) -> None:
    document = compare(rows([1.0] * 10), rows([factor] * 10))
    assert verdicts(document) == {
        "settled_max": verdict, "mean_error": "same", "worst_error": "same", "settling_time": "same",
    }  # fmt: skip
    changed = document["rows"][0]
    assert changed["ratio"] == pytest.approx(factor)
    assert (changed["pairs"], changed["changed"]) == (10, 10)
    assert changed["p"] == changed["q"] == pytest.approx(2.0**-9)


def test_five_seeds_tell_nothing_and_say_so() -> None:
    assert verdicts(compare(rows([1.0] * 5), rows([0.5] * 5)))["settled_max"] == "too few seeds"


def test_noise_is_noise() -> None:
    rng = np.random.default_rng(1)
    first: list[Row] = []
    second: list[Row] = []
    for estimator in "abcdefghijklmnopqrst":
        for scenario in ("noise", "drift"):
            named = {"estimator": estimator, "scenario": scenario}
            first += rows(rng.lognormal(0.0, 0.3, 12).tolist(), **named)
            second += rows(rng.lognormal(0.0, 0.3, 12).tolist(), **named)
    document = compare(first, second)
    assert document["counts"] == {"within noise": 60, "same": 180}
    # Without allowing for sixty comparisons some would have been taken for changes.
    assert sum(each["p"] is not None and each["p"] < 0.05 for each in document["rows"]) > 0


def test_all_scenarios_tell_what_one_alone_cannot() -> None:
    first = [each for name in ("noise", "drift") for each in rows([1.0] * 4, scenario=name)]
    second = [each for name in ("noise", "drift") for each in rows([1.2] * 4, scenario=name)]
    found = {
        each["scenario"]: each["verdict"]
        for each in compare(first, second)["rows"]
        if each["quantity"] == "settled_max"
    }
    assert found == {ALL: "worse", "noise": "too few seeds", "drift": "too few seeds"}


def test_what_failed_or_did_not_settle_is_infinitely_worse() -> None:
    first = rows([1.0] * 8)
    second = rows([1.0] * 8, settling_time=None)
    second[0] = row(0, failure="RuntimeError: no", mean_error=None, settled_max=None)
    document = compare(first, second)
    found = {each["quantity"]: each for each in document["rows"]}
    assert found["settling_time"]["verdict"] == "worse"
    assert found["settling_time"]["ratio"] is None  # infinite
    assert found["settled_max"]["changed"] == 1
    assert document["notes"] == ["fails now: noise, seed 0, E: RuntimeError: no"]
    back = compare(second, first)
    assert back["notes"] == ["fails no longer: noise, seed 0, E"]
    assert {each["quantity"]: each["ratio"] for each in back["rows"]}["settling_time"] == 0.0


def test_logarithms() -> None:
    pairs = [
        (row(0, settling_time=a), row(0, settling_time=b))
        for a, b in ((1.0, 2.0), (0.0, 0.0), (None, None), (0.0, 0.2), (None, 1.0))
    ]
    expected = [math.log(2.0), 0.0, 0.0, math.inf, -math.inf]
    np.testing.assert_array_equal(logarithms(pairs, "settling_time"), expected)


@pytest.mark.parametrize("seed", range(5))
def test_signed_rank_is_the_textbooks(seed: int) -> None:
    """All signs tried, midranks for ties."""
    d = np.round(np.random.default_rng(seed).normal(0.5, 1.0, 9), 1)
    d[0] = np.inf
    kept = d[d != 0.0]
    ranks = rankdata(np.abs(kept))
    centre = ranks.sum() / 2.0
    observed = abs(ranks[kept > 0.0].sum() - centre)
    sums = [np.dot(ranks, signs) for signs in itertools.product((0, 1), repeat=kept.size)]
    expected = np.mean([abs(total - centre) >= observed - 1e-9 for total in sums])
    assert signed_rank(d) == pytest.approx(float(expected))


def test_signed_rank_of_many() -> None:
    rng = np.random.default_rng(0)
    assert signed_rank(rng.normal(0.0, 1.0, 200)) > 0.05
    assert signed_rank(rng.normal(0.5, 1.0, 200)) < 1e-6
    assert signed_rank(np.zeros(3)) == 1.0


def test_runs_of_one_side_are_named() -> None:
    first = rows([1.0] * 3) + rows([1.0] * 2, estimator="Old")
    document = compare(first, rows([1.0] * 2))
    assert document["pairs"] == 2
    assert document["notes"] == ["3 runs are in A only (E, Old); they are not compared."]


def test_settings_have_to_be_the_same() -> None:
    check_settings({"settings": {"a": 1}}, {"settings": {"a": 1}})
    with pytest.raises(ValueError, match="a is 1 in A and 2 in B"):
        check_settings({"settings": {"a": 1}}, {"settings": {"a": 2}})
