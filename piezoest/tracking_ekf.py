"""The compiled ring of `piezoest.track` with a `HysteresisEKF`: by itself, for it takes time to compile."""

from __future__ import annotations

from typing import Any

from numba import njit
from numba.extending import register_jitable

from piezoest.estimators import ekf_kernel
from piezoest.tracking_kernel import SIGNATURE, ring


@register_jitable
def _learn(estimator: Any, settings: Any, u: Any, x: Any, scale: Any, none: Any, no_rows: Any) -> None:
    ekf_kernel.run(estimator, settings, u, x, u.size + 1, no_rows, no_rows, none, none, no_rows)


@njit(SIGNATURE, cache=True)
def run(
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
    """Run the ring, see `piezoest.tracking_kernel.ring`."""
    return ring(
        _learn, ekf_kernel.propose, interval, hysteretic, estimator, estimator_settings, scale, terms,
        compensator, settings, plays, creep_terms, stage, stage_settings, noise, factor, shape,
        r, model, record, models, none, no_rows,
    )  # fmt: skip
