"""HysteresisRLS: parity with the textbook, convergence, offsets, delays, gaps, dwells."""

from __future__ import annotations

import json
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import piezoest as pz
from piezoest.estimators import rls_kernel
from piezoest.layout import Named, leaves
from tests.reference import hysteresis_rls as reference

FS = 50_000.0
TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)


def record(seconds: float = 1.0, noise: float = 0.0, fs: float = FS, model: Any = TRUE) -> tuple[Any, Any]:
    u = pz.signals.triangle(33.0, 5.0, 5.0 * seconds, fs).values
    return u, model.simulate(u) + noise * np.random.default_rng(0).standard_normal(u.size)


def test_equals_the_textbook_with_gaps() -> None:
    u, x = record(0.3, 1e-3)
    x[2000] = x[7001] = x[7002] = np.nan
    estimator = pz.HysteresisRLS(FS, memory=0.1, policies=())
    theta = estimator.run(u, x).theta
    expected = reference.coleman_hodgdon(
        u,
        x,
        FS,
        start=np.array([0.02, 0.12, 0.0036]),
        uncertainty=0.5,
        noise=1.5e-3,
        memory=0.1,
        cutoff=2500.0,
    )
    np.testing.assert_allclose(theta, expected, rtol=1e-7)


def test_finds_the_parameters() -> None:
    u, x = record(1.0, 1e-3)
    estimator = pz.HysteresisRLS(FS, memory=0.4)
    estimator.run(u, x)
    np.testing.assert_allclose(estimator.theta, TRUE.theta, rtol=0.02)
    assert estimator.status.updates == u.size - 1
    assert not estimator.status.projected


def test_finds_the_gain() -> None:
    u, x = record(1.0, 1e-3, model=pz.LinearGain(0.155))
    estimator = pz.HysteresisRLS(FS, initial_model=pz.LinearGain(0.1), memory=0.4)
    estimator.run(u, x)
    np.testing.assert_allclose(estimator.model.theta, [0.155], rtol=1e-4)
    with_offset = pz.HysteresisRLS(FS, initial_model=pz.LinearGain(0.1), offset=True, memory=None)
    with_offset.run(u + 20.0, x + 3.0)
    np.testing.assert_allclose(with_offset.model.theta, [0.155], rtol=1e-3)
    assert with_offset.model.to_dict()["offset"] == pytest.approx(3.0 - 0.155 * 20.0, abs=1e-2)


def test_offset_needs_no_high_pass() -> None:
    """A unipolar voltage and a biased gauge: centre (60 V, -120 µm)."""
    u, x = record(1.0, 1e-3)
    plain = pz.HysteresisRLS(FS, memory=0.4)
    plain.run(u + 60.0, x - 120.0)
    centred = pz.HysteresisRLS(FS, memory=0.4, offset=True)
    centred.run(u + 60.0, x - 120.0)
    assert not np.allclose(plain.theta, TRUE.theta, rtol=0.2)
    np.testing.assert_allclose(centred.theta[:3], TRUE.theta, rtol=0.03)
    model = centred.model
    assert isinstance(model, pz.ColemanHodgdon)
    assert model.offset == pytest.approx(-120.0 - TRUE.c * 60.0, abs=0.15)
    again = model.simulate(u + 60.0)
    assert np.max(np.abs(again - (x - 120.0))[u.size // 2 :]) < 0.02


def test_high_pass_removes_a_bias_of_the_sensor() -> None:
    u = pz.signals.triangle(33.0, 5.0, 25, FS, smoothing=0.0).values
    x = TRUE.simulate(u)
    biased, passed = pz.HysteresisRLS(FS, memory=0.4), pz.HysteresisRLS(FS, memory=0.4, high_pass=0.5)
    biased.run(u, x + 2.0)
    passed.run(u, x + 2.0)

    def worst(estimator: Any) -> float:
        return float(np.max(np.abs(estimator.theta / TRUE.theta - 1.0)))

    assert worst(passed) < 1e-3 < 0.5 < worst(biased)


@pytest.mark.parametrize("delay", [1.0, 3.0, 2.5])
def test_delay(delay: float) -> None:
    u, x = record(1.0)
    late = np.interp(np.arange(x.size) - delay, np.arange(x.size), x)
    estimator = pz.HysteresisRLS(FS, memory=0.4, delay=delay)
    estimator.run(u, late)
    np.testing.assert_allclose(estimator.theta, TRUE.theta, rtol=2e-3)
    # At a tenth of the rate the same delay, left out, would show.
    slow_u, slow_x = record(1.0, fs=2000.0)
    late = np.interp(np.arange(slow_x.size) - delay, np.arange(slow_x.size), slow_x)
    told, untold = pz.HysteresisRLS(2000.0, memory=0.4, delay=delay), pz.HysteresisRLS(2000.0, memory=0.4)
    told.run(slow_u, late)
    untold.run(slow_u, late)
    error = np.abs(told.theta / TRUE.theta - 1.0).max()
    assert error < 0.3 * np.abs(untold.theta / TRUE.theta - 1.0).max()


@pytest.mark.parametrize("time_base", ["discrete", "continuous"])
@pytest.mark.parametrize("options", [{}, {"offset": True}, {"high_pass": 0.5, "delay": 2.5}])
def test_step_run_and_split_run_are_the_same_bits(time_base: Any, options: dict[str, Any]) -> None:
    u, x = record(0.05, 1e-3)
    x[777] = np.nan
    whole, steps, halves, parts = (pz.HysteresisRLS(FS, time_base=time_base, **options) for _ in range(4))
    trace = whole.run(u, x, record=("y", "S", "P"))
    for k in range(u.size):
        steps.step(float(u[k]), None if k == 777 else float(x[k]))
        parts.predict(float(u[k]))
        parts.update(float(x[k]))
    halves.run(u[:1000], x[:1000])
    saved = json.loads(json.dumps(halves.to_dict(), allow_nan=False))
    resumed = pz.HysteresisRLS.from_dict(saved)
    pickled = pickle.loads(pickle.dumps(resumed))
    later = resumed.run(u[1000:], x[1000:])
    pickled.run(u[1000:], x[1000:])
    assert np.array_equal(later.theta, trace.theta[1000:])
    for other in (steps, parts, resumed, pickled, whole.copy()):
        assert np.array_equal(other.theta, whole.theta)
        assert np.array_equal(other.P, whole.P)
        assert other.status == whole.status
        assert other.y == whole.y
    assert trace.y is not None
    assert trace.P is not None
    assert trace.y[-1] == whole.y
    assert np.array_equal(trace.P[-1], whole.P)
    whole.reset()
    assert np.array_equal(whole.run(u, x, every=10).theta, trace.theta[9::10])


def test_a_missing_sample_changes_nothing_but_itself() -> None:
    u, x = record(1.0, 1e-3)
    whole, gappy = (pz.HysteresisRLS(FS, memory=0.4) for _ in range(2))
    whole.run(u, x)
    x[20_000] = np.nan
    trace = gappy.run(u, x)
    np.testing.assert_array_equal(trace.theta[20_000], trace.theta[19_999])
    np.testing.assert_allclose(gappy.theta, whole.theta, rtol=1e-4)
    assert gappy.status.missing == 1


def test_long_gap_starts_anew() -> None:
    u, x = record(2.0)
    x[30_000:52_345] = np.nan
    estimator = pz.HysteresisRLS(FS, memory=0.4)
    estimator.run(u, x)
    np.testing.assert_allclose(estimator.theta, TRUE.theta, rtol=1e-3)


def test_dwell_of_a_minute_moves_nothing() -> None:
    u, x = record(2.0, 1e-3)
    half = u.size // 2
    estimator = pz.HysteresisRLS(FS, memory=0.4)
    estimator.run(u[:half], x[:half])
    before = estimator.theta
    noise = 1e-3 * np.random.default_rng(1).standard_normal(50_000)
    for _ in range(60):
        estimator.run(np.full(50_000, u[half]), x[half] + noise, every=50_000)
    np.testing.assert_allclose(estimator.theta, before, rtol=2e-3)
    assert np.all(np.isfinite(estimator.P))
    assert estimator.status.held > 2_900_000
    estimator.run(u[half:], x[half:])
    np.testing.assert_allclose(estimator.theta, TRUE.theta, rtol=0.02)


def test_dwell_without_a_dead_zone_stays_within_the_bound() -> None:
    u, x = record(1.0, 1e-3)
    estimator = pz.HysteresisRLS(FS, memory=0.05, policies=(pz.policies.NormBound(10.0),))
    estimator.run(u, x)
    for _ in range(60):
        estimator.run(np.full(50_000, u[-1]), np.full(50_000, x[-1]), every=50_000)
    relative = estimator.P / np.outer([0.02, 0.12, 0.0036], [0.02, 0.12, 0.0036])
    assert np.trace(relative) <= 10.0 * 0.75 * (1.0 + 1e-9)
    assert np.all(np.isfinite(estimator.theta))


@given(
    st.lists(
        st.tuples(
            st.floats(allow_nan=True, allow_infinity=True), st.floats(allow_nan=True, allow_infinity=True)
        ),
        max_size=60,
    ),
    st.booleans(),
    st.sampled_from(["discrete", "continuous"]),
)
def test_nothing_makes_the_estimate_infinite(
    samples: list[tuple[float, float]], offset: bool, base: Any
) -> None:
    estimator = pz.HysteresisRLS(1000.0, offset=offset, time_base=base)
    for u, x in samples:
        estimator.step(u, x)
    assert np.all(np.isfinite(estimator.theta))
    assert np.all(np.isfinite(estimator.P))
    model = estimator.model
    assert model.is_admissible


def test_continuous_law_in_seconds_adapts_over_seconds() -> None:
    """The paper's normalised law is bounded per unit of time: in seconds it is the slower one."""
    u, x = record(1.0)
    errors = []
    bases: tuple[Any, ...] = ("discrete", "continuous")
    for base in bases:
        estimator = pz.HysteresisRLS(FS, memory=0.4, time_base=base)
        estimator.run(u, x)
        errors.append(np.abs(estimator.theta / TRUE.theta - 1.0).max())
    assert errors[0] < 1e-3 < errors[1]


def test_covariance_resetting() -> None:
    u, x = record(1.0)
    estimator = pz.HysteresisRLS(FS, memory=0.4, policies=(pz.policies.CovarianceResetting(1e-4),))
    estimator.run(u, x)
    assert estimator.status.resets > 0
    resets = estimator.status.resets
    estimator.reset_covariance()
    assert estimator.status.resets == resets + 1
    np.testing.assert_allclose(np.diag(estimator.P), (0.5 * np.array([0.02, 0.12, 0.0036])) ** 2)


def test_gain_of_the_last_sample() -> None:
    u, x = record(0.01, 1e-3)
    estimator = pz.HysteresisRLS(FS)
    assert estimator.K.shape == (4,)
    estimator.run(u, x)
    assert np.all(np.isfinite(estimator.K))
    assert estimator.standard_errors.shape == (4,)


@pytest.mark.parametrize("options", [{}, {"memory": 0.4}], ids=["default", "the paper's"])
def test_without_errors_nothing_else_changes(options: dict[str, Any]) -> None:
    u, x = record(0.5, 1e-3)
    estimator = pz.HysteresisRLS(FS, **options)
    lean = pz.HysteresisRLS(FS, errors=False, **options)
    assert np.array_equal(lean.run(u, x).theta, estimator.run(u, x).theta)
    assert estimator.excitation > 0.0
    assert np.isnan(lean.excitation)
    assert np.array_equal(lean.standard_errors, np.sqrt(np.diag(lean.P)))
    assert not np.allclose(lean.standard_errors, estimator.standard_errors, rtol=0.01)
    again = pz.HysteresisRLS.from_dict(json.loads(json.dumps(lean.to_dict())))
    assert np.array_equal(again.standard_errors, lean.standard_errors)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"errors": False, "delay": 1.5},
        {"memory": 0.4, "errors": False},
        {"initial_model": pz.LinearGain(0.15), "offset": True},
        {"time_base": "continuous", "high_pass": 0.5},
    ],
)
def test_machine_code_does_what_its_source_says(options: dict[str, Any]) -> None:
    u, x = record(0.02, 1e-3)
    x[300:310] = u[500] = np.nan
    x[20:120] = np.inf
    machine, plain = pz.HysteresisRLS(FS, **options), pz.HysteresisRLS(FS, **options)
    machine.run(u, x)
    state, given = Named(plain.state, plain.layout), Named(plain.settings, plain.layouts[1])
    with np.errstate(all="ignore"):
        for u_k, x_k in zip(u.tolist(), x.tolist(), strict=True):
            rls_kernel.sample(state, given, u_k, x_k)
    for name, _, (one, other) in leaves(machine.layout, machine.state, plain.state):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12, err_msg=name)
    assert machine.status.updates > 500


def test_wrong_arguments() -> None:
    with pytest.raises(ValueError, match="sample_rate must be above zero"):
        pz.HysteresisRLS(0.0)
    with pytest.raises(ValueError, match="initial_model must be"):
        pz.HysteresisRLS(FS, initial_model="coleman-hodgdon")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="memory must be above zero"):
        pz.HysteresisRLS(FS, memory=-1.0)
    with pytest.raises(ValueError, match="time_base must be"):
        pz.HysteresisRLS(FS, time_base="seconds")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="policies holds 2 of NormBound"):
        pz.HysteresisRLS(FS, policies=(pz.policies.NormBound(), pz.policies.NormBound()))
    with pytest.raises(ValueError, match="memory must be one number, got 'foo'"):
        pz.HysteresisRLS(FS, memory="foo")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="offset must be True, False or None"):
        pz.HysteresisRLS(FS, offset="x")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="policies must be a tuple"):
        pz.HysteresisRLS(FS, policies=3)  # type: ignore[arg-type]
    estimator = pz.HysteresisRLS(FS)
    with pytest.raises(ValueError, match="u and x must have the same length, got 3 and 2"):
        estimator.run([1.0, 2.0, 3.0], [1.0, 2.0])
    with pytest.raises(ValueError, match="predict"):
        estimator.update(1.0)
    with pytest.raises(ValueError, match="record holds unknown names"):
        estimator.run([1.0], [1.0], record=("theta",))
    with pytest.raises(ValueError, match="not of a HysteresisRLS"):
        pz.HysteresisRLS.from_dict({"estimator": "Other"})
    with pytest.raises(AttributeError):
        estimator.memmory = 3.0  # type: ignore[attr-defined]
