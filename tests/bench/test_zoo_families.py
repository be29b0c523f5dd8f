"""The families of the zoo: known limits, textbook versions, and what hysteresis without a clock must do."""

import itertools

import numpy as np
import pytest

from piezoest._checks import FloatArray
from piezoest.bench.zoo.backlash import Backlash
from piezoest.bench.zoo.bouc_wen import BoucWen
from piezoest.bench.zoo.duhem import Duhem
from piezoest.bench.zoo.families import FAMILIES, POINTS, Reach, draw_family
from piezoest.bench.zoo.relays import Relays
from piezoest.models import ColemanHodgdon

REACHES = (Reach(-100.0, 100.0), Reach(0.0, 150.0))
WIPING_OUT = ("backlash", "relays", "paper", "preisach")


def path(reach: Reach, *places: float, points: int = 60) -> FloatArray:
    """Voltages from 0 V by way of places between -1 and 1 of the reach."""
    volts = [0.0, *(reach.middle + reach.half * np.array(places))]
    pairs = itertools.pairwise(volts)
    return np.concatenate([np.linspace(a, b, points, endpoint=False) for a, b in pairs] + [volts[-1:]])


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("reach", REACHES)
def test_loops_have_the_width_and_the_slope_that_are_asked_for(family: str, reach: Reach) -> None:
    for width in (0.08, 0.25):
        model = draw_family(family, np.random.default_rng(3), reach, width=width, gain=0.2)
        x = model.simulate(reach.cycle())
        falling, rising = x[-2 * POINTS : -POINTS][::-1], x[-POINTS:]
        assert np.max(falling - rising) / np.ptp(rising) == pytest.approx(width, rel=1e-6)
        assert np.ptp(x[-400:]) == pytest.approx(0.2 * 2.0 * reach.half, rel=0.01)
        assert model.simulate(np.zeros(3)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("family", FAMILIES)
def test_it_is_the_path_that_counts_not_the_time(family: str) -> None:
    reach = REACHES[0]
    model = draw_family(family, np.random.default_rng(1), reach, width=0.2, gain=0.1)
    coarse = path(reach, 0.9, -0.5, 0.3, -0.95, 0.1)
    fine = np.interp(np.arange(0.0, coarse.size - 0.9, 0.125), np.arange(coarse.size), coarse)
    np.testing.assert_allclose(model.simulate(fine)[::8], model.simulate(coarse), atol=2e-5)
    slow = np.repeat(coarse, 3)
    np.testing.assert_array_equal(model.simulate(slow)[::3], model.simulate(coarse))
    du, dx = np.diff(coarse), np.diff(model.simulate(coarse))
    assert np.all(dx[du != 0.0] / du[du != 0.0] > 0.0)  # the slope never turns round


@pytest.mark.parametrize("family", WIPING_OUT)
@pytest.mark.parametrize("reach", REACHES)
def test_a_large_swing_deletes_small_ones(family: str, reach: Reach) -> None:
    model = draw_family(family, np.random.default_rng(2), reach, width=0.2, gain=0.1)
    plain = model.simulate(path(reach, 0.9, -0.9, 0.2))[-1]
    with_loops = model.simulate(path(reach, 0.5, 0.1, 0.9, -0.2, 0.4, -0.9, -0.3, -0.5, 0.2))[-1]
    assert with_loops == pytest.approx(plain, abs=1e-11)


def test_two_families_contain_coleman_and_hodgdon() -> None:
    u = path(REACHES[0], 0.8, -0.6, 0.2, -0.9, 0.9)
    expected = ColemanHodgdon.from_loop(1.0 / 40.0, 0.3 * 0.2, 0.2).simulate(u)
    same = BoucWen(gain=0.2, share=0.3, width=40.0, power=1.0, fullness=1.0)
    np.testing.assert_allclose(same.simulate(u), expected, atol=1e-7)
    duhem = Duhem(
        gain=0.2, share=0.3, scale=100.0, centre=0.0, rate_up=0.025, rate_down=0.025, top=40.0, bottom=40.0
    )
    np.testing.assert_allclose(duhem.simulate(u), expected, atol=1e-12)


def test_a_duhem_loop_is_that_of_its_differential_equation() -> None:
    model = Duhem(
        scale=100.0, centre=20.0, rate_up=0.03, rate_down=0.015, top=15.0, bottom=25.0, tilt=0.2, bend=0.1
    )
    u = np.concatenate((np.linspace(0.0, 80.0, 40_001), np.linspace(80.0, -60.0, 70_001)[1:]))
    h, values = 0.0, [0.0]
    for u_0, u_1 in itertools.pairwise(u):
        v = (0.5 * (u_0 + u_1) - 20.0) / 100.0
        rate, target = (0.03, 15.0 * (1.0 + 0.2 * v)) if u_1 > u_0 else (0.015, -25.0 * (1.0 - 0.2 * v))
        h += rate * abs(u_1 - u_0) * (target - h)
        values.append(h)
    line = u + 0.05 / 100.0 * ((u - 20.0) ** 2 - 400.0)
    np.testing.assert_allclose(model.simulate(u), line - np.array(values), atol=5e-3)


def lines_of(model: Relays) -> FloatArray:
    return np.linspace(model.low, model.high, model.levels + 1)


def slow_relays(model: Relays, u: FloatArray) -> FloatArray:
    """Every relay by itself, for voltages on the lines of the grid: a cell switches between two of them."""
    v = lines_of(model)
    up, down = np.meshgrid(v[1:], v[:-1], indexing="ij")
    state = np.zeros_like(up, dtype=bool)
    sums = []
    for voltage in (0.0, *u):
        state = np.where(up <= voltage, True, np.where(down >= voltage, False, state))
        sums.append(model.weights[state].sum())
    return model.gain * (u + model.share * (np.array(sums[1:]) - sums[0]))


def test_relays_are_relays() -> None:
    rng = np.random.default_rng(5)
    for low, high in ((-100.0, 130.0), (-10.0, 220.0)):  # with a line at 0 V, where all begins
        middle = 0.5 * (low + high)
        model = Relays(
            gain=0.1, share=0.7, low=low, high=high, half_width=20.0, half_width_spread=15.0, place=middle,
            place_spread=40.0, levels=23,
        )  # fmt: skip
        u = rng.choice(lines_of(model), 500)
        np.testing.assert_allclose(model.simulate(u), slow_relays(model, u), atol=1e-11)
        fine = model.simulate(np.linspace(low, high, 100_001))
        assert np.diff(fine).max() < 20.0 * (high - low) * 0.1 / 100_000  # no step anywhere


def test_of_too_many_loops_the_smallest_are_forgotten() -> None:
    model = draw_family("relays", np.random.default_rng(6), REACHES[0], width=0.2, gain=0.1)
    turns = 60.0 * 0.97 ** np.arange(200) * (-1.0) ** np.arange(200)
    x = model.simulate(np.concatenate((turns, [90.0, -20.0])))
    assert np.abs(np.diff(x[150:200])).max() < 0.15  # near the middle, as the voltage is
    np.testing.assert_allclose(x[-2:], model.simulate(np.array([90.0, -20.0])), atol=1e-9)


def test_backlash_has_play_and_a_place_where_it_does_not_pull() -> None:
    model = Backlash(gain=0.1, share=2.0, width=10.0, dead=5.0, place=30.0)
    u = np.array([0.0, 30.0, 35.0, 45.0, 60.0, 45.0, 40.0, 30.0, 10.0])
    y = np.array([0.0, 20.0, 25.0, 35.0, 50.0, 50.0, 50.0, 40.0, 20.0])
    pulled = np.where(y > 35.0, y - 5.0, np.where(y < 25.0, y + 5.0, 30.0)) - 5.0
    np.testing.assert_allclose(model.simulate(u), 0.1 * (u + 2.0 * pulled), atol=1e-12)


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(ValueError, match="bouc-wen, duhem"):
        draw_family("magic", np.random.default_rng(0), REACHES[0], width=0.1, gain=0.1)
