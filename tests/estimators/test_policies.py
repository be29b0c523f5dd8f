"""Policies that are off by default: each does what it says, refuses bad values, and is saved."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies as p
from tests.estimators.shared import TRUE, recorded

FS = 5000.0
BASE = (p.DeadZone(), p.OutlierRejection())


POLICIES: dict[str, tuple[Any, ...]] = {
    "directional": (p.DirectionalForgetting(0.2, "second"), p.ExcitationGate()),
    "variable": (p.VariableForgetting(), p.Projection(), p.ChangeDetection(), p.AmplitudeMemory()),
}


def made(*policies: Any, **options: Any) -> Any:
    return pz.HysteresisRLS(FS, policies=(*policies, *BASE), **options)


@pytest.mark.parametrize("name", POLICIES)
@pytest.mark.slow_but_first
def test_same_bits_by_step_run_and_from_a_file(name: str) -> None:
    u, x = recorded(FS, 6.0)
    u = np.concatenate([u, 0.5 * u, u])
    x = TRUE.simulate(u) + 1e-3 * np.random.default_rng(1).standard_normal(u.size)
    whole, steps, halves = (made(*POLICIES[name], delay=1.5) for _ in range(3))
    fresh = whole.to_dict()
    whole.run(u, x)
    for u_k, x_k in zip(u.tolist(), x.tolist(), strict=True):
        steps.step(u_k, x_k)
    halves.run(u[:7000], x[:7000])
    resumed = pz.HysteresisRLS.from_dict(json.loads(json.dumps(halves.to_dict(), allow_nan=False)))
    resumed.run(u[7000:], x[7000:])
    for other in (steps, resumed, whole.copy()):
        assert other.to_dict() == whole.to_dict()
    np.testing.assert_allclose(whole.theta[:3], TRUE.theta, rtol=0.15)
    assert np.linalg.eigvalsh(whole.P / np.sqrt(np.outer(np.diag(whole.P), np.diag(whole.P))))[0] > 0.0
    whole.reset()
    assert whole.to_dict() == fresh


@pytest.mark.parametrize("forgetting", [p.RandomWalk(), p.PeriodicForgetting(2.0)])
@pytest.mark.slow_but_first
def test_a_step_of_the_gain_is_detected_once(forgetting: Any) -> None:
    u, x = recorded(FS, 20.0)
    half = u.size // 2
    with_it, without = made(forgetting, p.ChangeDetection()), made(forgetting)
    with_it.run(u[:half], x[:half])
    assert with_it.status.resets == 0
    without.run(u[:half], x[:half])
    for estimator in (with_it, without):
        estimator.run(u[half : half + 1500], 0.8 * x[half : half + 1500])
    assert with_it.status.resets == 1
    expected = TRUE.theta * [1.0, 0.8, 0.8]
    errors = [np.abs(e.theta[:3] / expected - 1.0).max() for e in (with_it, without)]
    assert errors[0] < errors[1]


@pytest.mark.slow
def test_projection_keeps_theta_admissible() -> None:
    """A straight line has no admissible Coleman-Hodgdon model: the data pull theta out of the set."""
    u, x = recorded(FS, 4.0, model=pz.LinearGain(0.15))
    inside, free = made(p.RandomWalk(), p.Projection(0.02)), made(p.RandomWalk())
    theta = inside.run(u, x).theta
    free.run(u, x)
    assert free.status.projected
    assert not inside.status.projected
    area = theta[:, 0] * theta[:, 1]
    assert np.all(theta[:, 2] >= 1.02 * area * (1.0 - 1e-12))
    assert np.all(theta[:, 2] <= 1.98 * area * (1.0 + 1e-12))
    np.testing.assert_array_equal(inside.model.theta, inside.theta[:3])


@pytest.mark.slow
def test_amplitudes_are_remembered(tmp_path: Path) -> None:
    """Another loop at each amplitude: a long memory then starts from what was learnt there."""
    small, large = pz.ColemanHodgdon(0.024, 0.14, 0.0046), TRUE
    parts = [
        recorded(FS, 8.0, volts=volts, model=model)
        for volts, model in ((15.0, small), (45.0, large), (15.0, small))
    ]
    estimator = made(p.PeriodicForgetting(1.0), p.AmplitudeMemory())
    for part in parts[:2]:
        estimator.run(*part)
    profile = estimator.profile
    np.testing.assert_allclose(profile.swings, [30.0, 90.0], rtol=0.05)
    np.testing.assert_allclose(profile.at(30.0).theta, small.theta, rtol=0.25)
    np.testing.assert_allclose(profile.at(90.0).theta, large.theta, rtol=0.15)
    np.testing.assert_array_equal(
        np.median([*profile.theta, profile.at(60.0).theta], axis=0), profile.at(60.0).theta
    )
    path = tmp_path / "profile.json"
    profile.save(path)
    loaded = pz.AmplitudeProfile.load(path)
    np.testing.assert_array_equal(loaded.theta, profile.theta)
    fresh = made(p.PeriodicForgetting(1.0), p.AmplitudeMemory())
    fresh.profile = loaded
    np.testing.assert_allclose(fresh.profile.theta, profile.theta, rtol=1e-14)

    known, unknown = estimator, made(p.PeriodicForgetting(1.0))
    for part in parts[:2]:
        unknown.run(*part)
    resets = known.status.resets
    quarter = int(0.6 * FS / 5.0)
    errors = []
    for e in (known, unknown):
        e.run(parts[2][0][:quarter], parts[2][1][:quarter])
        errors.append(np.abs(e.theta[:3] / small.theta - 1.0).max())
    assert known.status.resets > resets
    assert errors[0] < errors[1]
