"""Loops wired by hand, a model handed over at every sample: what drove the voltage to a limit for good."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench.zoo import draw

FS = 10_000.0
START = pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
LIMITS = pz.VoltageLimits(-50.0, 100.0)


def driven(
    r: Any, stage: Any, estimator: Any, compensator: Any, first_reading: float = 0.0
) -> tuple[Any, Any]:
    """Errors and voltages of the documentation's loop; the first reading is wrong by so much."""
    errors, voltages, x, wrong = np.empty(r.size), np.empty(r.size), None, first_reading
    feeds_back = isinstance(compensator, pz.IntegralFeedback)
    for k, r_k in enumerate(np.asarray(r).tolist()):
        u = compensator.step(r_k, x) if feeds_back else compensator.step(r_k)
        x = stage.step(u) + wrong
        wrong = 0.0
        estimator.step(u, x)
        compensator.model = estimator.model
        errors[k], voltages[k] = r_k - np.ravel(stage.displacement)[0], u
    return errors, voltages


def missed_by_a_line(r: Any, last: int) -> float:
    """Least largest error over the last samples of any straight line, its centre known beforehand."""
    found = []
    for gain in np.linspace(0.11, 0.17, 13):
        stage = pz.PaperStage(FS, seed=0)
        stage.run(np.asarray(r) / gain)
        found.append(np.ptp((r - stage.displacement)[-last:]) / 2)
    return float(min(found))


def at_a_limit(u: Any, limits: Any) -> float:
    return float(np.mean((u <= limits.minimum) | (u >= limits.maximum)))


def dwell(seconds: float) -> Any:
    """A setpoint at rest, with 0.1 nm of noise."""
    return 1e-4 * np.random.default_rng(5).standard_normal(round(seconds * FS))


@pytest.mark.parametrize("make", [pz.HysteresisRLS, pz.OutputErrorRLS])
@pytest.mark.parametrize("feedback", [0.0, 50.0])
def test_a_setpoint_that_rests_with_noise_before_it_moves(make: Any, feedback: float) -> None:
    moving = np.asarray(pz.signals.triangle(5.0, 5.0, 8, FS))
    r = np.concatenate([dwell(1.0), moving])
    compensator: Any = pz.InverseCompensator(START, LIMITS)
    if feedback > 0.0:
        compensator = pz.IntegralFeedback(compensator, gain=feedback, sample_rate=FS)
    last = round(2 * FS / 5.0)
    errors, u = driven(r, pz.PaperStage(FS, seed=0), make(FS, initial_model=START), compensator)
    assert np.abs(errors[-last:]).max() < 1.5 * missed_by_a_line(moving, last)
    assert np.abs(u).max() < LIMITS.maximum


def test_noise_at_rest_is_no_travel() -> None:
    compensator = pz.InverseCompensator(pz.LinearGain(0.1), LIMITS)
    compensator.model = pz.LinearGain(0.11)
    compensator.run(dwell(1.0))
    compensator.model = pz.LinearGain(0.12)
    compensator.run(dwell(10.0))
    assert compensator.model == pz.LinearGain(0.11)
    assert compensator.state["corridor"]["legs"] == 0.0


@pytest.mark.parametrize("make", [pz.HysteresisRLS, pz.OutputErrorRLS])
@pytest.mark.parametrize("seed", [6, 50, 69, 92])
def test_a_wrong_first_reading_does_not_leave_the_voltage_at_a_limit(make: Any, seed: int) -> None:
    """Stages of every family of the zoo, a start that is off by up to 60 %."""
    rng = np.random.default_rng([seed, 99])
    kind = str(rng.choice(["triangle", "sine", "raster", "walk"]))
    rig = draw(seed, fault="none", mechanics="none", delay=0, reference=kind)
    off = float(np.exp(rng.uniform(np.log(0.6), np.log(1.6))))
    wrong = rig.plain.amplitude * rng.uniform(0.3, 1.5) * float(rng.choice([-1.0, 1.0]))
    gain = off * rig.gain
    start = pz.ColemanHodgdon.from_loop(1.5 / rig.reach.half, 0.2 * gain, gain)
    estimator = make(rig.sample_rate, initial_model=start)
    compensator = pz.InverseCompensator(start, rig.limits)
    _, u = driven(rig.reference, rig.stage(), estimator, compensator, wrong)
    last = min(2 * rig.plain.cycle, u.size // 3)
    assert at_a_limit(u[-last:], rig.limits) < 0.75
