"""Signals: shapes, continuity, the paper's PRBS, periods, and the refusal of jumps."""

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt

from piezoest import signals
from piezoest.signals import Signal, check_continuity

FS = 50_000.0
EXAMPLES: dict[str, Callable[[], Signal]] = {
    "triangle": lambda: signals.triangle(5.0, 5.0, 3, 10_000.0),
    "sine": lambda: signals.sine(5.0, 5.0, 3, 10_000.0),
    "amplitude_modulated": lambda: signals.amplitude_modulated(5.0, 5.0, 0.5, 4.0, 10_000.0),
    "multi_amplitude": lambda: signals.multi_amplitude([2.5, 7.5, 0.0, 5.0], 5.0, 2, 10_000.0),
    "multi_amplitude of sines": lambda: signals.multi_amplitude([1.0, 5.0], 7.0, 3, 1000.0, shape="sine"),
    "filtered_steps": lambda: signals.filtered_steps([1.0, -2.0, 3.0], 0.2, 10_000.0),
    "chirp": lambda: signals.chirp(5.0, 1.0, 20.0, 2.0, 10_000.0),
    "prbs": lambda: signals.prbs(periods=2, sample_rate=10_000.0, lead_in=0.1),
    "dwell": lambda: signals.dwell(2.0, 0.5, 10_000.0),
    "two_tone": lambda: signals.two_tone((4.0, 1.0), (5.0, 40.0), 1.0, 10_000.0),
    "random_walk": lambda: signals.random_walk(5.0, 20.0, 2.0, 10_000.0, seed=3),
    "from_array": lambda: signals.from_array(np.sin(np.arange(200) / 10), 200.0),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_signals_are_finite_continuous_deterministic_and_periodic(name: str) -> None:
    signal = EXAMPLES[name]()
    check_continuity(signal)  # which wants finite numbers
    np.testing.assert_array_equal(signal.values, EXAMPLES[name]().values)
    if signal.period is not None and not name.startswith(("prbs", "multi_amplitude")):
        again, n = signal.repeat(2), round(signal.period)
        assert n == pytest.approx(again.period)
        np.testing.assert_allclose(again.values[n:], again.values[:-n], rtol=0.0, atol=1e-12)


def test_triangle_is_linear_up_to_ninety_per_cent_and_rounded_beyond() -> None:
    r = signals.triangle(5.0, 5.0, 1, FS).values
    slope = np.abs(np.diff(r)) * FS
    straight = np.maximum(np.abs(r[:-1]), np.abs(r[1:])) <= 4.5
    np.testing.assert_allclose(slope[straight], 4.0 * 5.0 * 5.0, rtol=1e-9)
    assert np.mean(slope < 99.9) == pytest.approx(0.1, abs=0.01), "rounded beyond"
    assert straight.mean() == pytest.approx(0.9, abs=1e-3)
    assert r[1] > r[0] == 0.0
    for continuity, peak in ((1, 0.95), (2, 0.9625), (3, 0.96875), (4, 1 - 0.1 * 35 / 128)):
        wave = signals.triangle(2.0, 5.0, 2, 20_000.0, continuity=continuity)
        ends = wave.values.max(), -wave.values.min(), wave.amplitude
        assert ends == pytest.approx((2.0 * peak,) * 3, rel=1e-12)
    # Without smoothing it has corners.
    ideal = np.interp(np.arange(800), [0, 100, 300, 500, 700, 800], [0.0, 3.0, -3.0, 3.0, -3.0, 0.0])
    np.testing.assert_allclose(signals.triangle(3.0, 1.0, 2, 400.0, smoothing=0.0).values, ideal, atol=1e-12)


@settings(max_examples=50)
@given(st.floats(0.01, 100.0), st.floats(0.0, 1.0), st.integers(1, 8), st.floats(-2.0, 2.0))
def test_triangle_keeps_amplitude_and_slope(
    frequency: float, smoothing: float, continuity: int, phase: float
) -> None:
    r = signals.triangle(5.0, frequency, 2, 1000.0, smoothing, continuity, phase)
    assert r.amplitude <= 5.0 + 1e-12
    assert np.all(np.abs(np.diff(r.values)) <= 4.0 * 5.0 * frequency / 1000.0 * (1 + 1e-6) + 1e-12)


def test_periods_of_several_waves() -> None:
    r = signals.sine(1.0, 7.0, 7000, 1000.0)  # no period is a whole number of samples, and none drifts
    assert len(r) == 1_000_000
    assert r.period == pytest.approx(1000 / 7)
    np.testing.assert_array_equal(r.values[-1000:], r.values[:1000])
    tones: Any = {(2.0, 3.0): 1000.0, (0.01, 50.0): 100_000.0, (1.0, np.pi): None}
    for frequencies, period in tones.items():
        assert signals.two_tone((1.0, 1.0), frequencies, 1.0, 1000.0).period == pytest.approx(period)
    # Amplitudes change at zero.
    r, n = signals.multi_amplitude([2.5, 7.5], 5.0, [2, 3], FS, smoothing=0.1), 10_000
    assert (len(r), r.period, r.values[2 * n]) == (5 * n, n, 0.0)
    assert np.max(np.abs(r.values[: 2 * n])) == pytest.approx(2.5 * 0.96875)
    assert np.max(np.abs(r.values[2 * n :])) == pytest.approx(7.5 * 0.96875)
    r = signals.amplitude_modulated(4.0, 50.0, 1.0, 1.0, 10_000.0, depth=0.75)
    assert r.period == 10_000
    assert np.max(np.abs(r.values[:200])) == pytest.approx(4.0, rel=0.01)
    assert np.max(np.abs(r.values[4900:5100])) == pytest.approx(1.0, rel=0.01)


def test_prbs_is_the_steady_state_of_the_repeated_filtered_sequence() -> None:
    for bits in (2, 3, 5, 8):
        sequence = signals.maximal_length_sequence(bits)
        n = 2**bits - 1
        assert [float(sequence @ np.roll(sequence, lag)) for lag in range(n)] == [float(n)] + [-1.0] * (n - 1)
        assert sequence.sum() == 1.0
    n, r = 38_750, signals.prbs(periods=2, sample_rate=FS)
    assert (len(r), r.period) == (2 * n, n)
    chips = np.repeat(5.0 * signals.maximal_length_sequence(5), 1250)
    settled = sosfilt(butter(2, 10.0, fs=FS, output="sos"), np.tile(chips, 3))[-n:]
    np.testing.assert_allclose(r.values, np.tile(settled, 2), atol=1e-8)
    begun = signals.prbs(start="zero")
    assert abs(begun.values[0]) < 0.01 < begun.values[100]
    np.testing.assert_allclose(np.sort(begun.values), np.sort(r.values[:n]), atol=1e-12)
    led = signals.prbs(periods=2, lead_in=0.2).values
    assert led[0] == 0.0
    np.testing.assert_array_equal(led[10_000:], r.values)
    np.testing.assert_allclose(led[9_950:10_000], r.values[n - 50 : n], atol=1e-5)


def test_random_walk_is_band_limited_and_reproducible() -> None:
    r = signals.random_walk(5.0, 20.0, 3.0, 1000.0, seed=7)
    assert r.amplitude == pytest.approx(5.0)
    assert r.values[0] == 0.0
    spectrum = np.abs(np.fft.rfft(r.values))
    assert spectrum[61:].max() < 1e-9 * spectrum.max()
    finer, other = (signals.random_walk(5.0, 20.0, 3.0, *given) for given in ((2000.0, 7), (1000.0, 8)))
    np.testing.assert_allclose(r.values, finer.values[::2], rtol=2e-3)
    assert not np.allclose(r.values, other.values)


def test_signal_is_an_array_where_one_is_wanted() -> None:
    given_values = np.array([1.0, -3.0, 2.0])
    r = signals.from_array(given_values, 10.0, period=3)
    given_values[0] = 99.0
    assert list(r) == [1.0, -3.0, 2.0], "the samples are copied"
    assert (len(r), r.amplitude, r.duration, r[1], r[:2].shape) == (3, 3.0, 0.3, -3.0, (2,))
    np.testing.assert_allclose(r.time, [0.0, 0.1, 0.2])
    assert np.asarray(r, dtype=np.float32).dtype == np.float32
    with pytest.raises(AttributeError):
        r.sample_rate = 5.0  # type: ignore[misc]


def test_signal_arithmetic() -> None:
    r = signals.sine(1.0, 5.0, 2, 1000.0)
    both, broken = r + 3 * r, signals.sine(1.0, 7.0, 2, 1000.0).repeat(2)
    for result, values, period in (
        (2 * r, 2.0 * r.values, 200.0), (r * np.float64(2.0), 2.0 * r.values, 200.0),
        (-r, -r.values, 200.0), (r.shifted(3.0), r.values + 3.0, 200.0), (40 + r, r.values + 40.0, 200.0),
        (r - np.uint8(3), r.values - 3.0, 200.0), (3.0 - r, 3.0 - r.values, 200.0),
        (r.repeat(3), np.tile(r.values, 3), 200.0), (both, [*r.values, *(3.0 * r.values)], 200.0),
        (r + signals.dwell(0.0, 0.1, 1000.0), [*r.values, *np.zeros(100)], None),
        (broken, broken.values, None),  # the phase breaks at the joint
    ):  # fmt: skip
        np.testing.assert_array_equal(result.values, values)
        assert result.period == period
    for sampled in (r + r.values, r.values + r, r - r.values, r.values - r):
        assert type(sampled) is np.ndarray, "sample by sample"
    for wrong in ("40", None, [40.0], 40j):
        for pair in ((r, wrong), (wrong, r)):
            for combine in (operator.add, operator.sub):
                with pytest.raises(TypeError, match=r"operand|concatenate"):
                    combine(*pair)
    with pytest.raises(TypeError, match="operand"):
        r - r


@pytest.mark.parametrize("start", [0.0, 12.0, 45.0, 80.0])
def test_a_lead_in_goes_smoothly_from_rest_to_the_first_value(start: float) -> None:
    r = signals.triangle(5.0, 5.0, 2, 1000.0) + 45.0
    led = r.with_lead_in(0.3, start=start)
    assert (led.period, led.sample_rate, led.name, len(led)) == (200.0, 1000.0, "triangle", 300 + len(r))
    np.testing.assert_array_equal(led.values[300:], r.values)
    assert led.values[0] == start
    way, steps = abs(45.0 - start), np.diff(led.values[:301]) * np.sign(45.0 - start)
    assert np.all(steps >= 0.0), "in one direction, so never beyond its ends"
    assert np.all(steps[[0, -1]] <= 1e-4 * way), "at rest at both ends"
    # The steepest of all ways that are at rest at both ends, and whose acceleration is zero there, is 15/8.
    assert steps.max() <= 1.875 * way / 300
    check_continuity(led)


T = np.arange(2000) / 1000.0
SLOW, STEP = np.sin(2.0 * np.pi * T), np.where(T < 1.0, 0.0, 1.0)
JUMPY = {
    "square wave": np.sign(np.sin(2.0 * np.pi * T + 0.01)),
    "step in three samples": np.interp(T, [0.0, 1.0, 1.003, 2.0], [0.0, 0.0, 1.0, 1.0]),
    "unfiltered PRBS": np.repeat(signals.maximal_length_sequence(5), 50),
    "slow sine with a spike": SLOW + (np.arange(2000) == 700),
    "joined signals": np.concatenate([SLOW[:250], SLOW]),
    "noisy steps": STEP + 0.001 * np.random.default_rng(0).standard_normal(2000),
    "three samples": np.array([0.0, 5.0, 5.0]),
}
LEGITIMATE = {
    "coarse triangle": signals.triangle(5.0, 1.0, 5, 12.0, smoothing=0.0).values,
    "triangle with rests": signals.multi_amplitude([5.0, 0.0, 1.0], 1.0, 3, 40.0).values,
    "noise after a dwell": np.concatenate([np.zeros(100), np.random.default_rng(2).standard_normal(3000)]),
    "ramp of five samples": np.interp(np.arange(100), [0, 50, 55, 99], [0.0, 0.0, 1.0, 1.0]),
    "quantised slow sine": np.round(SLOW * 50.0) / 50.0,
    "two samples": np.array([0.0, 5.0]),
    "empty": np.array([]),
    "coarse steps": signals.filtered_steps([1.0, -1.0, 1.0], 1.0, 100.0, cutoff=20.0).values,
    "coarse PRBS": signals.prbs(sample_rate=40.0).values,
}


@pytest.mark.parametrize("name", [*JUMPY, *LEGITIMATE])
def test_jumps_are_refused_and_nothing_else(name: str) -> None:
    if name in LEGITIMATE:
        check_continuity(LEGITIMATE[name], 1000.0, "r")
        return
    with pytest.raises(ValueError, match=r"^r jumps by .* use signals\.filtered_steps"):
        check_continuity(JUMPY[name], 1000.0, "r")


sg: Any = signals  # unchecked: what is asked here is wrong on purpose


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: sg.sine(1.0, 600.0, 1, 1000.0), "frequency"),
        (lambda: sg.triangle(1.0, 5.0, 1e-9, FS), "periods"),
        (lambda: sg.triangle(1.0, 5.0, 1, FS, smoothing=1.5), "smoothing"),
        (lambda: sg.triangle(1.0, 5.0, 1, FS, continuity=9), "continuity"),
        (lambda: sg.multi_amplitude([1.0, 2.0], 5.0, [1], FS), "periods"),
        (lambda: sg.multi_amplitude([1.0], 5.0, 1, FS, shape="saw"), "shape"),
        (lambda: sg.filtered_steps([1.0, 2.0], [0.1, 0.0], FS), "dwell_times"),
        (lambda: sg.prbs(start="middle"), "start"),
        (lambda: sg.maximal_length_sequence(40), "bits"),
        (lambda: sg.from_array([1.0, np.nan], FS), "values holds 1"),
        (lambda: sg.dwell(1.0, 0.1, FS).with_lead_in(1e-6), "duration"),
        (lambda: sg.dwell(1.0, 0.1, FS) + float("nan"), "offset"),
        (lambda: sg.dwell(1.0, 0.1, FS).then(sg.dwell(0.0, 1.0, 500.0)), "same sample rate"),
        (lambda: check_continuity([0.0, np.inf], FS, "u"), "u holds 1 values"),
    ],
)
def test_bad_arguments_are_named(call: Callable[[], object], argument: str) -> None:
    with pytest.raises(ValueError, match=argument):
        call()


@pytest.mark.parametrize("method", ["linear", "logarithmic"])
def test_chirp_sweeps_from_start_to_stop(method: Any) -> None:
    r = signals.chirp(1.0, 2.0, 32.0, 10.0, 10_000.0, method=method)
    rises = np.flatnonzero((r.values[:-1] < 0.0) & (r.values[1:] >= 0.0)) / 10_000.0
    middle = 0.5 * (rises[1:] + rises[:-1])
    expected = 2.0 + 3.0 * middle if method == "linear" else 2.0 * 16.0 ** (middle / 10.0)
    np.testing.assert_allclose(1.0 / np.diff(rises), expected, rtol=0.03)


def test_filtered_steps_reach_their_levels() -> None:
    r = signals.filtered_steps([5.0, -5.0], [0.5, 1.0], FS, cutoff=10.0)
    assert (len(r), r.period) == (75_000, None)
    assert (r.values[24_999], r.values[-1]) == pytest.approx((5.0, -5.0), abs=1e-6)
    assert r.values.max() == pytest.approx(5.0 * 1.0432, rel=1e-3)
    rest = signals.filtered_steps([2.0], 0.1, FS, start=2.0)
    np.testing.assert_allclose(rest.values, 2.0, atol=1e-12)
    wave = signals.filtered_steps([5.0, -5.0], 0.1, FS, periods=4)
    assert (len(wave), wave.period) == (40_000, 10_000)
    np.testing.assert_allclose(wave.values[:5000], -wave.values[5000:10_000], atol=1e-8)
