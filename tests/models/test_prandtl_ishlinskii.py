"""The Prandtl-Ishlinskii model, creep and mechanics as objects."""

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete

from piezoest import Creep, MassSpringDamper, PrandtlIshlinskii
from piezoest.equations.mechanics import mechanics_coefficients
from piezoest.signals import triangle

MODEL = PrandtlIshlinskii(0.1, [1.0, 4.0], [0.02, 0.03])
CREEP, MECHANICS = Creep.logarithmic(0.01, shortest=0.01, longest=10.0), MassSpringDamper(780.0, 0.02)


def test_initial_state_continues_a_record() -> None:
    u, y = 20.0 * np.sin(np.linspace(0.0, 9.0, 300)), np.zeros(2)
    for value in u[:200]:
        y = np.maximum(value - MODEL.thresholds, np.minimum(value + MODEL.thresholds, y))
    np.testing.assert_array_equal(MODEL.simulate(u[200:], initial_state=y), MODEL.simulate(u)[200:])


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


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: PrandtlIshlinskii(0.1, [1.0, 2.0], [0.1]), "weights must have one value per threshold"),
        (lambda: PrandtlIshlinskii(0.1, [2.0, 1.0], [0.1, 0.1]), "thresholds must rise"),
        (lambda: PrandtlIshlinskii(np.nan, [1.0], [0.1]), "gain must be finite"),
        (lambda: PrandtlIshlinskii(0.1, [1.0], [0.02], bends=[1.0]), "bend_weights"),
        (lambda: PrandtlIshlinskii(0.1, [1.0], [0.02], creep=3.0), "creep"),  # type: ignore[arg-type]
        (lambda: PrandtlIshlinskii.from_theta([0.1, 1.0]), "1 \\+ 2n values"),
        (lambda: MODEL.simulate(np.ones(5), initial_state=np.array([0.0, 50.0])), "cannot be reached"),
        (lambda: Creep([0.1], [0.0]), "time_constants must be above zero"),
        (lambda: Creep.logarithmic(0.01, shortest=1.0, longest=0.1), "longest must be above"),
        (lambda: CREEP.simulate(np.ones(5), sample_rate=1e3, initial_state=np.zeros(3)), "initial_state"),
        (lambda: MassSpringDamper.from_dict({}), "mechanics has no 'natural_frequency'"),
    ],
)
def test_refusals(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


def test_creep() -> None:
    np.testing.assert_allclose(CREEP.time_constants, [0.01, 0.1, 1.0, 10.0])
    np.testing.assert_allclose(CREEP.gains, 0.01)
    again = Creep.from_dict(json.loads(json.dumps(CREEP.to_dict())))
    assert again == CREEP
    assert hash(again) == hash(CREEP)
    x = CREEP.simulate(np.ones(100_000), sample_rate=1000.0)
    # Of first-order terms: gains (1 - exp(-t/time constants)) after a step.
    t = np.arange(1.0, 1.0 + x.size)[:, None] / 1000.0
    np.testing.assert_allclose(x, (1.0 - np.exp(-t / CREEP.time_constants)) @ CREEP.gains, atol=1e-12)
    # A signal says its rate.
    model = PrandtlIshlinskii(0.1, [1.0], [0.02], creep=CREEP, sample_rate=1000.0)
    coarse, fine = (triangle(30.0, 5.0, 2, rate) for rate in (1000.0, 4000.0))
    np.testing.assert_allclose(model.simulate(fine.values[::4]), model.simulate(fine)[::4], atol=1e-3)
    np.testing.assert_allclose(model.simulate(model.invert(fine), sample_rate=4000.0), fine, atol=1e-9)
    with pytest.raises(ValueError, match="sample rates differ: u has 1000 Hz, 4000 Hz is expected"):
        model.simulate(coarse, sample_rate=4000.0)
    rest = CREEP.simulate(np.zeros(1), sample_rate=1000.0, initial_state=CREEP.gains)
    assert rest[0] == pytest.approx(np.sum(CREEP.gains * CREEP.decays(1000.0)))


def test_mechanics() -> None:
    assert MassSpringDamper.from_dict(MECHANICS.to_dict()) == MECHANICS
    x = MECHANICS.simulate(np.ones(50_000), sample_rate=50_000.0)
    assert x.max() == pytest.approx(1.0 + np.exp(-np.pi * 0.02 / np.sqrt(1.0 - 0.02**2)), rel=1e-3)
    assert x[-1] == pytest.approx(1.0, abs=1e-6)


@given(st.floats(10.0, 5000.0), st.one_of(st.floats(0.0, 3.0), st.just(1.0)))
def test_coefficients_are_the_held_discretisation(frequency: float, damping: float) -> None:
    dt, omega = 2e-5, 2.0 * np.pi * frequency
    a = np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]])
    b = np.array([[0.0], [omega**2]])
    a_d, b_d, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), dt)
    a11, a12, a21, a22, b1, b2 = mechanics_coefficients(frequency, damping, dt)
    scale = np.array([1.0, omega])  # velocities in units of omega µm/s
    unit = scale / scale[:, None]
    np.testing.assert_allclose(np.array([[a11, a12], [a21, a22]]) * unit, a_d * unit, atol=1e-11)
    np.testing.assert_allclose(np.array([b1, b2]) / scale, b_d[:, 0] / scale, atol=1e-11)
