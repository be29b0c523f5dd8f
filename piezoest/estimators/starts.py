"""Where an output-error fit starts: the linear least-squares fit of the derivative form."""

from __future__ import annotations

import numpy as np

from piezoest._checks import FloatArray
from piezoest.estimators.rls import HysteresisRLS
from piezoest.estimators.shooting import Problem
from piezoest.models import ColemanHodgdon, LinearGain

DEFAULT_MODEL = ColemanHodgdon(0.02, 0.12, 0.0036)


def best_start(
    problem: Problem,
    sample_rate: float,
    given: ColemanHodgdon | LinearGain | None,
    creep_gains: FloatArray,
    learn: bool,
) -> FloatArray:
    """Coordinates to start from: the better of the derivative form's fit and the given model.

    Parameters
    ----------
    problem : Problem
        Record and coordinates.
    sample_rate : float
        [Hz].
    given : ColemanHodgdon, LinearGain or None
        Model to start from; by default one of the record's size.
    creep_gains : ndarray
        Start of the creep terms' gains.
    learn : bool
        Whether to fit the derivative form, which is that of the Coleman-Hodgdon model.
    """
    first = guess(problem) if given is None else given
    models = [first]
    if learn:
        x = np.where(problem.weight > 0.0, problem.x, np.nan)
        rls = HysteresisRLS(sample_rate, initial_model=first, memory=None, offset=True, uncertainty=1.0)
        rls.run(problem.u, x, every=problem.u.size)
        learnt = rls.model
        assert isinstance(learnt, ColemanHodgdon)
        models.append(learnt)
    starts = [problem.settled(problem.coordinates.of(model, 0.0, creep_gains)) for model in models]
    return min(starts, key=problem.cost)


def guess(problem: Problem) -> ColemanHodgdon:
    """A model of the record's size: the line through it, bent within its range of voltage."""
    counts = problem.weight > 0.0
    u, x = problem.u[counts], problem.x[counts]
    extent, deviation = float(np.ptp(u)), u - u.mean()
    power = float(deviation @ deviation)
    gain = abs(float(deviation @ x)) / power if power > 0.0 else 0.0
    if gain <= 0.0:
        return DEFAULT_MODEL
    return ColemanHodgdon.from_loop(2.0 / extent, 0.4 * gain, 1.3 * gain, float(x.mean()))
