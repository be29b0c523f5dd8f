"""What a stage remembers of a gap in the voltage."""

import numpy as np

from piezoest.fitting import fit
from piezoest.fitting.gaps import forgotten
from piezoest.models import PrandtlIshlinskii

RATE = 1000.0


def waves(sizes: list[float]) -> np.ndarray:
    return np.concatenate([size * np.sin(2.0 * np.pi * np.arange(200) / 200.0) for size in sizes])


def bridged(u: np.ndarray) -> np.ndarray:
    known = np.isfinite(u)
    return np.interp(np.arange(u.size), np.flatnonzero(known), u[known])


def test_samples_behind_a_gap_are_left_out_until_both_extremes_were_passed() -> None:
    u = waves([10.0] * 6)
    u[430:530] = np.nan  # over a maximum
    found = np.flatnonzero(forgotten(u, bridged(u)))
    assert found[0] == 530
    assert 630 < found[-1] < 670  # the next maximum is at 650


def test_short_gaps_and_those_without_a_turn_are_no_matter() -> None:
    u = waves([10.0] * 6)
    u[500:503], u[690:720] = np.nan, np.nan
    assert not forgotten(u, bridged(u)).any()


def test_a_turn_that_was_lost_does_not_spoil_a_fit() -> None:
    u = waves([4.0, 10.0, 6.0, 9.0, 3.0, 10.0, 5.0, 8.0, 10.0, 2.0])
    model = PrandtlIshlinskii(gain=0.1, thresholds=[1.0, 3.0], weights=[0.03, 0.05])
    x = model.simulate(u) + 1e-3 * np.random.default_rng(0).standard_normal(u.size)
    u[400:500], x[400:500] = np.nan, np.nan
    found = fit(u, x, sample_rate=RATE, model="plays")
    missed = (found.predict().x - x)[found.counts]
    assert np.sqrt(np.mean(missed**2)) < 2e-3
