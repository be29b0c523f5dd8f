"""Compensators: exactness, limits, bumpless change of model, feedback, lead."""

from functools import partial
from typing import Any

import numpy as np
import pytest

import piezoest as pz

FS = 50_000.0
MECHANICS = pz.MassSpringDamper(780.0, 0.02)
MODEL = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
PLAYS = pz.PrandtlIshlinskii(0.11, [0.5, 2.0], [0.02, 0.03])
BENT = pz.PrandtlIshlinskii(
    0.1, [1.0, 3.0, 9.0], [0.01, 0.02, 0.01], 0.3, creep=pz.Creep([0.04, 0.03], [0.01, 0.5]),
    bends=[-8.0, 5.0], bend_weights=[[0.01, 0.0, 0.01, 0.0], [0.0, 0.005, -0.01, 0.0]], sample_rate=FS,
)  # fmt: skip


def triangle(periods: int = 3) -> Any:
    return pz.signals.triangle(5.0, 5.0, periods, FS)


@pytest.mark.parametrize(
    "make",
    [
        partial(pz.InverseCompensator, MODEL),
        partial(pz.InverseCompensator, MODEL, method="bogacki-shampine"),
        partial(pz.InverseCompensator, BENT),
        partial(pz.InverseCompensator, pz.LinearGain(-0.15)),
        partial(pz.LinearCompensator, pz.LinearGain(0.15, offset=0.3)),
    ],
)
def test_step_run_and_split_run_are_the_same_bits_within_limits(make: Any) -> None:
    r = triangle(1).values.copy()
    r[400], r[5000:5020] = np.nan, np.inf
    limits = pz.VoltageLimits(-25.0, 28.0, slew_rate=900.0, sample_rate=FS)
    whole, steps, parts = (make(limits=limits) for _ in range(3))
    u = whole.run(r)
    np.testing.assert_array_equal([steps.step(value) for value in r.tolist()], u)
    np.testing.assert_array_equal(np.concatenate([parts.run(r[:123]), parts.run(r[123:])]), u)
    assert whole.status == steps.status == parts.status
    assert whole.status.missing == 21
    assert whole.status.saturated > 0
    assert steps.step(None) == u[-1]
    # Where nothing limits it, the model stands where the reference is.
    free = (u > -25.0 + 1e-9) & (u < 28.0 - 1e-9) & np.isfinite(r)
    free &= np.abs(np.diff(u, prepend=0.0)) < 900.0 / FS - 1e-9
    assert 0.5 < free.mean() < 1.0
    np.testing.assert_allclose(whole.model.simulate(u)[free], r[free], atol=1e-9)
    whole.reset()
    np.testing.assert_array_equal(whole.run(r), u)


@pytest.mark.parametrize("at", [700, 2500, 4100])
def test_change_of_model_is_bumpless(at: int) -> None:
    r = triangle(2).values
    new = pz.ColemanHodgdon(0.033, 0.12, 0.0055, offset=0.2)
    compensator = pz.InverseCompensator(MODEL)
    before = compensator.run(r[:at])
    compensator.model = new
    u = np.concatenate([before, compensator.run(r[at:])])
    assert np.abs(np.diff(u)).max() < 3.0 * np.abs(np.diff(before)).max()
    # Once paid back, it is the new model's inverse: the output follows r.
    settled = pz.InverseCompensator(new)
    for each in (compensator, settled):
        each.run(np.tile(r, 3))
    np.testing.assert_allclose(compensator.run(r), settled.run(r), atol=1e-3)


@pytest.mark.parametrize("models", [(BENT, PLAYS), (MODEL, BENT), (PLAYS, pz.LinearGain(0.15))])
def test_change_to_a_model_of_another_kind_is_bumpless(models: tuple[Any, Any]) -> None:
    r = 3.0 * np.sin(np.arange(2000) / 200.0)
    compensator = pz.InverseCompensator(models[0], sample_rate=FS, transfer_samples=100)
    first = compensator.run(r[:1000])
    compensator.model = models[1]
    u = np.concatenate([first, compensator.run(r[1000:])])
    assert abs(u[1000] - u[999]) < 2.0 * np.abs(np.diff(first)).max()
    # Plays were set from the voltage's turning points: what was owed is paid back, and then it fits.
    if models[1] is PLAYS:
        np.testing.assert_allclose(PLAYS.simulate(u)[-100:], r[-100:], atol=1e-3)


def test_an_inadmissible_model_is_replaced_and_one_without_an_inverse_ignored() -> None:
    compensator: Any = pz.InverseCompensator(MODEL)
    compensator.model = pz.ColemanHodgdon(0.021, 0.147, 0.02)
    assert compensator.status.projected
    assert compensator.model.is_admissible
    assert np.all(np.isfinite(compensator.run(triangle(1))))
    compensator.model = pz.LinearGain(0.15)
    assert not compensator.status.projected
    compensator.reset()
    compensator.model = pz.LinearGain(0.15, 1e12)
    assert compensator.status.projected
    assert compensator.model == MODEL


def lead(compensator: Any, **options: Any) -> Any:
    return pz.LeadFilter(compensator, **{"mechanics": MECHANICS, "sample_rate": FS, **options})


later: Any = partial  # of wrong types, too
LINE = pz.LinearCompensator(pz.LinearGain(0.15))
CREEPING = pz.PrandtlIshlinskii(0.1, [1.0], [0.2], creep=pz.Creep([0.1], [1.0]))
SIGNAL = pz.signals.sine(1.0, 5.0, 1, 500.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (later(pz.VoltageLimits, 1.0, -1.0), "minimum must be below maximum"),
        (later(pz.VoltageLimits, 0.0, "100"), "maximum must be a number of volts, got '100'"),
        (later(pz.InverseCompensator, MODEL, (0, 5)), r"VoltageLimits\(minimum, maximum\), got tuple"),
        (later(pz.InverseCompensator, pz.ColemanHodgdon(0.021, 0.147, 0.02)), "nearest_admissible"),
        (later(pz.InverseCompensator, CREEPING), "sample_rate"),
        (later(pz.LinearCompensator, pz.LinearGain(0.0)), "its gain must not be zero"),
        (later(pz.IntegralFeedback, MODEL, gain=1.0, sample_rate=1e3), "must be a LinearCompensator or"),
        (later(lead, LINE, mechanics=780.0), "mechanics"),
        (later(lead, LINE, delay=np.nan), "delay"),
        (later(lead, LINE, delay=2.0), "delay is in seconds, and must lie between zero and a period"),
        (later(pz.IntegralFeedback, LINE, gain=2e3, sample_rate=1e3), "gain must be below 2 times"),
        (later(pz.VoltageLimits, 0.0, 10**400), "maximum must be a number of volts"),
        (later(pz.InverseCompensator(CREEPING, sample_rate=1e3).run, SIGNAL), "rates differ: r has 500 Hz"),
        (later(pz.InverseCompensator(MODEL).run, np.zeros((3, 1))), r"r must have shape .*pass r\.ravel"),
    ],
)
def test_wrong_arguments(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


TWO = [np.array([2.0]), np.array(2.0), [2.0], (2.0,), np.float32(2.0), np.int64(2), 2, np.ma.array([2.0])]
NO_NUMBERS = ["2", 10**400, 2j, object(), [1.0, 2.0], np.zeros(3), np.ma.masked, None, b"2"]


@pytest.mark.parametrize("wrap", [lambda c: c, lead])
@pytest.mark.parametrize("model", [pz.LinearGain(0.15), pz.PrandtlIshlinskii(0.1, [1.0], [0.02])])
def test_what_a_program_hands_over_for_a_reference(wrap: Any, model: Any) -> None:
    first, second = wrap(pz.InverseCompensator(model)).run([1.0, 2.0])
    for values, expected in ((TWO, (second, 0)), (NO_NUMBERS, (first, 1))):
        for value in values:
            compensator = wrap(pz.InverseCompensator(model))
            compensator.step(1.0)
            assert (compensator.step(value), compensator.status.missing) == expected


def test_integral_feedback_removes_a_constant_error() -> None:
    stage = pz.SimulatedStage(sample_rate=10_000.0, hysteresis=pz.LinearGain(0.12, offset=0.5))
    loop = pz.IntegralFeedback(pz.LinearCompensator(pz.LinearGain(0.15)), gain=200.0, sample_rate=10_000.0)
    record = pz.track(np.full(2000, 2.0), stage=stage, compensator=loop, allow_jumps=True)
    assert abs(record.error[-1]) < 1e-6
    assert abs(record.error[0]) > 0.09


@pytest.mark.parametrize(
    "model", [MODEL, pz.LinearGain(0.155, offset=0.3), pz.PrandtlIshlinskii(0.1, [2.0], [0.04])]
)
def test_begins_where_the_stage_is_told_to_be(model: Any) -> None:
    """From a voltage and a reading there the voltage does not jump; the model's own way is the end of it."""
    compensator = pz.InverseCompensator(model, pz.VoltageLimits(0.0, 100.0), transfer_samples=20)
    compensator.reset(voltage=40.0, displacement=7.0)
    u = compensator.run(np.full(400, 7.0))
    assert abs(u[0] - 40.0) < 1.0
    assert np.abs(np.diff(u)).max() < 1.0
    compensator.reset(voltage=40.0)
    assert compensator.voltage == 40.0
    compensator.reset()
    assert compensator.voltage == 0.0
    with pytest.raises(ValueError, match="voltage must lie within the limits"):
        compensator.reset(voltage=101.0)
    with pytest.raises(ValueError, match="displacement"):
        compensator.reset(displacement=float("nan"))


def test_what_is_around_is_told_too_and_a_reset_that_is_refused_changes_nothing() -> None:
    feedback = pz.IntegralFeedback(pz.InverseCompensator(MODEL), gain=10.0, sample_rate=FS)
    for around in (feedback, lead(pz.InverseCompensator(MODEL))):
        around.reset(voltage=10.0, displacement=2.0)
        assert around.compensator.voltage == 10.0
    feedback.step(2.0, 1.5)
    before = feedback.integral, feedback.compensator.voltage
    assert before[0] > 0.0
    with pytest.raises(ValueError, match="displacement"):
        feedback.reset(displacement=float("nan"))
    assert (feedback.integral, feedback.compensator.voltage) == before


@pytest.mark.parametrize("wrong", [2.1e6, 1e12, -1.7e308])
def test_a_wrong_reading_does_not_wind_feedback_up(wrong: float) -> None:
    compensator = pz.LinearCompensator(pz.LinearGain(0.15), pz.VoltageLimits(-50.0, 100.0))
    feedback = pz.IntegralFeedback(compensator, gain=5.0, sample_rate=1000.0)
    feedback.step(1.0, wrong)
    assert abs(feedback.integral) < 0.2
    for _ in range(2000):
        u = feedback.step(1.0, 0.15 * feedback.compensator.voltage)
    assert u == pytest.approx(1.0 / 0.15, rel=1e-3)


@pytest.mark.parametrize("slope", [0.15, -0.15])
def test_feedback_does_not_wind_up_at_a_limit_or_without_a_reading(slope: float) -> None:
    compensator = pz.LinearCompensator(pz.LinearGain(slope), pz.VoltageLimits(-10.0, 10.0))
    feedback = pz.IntegralFeedback(compensator, gain=5.0, sample_rate=1000.0)
    for _ in range(2000):
        feedback.step(5.0, slope * compensator.voltage)
    assert abs(compensator.voltage) == 10.0
    assert abs(feedback.integral) < 0.1
    before = feedback.integral
    for r, x in ((1.0, None), (1.0, np.nan), (np.nan, 1.0)):
        feedback.step(r, x)
    assert feedback.integral == before
    feedback.reset()
    assert feedback.integral == 0.0


SLEWED = pz.VoltageLimits(-50.0, 100.0, slew_rate=100.0, sample_rate=1000.0)


@pytest.mark.parametrize(
    "compensator",
    [
        pz.LinearCompensator(pz.LinearGain(0.15), SLEWED),
        pz.InverseCompensator(CREEPING, sample_rate=1000.0),
    ],
)
def test_what_is_for_another_rate_is_refused(compensator: Any) -> None:
    estimator, r = pz.HysteresisRLS(5000.0), pz.signals.triangle(1.0, 5.0, 1, 5000.0)
    for call in (
        lambda: pz.IntegralFeedback(compensator, gain=5.0, sample_rate=5000.0),
        lambda: pz.export.Controller(estimator, compensator),
        lambda: pz.export.c(estimator, compensator),
        lambda: pz.track(r, stage=pz.PaperStage(5000.0), compensator=compensator),
        lambda: pz.track(
            r,
            stage=pz.PaperStage(5000.0),
            compensator=pz.IntegralFeedback(compensator, gain=1.0, sample_rate=1e3),
        ),
    ):
        with pytest.raises(ValueError, match=r"sample.rate"):
            call()


@pytest.mark.parametrize("smoothing", [5e-5, 2e-4])
def test_a_parabola_is_led_exactly(smoothing: float) -> None:
    t, plain = np.arange(2000) / FS, pz.LinearCompensator(pz.LinearGain(1.0))
    led = lead(plain, delay=3e-5, smoothing=smoothing).run(20.0 * t + 300.0 * t**2)
    omega, lag, v, a = 2.0 * np.pi * 780.0, 2e-5, 20.0 + 600.0 * t[-1], 600.0
    c1, c2 = 0.04 / omega + lag, 1.0 / omega**2 + 0.04 / omega * lag + lag**2 / 2.0
    assert led[-1] == pytest.approx(20.0 * t[-1] + 300.0 * t[-1] ** 2 + c1 * v + c2 * a, abs=1e-9)


def test_a_leads_run_is_a_loop_of_step_with_gaps() -> None:
    r = 4.0 * np.sin(np.arange(4000) * 5e-3)
    r[1000:1010], r[2000] = np.nan, np.inf
    whole, single, split = (lead(pz.InverseCompensator(MODEL)) for _ in range(3))
    u = whole.run(r)
    np.testing.assert_array_equal([single.step(value) for value in r.tolist()], u)
    np.testing.assert_array_equal(np.concatenate([split.run(r[:1005]), split.copy().run(r[1005:])]), u)
    assert np.all(np.isfinite(u))
    assert whole.status.missing == 11
    whole.reset()
    np.testing.assert_array_equal(whole.run(r), u)


def test_a_led_voltage_keeps_its_limits_and_is_bounded() -> None:
    rng = np.random.default_rng(0)
    line = pz.LinearCompensator(pz.LinearGain(0.15), pz.VoltageLimits(-60.0, 60.0))
    assert np.max(np.abs(lead(line).run(rng.normal(scale=50.0, size=20_000)))) == 60.0
    line.reset()
    assert np.max(np.abs(lead(line).run(np.repeat(rng.choice([-1.0, 1.0], 200), 100)))) < 4.0 / 0.15


@pytest.mark.parametrize("stage", [pz.PaperStage, pz.PreisachStage])
@pytest.mark.slow
def test_a_lead_pays_at_a_twentieth_of_the_resonance(stage: Any) -> None:
    errors, start = [], pz.InverseCompensator(pz.ColemanHodgdon(0.02, 0.12, 0.0036))
    for compensator, mechanics, delay in (
        (lead(start.copy(), delay=1.95e-5), MECHANICS, 1.95), (start, None, 0.97),
    ):  # fmt: skip
        estimator = pz.PrandtlIshlinskiiRLS(FS, mechanics=mechanics, delay=delay)
        triangle = pz.signals.triangle(5.0, 39.0625, 40, FS)
        record = pz.track(triangle, stage=stage(FS), compensator=compensator, estimator=estimator)
        errors.append(record.max_error(2))
    assert errors[0] < 0.8 * errors[1]
