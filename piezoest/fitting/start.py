"""Where a nonlinear fit starts: from what the user knows, or what linear fits show of the record."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.loop_columns import LoopColumns
from piezoest.fitting.problem import Problem
from piezoest.fitting.regression import Log
from piezoest.fitting.search import SMOOTH, best_alpha, regression
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
        log = Log(problem.u, problem.x, problem.measured, 1.0, np.empty(0))
        loop = regression(log, LoopColumns(best_alpha(log)))
        if loop.line_gain > 0.0:
            w = loop.solved(SMOOTH, loop.columns(drift=False))
            shown: Any = loop.design.model(w)
            starts.append(of(shown, {**others, "initial_state": float(w[2])}))
    elif given is None:
        shown = model.guess(problem.u, np.where(problem.measured, problem.x, np.nan))
        starts += [of(shown, others)] if shown else []
    return min(starts or [of(default, others)], key=problem.cost)
