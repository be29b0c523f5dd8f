"""Readings at the end of a sensor's range are left out of the fit, and of what is said about its error."""

import numpy as np
import pytest

import piezoest as pz
from piezoest.fitting.flaws import flawed
from piezoest.identification.sense import findings
from piezoest.records import Record

FS, NOISE = 2000.0, 2e-3
TRUE = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
U = np.concatenate([pz.signals.triangle(peak, 2.0, 3, FS).values for peak in (10.0, 20.0, 30.0, 40.0, 50.0)])
X = TRUE.simulate(U) + NOISE * np.random.default_rng(1).standard_normal(U.size)


@pytest.mark.parametrize(("low", "high"), [(-3.0, 3.0), (-20.0, 3.0)])
@pytest.mark.slow_but_first
def test_a_clipped_log_gives_the_model_of_the_whole_one(low: float, high: float) -> None:
    found = pz.identify(U, np.clip(X, low, high), sample_rate=FS, model="coleman-hodgdon")
    # Fitted and judged with them, the model missed 0.3 to 1.4 µm.
    assert found.held_out.rms < 2.0 * NOISE
    assert isinstance(found.model, pz.ColemanHodgdon)
    assert np.max(np.abs(found.model.simulate(U) - TRUE.simulate(U))) < 2.0 * NOISE
    assert any("identify leaves them out" in sentence for sentence in found.advice)


@pytest.mark.parametrize(("low", "high"), [(-20.0, 3.0), (-0.5, 0.5), (-3.0, 3.0)])
def test_what_is_clipped_is_marked_and_nothing_else_is_said(low: float, high: float) -> None:
    x = np.clip(X, low, high)
    flaws, clipped = flawed(U, x), (x == low) | (x == high)
    assert [top.limit for top in flaws.tops] == [limit for limit in (high, low) if limit > X.min()]
    if high == 3.0:
        np.testing.assert_array_equal(flaws.clipped, clipped)
        np.testing.assert_array_equal(flaws.before(8000).clipped, clipped[:8000])
    assert not flaws.jumps.size
    doubts = [each.name for each in findings(Record.from_arrays(U, x, FS)) if each.severity == "doubt"]
    assert set(doubts) == {"clipped displacement"}
