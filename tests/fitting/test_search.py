"""What a fit finds of stages that are known: slopes, start, delay, creep, drift, jumps, spikes, dropouts."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.bench.zoo.families import draw_family
from piezoest.bench.zoo.logs import REACHES
from piezoest.fitting import Fit
from tests.fitting.stages import RATE, N, T, noise, rms, stage, voltage

CREEP = pz.Creep([0.06], [0.25])
LOOP = pz.ColemanHodgdon(0.03, 0.12, 0.0066, offset=1.5)


def drawn(seed: int, **kinds: Any) -> tuple[FloatArray, FloatArray, float]:
    """Voltage, displacement without noise, and noise of 1e-3 of the stroke [µm]."""
    rng = np.random.default_rng(seed)
    half = float(rng.uniform(10.0, 80.0))
    u = voltage(rng, half, half * (seed % 2))
    x = stage(rng, half, **kinds).simulate(u)
    return u, x, 1e-3 * float(np.ptp(x))


def fit(u: FloatArray, x: FloatArray, model: str, **options: Any) -> Fit:
    return pz.fit(u, x, sample_rate=RATE, model=model, **options)


@pytest.mark.parametrize(
    ("model", "kinds"),
    [("plays", {}), ("plays-creep", {"creep": CREEP}), ("plays-asymmetric", {"bends": 2}),
     ("plays-asymmetric-creep", {"bends": 2, "creep": CREEP})],
)  # fmt: skip
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.slow_but_first
def test_a_stage_of_plays_is_recovered_to_its_noise(model: str, kinds: dict[str, Any], seed: int) -> None:
    u, x, sigma = drawn(seed, **kinds)
    found = fit(u, x + noise(sigma, seed), model)
    # Thresholds, bends and time constants are not the stage's own.
    error = (found.predict().x - x)[found.left_out :]
    assert rms(error) < (1.5 if kinds else 0.7) * sigma
    assert found.held_out < (2.2 if kinds else 1.5) * sigma
    assert found.spikes <= 5
    # A stage that creeps at the start has not settled.
    assert found.left_out <= 0.1 * N


@pytest.mark.parametrize("centre", [0.0, 60.0])
def test_a_loop_and_a_line_are_recovered_to_their_noise(centre: float) -> None:
    u = voltage(np.random.default_rng(1), centre=centre)
    x = LOOP.simulate(u, initial_state=0.7)
    found = fit(u, x + noise(2e-3) + (np.arange(N) == 1000), "coleman-hodgdon")
    np.testing.assert_array_equal(np.flatnonzero(~found.counts), [1000])
    assert rms(found.predict().x - x) < 1e-3
    np.testing.assert_allclose(found.model.theta, LOOP.theta, rtol=0.01)
    assert found.model.offset == pytest.approx(1.5, abs=0.05)
    line = fit(u, 0.2 * u - 3.0 + noise(2e-3), "line")
    assert line.model.theta[0] == pytest.approx(0.2, abs=1e-5)
    assert line.model.offset == pytest.approx(-3.0, abs=1e-3)
    assert line.parameters == 2


def test_no_noise_is_no_hindrance() -> None:
    u, x, sigma = drawn(3)
    found = fit(u, x, "plays")
    assert rms(found.predict().x - x) < sigma
    # What a fit misses of no noise has kinks: hardly any of them look like spikes.
    assert found.spikes <= 5
    line = fit(u, 0.1 * u, "plays")
    assert rms(line.predict().x - 0.1 * u) < 1e-6
    assert line.spikes + line.left_out == 0


SWUNG, RESTED = 40.0 * np.sin(np.linspace(0.0, 20.0, 999)), np.full(3000, 40.0)


@pytest.mark.parametrize("before", [SWUNG, [40.0], [-40.0], RESTED])
def test_a_start_that_is_not_known_is_found(before: Any) -> None:
    """Of plays, and of creep that began before the record."""
    rng, creep = np.random.default_rng(4), None
    if before is RESTED:
        rng, creep = np.random.default_rng(8), pz.Creep([0.08], [2.5])
    u, model = voltage(rng), stage(rng, creep=creep)
    x = model.simulate(np.concatenate([before, np.linspace(before[-1], u[0], 50), u]))[-N:]
    sigma = 1e-3 * float(np.ptp(x))
    found: Any = fit(u, x + noise(sigma), "plays-creep" if creep else "plays")
    assert rms(found.predict().x - x) < (2.0 if creep else 1.5) * sigma
    # The model, with this start, is what predicts.
    again = found.model.simulate(u, initial_state=found.initial_state) + found.drift * np.arange(N) / N
    np.testing.assert_allclose(again, found.predict().x, atol=1e-9)


@pytest.mark.parametrize("delay", [2.4, 0.6, 0.0, 9.0])
@pytest.mark.parametrize("model", ["plays-creep", "plays", "coleman-hodgdon"])
@pytest.mark.slow_but_first
def test_a_delay_is_found_where_the_voltage_has_several_frequencies(delay: float, model: str) -> None:
    """Creep is not taken for one."""
    rng = np.random.default_rng(5)
    u, creep = voltage(rng), pz.Creep([0.04, 0.04], [0.05, 0.5]) if model == "plays-creep" else None
    true: Any = LOOP if model == "coleman-hodgdon" else stage(rng, creep=creep)
    x = true.simulate(np.interp(np.arange(N) - delay, np.arange(N), u))
    found = fit(u, x + noise(1e-3 * float(np.ptp(x))), model, delay="auto")
    assert found.delay == pytest.approx(delay, abs=0.15 if creep else 0.1)
    assert found.delay_estimated


def test_creep_of_several_amplitudes_is_no_delay() -> None:
    t = np.arange(10_000) / 1000.0
    u = 30.0 - 30.0 * np.interp(t % 5.0, [0.0, 2.5, 5.0], [1.0, 0.3, 1.0]) * np.cos(2.0 * np.pi * t)
    x = pz.PaperStage(sample_rate=1000.0, seed=1).run(u)
    assert pz.fit(u, x, sample_rate=1000.0, model="plays-creep", delay="auto").delay < 0.5


@pytest.mark.slow
def test_creep_is_found() -> None:
    u, x, sigma = drawn(5, creep=pz.Creep([0.05], [0.5]))
    found: Any = fit(u, x + noise(sigma), "plays-creep")
    # 0.5 s is one of the time constants that are tried.
    creep = dict(zip(found.model.creep.time_constants.tolist(), found.model.creep.gains, strict=True))
    assert creep[0.5] == pytest.approx(0.05, abs=0.015)
    assert sum(creep.values()) == pytest.approx(0.05, abs=0.01)
    assert fit(u, x + noise(sigma), "plays").held_out > 1.5 * found.held_out
    u, x, sigma = drawn(7)  # which has none
    found = fit(u, x + noise(sigma), "plays-creep")
    assert found.model.creep is None or found.model.creep.gains.sum() < 0.01


@pytest.mark.parametrize("seed", [0, 3])
def test_a_drift_is_fitted_together_with_a_loop_and_its_delay(seed: int) -> None:
    """A drift that stays where plays have put it bends the loop."""
    u = voltage(np.random.default_rng(seed))
    x = LOOP.simulate(np.concatenate([np.linspace(0.0, u[0], 300), u]))[300:]
    stroke = float(np.ptp(x))
    x = np.interp(np.arange(N) - 2.4, np.arange(N), x) + 0.02 * stroke * T / T[-1]
    found = fit(u, x + noise(1e-4 * stroke), "coleman-hodgdon", delay="auto")
    assert rms(found.predict().x - x) < 0.3e-4 * stroke
    assert found.drift == pytest.approx(0.02 * stroke, rel=0.2)
    assert found.delay == pytest.approx(2.4, abs=0.01)
    errors = [found.standard_errors[name] for name in LOOP.parameter_names]
    assert np.all(np.abs(np.subtract(found.model.theta, LOOP.theta)) < np.multiply(4.0, errors))


@pytest.mark.parametrize("place", [700, 2600, 3900, 4700])
@pytest.mark.slow_but_first
def test_a_jump_is_fitted_beside_the_model(place: int) -> None:
    u, x, sigma = drawn(10)
    y = x + noise(sigma)
    without = fit(u, y, "plays")
    y[place:] += 100.0 * sigma
    found = fit(u, y, "plays")
    # It is nobody's fault, wherever it stands.
    assert found.held_out < 1.2 * without.held_out
    assert found.ahead < 1.5 * without.ahead
    assert found.spread.within < 1.5 * without.spread.within
    assert rms(found.predict().x - x - 100.0 * sigma * (np.arange(N) >= place)) < sigma
    assert rms(found.predict(u).x - without.predict(u).x) < sigma


@pytest.mark.parametrize("model", ["plays", "coleman-hodgdon"])
def test_a_jump_no_larger_than_what_the_stage_moves_in_a_sample_is_found(model: str) -> None:
    u = pz.signals.triangle(50.0, 1.0, 20, 150.0).values
    x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(u)
    jump = 0.7 * float(np.max(np.abs(np.diff(x))))
    y = x + jump * (np.arange(x.size) >= 900) + 0.02 * jump * np.random.default_rng(0).standard_normal(x.size)
    found = pz.fit(u, y, sample_rate=150.0, model=model)
    assert found.jumps.tolist() == [900]
    left = y - found.predict().x
    assert abs(left[600:900].mean() - left[900:1200].mean()) < 0.25 * jump
    assert pz.fit(u, x, sample_rate=150.0, model=model).jumps.size == 0


@pytest.mark.parametrize("seed", range(4))
def test_what_a_model_misses_at_steps_of_the_voltage_is_no_jump_of_the_sensor(seed: int) -> None:
    rng, reach = np.random.default_rng(seed), REACHES[0]
    u = reach.middle + reach.half * np.repeat(rng.uniform(-0.9, 0.9, 10), 300)
    x = draw_family("bouc-wen", rng, reach, width=0.15, gain=0.1).simulate(u)
    found = fit(u, x + noise(1e-3 * float(np.ptp(x)), seed, u.size), "plays")
    assert found.jumps.size == 0
    assert found.spikes == 0


@pytest.mark.parametrize("ramp", [0, 300])
def test_wide_plays_that_the_first_way_from_rest_moves_are_fitted(ramp: int) -> None:
    """A unipolar stage: from 0 V up, plays move that no swing about the middle moves again."""
    sizes = [20.0, 40.0, 30.0] * 3
    swings = np.outer(sizes, np.sin(2.0 * np.pi * np.arange(1000) / 1000.0)).ravel()
    u = np.concatenate([np.linspace(0.0, 40.0, ramp), 40.0 + swings])
    thresholds = np.linspace(1.0, 60.0, 30)
    stage = pz.PrandtlIshlinskii(0.08, thresholds, 0.006 * np.exp(-thresholds / 25.0))
    x = stage.simulate(u, initial_state=np.zeros(30))
    found = fit(u, x + noise(5e-3, 0, u.size), "plays", delay=0.0)
    assert rms(found.predict().x - x) < 4e-3
