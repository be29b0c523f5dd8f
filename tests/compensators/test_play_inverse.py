"""Inverse of Prandtl-Ishlinskii models in the compensator: exact, limited, bumpless."""

import numpy as np
import pytest

import piezoest as pz

RATE = 1000.0
MODEL = pz.PrandtlIshlinskii(
    0.1, [1.0, 3.0, 9.0], [0.01, 0.02, 0.01], 0.3,
    creep=pz.Creep([0.04, 0.03], [0.01, 0.5]),
    bends=[-8.0, 5.0], bend_weights=[[0.01, 0.0, 0.01, 0.0], [0.0, 0.005, -0.01, 0.0]], sample_rate=RATE,
)  # fmt: skip
OTHER = pz.PrandtlIshlinskii(0.11, [0.5, 2.0], [0.02, 0.03])


def reference(n: int = 3000) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.asarray(0.05 * np.cumsum(np.random.default_rng(0).standard_normal(n)))


def test_follows_its_own_model_step_by_step_and_at_once() -> None:
    r = reference()
    ran, stepped = pz.InverseCompensator(MODEL), pz.InverseCompensator(MODEL)
    u = ran.run(r)
    np.testing.assert_array_equal(u, [stepped.step(value) for value in r.tolist()])
    np.testing.assert_allclose(u, MODEL.invert(r), atol=1e-12)
    np.testing.assert_allclose(MODEL.simulate(u), r, atol=1e-12)
    ran.reset()
    np.testing.assert_array_equal(ran.run(r), u)


def test_limits_and_gaps_leave_the_model_where_the_voltage_is() -> None:
    r = 4.0 * np.sin(np.arange(3000) / 100.0)
    r[500:520] = np.nan
    limits = pz.VoltageLimits(-12.0, 20.0, slew_rate=300.0, sample_rate=RATE)
    compensator = pz.InverseCompensator(MODEL, limits)
    u = compensator.run(r)
    assert u.min() >= -12.0
    assert u.max() <= 20.0
    assert np.abs(np.diff(u)).max() <= 0.3 + 1e-12
    assert np.ptp(u[499:520]) == 0.0
    assert compensator.status.missing == 20
    x = MODEL.simulate(u)
    free = (np.abs(u - 20.0) > 1e-9) & (np.abs(u + 12.0) > 1e-9)
    free[1:] &= np.abs(np.diff(u)) < 0.3 - 1e-9
    free[[0, *range(500, 520)]] = False
    np.testing.assert_allclose(x[free], r[free], atol=1e-9)


@pytest.mark.parametrize(
    "models", [(MODEL, OTHER), (pz.ColemanHodgdon(0.02, 0.12, 0.0036), MODEL), (OTHER, pz.LinearGain(0.15))]
)
def test_change_of_model_is_bumpless(models: tuple[pz.models.Model, pz.models.Model]) -> None:
    r = 3.0 * np.sin(np.arange(2000) / 200.0)
    compensator = pz.InverseCompensator(models[0], sample_rate=RATE, transfer_samples=100)
    first = compensator.run(r[:1000])
    compensator.model = models[1]
    u = np.concatenate([first, compensator.run(r[1000:])])
    assert abs(u[1000] - u[999]) < 2.0 * np.abs(np.diff(first)).max()
    # Plays were set from the voltage's turning points: what was owed is paid back, and then it fits.
    if models[1] is OTHER:
        np.testing.assert_allclose(OTHER.simulate(u)[-100:], r[-100:], atol=1e-3)
