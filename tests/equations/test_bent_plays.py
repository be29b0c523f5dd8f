"""Bent plays: segments, the walk of the inverse, the memory of turning points, Preisach's properties."""

import itertools
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import piezoest as pz
from piezoest.equations import turning_points
from piezoest.equations.play import play
from piezoest.layout import Named, new

RATE = 1000.0


def random_model(seed: int, bends: int = 3) -> pz.PrandtlIshlinskii:
    """Admissible, with weights of both signs, bends and creep."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    thresholds = np.cumsum(rng.uniform(0.2, 5.0, n))
    changes = rng.uniform(-0.01, 0.03, (bends, n + 1))
    base = np.append(0.1, rng.uniform(0.0, 0.03, n))
    lowest = np.vstack([np.zeros(n + 1), np.cumsum(changes, axis=0)]).min(axis=0)
    base = np.maximum(base, -lowest + np.append(0.02, np.zeros(n)))
    return pz.PrandtlIshlinskii(
        base[0], thresholds, base[1:], 0.3,
        creep=pz.Creep([0.04, 0.02], [0.01, 0.5]),
        bends=np.sort(rng.uniform(-15.0, 15.0, bends)), bend_weights=changes, sample_rate=RATE,
    )  # fmt: skip


@given(seed=st.integers(0, 10_000), bends=st.integers(0, 4), scale=st.floats(1e-3, 3.0))
def test_inverse_is_exact(seed: int, bends: int, scale: float) -> None:
    model = random_model(seed, bends)
    assert model.is_admissible
    r = scale * np.cumsum(np.random.default_rng(seed).standard_normal(300))
    u = model.invert(r)
    np.testing.assert_allclose(model.simulate(u), r, atol=1e-9)
    np.testing.assert_allclose(model.invert(model.simulate(u)), u, atol=1e-9)
    assert pz.PrandtlIshlinskii.from_dict(model.to_dict()) == model


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), scale=st.floats(0.1, 10.0))
def test_turning_points_hold_all_the_memory_of_plays(seed: int, scale: float) -> None:
    u = np.round(scale * np.cumsum(np.random.default_rng(seed).standard_normal(150)), 1)
    memory = Named(new(turning_points.TURNING_POINTS), turning_points.TURNING_POINTS)
    thresholds = np.linspace(0.1, 8.0, 9)
    y = np.zeros(9)
    for value in u.tolist():
        y = play(y, value, thresholds)
        turning_points.remember(memory, value)
        np.testing.assert_array_equal([turning_points.recall(memory, r) for r in thresholds], y)


def test_of_more_nested_loops_than_are_kept_the_smallest_are_forgotten() -> None:
    memory = Named(new(turning_points.TURNING_POINTS))
    thresholds = np.array([20.0, 30.0, 45.0])  # V: the loops that are forgotten move none of them
    y = np.zeros(3)
    for value in (60.0 * 0.97 ** np.arange(200) * (-1.0) ** np.arange(200)).tolist():
        y = np.array([play(old, value, r) for old, r in zip(y, thresholds, strict=True)])
        turning_points.remember(memory, value)
        np.testing.assert_array_equal([turning_points.recall(memory, r) for r in thresholds], y)


def line(*turns: float) -> Any:
    parts = [np.linspace(a, b, 101)[1:] for a, b in itertools.pairwise(turns)]
    return np.concatenate([[turns[0]], *parts])


PREISACH = pz.PreisachStage(50_000.0).hysteresis


def test_preisach_is_congruent() -> None:
    """Loops between the same turns are the same but for their level."""
    assert isinstance(PREISACH, pz.Preisach)
    up = PREISACH.simulate(line(0.0, 10.0, 20.0, 10.0, 20.0))[-201:]
    down = PREISACH.simulate(line(0.0, 60.0, 10.0, 20.0, 10.0, 20.0))[-201:]
    np.testing.assert_allclose(np.diff(up - down), 0.0, atol=1e-12)
