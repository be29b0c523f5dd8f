"""Readings that a stage cannot have made are left out."""

import numpy as np
import pytest

import piezoest as pz

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
