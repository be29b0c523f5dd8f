"""Between what a reading will lie, where several kinds may be right."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from piezoest.fitting.result import Prediction
from piezoest.identification.interval import AS_WELL, STILL, interval


def kind(missed: float, x: list[float]) -> Any:
    """One that expects x along a record of four samples, of which three are fitted, and within 3 µm."""
    prediction = Prediction(np.array(x), np.array(x) - 3.0, np.array(x) + 3.0)
    fit = SimpleNamespace(left_out=1, counts=np.ones(3, bool), predict=lambda u: prediction)
    return SimpleNamespace(cross_validated=missed, prediction=prediction, fit=fit)


@pytest.mark.parametrize("u", [None, np.zeros(4)])
@pytest.mark.parametrize(
    ("missed", "x", "half"),
    [
        (AS_WELL, [4.0, -4.0, 0.0, 4.0], [5.0, 5.0, 3.0, 5.0]),
        # Of a kind that is not right in the record only what is more than there counts.
        (1.1 * AS_WELL, [4.0, -4.0, 0.0, 4.0], [3.0, 3.0, 3.0, 3.0]),
        (STILL, [0.0, 1.0, -2.0, 6.0], [3.0, 3.0, 3.0, 5.0]),
        (1.1 * STILL, [0.0, 0.0, 0.0, 9.0], [3.0, 3.0, 3.0, 3.0]),
    ],
)
def test_kinds_may_be_right_as_well(missed: float, x: list[float], half: list[float], u: Any) -> None:
    best = kind(1.0, [0.0, 0.0, 0.0, 0.0])
    found = interval(best, [best, kind(missed, x)], u)
    np.testing.assert_allclose(found.upper, half)
    np.testing.assert_allclose(found.lower, np.negative(half))
