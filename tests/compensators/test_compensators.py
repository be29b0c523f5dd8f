"""Compensators: exactness, limits, bumpless change of model, feedback."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import piezoest as pz

FS = 50_000.0
MODEL = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
PLAYS = pz.PrandtlIshlinskii(0.11, [0.5, 2.0], [0.02, 0.03])
BENT = pz.PrandtlIshlinskii(
    0.1, [1.0, 3.0, 9.0], [0.01, 0.02, 0.01], 0.3, creep=pz.Creep([0.04, 0.03], [0.01, 0.5]),
    bends=[-8.0, 5.0], bend_weights=[[0.01, 0.0, 0.01, 0.0], [0.0, 0.005, -0.01, 0.0]], sample_rate=FS,
)  # fmt: skip


def triangle(periods: int = 3) -> Any:
    return pz.signals.triangle(5.0, 5.0, periods, FS)


def test_linear() -> None:
    u = pz.LinearCompensator(pz.LinearGain(0.155, offset=0.3)).run([0.0, 1.0, -2.0])
    np.testing.assert_allclose(u, (np.array([0.0, 1.0, -2.0]) - 0.3) / 0.155)
    inverted = pz.LinearCompensator(pz.LinearGain(-0.155)).run([0.0, 1.0, -40.0])
    np.testing.assert_allclose(inverted, np.array([0.0, 1.0, -40.0]) / -0.155)


@pytest.mark.parametrize(
    ("model", "method"),
    [(MODEL, "closed-form"), (MODEL, "bogacki-shampine"), (BENT, "closed-form"),
     (pz.LinearGain(0.15, offset=0.3), "closed-form"), (pz.LinearGain(-0.15), "closed-form")],
)  # fmt: skip
def test_step_run_and_split_run_are_the_same_bits_within_limits(model: Any, method: Any) -> None:
    r = triangle(1).values.copy()
    r[400], r[5000:5020] = np.nan, np.inf
    limits = pz.VoltageLimits(-25.0, 28.0, slew_rate=900.0, sample_rate=FS)
    whole, steps, parts = (pz.InverseCompensator(model, limits, method=method) for _ in range(3))
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
    np.testing.assert_allclose(model.simulate(u)[free], r[free], atol=1e-9)
    whole.reset()
    np.testing.assert_array_equal(whole.run(r), u)


@given(
    st.lists(st.floats(allow_nan=True, allow_infinity=True, width=64), min_size=1, max_size=30),
    st.floats(-50.0, -1.0),
    st.floats(1.0, 50.0),
)
def test_voltage_never_leaves_its_limits(r: list[float], low: float, high: float) -> None:
    limits = pz.VoltageLimits(low, high, slew_rate=1000.0, sample_rate=1000.0)
    compensator = pz.InverseCompensator(MODEL, limits)
    u = compensator.run(r)
    assert np.all((u >= low) & (u <= high))
    assert np.max(np.abs(np.diff(u, prepend=0.0))) <= 1.0 + 1e-12
    later = compensator.run(triangle(1))
    assert np.all(np.isfinite(later))


@pytest.mark.parametrize("at", [700, 2500, 4100])
def test_change_of_model_is_bumpless(at: int) -> None:
    r = triangle(2).values
    new = pz.ColemanHodgdon(0.033, 0.12, 0.0055, offset=0.2)
    compensator = pz.InverseCompensator(MODEL)
    before = compensator.run(r[:at])
    compensator.model = new
    after = compensator.run(r[at:])
    usual = np.max(np.abs(np.diff(before)))
    assert np.max(np.abs(np.diff(np.concatenate([before, after])))) < 3.0 * usual
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


def test_inadmissible_model() -> None:
    wrong = pz.ColemanHodgdon(0.021, 0.147, 0.02)
    compensator = pz.InverseCompensator(MODEL)
    compensator.model = wrong
    assert compensator.status.projected
    assert compensator.model.is_admissible
    assert np.all(np.isfinite(compensator.run(triangle(1))))
    compensator.model = pz.LinearGain(0.15)
    assert not compensator.status.projected


def made(kind: Any = pz.InverseCompensator, *arguments: Any, **options: Any) -> Any:
    return lambda: kind(*(arguments or (MODEL,)), **options)


def lead(compensator: Any, **options: Any) -> Any:
    given: dict[str, Any] = {"mechanics": pz.MassSpringDamper(780.0, 0.02), "sample_rate": FS}
    return pz.LeadFilter(compensator, **given | options)


def led(**options: Any) -> Any:
    return lambda: lead(pz.LinearCompensator(pz.LinearGain(0.15)), **options)


CREEPING = pz.PrandtlIshlinskii(0.1, [1.0], [0.2], creep=pz.Creep([0.1], [1.0]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (made(pz.VoltageLimits, 1.0, -1.0), "minimum must be below maximum"),
        (made(pz.VoltageLimits, 0.0, "100"), "maximum must be a number of volts, got '100'"),
        (made(limits=(0, 5)), r"limits must be VoltageLimits\(minimum, maximum\), got tuple"),
        (made(pz.InverseCompensator, pz.ColemanHodgdon(0.021, 0.147, 0.02)), "nearest_admissible"),
        (made(pz.InverseCompensator, CREEPING), "sample_rate"),
        (made(pz.LinearCompensator, pz.LinearGain(0.0)), "its gain must not be zero"),
        (made(pz.IntegralFeedback, gain=1.0, sample_rate=1e3), "compensator must be a LinearCompensator or"),
        (led(mechanics=780.0), "mechanics"),
        (led(delay=np.nan), "delay"),
        (lambda: pz.InverseCompensator(MODEL).run(np.zeros((3, 1))), r"r must have shape .*pass r\.ravel"),
    ],
)
def test_wrong_arguments(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_integral_feedback_does_not_wind_up() -> None:
    line = pz.LinearCompensator(pz.LinearGain(0.15), pz.VoltageLimits(-10.0, 10.0))
    loop = pz.IntegralFeedback(line, gain=200.0, sample_rate=10_000.0)
    for _ in range(10_000):
        assert loop.step(5.0, 1.5) <= 10.0
    assert loop.integral < 0.1
    for r, x in ((1.0, None), (1.0, np.nan), (np.nan, 1.0)):
        loop.step(r, x)
    assert np.isfinite(loop.integral)
    loop.reset()
    assert loop.integral == 0.0


ODD = [np.array([2.0]), np.array(2.0), [2.0], (2.0,), np.float32(2.0), np.int64(2), 2, np.ma.array([2.0])]
NO_NUMBERS = ["2", 10**400, 2j, object(), [1.0, 2.0], np.zeros(3), np.ma.masked, None, b"2"]


@pytest.mark.parametrize("wrap", [lambda c: c, lead])
@pytest.mark.parametrize("model", [pz.LinearGain(0.15), pz.PrandtlIshlinskii(0.1, [1.0], [0.02])])
def test_what_a_program_hands_over_for_a_reference(wrap: Any, model: Any) -> None:
    plain = wrap(pz.InverseCompensator(model))
    voltages = [plain.step(r) for r in (1.0, 2.0)]
    for value in ODD:
        compensator = wrap(pz.InverseCompensator(model))
        assert [compensator.step(1.0), compensator.step(value)] == voltages
    for value in NO_NUMBERS:
        compensator = wrap(pz.InverseCompensator(model))
        first = compensator.step(1.0)
        assert (compensator.step(value), compensator.status.missing) == (first, 1)


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
def test_feedback_does_not_wind_up_at_a_limit(slope: float) -> None:
    compensator = pz.LinearCompensator(pz.LinearGain(slope), pz.VoltageLimits(-10.0, 10.0))
    feedback = pz.IntegralFeedback(compensator, gain=5.0, sample_rate=1000.0)
    for _ in range(2000):
        feedback.step(5.0, slope * compensator.voltage)
    assert abs(compensator.voltage) == 10.0
    assert abs(feedback.integral) < 0.1


def test_limits_for_another_rate_are_refused() -> None:
    limits = pz.VoltageLimits(-50.0, 100.0, slew_rate=100.0, sample_rate=1000.0)
    compensator = pz.LinearCompensator(pz.LinearGain(0.15), limits)
    estimator, r = pz.HysteresisRLS(5000.0), pz.signals.triangle(1.0, 5.0, 1, 5000.0)
    for call in (
        lambda: pz.IntegralFeedback(compensator, gain=5.0, sample_rate=5000.0),
        lambda: pz.export.Controller(estimator, compensator),
        lambda: pz.export.c(estimator, compensator),
        lambda: pz.track(r, stage=pz.PaperStage(5000.0), compensator=compensator),
    ):
        with pytest.raises(ValueError, match="sample_rate"):
            call()
