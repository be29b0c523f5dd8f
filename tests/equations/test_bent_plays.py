"""Plays, straight and bent: the exact inverse, the memory of turning points, Preisach's properties."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import piezoest as pz
from piezoest.equations import turning_points
from piezoest.equations.play import play
from piezoest.layout import Named, new

RATE = 1000.0


@given(st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=12), st.floats(0.0, 20.0))
def test_play_is_a_piston_in_a_cylinder(u: list[float], r: float) -> None:
    y = piston = 0.0
    for value in u:
        y = play(y, value, r)
        if value - piston > r:
            piston = value - r
        elif value - piston < -r:
            piston = value + r
        assert y == piston


def random_model(seed: int, bends: int) -> pz.PrandtlIshlinskii:
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


def assert_recalled(u: np.ndarray, thresholds: np.ndarray) -> None:
    """The turning points of u give the plays, after every sample."""
    memory = Named(new(turning_points.TURNING_POINTS), turning_points.TURNING_POINTS)
    y = np.zeros(thresholds.size)
    for value in u.tolist():
        y = play(y, value, thresholds)
        turning_points.remember(memory, value)
        np.testing.assert_array_equal([turning_points.recall(memory, r) for r in thresholds], y)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), scale=st.floats(0.1, 10.0))
def test_turning_points_hold_all_the_memory_of_plays(seed: int, scale: float) -> None:
    walk = np.cumsum(np.random.default_rng(seed).standard_normal(150))
    assert_recalled(np.round(scale * walk, 1), np.linspace(0.1, 8.0, 9))


def test_of_more_nested_loops_than_are_kept_the_smallest_are_forgotten() -> None:
    k = np.arange(200)
    # None of the loops that are forgotten moves these plays.
    assert_recalled(60.0 * 0.97**k * (-1.0) ** k, np.array([20.0, 30.0, 45.0]))


def test_preisach_is_congruent() -> None:
    """Loops between the same turns are the same but for their level."""
    model = pz.PreisachStage(50_000.0).hysteresis
    assert isinstance(model, pz.Preisach)
    loops = []
    for turns in ([0.0, 10.0, 20.0, 10.0, 20.0], [0.0, 60.0, 10.0, 20.0, 10.0, 20.0]):
        places = np.arange(100 * len(turns) - 99) / 100.0
        loops.append(model.simulate(np.interp(places, np.arange(len(turns)), turns))[-201:])
    np.testing.assert_allclose(np.diff(loops[0] - loops[1]), 0.0, atol=1e-12)
