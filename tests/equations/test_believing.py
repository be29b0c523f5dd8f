"""Readings that a stage cannot have made are left out."""

from __future__ import annotations

import numpy as np
import pytest

import piezoest as pz
from piezoest.equations import believing
from piezoest.layout import Named, new

FS = 20_000.0
TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.0043)
U = np.asarray(pz.signals.triangle(35.0, 5.0, 8, FS))
X = TRUE.simulate(U)


@pytest.mark.parametrize("estimator", [pz.HysteresisRLS, pz.PrandtlIshlinskiiRLS])
def test_saturated_readings_are_left_out(estimator: type) -> None:
    saturated = estimator(FS)
    saturated.run(U, np.clip(X, -4.0, 4.0))
    part = np.mean(np.abs(X) > 4.0)
    assert saturated.status.outliers > 0.9 * part * U.size
    slope = np.polyfit(U, saturated.model.simulate(U), 1)[0]
    assert slope == pytest.approx(np.polyfit(U, X, 1)[0], rel=0.03)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_a_coarse_converter_still_teaches(bits: int) -> None:
    code = 2.0 * np.max(np.abs(X)) / 2**bits
    estimator = pz.HysteresisRLS(FS)
    estimator.run(U, code * np.round(X / code))
    model = estimator.model
    assert isinstance(model, pz.ColemanHodgdon)
    apart = (model.simulate(U) - X)[-4000:]
    assert np.max(np.abs(apart)) < 0.005 + 0.5 * code


def test_stands_still_counts_travel_not_time() -> None:
    memory = Named(new(believing.BELIEF), believing.BELIEF)
    assert not believing.stands_still(memory, 0.0, 0.0, 60.0)
    assert not believing.stands_still(memory, 0.0, 0.1, 60.0)
    assert believing.believable(memory, 0.0, 0.15, 0.1, 100.0)
    assert not believing.stands_still(memory, 0.0, 0.1, 60.0)
    assert believing.stands_still(memory, 0.0, 0.3, 60.0)
    # A reading that moves again is a reading again.
    assert not believing.stands_still(memory, 1e-6, 10.0, 60.0)
    assert believing.believable(memory, 1e-6, 0.15, 0.1, 100.0)
    assert not believing.stands_still(memory, 0.0, 0.25, 60.0)
