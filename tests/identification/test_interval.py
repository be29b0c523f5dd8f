"""Between what a reading will lie, where several kinds may be right."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from piezoest.fitting.result import Prediction
from piezoest.identification.interval import AS_WELL, STILL, interval


def kind(missed: float, x: list[float]) -> Any:
    """One that expects x along a record of four samples, of which three are fitted, and within 3 µm."""
    expected = np.array(x)
    prediction = Prediction(expected, expected - 3.0, expected + 3.0)
    fit = SimpleNamespace(left_out=1, counts=np.ones(3, bool), predict=lambda u: prediction)
    return SimpleNamespace(cross_validated=missed, prediction=prediction, fit=fit)


@pytest.mark.parametrize("u", [None, np.zeros(4)])
@pytest.mark.parametrize(
    ("missed", "half"),
    [
        (AS_WELL, [5.0, 5.0, 3.0, 5.0]),
        # Of a kind that is not right in the record only what is more than there counts.
        (1.1 * AS_WELL, [3.0, 3.0, 3.0, 3.0]),
        (1.1 * STILL, [3.0, 3.0, 3.0, 3.0]),
    ],
)
def test_kinds_that_are_about_as_good_may_be_right(missed: float, half: list[float], u: Any) -> None:
    best = kind(1.0, [0.0, 0.0, 0.0, 0.0])
    found = interval(best, [best, kind(missed, [4.0, -4.0, 0.0, 4.0])], u)
    np.testing.assert_allclose(found.upper, half)
    np.testing.assert_allclose(found.lower, np.negative(half))


def test_other_kinds_count_where_they_differ_by_more_than_in_the_record() -> None:
    best, others = kind(1.0, [0.0] * 4), [kind(STILL, [0.0, 1.0, -2.0, 6.0]), kind(2.0 * STILL, [0, 0, 0, 9])]
    np.testing.assert_allclose(interval(best, [best, *others], None).upper, [3.0, 3.0, 3.0, 5.0])
