"""The ring of `piezoest.track` as one compiled loop, for parts that are compiled themselves.

It calls the parts' own loops; only what Python does between them is done here: cut the record
into intervals, and hand the estimator's model over.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from piezoest._checks import FloatArray
from piezoest._jit import PROPOSE_TYPES, RUN_TYPES, taking
from piezoest.compensators import Compensator, InverseCompensator, LinearCompensator
from piezoest.compensators import base as compensators
from piezoest.compensators.adoption import adopt
from piezoest.equations import admissible
from piezoest.estimators.base import NO_ROWS, NONE, EstimatorBase
from piezoest.models import ColemanHodgdon, LinearGain
from piezoest.stage import SimulatedStage
from piezoest.stage import kernel as stages

_SIGNATURE = (
    "b1(i8, b1, f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], i8, i8, f8[::1], f8[::1], f8[::1],"
    " f8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])"
)


@njit(taking((RUN_TYPES, PROPOSE_TYPES), _SIGNATURE), cache=True)
def ring(
    learn: Any,
    propose: Any,
    interval: int,
    hysteretic: bool,
    estimator: Any,
    estimator_settings: Any,
    scale: Any,
    terms: Any,
    compensator: Any,
    settings: Any,
    plays: int,
    creep_terms: int,
    stage: Any,
    stage_settings: Any,
    noise: Any,
    factor: Any,
    shape: Any,
    r: Any,
    model: Any,
    record: Any,
    models: Any,
    none: Any,
    no_rows: Any,
) -> bool:
    """Run the ring; rows of `record` are u, x and the true x, of `models` the model in use in each interval.

    `learn` and `propose` are the estimator's. Returns whether the last model was not taken as proposed.
    """
    projected = False
    u, x, true = record[0], record[1], record[2]
    proposed = np.zeros(4)
    for start in range(0, r.size, interval):
        stop = min(start + interval, r.size)
        for i in range(4):
            models[start // interval, i] = model[i]
            proposed[i] = 0.0
        compensators._run(compensator, settings, r[start:stop], u[start:stop])
        for k in range(start, stop):
            true[k] = u[k]
        stages.run(
            stage,
            stage_settings,
            plays,
            creep_terms,
            true[start:stop],
            noise[start:stop] if noise.size > 1 else noise,
            factor[start:stop] if factor.size > 1 else factor,
            shape[start:stop] if shape.size > 1 else shape,
            x[start:stop],
        )
        learn(
            estimator, estimator_settings, u[start:stop], x[start:stop], stop - start + 1, scale,
            no_rows, no_rows, none, none, no_rows,
        )  # fmt: skip
        propose(estimator, estimator_settings, terms, proposed)
        projected = hysteretic and not admissible.has_inverse(proposed[0], proposed[1], proposed[2])
        if adopt(compensator, settings, proposed, hysteretic, compensators.change_model):
            for i in range(4):
                model[i] = proposed[i]
        else:
            projected = True
    return projected


def can_run(stage: Any, compensator: Any, estimator: Any) -> bool:
    """Whether the compiled ring does what a loop over these three would."""
    return (
        isinstance(stage, SimulatedStage)
        and type(stage).run is SimulatedStage.run
        and type(compensator) in (InverseCompensator, LinearCompensator)
        and isinstance(estimator, EstimatorBase)
        and "_loops" in vars(type(estimator))  # of this very class: what inherits may learn otherwise
        and type(compensator.model) in (ColemanHodgdon, LinearGain)
        and type(getattr(estimator, "_initial", None)) is type(compensator.model)
    )


def run(
    r: FloatArray, interval: int, stage: SimulatedStage, compensator: Compensator, estimator: Any
) -> tuple[FloatArray, FloatArray]:
    """Rows of voltage, measured and true displacement, shape (3, N), and each interval's parameters."""
    first: Any = compensator.model
    kind, n = type(first), len(first.parameter_names)
    model = np.zeros(4)
    model[:n], model[3] = first.theta, first.offset
    record, models = np.empty((3, r.size)), np.empty((-(-r.size // interval), 4))
    estimator._records(NONE, NONE)
    noise, factor, shape = stage._disturbances(r.size)
    projected = ring(
        *estimator._loops(), interval, kind is ColemanHodgdon,
        estimator._state, estimator._config, getattr(estimator, "_scale", NONE), estimator._terms,
        compensator._state, compensator._config,
        stage._plays, stage._terms, stage._state, stage._settings, noise, factor, shape,
        r, model, record, models, NONE, NO_ROWS,
    )  # fmt: skip
    compensator._handed_over(kind(*model[:n].tolist(), float(model[3])), projected)
    stage._displacement = record[2, (r.size - 1) // interval * interval :].copy()
    return record, models[:, :n]
