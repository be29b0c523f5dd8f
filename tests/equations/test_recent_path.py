"""The recent path of the voltage tells where any Coleman-Hodgdon model would stand."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from piezoest.equations import recent_path
from piezoest.equations.coleman_hodgdon import hysteresis_step
from piezoest.layout import Named, new


def followed(u: np.ndarray, rest: float = 0.0, a: float = 0.02) -> Named:
    path = Named(new(recent_path.PATH), recent_path.PATH)
    recent_path.begin(path, rest, a)
    for value in u:
        recent_path.follow(path, float(value))
    return path


def with_decay(path: Named, a: float) -> float:
    recent_path.use_decay(path, a)
    return float(recent_path.hysteresis(path))


def simulated(u: np.ndarray, a: float, rest: float = 0.0) -> float:
    h, last = 0.0, rest
    for value in u:
        h, last = hysteresis_step(h, value - last, a, 1.0), value
    return float(h)


def triangle(turns: list[float], samples: int = 5) -> np.ndarray:
    places = np.concatenate([[0.0], turns])
    return np.interp(np.arange(1, samples * len(turns) + 1) / samples, np.arange(places.size), places)


@given(
    st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=recent_path.MOST - 1),
    st.floats(1e-4, 0.5),
    st.floats(-20.0, 20.0),
)
def test_equals_a_model_that_had_been_running(turns: list[float], a: float, rest: float) -> None:
    u = triangle(turns)
    expected = simulated(u, a, rest)
    # A way back of a hundredth of a swing is no turn, and what is long gone is left out.
    slack = 2.0 * recent_path.TURN * (np.ptp(u) + abs(rest)) * len(turns)
    path = followed(u, rest)
    assert abs(with_decay(path, a) - expected) <= slack + 3.0 * recent_path.FORGOTTEN / a
