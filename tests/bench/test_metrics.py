"""Metrics of records made by hand, whose numbers one can see."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench.cases import RIGHT_GAIN, RIGHT_MODEL, Case
from piezoest.bench.metrics import measure, settles

PERIOD = 10
AMPLITUDE = 5.0  # settled below 0.06


def record(errors: Sequence[float]) -> pz.TrackingRecord:
    """A record whose error has one size in each period, and alternates in sign."""
    size = np.repeat(np.asarray(errors, dtype=float), PERIOD)
    reference = size * np.where(np.arange(size.size) % 2, 1.0, -1.0)
    nothing, rows = np.zeros(size.size), np.ones((size.size, 3))
    names = ("alpha", "beta", "gamma")
    return pz.TrackingRecord(reference, nothing, nothing, nothing, rows, names, 50.0, PERIOD)


def numbers(errors: Sequence[float], linear: Sequence[float] = (), change: int = 0) -> dict[str, Any]:
    signal = pz.Signal(np.zeros(PERIOD * len(errors)), 50.0, PERIOD)
    case = Case("by hand", 0, signal, PERIOD, change, AMPLITUDE, RIGHT_MODEL, RIGHT_GAIN, 1)
    return measure(record(errors), record(linear or [0.5] * len(errors)), case)


@pytest.mark.parametrize(
    ("errors", "periods"),
    [([0.01, 0.01], 0), ([1.0, 0.059], 1), ([1.0, 0.06], None), ([0.01, 1.0, 0.01], 2),
     ([1.0, 0.01, 1.0], None), ([1.0, 0.01, np.nan], None)],
)  # fmt: skip
def test_periods_until_every_further_error_is_below_the_level(errors: Any, periods: int | None) -> None:
    assert settles(np.array(errors), 0.06) == periods


def test_a_settled_error_is_that_of_the_last_half_and_of_five_periods_at_least() -> None:
    errors = [2.0, 0.9, 0.5, 0.1, 0.04, 0.02, 0.03, 0.02, 0.02, 0.02, 0.05, 0.02]
    found = numbers(errors)
    assert found["errors"] == errors
    # Settled is the largest of the last six.
    assert [found[name] for name in ("settles", "first", "worst", "settled")] == [4, 2.0, 2.0, 0.05]
    assert found["settled_rms"] == pytest.approx(np.sqrt(np.mean(np.square(errors[6:]))))
    assert found["typical"] == pytest.approx(np.exp(np.mean(np.log(errors))))
    # A slow start cannot count as settled: there are always periods before.
    assert numbers([2.0, *[0.02] * 5])["settled"] == 0.02
    with pytest.raises(ValueError, match="5 periods after the change are too few"):
        numbers([2.0, *[0.02] * 4])


def test_what_comes_before_the_change_counts_for_divergence_alone() -> None:
    found = numbers([9.0, 0.9, 0.3, 0.02, 0.02, 0.02, 0.02, 0.02], change=20)
    assert found["errors"] == [0.3, 0.02, 0.02, 0.02, 0.02, 0.02]
    assert (found["first"], found["worst"], found["settles"]) == (0.3, 0.3, 1)
    assert found["diverged"]  # 0.9, where linear feed-forward has 0.5


@pytest.mark.parametrize(
    ("errors", "linear", "diverged"),
    [
        ([9.0, 0.1, 0.1], [0.5] * 3, False),  # in the first period anything goes
        ([0.1, 0.1, 0.9], [0.5] * 3, True),
        ([0.1, 0.1, 0.9], [0.5, 0.8, 0.3], False),  # no larger than that was once
        ([0.1, 0.1, np.nan], [0.5] * 3, True),
    ],
)
def test_divergence(errors: list[float], linear: list[float], diverged: bool) -> None:
    assert numbers([*errors, *[0.1] * 4], [*linear, *[0.3] * 4])["diverged"] is diverged
