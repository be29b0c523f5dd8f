"""The lead: exact to second order, stable, bounded, and worth it near the resonance."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.equations.lead import SETTINGS, STATE, lead_coefficients, lead_step
from piezoest.layout import Named, new

FS = 50_000.0
MECHANICS = pz.MassSpringDamper(780.0, 0.02)
LIMITS = pz.VoltageLimits(-60.0, 60.0)


def lead(model: pz.ColemanHodgdon | pz.LinearGain, **options: Any) -> pz.LeadFilter:
    return pz.LeadFilter(pz.InverseCompensator(model, LIMITS), MECHANICS, sample_rate=FS, **options)


@pytest.mark.parametrize("smoothing", [5e-5, 2e-4])
def test_a_parabola_is_led_exactly(smoothing: float) -> None:
    numbers = lead_coefficients(780.0, 0.02, 3e-5, smoothing, 1.0 / FS)
    t = np.arange(2000) / FS
    state, settings = Named(new(STATE), STATE), Named(new(SETTINGS, **numbers), SETTINGS)
    led = [lead_step(state, r, settings) for r in (20.0 * t + 300.0 * t**2).tolist()]
    omega, lag, v, a = 2.0 * np.pi * 780.0, 2e-5, 20.0 + 600.0 * t[-1], 600.0
    c1, c2 = 0.04 / omega + lag, 1.0 / omega**2 + 0.04 / omega * lag + lag**2 / 2.0
    assert led[-1] == pytest.approx(20.0 * t[-1] + 300.0 * t[-1] ** 2 + c1 * v + c2 * a, abs=1e-9)


def test_run_is_a_loop_of_step_with_gaps() -> None:
    model = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
    r = 4.0 * np.sin(np.arange(4000) * 5e-3)
    r[1000:1010], r[2000] = np.nan, np.inf
    whole, single, split = lead(model), lead(model), lead(model)
    u = whole.run(r)
    np.testing.assert_array_equal([single.step(value) for value in r.tolist()], u)
    np.testing.assert_array_equal(np.concatenate([split.run(r[:1005]), split.copy().run(r[1005:])]), u)
    assert np.all(np.isfinite(u))
    assert whole.status.missing == 11
    whole.reset()
    np.testing.assert_array_equal(whole.run(r), u)


def test_voltage_keeps_its_limits_and_is_bounded() -> None:
    rng = np.random.default_rng(0)
    wild = lead(pz.LinearGain(0.15)).run(rng.normal(scale=50.0, size=20_000))
    assert np.max(np.abs(wild)) == 60.0
    jumps = np.repeat(rng.choice([-1.0, 1.0], 200), 100)
    assert np.max(np.abs(lead(pz.LinearGain(0.15)).run(jumps))) < 4.0 / 0.15


def settled(stage: Any, reference: pz.Signal, with_lead: bool) -> float:
    start = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
    options: dict[str, Any] = {"mechanics": MECHANICS, "delay": 1.95} if with_lead else {"delay": 0.97}
    compensator: Any = lead(start, delay=1.95e-5) if with_lead else pz.InverseCompensator(start, LIMITS)
    estimator = pz.PrandtlIshlinskiiRLS(FS, **options)
    record = pz.track(reference, stage=stage(FS), compensator=compensator, estimator=estimator)
    return record.max_error(2)


@pytest.mark.parametrize("stage", [pz.PaperStage, pz.PreisachStage])
@pytest.mark.slow
def test_error_at_a_twentieth_of_the_resonance(stage: Any) -> None:
    triangle = pz.signals.triangle(5.0, 39.0625, 40, FS)
    assert settled(stage, triangle, True) < 0.8 * settled(stage, triangle, False)
