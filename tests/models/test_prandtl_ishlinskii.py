"""The Prandtl-Ishlinskii model, creep and mechanics as objects."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezoest import Creep, MassSpringDamper, PrandtlIshlinskii


@st.composite
def models(draw: st.DrawFn) -> PrandtlIshlinskii:
    """Admissible models, weights of either sign."""
    n = draw(st.integers(0, 8))
    steps = [draw(st.floats(0.05, 10.0)) for _ in range(n)]
    slopes = [draw(st.floats(0.02, 0.5)) for _ in range(n + 1)]
    return PrandtlIshlinskii(slopes[0], np.cumsum(steps), np.diff(slopes), draw(st.floats(-2.0, 2.0)))


@given(models(), st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=20))
def test_inverse_undoes_simulate(model: PrandtlIshlinskii, u: list[float]) -> None:
    assert model.is_admissible
    np.testing.assert_allclose(model.invert(model.simulate(np.array(u))), u, atol=1e-9)


@given(models(), st.lists(st.floats(-15.0, 15.0), min_size=1, max_size=20))
def test_simulate_undoes_inverse(model: PrandtlIshlinskii, r: list[float]) -> None:
    np.testing.assert_allclose(model.simulate(model.invert(np.array(r))), r, atol=1e-9)


def test_inverse_holds_over_a_long_record_with_many_plays() -> None:
    r = np.linspace(0.5, 60.0, 70)
    model = PrandtlIshlinskii(0.1, r, 0.005 * np.exp(-r / 15.0))
    reference = np.cumsum(np.random.default_rng(1).standard_normal(20_000)) * 0.05
    np.testing.assert_allclose(model.simulate(model.invert(reference)), reference, atol=1e-9)


def test_initial_state_continues_a_record() -> None:
    model = PrandtlIshlinskii(0.1, [1.0, 4.0], [0.02, 0.03])
    u = 20.0 * np.sin(np.linspace(0.0, 9.0, 300))
    y = np.zeros(2)
    for value in u[:200]:
        y = np.maximum(value - model.thresholds, np.minimum(value + model.thresholds, y))
    np.testing.assert_array_equal(model.simulate(u[200:], initial_state=y), model.simulate(u)[200:])
    with pytest.raises(ValueError, match="cannot be reached by any voltage"):
        model.simulate(u, initial_state=np.array([0.0, 50.0]))
    with pytest.raises(ValueError, match="initial_state must hold 2 play states, got 3"):
        model.simulate(u, initial_state=np.zeros(3))


def test_simulate_takes_read_only_arrays_and_leaves_its_argument() -> None:
    model = PrandtlIshlinskii(0.1, [1.0], [0.02])
    u = np.linspace(0.0, 5.0, 11)
    u.flags.writeable = False
    before = u.copy()
    model.simulate(u)
    model.invert(u)
    np.testing.assert_array_equal(u, before)


def test_vector_and_dictionary_forms() -> None:
    model = PrandtlIshlinskii(0.1, [1.0, 4.0], [0.02, 0.03], offset=0.5)
    assert len(model.parameter_names) == len(model.parameter_units) == model.theta.size == 5
    assert PrandtlIshlinskii.from_theta(model.theta, offset=0.5) == model
    again = PrandtlIshlinskii.from_dict(json.loads(json.dumps(model.to_dict())))
    assert again == model
    assert hash(again) == hash(model)
    assert model != PrandtlIshlinskii(0.1, [1.0, 4.0], [0.02, 0.031], offset=0.5)
    assert model != "model"
    with pytest.raises(ValueError, match="assignment destination is read-only"):
        model.weights[0] = 1.0
    with pytest.raises(ValueError, match="1 \\+ 2n values"):
        PrandtlIshlinskii.from_theta([0.1, 1.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.1, [1.0, 2.0], [0.1]), "weights must have one value per threshold"),
        ((0.1, [0.0, 2.0], [0.1, 0.1]), "thresholds must be above zero.*add the weight"),
        ((0.1, [2.0, 1.0], [0.1, 0.1]), "thresholds must rise"),
        ((0.1, [1.0, 1.0], [0.1, 0.1]), "thresholds must rise"),
        ((np.nan, [1.0], [0.1]), "gain must be finite"),
        ((0.1, [[1.0]], [0.1]), "thresholds must have shape"),
    ],
)
def test_refusals(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PrandtlIshlinskii(*arguments)


def test_inadmissible_models_have_no_inverse() -> None:
    model = PrandtlIshlinskii(0.1, [1.0, 2.0], [-0.2, 0.3])
    assert not model.is_admissible
    with pytest.raises(ValueError, match=r"no inverse, its lowest slope is -0\.1"):
        model.invert(np.zeros(3))


def test_creep() -> None:
    creep = Creep.logarithmic(0.01, shortest=0.01, longest=10.0)
    np.testing.assert_allclose(creep.time_constants, [0.01, 0.1, 1.0, 10.0])
    np.testing.assert_allclose(creep.gains, 0.01)
    assert Creep.from_dict(json.loads(json.dumps(creep.to_dict()))) == creep
    assert hash(Creep.from_dict(creep.to_dict())) == hash(creep)
    x = creep.simulate(np.ones(100_000), sample_rate=1000.0)
    assert x[-1] == pytest.approx(creep.gains.sum(), rel=1e-3)
    halves = [
        creep.simulate(np.ones(5), sample_rate=1000.0, initial_state=np.zeros(4)),
        creep.simulate(np.zeros(1), sample_rate=1000.0, initial_state=creep.gains),
    ]
    np.testing.assert_array_equal(halves[0], x[:5])
    assert halves[1][0] == pytest.approx(np.sum(creep.gains * creep.decays(1000.0)))
    with pytest.raises(ValueError, match="time_constants must be above zero"):
        Creep([0.1], [0.0])
    with pytest.raises(ValueError, match="one value per gain"):
        Creep([0.1, 0.2], [1.0])
    with pytest.raises(ValueError, match="longest must be above"):
        Creep.logarithmic(0.01, shortest=1.0, longest=0.1)
    with pytest.raises(ValueError, match="creep has no 'time_constants'"):
        Creep.from_dict({"gains": [1.0]})
    with pytest.raises(ValueError, match="initial_state must hold 4"):
        creep.simulate(np.ones(5), sample_rate=1000.0, initial_state=np.zeros(3))


def test_many_plays_are_counted_not_listed() -> None:
    model = PrandtlIshlinskii(0.1, np.arange(1.0, 41.0), np.full(40, 0.002), offset=1.5)
    assert (
        repr(model) == "PrandtlIshlinskii(gain=0.1, 40 plays up to 40 V, 0 bends, 0 creep terms, offset=1.5)"
    )


def test_mechanics() -> None:
    mechanics = MassSpringDamper(780.0, 0.02)
    assert MassSpringDamper.from_dict(mechanics.to_dict()) == mechanics
    x = mechanics.simulate(np.ones(50_000), sample_rate=50_000.0)
    assert x.max() == pytest.approx(1.0 + np.exp(-np.pi * 0.02 / np.sqrt(1.0 - 0.02**2)), rel=1e-3)
    assert x[-1] == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(ValueError, match="natural_frequency must be above zero"):
        MassSpringDamper(0.0, 0.02)
    with pytest.raises(ValueError, match="initial_state must hold displacement and velocity"):
        mechanics.simulate(np.ones(3), sample_rate=1e4, initial_state=np.zeros(1))
    with pytest.raises(ValueError, match="mechanics has no 'natural_frequency'"):
        MassSpringDamper.from_dict({})
