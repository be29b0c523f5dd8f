"""Models handed over as often as one likes, by hand: the voltage stays near the line, and leaves a limit."""

import itertools
from collections.abc import Iterable
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import piezoest as pz
from piezoest.bench.zoo import draw
from piezoest.compensators import corridor
from piezoest.layout import Named, new
from piezoest.stage.instruments import Gauge

FS = 50_000.0
START = pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
LIMITS = pz.VoltageLimits(-50.0, 100.0)


def hand_wired(
    r: Any, stage: Any, estimator: Any, compensator: Any, every: int = 1, wrong: float = 0.0
) -> tuple[Any, Any]:
    """The README's loop: true errors, and voltages; the first reading may be wrong."""
    errors, voltages, x = [], [], None
    feeds_back = isinstance(compensator, pz.IntegralFeedback)
    for k, r_k in enumerate(np.asarray(r).tolist()):
        u = compensator.step(r_k, x) if feeds_back else compensator.step(r_k)
        x = stage.step(u) + (wrong if k == 0 else 0.0)
        estimator.step(u, x)
        if k % every == 0:
            compensator.model = estimator.model
        errors.append(r_k - stage.displacement)
        voltages.append(u)
    return np.array(errors), np.array(voltages)


def per_period(errors: Any, periods: int) -> Any:
    size = errors.size // periods
    return np.abs(errors[: periods * size]).reshape(periods, size).max(axis=1)


def best_line(r: Any, rate: float, last: int) -> float:
    """Least largest error over the last samples of any straight line, known beforehand."""
    found = []
    for gain in np.linspace(0.09, 0.17, 33):
        stage = pz.PaperStage(rate, seed=0)
        stage.run(r / gain)
        found.append(np.ptp((r - stage.displacement)[-last:]) / 2)
    return float(min(found))


@pytest.mark.slow_but_first
@pytest.mark.parametrize("make", [pz.HysteresisRLS, pz.OutputErrorRLS])
@pytest.mark.parametrize("amplitude", [5.0, 0.5])
@pytest.mark.parametrize(("frequency", "every"), [(20.0, 1), (30.0, 1), (15.0, 30)])
def test_no_pace_of_models_runs_away(make: Any, amplitude: float, frequency: float, every: int) -> None:
    r = np.asarray(pz.signals.triangle(amplitude, frequency, 8, FS))
    compensator = pz.InverseCompensator(START, LIMITS)
    errors, voltages = hand_wired(r, pz.PaperStage(FS, seed=0), make(FS), compensator, every)
    assert per_period(errors, 8)[2:].max() < best_line(r[: r.size // 2], FS, r.size // 4)
    assert LIMITS.minimum <= voltages.min() <= voltages.max() <= LIMITS.maximum


@pytest.mark.parametrize("make", [pz.HysteresisRLS, pz.OutputErrorRLS])
@pytest.mark.parametrize("feedback", [0.0, 50.0])
def test_a_setpoint_that_rests_with_noise_before_it_moves(make: Any, feedback: float) -> None:
    rate, noise = 10_000.0, 1e-4 * np.random.default_rng(5).standard_normal(10_000)
    r = np.concatenate([noise, np.asarray(pz.signals.triangle(5.0, 5.0, 8, rate))])
    compensator: Any = pz.InverseCompensator(START, LIMITS)
    if feedback > 0.0:
        compensator = pz.IntegralFeedback(compensator, gain=feedback, sample_rate=rate)
    estimator = make(rate, initial_model=START)
    errors, u = hand_wired(r, pz.PaperStage(rate, seed=0), estimator, compensator)
    assert np.abs(errors[-4000:]).max() < 1.5 * best_line(r[noise.size :], rate, 4000)
    assert np.abs(u).max() < LIMITS.maximum


@pytest.mark.parametrize("make", [pz.HysteresisRLS, pz.OutputErrorRLS])
@pytest.mark.parametrize("seed", [6, 50, 69, 92])
def test_a_wrong_first_reading_does_not_leave_the_voltage_at_a_limit(make: Any, seed: int) -> None:
    """Stages of every family of the zoo, a start that is off by up to 60 %."""
    rng = np.random.default_rng([seed, 99])
    kind = str(rng.choice(["triangle", "sine", "raster", "walk"]))
    rig = draw(seed, fault="none", mechanics="none", delay=0, reference=kind)
    gain = float(np.exp(rng.uniform(np.log(0.6), np.log(1.6)))) * rig.gain
    wrong = rig.plain.amplitude * rng.uniform(0.3, 1.5) * float(rng.choice([-1.0, 1.0]))
    start = pz.ColemanHodgdon.from_loop(1.5 / rig.reach.half, 0.2 * gain, gain)
    estimator = make(rig.sample_rate, initial_model=start)
    compensator = pz.InverseCompensator(start, rig.limits)
    _, u = hand_wired(rig.reference, rig.stage(), estimator, compensator, wrong=wrong)
    u = u[-min(2 * rig.plain.cycle, u.size // 3) :]
    assert np.mean((u <= rig.limits.minimum) | (u >= rig.limits.maximum)) < 0.75


@pytest.mark.parametrize("every", [1, 50])
def test_a_unipolar_stage_with_an_identified_start_settles(every: int) -> None:
    def unipolar(seed: int) -> pz.SimulatedStage:
        paper, gauge = pz.PaperStage(FS), Gauge(noise=1.2e-3)
        return pz.SimulatedStage(FS, paper.hysteresis, paper.creep, paper.mechanics, gauge=gauge, seed=seed)

    s = np.linspace(0.0, 1.0, int(0.2 * FS))
    up, centre = s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 8.0
    r, log = (
        np.concatenate([centre * up, centre + np.asarray(pz.signals.triangle(amplitude, 5.0, periods, FS))])
        for amplitude, periods in ((5.0, 6), (7.0, 3))
    )
    identified = pz.BatchFit(FS)
    identified.run(6.5 * log, unipolar(1).run(6.5 * log))
    model: Any = identified.model
    estimator = pz.HysteresisRLS(FS, initial_model=model)
    compensator = pz.InverseCompensator(model, pz.VoltageLimits(0.0, 150.0))
    errors, voltages = hand_wired(r, unipolar(0), estimator, compensator, every)
    assert per_period(errors[s.size :], 6)[2:].max() < 0.1
    assert 0.0 <= voltages.min() <= voltages.max() <= 150.0


def handed_over(compensator: Any, r: Any, models: Iterable[Any]) -> Any:
    """Voltages of a compensator that is given one model after the other."""
    u = []
    for r_k, model in zip(r.tolist(), models, strict=False):
        u.append(compensator.step(r_k))
        compensator.model = model
    return np.array(u)


def test_whatever_is_handed_over_the_voltage_stays_in_the_corridor() -> None:
    rng = np.random.default_rng(3)
    gains = 0.15 * 10.0 ** rng.uniform(-3.0, 3.0, 30_000)
    models = (pz.ColemanHodgdon.from_loop(0.05, 0.4 * gain, gain, float(rng.normal())) for gain in gains)
    r = 5.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(30_000) / 10_000.0)
    wild = handed_over(pz.InverseCompensator(pz.LinearGain(0.15), transfer_samples=20), r, models)
    # Models as wild as these may lead the line away by a quarter in each turn, by more in the first two.
    assert np.abs(wild[:1500]).max() < 4.0 * 5.0 / 0.15 + 1e-9
    legs = [np.abs(wild[k : k + 1000]).max() for k in range(1500, 29_000, 1000)]
    assert max(later / before for before, later in itertools.pairwise(legs)) < 2.0
    assert np.all(np.isfinite(wild))


def test_models_take_effect_by_travel() -> None:
    first, second, third = (pz.LinearGain(gain) for gain in (0.1, 0.11, 0.12))
    compensator = pz.InverseCompensator(first)
    assert compensator.hand_over_due
    compensator.model = second  # at rest: at once
    assert compensator.model == second
    compensator.run(np.linspace(0.0, 1.0, 200))
    compensator.model = first
    assert compensator.model == first
    compensator.model = second
    compensator.model = third  # the last one waits
    assert compensator.model == first
    compensator.run(np.full(5000, 1.0) + 1e-4 * np.sin(np.arange(5000.0)))  # a dwell with noise is no travel
    assert compensator.model == first
    u = compensator.run(np.linspace(1.0, 0.9, 50))
    assert compensator.model == third
    assert np.all(np.isfinite(u))
    compensator.model = first
    compensator.reset()
    assert compensator.model == first


extreme = st.floats(width=64, allow_nan=False, allow_infinity=False)
positive = st.floats(min_value=5e-324, max_value=1.7e308)


@given(
    numbers=st.tuples(positive, positive, positive, extreme),
    line=st.tuples(extreme, extreme),
    plays=st.tuples(positive, positive, extreme, extreme),
    r=st.lists(st.floats(width=64), min_size=3, max_size=8),
)
def test_every_voltage_is_finite_and_within_its_limits(
    numbers: Any, line: Any, plays: Any, r: list[float]
) -> None:
    models: list[Any] = [START]
    for make in (
        lambda: pz.ColemanHodgdon(*numbers),
        lambda: pz.ColemanHodgdon(*numbers).nearest_admissible(),
        lambda: pz.LinearGain(*line),
        lambda: pz.PrandtlIshlinskii(plays[0], [plays[1]], [plays[2]], plays[3]),
    ):
        with suppress(ValueError), np.errstate(all="ignore"):
            models.append(make())
    slow = pz.VoltageLimits(-50.0, 50.0, slew_rate=1000.0, sample_rate=1000.0)
    for limits in (LIMITS, pz.VoltageLimits(0.0, 150.0), pz.VoltageLimits(), slow):
        for start in models:
            try:
                with np.errstate(all="ignore"):
                    compensator = pz.InverseCompensator(start, limits)
            except ValueError:
                continue
            for k, r_k in enumerate(r * 2):
                before, u = compensator.voltage, compensator.step(r_k)
                assert np.isfinite(u)
                assert abs(u - before) <= limits.largest_step * (1.0 + 1e-9)
                assert limits.minimum <= u <= limits.maximum
                with np.errstate(all="ignore"):
                    compensator.model = models[k % len(models)]


SLOW = 2000.0


def small_scan(r: Any, periods: int = 25) -> Any:
    """Largest error of each of the last periods, at 10 Hz, of a loop that learns."""
    stage = pz.SimulatedStage(SLOW, pz.PaperStage(SLOW).hysteresis, gauge=Gauge(noise=1e-3), seed=0)
    compensator = pz.InverseCompensator(START, pz.VoltageLimits(-60.0, 150.0))
    errors, _ = hand_wired(r, stage, pz.HysteresisRLS(SLOW), compensator)
    return per_period(errors[-round(periods * SLOW / 10.0) :], periods)


@pytest.mark.parametrize("amplitude", [0.2, 0.3])
def test_a_small_scan_after_a_large_move_learns(amplitude: float) -> None:
    scan = 15.0 + np.asarray(pz.signals.triangle(amplitude, 10.0, 25, SLOW))
    errors = small_scan(np.concatenate([np.linspace(0.0, 15.0, 800), scan])) / amplitude
    assert errors[-3:].max() < 1.0
    assert errors[1:].max() < 8.0


@pytest.mark.parametrize("wrong", [100.0, 1e6])
def test_a_wrong_sample_of_the_reference_ends_no_learning(wrong: float) -> None:
    r = np.asarray(pz.signals.triangle(5.0, 10.0, 25, SLOW)).copy()
    r[250] += wrong
    assert small_scan(r)[-3:].max() < 0.1


@pytest.mark.parametrize("offset", [1e6, 1e12])
def test_models_that_are_absurd_or_have_no_inverse_lead_the_corridor_nowhere(offset: float) -> None:
    compensator = pz.InverseCompensator(pz.LinearGain(0.1))
    r = np.asarray(pz.signals.triangle(1.0, 10.0, 40, SLOW))
    offsets = [1e-9 * (k % 2) + (0.0 if k < 800 else offset) for k in range(r.size)]
    u = handed_over(compensator, r, (pz.LinearGain(0.1, each) for each in offsets))
    assert np.abs(u).max() < 20.0
    assert compensator.state["corridor"]["soon"]


def test_no_line_holds_the_voltage_at_a_limit() -> None:
    state = Named(new(corridor.CORRIDOR), corridor.CORRIDOR)
    state.soon, state.gain, state.half_swing = 1.0, 0.1, 5.0
    state.centre, state.known = -40.0, corridor.ENOUGH
    limits = SimpleNamespace(minimum=LIMITS.minimum, maximum=LIMITS.maximum)
    assert corridor.kept(state, limits, 0.0, 0.0) < LIMITS.maximum - 10.0
