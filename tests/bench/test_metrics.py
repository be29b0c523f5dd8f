"""Metrics of records made by hand, whose numbers one can see."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench.cases import RIGHT_GAIN, RIGHT_MODEL, Case
from piezoest.bench.metrics import Metrics, deviation, edges_after, edges_before, measure, settling

PERIOD = 10
AMPLITUDE = 5.0  # settled below 0.06


def record(errors: Sequence[float], theta: Any = None) -> pz.TrackingRecord:
    """A record whose error has one size in each period, and alternates in sign."""
    size = np.repeat(np.asarray(errors, dtype=float), PERIOD)
    reference = size * np.where(np.arange(size.size) % 2, 1.0, -1.0)
    nothing = np.zeros(size.size)
    rows = np.ones((size.size, 3)) if theta is None else np.asarray(theta, dtype=float)
    return pz.TrackingRecord(
        reference, nothing, nothing, nothing, rows, ("alpha", "beta", "gamma"), 50.0, PERIOD
    )


def made(size: int, change: int = 0, rest: tuple[int, int] | None = None, period: float = PERIOD) -> Case:
    signal = pz.Signal(np.zeros(size), 50.0, period)
    return Case("by hand", 0, signal, period, change, AMPLITUDE, RIGHT_MODEL, RIGHT_GAIN, 1, rest)


def numbers(
    errors: Sequence[float], linear: Sequence[float] | None = None, change: int = 0, **more: Any
) -> Metrics:
    theta = more.pop("theta", None)
    theirs = record(linear or [0.5] * len(errors))
    return measure(record(errors, theta), theirs, made(PERIOD * len(errors), change, **more))


@pytest.mark.parametrize(
    ("errors", "periods"),
    [
        ([0.01, 0.01], 0),
        ([1.0, 0.059], 1),
        ([1.0, 0.06], None),
        ([0.01, 1.0, 0.01], 2),
        ([1.0, 0.01, 1.0], None),
        ([1.0, 0.01, np.nan], None),
    ],
)
def test_settling_counts_the_periods_that_were_needed(errors: list[float], periods: int | None) -> None:
    assert settling(np.array(errors), 0.06) == periods
    assert numbers(errors).settling_periods == periods


def test_errors_and_ratios() -> None:
    found = numbers([2.0, 0.5, 0.1, 0.04, 0.02, 0.03], linear=[1.0, 0.4, 0.4, 0.4, 0.4, 0.5])
    assert found.settling_periods == 3
    assert found.periods_to_final == 3  # below 0.06
    assert found.worst_error == 2.0
    assert found.settled_max == 0.04
    assert found.settled_rms == pytest.approx(np.sqrt((0.04**2 + 0.02**2 + 0.03**2) / 3.0))
    assert found.linear_settled_max == 0.5
    assert found.ratio == pytest.approx(0.08)
    # The first period counts for neither.
    assert found.run_ratio == pytest.approx(0.5 / 0.5)
    assert found.worst_ratio == pytest.approx(0.5 / 0.4)
    assert not found.diverged
    assert not found.diverged_in_a_period
    assert found.errors == (2.0, 0.5, 0.1, 0.04, 0.02, 0.03)
    assert found.before_max is None
    assert found.rest_excursion is None


def test_settled_against_the_final_error() -> None:
    found = numbers([2.0, 0.9, 0.44, 0.3, 0.3, 0.3])
    assert (found.settling_periods, found.periods_to_final) == (None, 2)


def test_divergence() -> None:
    over = numbers([0.1, 0.9, 0.1, 0.1], linear=[0.5] * 4)
    assert (over.diverged, over.diverged_in_a_period) == (True, True)
    # Large where linear feed-forward has long settled, but no larger than that was once.
    late = numbers([0.1, 0.1, 0.9, 0.1], linear=[0.5, 0.8, 0.3, 0.3])
    assert (late.diverged, late.diverged_in_a_period) == (False, True)
    # In the first period anything goes.
    early = numbers([9.0, 0.1, 0.1, 0.1], linear=[0.5] * 4)
    assert (early.diverged, early.diverged_in_a_period) == (False, False)
    # Below the settled level nothing is a divergence of a period.
    trifle = numbers([0.1, 0.05, 0.05, 0.05], linear=[0.5, 0.5, 0.001, 0.001])
    assert trifle.worst_ratio == pytest.approx(0.05 / 0.06)
    lost = numbers([0.1, 0.1, np.nan, 0.1], linear=[0.5] * 4)
    assert (lost.diverged, lost.diverged_in_a_period) == (True, True)


def test_only_what_comes_after_the_change_counts() -> None:
    theta = np.ones((60, 3))
    theta[:20] = 5.0
    theta[20:25, 1] = 1.5
    found = numbers([3.0, 0.2, 1.0, 0.03, 0.03, 0.03], change=20, theta=theta)
    assert found.before_max == 0.2
    assert found.errors == (1.0, 0.03, 0.03, 0.03)
    assert found.worst_error == 1.0
    assert found.settling_periods == 1
    assert found.excursion == pytest.approx(0.5)
    # The first period is that of the run, not of the change.
    assert found.run_ratio == pytest.approx(1.0 / 0.5)


def test_a_change_within_a_period() -> None:
    # Change at sample 14: windows [4, 14), [14, 24), ... and a rest of 6 samples that is left out.
    r = record([3.0, 0.2, 0.01, 0.01, 0.01])
    found = measure(r, record([0.5] * 5), made(50, change=14))
    assert found.before_max == 3.0
    assert found.errors == (0.2, 0.01, 0.01)
    # [4, 14) began in the first period and does not count.
    assert found.run_ratio == pytest.approx(0.2 / 0.5)


def test_rest() -> None:
    theta = np.ones((60, 3))
    theta[30:35, 2] = 0.999
    found = numbers([0.5, 0.04, 0.0, 0.0, 0.05, 0.04], change=40, rest=(20, 40), theta=theta)
    assert found.before_max == 0.04
    assert found.rest_excursion == pytest.approx(1e-3)
    assert found.errors == (0.05, 0.04)


def test_edges_of_periods_that_are_no_whole_number_of_samples() -> None:
    assert edges_after(5, 2.5, 13).tolist() == [5, 8, 10, 12]
    assert edges_before(9, 2.5).tolist() == [2, 4, 6, 9]
    assert edges_before(0, 2.5).tolist() == [0]


def test_deviation() -> None:
    assert deviation(np.array([[1.0, -2.0], [1.5, -2.2]]), np.array([1.0, -2.0])) == pytest.approx(0.5)
    assert deviation(np.empty((5, 0)), np.empty(0)) == 0.0


def test_refuses_a_record_without_a_whole_period() -> None:
    with pytest.raises(ValueError, match="ends within a period"):
        measure(record([0.1]), record([0.1]), made(10, change=5))
