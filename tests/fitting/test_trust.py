"""How far to trust a fit: standard errors and intervals hold what they promise."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.fitting.trust import Spread
from tests.fitting.stages import RATE, N, noise, stage, voltage

LOOP = pz.ColemanHodgdon(0.03, 0.12, 0.0066, offset=1.5)


def inside(x: FloatArray, expected: Any, part: slice = slice(None)) -> float:
    """Fraction of the readings within the interval."""
    return float(np.mean(((x >= expected.lower) & (x <= expected.upper))[part]))


def coloured(size: float, seed: int, memory: float) -> FloatArray:
    """Noise of standard deviation `size` of which a fraction `memory` is left a sample later."""
    return np.asarray(lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], noise(size, seed)))


@pytest.mark.parametrize("memory", [0.0, 0.9])
@pytest.mark.parametrize("model", ["coleman-hodgdon", "line"])
@pytest.mark.slow
def test_standard_errors_cover(model: str, memory: float) -> None:
    true: Any = LOOP if model == "coleman-hodgdon" else pz.LinearGain(0.2, -3.0)
    known, z = dict(zip(true.parameter_names, true.theta, strict=True)) | {"offset": true.offset}, []
    if true is LOOP:
        known["delay"] = 2.3
    for seed in range(10):
        u = voltage(np.random.default_rng(seed), centre=30.0)
        x = true.simulate(np.interp(np.arange(N) - known.get("delay", 0.0), np.arange(N), u))
        delay: Any = "auto" if "delay" in known else 0.0
        found = pz.fit(u, x + coloured(5e-3, seed, memory), sample_rate=RATE, model=model, delay=delay)
        values = [*found.model.theta, found.model.offset, found.delay]
        for value, (name, wanted) in zip(values, known.items(), strict=False):
            z.append((value - wanted) / found.standard_errors[name])
    # Standard errors that are right give 1; so many runs leave it within this.
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.5


def test_what_ends_at_a_bound_has_no_standard_error() -> None:
    u = voltage(np.random.default_rng(2))
    found = pz.fit(u, 0.1 * u + noise(1e-2), sample_rate=RATE, model="plays")
    assert found.standard_errors["gain"] > 0.0
    assert found.standard_errors["delay"] == 0.0
    assert set(found.standard_errors) == {*found.model.parameter_names, "offset", "delay"}
    assert found.parameters < 21


@pytest.mark.parametrize("model", ["plays", "plays-asymmetric-creep", "coleman-hodgdon"])
@pytest.mark.slow
def test_intervals_hold_what_they_promise(model: str) -> None:
    """Of the half behind the fitted one."""
    shares = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        u = voltage(rng, centre=40.0 * (seed % 2))
        true: Any = LOOP if model == "coleman-hodgdon" else stage(rng)
        x = true.simulate(u)
        y = x + noise(2e-3 * float(np.ptp(x)), seed)
        # The half of larger swings is fitted: beyond the range, less is known.
        first = np.ptp(u[: N // 2]) > np.ptp(u[N // 2 :])
        half = slice(N // 2) if first else slice(N // 2, N)
        found = pz.fit(u[half], y[half], sample_rate=RATE, model=model)
        shares.append(inside(y[half], found.predict()))
        if first:
            shares.append(inside(y, found.continued(u), slice(N // 2, N)))
    assert 0.9 <= np.median(shares) <= 0.995
    assert min(shares) > 0.85


def test_an_interval_widens_beyond_the_range_and_behind_the_record() -> None:
    spread = Spread(3.0, 4.0, 0.4, (-10.0, 10.0))
    along = [spread.along(np.array(u), np.zeros(1)) for u in ([0.0, 10.0, 20.0], [0.0, 20.0, 0.0])]
    # It stays wide: the stage remembers where it was.
    np.testing.assert_allclose(along, [[3.0, 3.0, 5.0], [3.0, 5.0, 5.0]])
    np.testing.assert_allclose(spread.along(np.zeros(2), np.array([0.0, np.expm1(1.0)])), [3.0, 5.0])


def test_an_interval_holds_a_lag_that_is_no_delay() -> None:
    """A chirp of which the slow half is fitted: in the fast one a lag of first order flattens the swings."""
    t = np.arange(2 * N) / (2 * N)
    u = 40.0 * np.sin(2.0 * np.pi * (20.0 * t + 150.0 * t * t))
    x = stage(np.random.default_rng(0)).simulate(u)
    y = lfilter([0.3], [1.0, -0.7], x - x[0]) + x[0] + noise(2e-3 * float(np.ptp(x)), 0, 2 * N)
    found = pz.fit(u[:N], y[:N], sample_rate=RATE, model="plays", delay="auto")
    assert inside(y, found.continued(u), slice(N, None)) > 0.9


def test_blocks_beyond_the_others_do_not_widen_the_interval_within_the_range() -> None:
    """Nothing was known there; within the range a stage of plays is known well."""
    t = np.linspace(0.0, 1.0, N)
    u = 40.0 * t * np.sin(150.0 * t)
    x = stage(np.random.default_rng(0)).simulate(u) + noise(5e-3)
    found = pz.fit(u, x, sample_rate=RATE, model="plays")
    assert found.ahead > 20.0 * 5e-3
    assert found.spread.within < 10.0 * 5e-3


def test_a_loop_is_trusted_beyond_the_range_and_plays_are_not() -> None:
    u = voltage(np.random.default_rng(3))
    x = LOOP.simulate(u) + noise(5e-3)
    loop, plays = (pz.fit(u, x, sample_rate=RATE, model=name).spread for name in ("coleman-hodgdon", "plays"))
    assert loop.by_volt < 0.5 * plays.by_volt


def test_a_fast_step_widens_the_interval_while_it_lasts() -> None:
    spread = Spread(0.01, 0.0, 0.0, (-50.0, 50.0), by_move=0.1, delay=3.0, moved=2.0)
    half = spread.along(np.where(np.arange(300) < 40, 0.0, 20.0), np.zeros(1))
    assert half[41] > 1.0
    np.testing.assert_allclose(np.delete(half, np.arange(38, 140)), 0.01)


@pytest.mark.slow
def test_an_interval_holds_loops_that_the_record_did_not_show() -> None:
    """Of slopes that were fitted to loops of one size; where it had shown those, nothing is wider."""
    t = np.arange(2 * N) / RATE
    whole = 40.0 * np.sin(2.0 * np.pi * 2.0 * t)
    stage, before, wider = pz.PreisachStage(RATE).hysteresis, [], []
    for small, both in ((0.4, False), (0.7, False), (0.4, True)):
        u = np.where((t >= N / RATE) | (both & (t % 1.0 > 0.5)), small * whole, whole)
        x = stage.simulate(u)
        x = x + noise(1e-3 * float(np.ptp(x)), 0, 2 * N)
        found = pz.fit(u[:N], x[:N], sample_rate=RATE, model="plays-asymmetric")
        p = found.continued(u)
        assert inside(x, p, slice(N, None)) > 0.9
        plain = found.spread._replace(by_new=0.0).along(u, np.maximum(np.arange(2 * N) / N - 1.0, 0.0))
        before.append(np.mean((np.abs(x - p.x) <= plain)[N:]))
        wider.append(np.median((p.upper - p.x)[N:] / plain[N:]))
    assert max(before[:2]) < 0.8
    assert min(wider[:2]) > 2.0
    assert wider[2] == pytest.approx(1.0)


def test_an_interval_holds_creep_that_the_record_could_not_show() -> None:
    """Of a stage that only swings, and then comes to rest at one side."""
    t = np.arange(2 * N) / RATE
    u = 40.0 * np.sin(2.0 * np.pi * 2.25 * np.minimum(t, 1.3 * N / RATE))
    assert abs(u[-1]) > 20.0
    creep = pz.Creep([5e-3, 5e-3, 5e-3], [0.1, 0.5, 3.0])
    x = stage(np.random.default_rng(0), creep=creep).simulate(u)
    x = x + noise(5e-4 * float(np.ptp(x)), 0, 2 * N)
    found = pz.fit(u[:N], x[:N], sample_rate=RATE, model="plays")
    p, later = found.continued(u), np.maximum(np.arange(2 * N) / N - 1.0, 0.0)
    assert inside(x, p, slice(N, None)) > 0.9
    plain = found.spread._replace(by_stay=0.0).along(u, later)
    assert np.mean((np.abs(x - p.x) <= plain)[N:]) < 0.8
    np.testing.assert_allclose((p.upper - p.x)[: N + 1000], plain[: N + 1000], rtol=0.01)


@pytest.mark.slow
def test_standard_errors_of_plays_and_creep_are_of_the_size_of_their_scatter() -> None:
    """Of a stage whose thresholds and time constants are those of the fit."""
    u = voltage(np.random.default_rng(1), centre=40.0)
    thresholds = 0.45 * np.ptp(u) * np.arange(1, 20) / 19.0
    creep = pz.Creep([0.05], [0.5])
    model = pz.PrandtlIshlinskii(0.1, thresholds, np.full(19, 4e-3), creep=creep, sample_rate=RATE)
    state = np.clip(0.0, u[0] - thresholds, u[0] + thresholds)
    x = model.simulate(u, initial_state=np.append(state, 0.0))
    found: list[Any] = []
    for seed in range(10):
        fit: Any = pz.fit(u, x + noise(5e-3, seed), sample_rate=RATE, model="plays-creep")
        if fit.model.creep is not None and fit.model.creep.gains.size == 1:
            found.append(fit)
    assert len(found) >= 3
    for name, values in {"gain": [fit.model.gain for fit in found],
                         "creep.gains[0]": [fit.model.creep.gains[0] for fit in found]}.items():  # fmt: skip
        stated = float(np.median([fit.standard_errors[name] for fit in found]))
        assert 0.3 < stated / np.std(values) < 4.0
