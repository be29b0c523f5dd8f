"""Where a nonlinear fit starts: from what the user knows, or what linear fits show of the record."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.problem import Problem
from piezoest.fitting.regression import Log
from piezoest.fitting.search import best_loop
from piezoest.models import FreeRunning


def best_start(
    problem: Problem,
    given: FreeRunning | None,
    default: FreeRunning,
    others: Mapping[str, float],
) -> FloatArray:
    """Coordinates to start from: the given model's, or those of a loop that misses less of the record.

    Without a given one a model of the record's size, or the default where the record shows none. Creep gains
    start from `others`, by name.
    """
    model, of = problem.coordinates.model, problem.coordinates.of
    starts = [] if given is None else [of(given, others)]
    if model.is_loop:
        found = best_loop(Log(problem.u, problem.x, problem.measured, 1.0, np.empty(0)))
        starts += [of(found[0], {**others, "initial_state": found[1]})] if found else []
    elif given is None:
        guess = model.guess(problem.u, np.where(problem.measured, problem.x, np.nan))
        starts += [of(guess, others)] if guess else []
    return min(starts or [of(default, others)], key=problem.cost)
