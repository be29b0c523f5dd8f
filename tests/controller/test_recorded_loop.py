"""The recorded loop: repeated motion needs no model."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.bench.zoo.families import FAMILIES, Reach, draw_family
from piezoest.controller import recorded_loop, recorder, travel
from piezoest.estimators import model_writing
from piezoest.layout import NUMBER, Named, new, record
from tests.controller.shared import LIMITS, drive, stands_along

FS = 5000.0
# What `candidate` has around an inverse.
AROUND = record(voltage=NUMBER, inverse=recorded_loop.STATE)
GIVEN = record(inverse=recorded_loop.LOOP)


def recorded(u: FloatArray, x: FloatArray, state: Any = None, fine: float = np.inf) -> Any:
    """State of the recorder after a record; legs of at least `fine` samples are drawn finely."""
    state = Named(new(recorder.STATE), recorder.STATE) if state is None else state
    settings = Named(new(recorder.LAYOUTS[1], fine=fine), recorder.LAYOUTS[1])
    for u_k, x_k in zip(u.tolist(), x.tolist(), strict=True):
        recorder.sample(state, settings, u_k, x_k)
    return state


def placed(state: Any, u: float) -> tuple[Any, Any]:
    """An inverse that uses what was recorded, at a voltage."""
    own, given = Named(new(AROUND), AROUND), Named(new(GIVEN), GIVEN)
    recorder.write_model(state, None, given.inverse)
    own.voltage = u
    own.inverse.direction[0], own.inverse.furthest = state.direction, u
    recorded_loop.place(own, given)
    return own, given


def loop(periods: float = 2.0, largest: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """A loop of no model: 20 % wide, bent, and not symmetric; each period is the same to the last bit."""
    t = np.arange(int(400 * periods)) % 400 / 400.0
    u = largest * np.cos(2.0 * np.pi * t)
    down = np.sin(2.0 * np.pi * t) > 0.0
    x = 0.9 * u + 0.1 * u**2 + np.where(down, 0.12, -0.08) * (1.0 - u**2)
    return u, x


def plays(u: FloatArray) -> FloatArray:
    """Plays of ten thresholds, from rest at zero."""
    thresholds = np.linspace(0.0, 0.9, 10)
    w, x = np.zeros(10), np.empty_like(u)
    for k, u_k in enumerate(u.tolist()):
        w = np.clip(w, u_k - thresholds, u_k + thresholds)
        x[k] = 0.6 * u_k + 0.04 * w.sum()
    return x


def follows(own: Any, given: Any, u: FloatArray) -> FloatArray:
    """Where the recorded loop stands along a voltage."""
    return stands_along(recorded_loop, own, given, u)


def along(ends: Sequence[float], samples: int) -> FloatArray:
    """Voltage from turn to turn, in so many samples each."""
    return np.interp(np.arange(0.0, len(ends) - 1.0, 1.0 / samples), np.arange(len(ends)), ends)


THRICE = along([0.0, 1.0, -1.0, 1.0, -1.0, 1.0], 200)


def inner_loops(change: float) -> tuple[float, ...]:
    """Turns of twenty inner loops, each larger by so much than the last one, and the way out of them."""
    return 1.0, *(side * (0.3 + change * k) for k in range(20) for side in (-1.0, 1.0)), -1.0


@pytest.mark.parametrize(
    "turns",
    [
        (1.0, -0.3, 0.3, -0.3, 0.3, -0.3),
        (1.0, -0.2, 0.1, -0.05, 0.05, -0.8),
        (1.0, -1.0, -0.4, -0.6, 0.5, 0.3, 1.0),
        inner_loops(0.0),
        inner_loops(0.01),
        inner_loops(-0.01),
    ],
    ids=["smaller", "inner loops", "both ways", "many equal loops", "growing loops", "shrinking loops"],
)
def test_after_other_turns_it_goes_as_plays_do(turns: tuple[float, ...]) -> None:
    more = along(turns, 100)
    x = plays(np.append(THRICE, more))
    own, given = placed(recorded(np.append(THRICE, more[:9]), x[: THRICE.size + 9]), float(more[8]))
    # Of many loops it knows the last ones; behind them it is on the outer one.
    part, most = (slice(-100, None), 0.02) if len(turns) > 10 else (slice(THRICE.size + 9, None), 0.015)
    stands = np.append(x[: THRICE.size + 9], follows(own, given, more[9:]))
    np.testing.assert_allclose(stands[part], x[part], atol=most)


def test_the_first_leg_stands_for_both_directions() -> None:
    up, down = recorded(*loop(0.6)).loop.x
    np.testing.assert_allclose(np.diff(up), -np.diff(down))
    np.testing.assert_allclose(up[[0, -1]], down[[-1, 0]])
    up, down = recorded(*loop(1.2)).loop.x
    assert np.abs(np.diff(up) + np.diff(down)).max() > 1e-3
    # So does the only leg of a sawtooth, which flies back in a few samples.
    u = np.concatenate([np.linspace(0.0, 1.0, 200), *[np.linspace(-1.0, 1.0, 400)] * 3, [0.5]])
    found = recorded(u, 2.0 * u).loop
    np.testing.assert_allclose(found.begins, (-1.0, 1.0), atol=0.01)
    np.testing.assert_allclose(found.x[1], found.x[0][::-1], atol=1e-9)


def test_a_leg_stands_for_a_much_shorter_one_before_it() -> None:
    """A small way up, then all the way down: farther up nothing is known but that it is like the way down."""
    u = along([0.0, 0.5, -1.0, -0.9], 500)
    own, given = placed(recorded(u, plays(u)), -0.9)
    back, way = plays(along([0.0, 0.5, -1.0, 0.5, 0.4], 500))[1000:1501], np.linspace(-0.9, 0.5, 100)
    expected = np.interp(way, np.linspace(-1.0, 0.5, 501), back)
    np.testing.assert_allclose(follows(own, given, way), expected, atol=0.03)


@pytest.mark.parametrize("size", [0.03, 0.1, 0.3])
def test_closed_inner_loops_do_not_drift(size: float) -> None:
    u, x = loop()
    own, given = placed(recorded(u, x), float(u[-1]))
    follows(own, given, np.linspace(u[-1], 0.0, 200))
    waves = np.tile(np.concatenate([np.linspace(0.0, size, 50), np.linspace(size, 0.0, 50)]), 40)
    stands = follows(own, given, waves)
    np.testing.assert_allclose(stands[::100], stands[0], atol=1e-9)


def test_numbers_that_were_changed_do_not_stop_it() -> None:
    u, x = loop()
    own, given = placed(recorded(u, x), float(u[-1]))
    given.inverse.apart[1] = 0.0
    assert recorded_loop.wanted(own, given, 0.3) == 0.3


def test_what_was_missed_before_anything_was_recorded_does_not_count() -> None:
    driver, r = pz.AdaptiveFeedforward(FS, limits=LIMITS), pz.signals.triangle(3.0, 5.0, 8, FS).values
    drive(driver, stage_of("preisach"), r[:1400])  # 1.4 periods
    missed = driver.candidates[-1].missed
    assert missed is not None
    assert missed < 0.04 * 3.0


@pytest.mark.parametrize("longer", [1.0, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_the_inverse_is_exact_wherever_it_turns(seed: int, longer: float) -> None:
    """Also between curves of unlike length: a way back may be a turn for one direction alone."""
    u, x = loop()
    own, given = placed(recorded(u, x), float(u[-1]))
    given.inverse.apart[1] *= longer
    # Turns anywhere, also beyond both ends, and rests; then small ones.
    rng = np.random.default_rng(seed)
    r = np.interp(np.arange(0.0, 29.0, rng.uniform(0.02, 1.0)), np.arange(30), rng.uniform(-1.3, 1.3, 30))
    r = np.repeat(r, rng.integers(1, 3, r.size))
    for r_k in np.append(r, r[-1] + np.cumsum(rng.normal(0.0, 0.02, 1000))).tolist():
        wanted = recorded_loop.wanted(own, given, r_k)
        recorded_loop.follow(own, given, wanted, wanted)
        own.voltage = wanted
        assert recorded_loop.expected(own, given) == pytest.approx(r_k, abs=1e-9)


@pytest.mark.parametrize("size", [0.01, 0.06])
def test_a_leg_goes_on_behind_a_small_way_back(size: float) -> None:
    u = THRICE
    plain = recorded(np.append(u, 0.9), plays(np.append(u, 0.9))).loop
    k = int(np.flatnonzero((u[:-1] < 0.2) & (u[1:] >= 0.2))[-1]) + 1
    back = u[k] - size * np.concatenate([np.linspace(0.0, 1.0, 9), np.linspace(1.0, 0.0, 9)])
    goes_back = np.concatenate([u[:k], back, u[k:], [0.9]])
    found = recorded(goes_back, plays(goes_back)).loop
    np.testing.assert_allclose(found.x, plain.x, atol=1e-3)
    np.testing.assert_array_equal((found.begins, found.apart), (plain.begins, plain.apart))


def test_a_rest_noise_and_ringing_are_not_recorded() -> None:
    u, x = loop()
    plain = recorded(u, x).loop
    rests = np.insert(u, 500, np.full(3000, u[499])), np.insert(x, 500, np.full(3000, x[499] - 0.1))
    # A leg with a rest in it stays as it was recorded before.
    np.testing.assert_array_equal(recorded(*rests).loop.x[1], plain.x[1])
    noise = np.random.default_rng(0).normal(0.0, 0.01, u.size)
    noisy = recorded(u, x + 0.02 * np.sin(np.pi * np.arange(u.size) / 10.0) + noise).loop
    for curve, other, direction in zip(plain.x, noisy.x, (1.0, -1.0), strict=True):
        assert np.abs(curve - other)[1:-1].max() < 0.01
        assert np.all(np.diff(other) * direction > 0.0)


def test_a_leg_in_which_feedback_moves_a_resting_stage_is_not_recorded() -> None:
    u, x = loop(1.25)
    way = np.linspace(0.0, 0.2, 3000)[1:]
    found = recorded(np.append(u, u[-1] + way), np.append(x, np.full(way.size, x[-1]))).loop
    np.testing.assert_array_equal(found.x, recorded(u, x).loop.x)


def misses(ends: Sequence[float], fine: float) -> float:
    """How far the curves of the last two legs between turns are from a record with sharp bends."""

    def bent(gone: FloatArray) -> FloatArray:
        return gone - 0.3 * (1.0 - np.exp(-gone / 0.3))

    u, x = [ends[0]], [0.0]
    for begin, end in itertools.pairwise(ends):
        gone = np.linspace(0.0, abs(end - begin), 201)[1:]
        u.extend(begin + np.sign(end - begin) * gone)
        x.extend(x[-1] + np.sign(end - begin) * bent(gone))
    found = recorded(np.append(u, ends[-2]), np.append(x, x[-1]), fine=fine).loop
    size = np.arange(recorded_loop.KNOTS)
    curves = [np.abs(x - x[0]) - bent(size * apart) for x, apart in zip(found.x, found.apart, strict=True)]
    return float(max(np.ptp(curve[1:-1]) for curve in curves))


def test_a_slow_leg_as_long_as_the_last_one_is_drawn_finely() -> None:
    ends = (0.0, 1.0, -1.0, 1.0, -1.0, 1.0)
    assert misses(ends, fine=100.0) < 0.3 * misses(ends, fine=300.0)
    longer = (0.0, 1.0, -1.2, 1.4, -1.6, 1.8)
    assert misses(longer, fine=100.0) == misses(longer, fine=300.0)


@pytest.mark.parametrize("end", [None, 0.3, 0.75])
def test_small_waves_and_a_leg_that_is_read_in_part_leave_it(end: float | None) -> None:
    u, x = loop()
    state = recorded(np.append(u, 0.9), np.append(x, 0.9))  # the last leg is over
    before = state.loop.x.copy()
    if end is None:  # the setpoint of a long rest is noisy, and readings are missing
        small = 0.9 + 0.02 * np.sin(0.35 * np.arange(10_000))
        recorded(small, np.where(np.arange(small.size) % 2, np.nan, 0.0), state)
    else:
        blind = (np.arange(u.size) - 1) % 200 >= 200.0 * end  # the end, too
        recorded(u, np.where(blind, np.nan, 2.0 * x), state)
    np.testing.assert_array_equal(state.loop.x, before)


def stage_of(family: str) -> pz.SimulatedStage:
    model = draw_family(family, np.random.default_rng(5), Reach(-60.0, 60.0), width=0.15, gain=0.1)
    return pz.SimulatedStage(FS, model, gauge=pz.Gauge(noise=2e-4), seed=1)


def test_the_reference_leaves_the_loop_where_it_goes_farther_than_before() -> None:
    reference = Named(new(travel.TRAVEL), travel.TRAVEL)
    travel.begin(reference, 0.0, 0.1)
    ends = [0.0, 1.0, -1.0, 1.0, -0.5, 0.5, -0.5, 2.0, -2.0, 2.0, -2.0, -1.0]
    inside = []
    for begin, end in itertools.pairwise(ends):
        for value in np.linspace(begin, end, 50)[1:]:
            travel.follow(reference, value)
        inside.append(reference.nested)
    assert inside == [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0]


def test_a_way_back_too_small_to_be_recorded_does_not_confuse_it() -> None:
    u, x = loop()
    state = recorded(np.append(u, [0.9, 0.905]), np.append(x, [0.9, 0.905]))
    plain, given = placed(state, 0.9)
    back, _ = placed(state, 0.905)
    back.inverse.direction[0], back.inverse.u[0] = 1.0, 0.9
    recorded_loop.place(back, given)
    small = 2.0 * 0.005  # what the displacement can do on so small a way
    assert recorded_loop.expected(back, given) == pytest.approx(
        recorded_loop.expected(plain, given), abs=small
    )


@pytest.mark.parametrize(
    ("drift", "given"),
    [(0.0, model_writing.TO_BE_PLACED), (0.01, model_writing.NOT_CLOSED)],
    ids=["closed", "drifts"],
)
def test_a_loop_of_a_stage_that_drifts_is_not_closed(drift: float, given: float) -> None:
    """It drifts by this part of the swing in each leg."""
    u, x = loop()
    state = recorded(u, x + drift * np.arange(u.size) / 200.0 * np.ptp(x))
    assert recorder.write_model(state, None, Named(new(GIVEN), GIVEN).inverse) == given


@pytest.mark.parametrize("family", FAMILIES)
def test_repeated_motion_is_learnt_in_periods_on_any_stage(family: str) -> None:
    driver, r = pz.AdaptiveFeedforward(FS, limits=LIMITS), pz.signals.triangle(3.0, 5.0, 8, FS).values
    worst = np.abs(r - drive(driver, stage_of(family), r).x).reshape(8, -1).max(axis=1) / 3.0
    assert worst[-1] < (0.06 if family == "backlash" else 0.008), worst
    assert isinstance(driver.model, pz.LinearGain | pz.ColemanHodgdon | pz.PrandtlIshlinskii)
