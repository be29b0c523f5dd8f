"""What a fit finds of stages that are known: slopes, start, delay, creep, drift, jumps, spikes, dropouts."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import nnls

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.bench.zoo.families import draw_family
from piezoest.bench.zoo.logs import REACHES
from piezoest.fitting import Fit, search
from tests.fitting.stages import RATE, N, T, noise, play_matrix, rms, stage, voltage

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
def test_a_loop_is_recovered_to_its_noise(centre: float) -> None:
    u = voltage(np.random.default_rng(1), centre=centre)
    x = LOOP.simulate(u, initial_state=0.7)
    found = fit(u, x + noise(2e-3), "coleman-hodgdon")
    assert rms(found.predict().x - x) < 1e-3
    np.testing.assert_allclose(found.model.theta, LOOP.theta, rtol=0.01)
    assert found.model.offset == pytest.approx(1.5, abs=0.05)


def test_a_line_is_recovered_to_its_noise() -> None:
    u = voltage(np.random.default_rng(2), centre=30.0)
    found = fit(u, 0.2 * u - 3.0 + noise(2e-3), "line")
    assert found.model.theta[0] == pytest.approx(0.2, abs=1e-5)
    assert found.model.offset == pytest.approx(-3.0, abs=1e-3)
    assert found.parameters == 2


def test_no_noise_is_no_hindrance() -> None:
    u, x, sigma = drawn(3)
    found = fit(u, x, "plays")
    assert rms(found.predict().x - x) < sigma
    # What a fit misses of no noise has kinks: hardly any of them look like spikes.
    assert found.spikes <= 5
    line = fit(u, 0.1 * u, "plays")
    assert rms(line.predict().x - 0.1 * u) < 1e-6
    assert line.spikes + line.left_out == 0


@pytest.mark.parametrize("before", ["cycled", "down from the top", "up from below"])
def test_a_start_that_is_not_known_is_found(before: str) -> None:
    rng = np.random.default_rng(4)
    u, model = voltage(rng), stage(rng)
    path = {"cycled": 40.0 * np.sin(np.linspace(0.0, 20.0, 999)), "down from the top": np.array([40.0]),
            "up from below": np.array([-40.0])}[before]  # fmt: skip
    way = np.concatenate([path, np.linspace(path[-1], u[0], 50), u])
    x = model.simulate(way)[-N:]
    sigma = 1e-3 * float(np.ptp(x))
    found = fit(u, x + noise(sigma), "plays")
    assert rms(found.predict().x - x) < 1.5 * sigma


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.slow_but_first
def test_creep_is_not_taken_for_a_delay(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u = voltage(rng)
    creep = pz.Creep([0.04, 0.04], [0.05, 0.5])
    x = stage(rng, creep=creep).simulate(np.interp(np.arange(N) - 2.4, np.arange(N), u))
    found = fit(u, x + noise(1e-3 * float(np.ptp(x))), "plays-creep", delay="auto")
    assert found.delay == pytest.approx(2.4, abs=0.15)


@pytest.mark.parametrize("delay", [3.3, 0.6, 0.0, 9.0])
@pytest.mark.parametrize("model", ["plays", "coleman-hodgdon"])
@pytest.mark.slow_but_first
def test_a_delay_is_found_where_the_voltage_has_several_frequencies(delay: float, model: str) -> None:
    rng = np.random.default_rng(5)
    u = voltage(rng)
    late = np.interp(np.arange(N) - delay, np.arange(N), u)
    x = stage(rng).simulate(late) if model == "plays" else LOOP.simulate(late)
    found = fit(u, x + noise(1e-3 * float(np.ptp(x))), model, delay="auto")
    assert found.delay == pytest.approx(delay, abs=0.1)
    assert found.delay_estimated


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


def test_creep_terms_that_are_none_do_not_begin_the_search_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    steps: list[int] = []
    crept = search._crept

    def counted(log: Any, last: Any, creep: pz.Creep) -> Any:
        steps.append(creep.gains.size)
        return crept(log, last, creep)

    monkeypatch.setattr(search, "_crept", counted)
    u, x, sigma = drawn(0, creep=pz.Creep([0.06], [0.5]))
    fit(u, x + noise(sigma), "plays-creep")
    assert steps == [3, 3, 3, 1, 1]


def test_a_loop_without_delay_needs_no_plays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "best_start", None)
    u = voltage(np.random.default_rng(2))
    found = fit(u, LOOP.simulate(u) + noise(1e-3), "coleman-hodgdon")
    assert rms(found.predict().x - LOOP.simulate(u)) < 1e-3


def test_creep_that_began_before_the_record_is_fitted() -> None:
    rng = np.random.default_rng(8)
    u, model = voltage(rng), stage(rng, creep=pz.Creep([0.08], [2.5]))
    x = model.simulate(np.concatenate([np.full(3000, 40.0), u]))[3000:]
    sigma = 1e-3 * float(np.ptp(x))
    found: Any = fit(u, x + noise(sigma), "plays-creep")
    assert rms(found.predict().x - x) < 2.0 * sigma
    # The model, with this start, is what predicts.
    again = found.model.simulate(u, initial_state=found.initial_state)
    np.testing.assert_allclose(again + found.drift * np.arange(N) / N, found.predict().x, atol=1e-9)


def test_a_drift_is_fitted_beside_the_model() -> None:
    u, x, sigma = drawn(9)
    size = 50.0 * sigma
    found = fit(u, x + size * T / T[-1] + noise(sigma), "plays")
    assert found.drift == pytest.approx(size, rel=0.2)
    assert fit(u, x + noise(sigma), "plays").drift == pytest.approx(0.0, abs=5.0 * sigma)


@pytest.mark.parametrize("seed", [0, 3])
def test_a_drift_is_fitted_together_with_a_coleman_hodgdon_loop_and_its_delay(seed: int) -> None:
    """A drift that stays where plays have put it bends the loop."""
    u = voltage(np.random.default_rng(seed))
    loop = pz.ColemanHodgdon(0.03, 0.12, 0.0066)
    x = loop.simulate(np.concatenate([np.linspace(0.0, u[0], 300), u]))[300:]
    stroke = float(np.ptp(x))
    sigma = 1e-4 * stroke
    x = np.interp(np.arange(N) - 2.4, np.arange(N), x) + 0.02 * stroke * T / T[-1]
    found = fit(u, x + noise(sigma), "coleman-hodgdon", delay="auto")
    assert rms(found.predict().x - x) < 0.3 * sigma
    assert found.delay == pytest.approx(2.4, abs=0.01)
    for name, true in zip(("alpha", "beta", "gamma"), loop.theta, strict=True):
        assert getattr(found.model, name) == pytest.approx(true, abs=4.0 * found.standard_errors[name])


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


def test_spikes_dropouts_and_gaps_do_not_move_a_fit() -> None:
    u, x, sigma = drawn(11)
    y = x + noise(sigma)
    without = fit(u, y, "plays").predict().x
    y[np.random.default_rng(1).choice(N, 40, replace=False)] += 200.0 * sigma
    y[1800:1900] = y[1800]
    y[3000:3200], y[123] = np.nan, np.nan
    v = u.copy()
    v[2500:2510] = np.nan
    found = fit(v, y, "plays")
    assert rms(found.predict().x - without) < 0.35 * sigma
    assert not found.counts[3000:3200].any()
    assert np.all(np.isfinite(found.predict().x))


def test_a_start_that_has_not_settled_is_left_out() -> None:
    u, x, sigma = drawn(12)
    y = x + noise(sigma) + 500.0 * sigma * np.exp(-np.arange(N) / 15.0)
    found = fit(u, y, "plays")
    assert 40 < found.left_out < 400
    assert rms((found.predict().x - x)[found.left_out :]) < sigma
    assert fit(u, y, "plays", settle=0.2).left_out == 200


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.slow
def test_predicts_what_comes_as_well_as_plain_least_squares(seed: int) -> None:
    """Of the same 20 plays, without penalty and with the true start."""
    u, x, sigma = drawn(seed)
    y, half = x + noise(sigma, seed), N // 2
    found = fit(u[:half], y[:half], "plays")
    thresholds = 0.45 * np.ptp(u[:half]) * np.arange(20) / 20.0
    columns = play_matrix(u, thresholds, np.clip(0.0, u[0] - thresholds, u[0] + thresholds))
    columns = np.column_stack([columns, np.full(N, np.ptp(u)), np.full(N, -np.ptp(u))])
    weights, _ = nnls(columns[:half], y[:half])
    mine, other = y - found.continued(u).x, y - columns @ weights
    assert rms(mine[:half]) < 1.1 * rms(other[:half]) + 0.1 * sigma
    assert rms(mine[half:]) < 1.1 * rms(other[half:]) + 0.1 * sigma


@pytest.mark.parametrize("ramp", [0, 300])
def test_wide_plays_that_the_first_way_from_rest_moves_are_fitted(ramp: int) -> None:
    """A unipolar stage: from 0 V up, plays move that no swing about the middle moves again."""
    swings = np.concatenate(
        [a * np.sin(2.0 * np.pi * np.arange(1000) / 1000.0) for a in [20.0, 40.0, 30.0] * 3]
    )
    u = np.concatenate([np.linspace(0.0, 40.0, ramp), 40.0 + swings])
    thresholds = np.linspace(1.0, 60.0, 30)
    stage = pz.PrandtlIshlinskii(0.08, thresholds, 0.006 * np.exp(-thresholds / 25.0))
    x = stage.simulate(u, initial_state=np.zeros(30))
    found = fit(u, x + noise(5e-3, 0, u.size), "plays", delay=0.0)
    assert rms(found.predict().x - x) < 4e-3
