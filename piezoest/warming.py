"""Compile and load all that a live loop will call, before it runs."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, instance
from piezoest.compensators import InverseCompensator, LinearCompensator
from piezoest.estimators.bank import EstimatorBank
from piezoest.estimators.base import EstimatorBase
from piezoest.estimators.ekf import HysteresisEKF
from piezoest.estimators.play_rls import PrandtlIshlinskiiRLS
from piezoest.estimators.recursive_least_squares import RecursiveLeastSquares
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import ColemanHodgdon, LinearGain, PrandtlIshlinskii
from piezoest.stage import PaperStage


def warmup(*used: Any) -> float:
    """Compile and load the kernels of estimators, compensators and stages.

    The first process after an installation compiles, which takes about a minute; every later one
    loads from the disk in a second. Call it before a live loop starts.

    Parameters
    ----------
    *used : estimator or EstimatorBank
        Those that the loop will use: what is compiled goes by their settings. They are left as they
        are. Estimators as they are by default are warmed up in any case.

    Returns
    -------
    float
        Seconds it took.

    Raises
    ------
    ValueError
        If one of them is neither.

    Examples
    --------
    >>> import piezoest as pz
    >>> seconds = pz.warmup(pz.HysteresisRLS(50_000.0, delay=1.0))
    """
    for learner in used:
        expected = "estimators of piezoest or an EstimatorBank: warm up one of your own by a step of it"
        instance("used", learner, EstimatorBase | EstimatorBank, expected)
    began = time.perf_counter()
    sample_rate = 50_000.0
    u = np.linspace(0.0, 1.0, 8)
    x = 0.15 * u
    for estimator in (HysteresisRLS(sample_rate), HysteresisEKF(sample_rate)):
        bank = EstimatorBank(estimator, 2)
        bank.step(u[:2], x[:2])
    loop = ColemanHodgdon(0.02, 0.12, 0.0036)
    plays = PrandtlIshlinskii(0.1, [1.0], [0.02])
    for learner in (
        HysteresisRLS(sample_rate),
        HysteresisEKF(sample_rate),
        PrandtlIshlinskiiRLS(sample_rate),
        *used,
    ):
        _use(learner, u, x)
    RecursiveLeastSquares(2).update(1.0, np.ones(2))
    for compensator in (
        LinearCompensator(LinearGain(0.15)),
        InverseCompensator(loop),
        InverseCompensator(plays),
    ):
        compensator.step(0.0)
        compensator.run(x)
        compensator.model = compensator.model
    stage = PaperStage(sample_rate)
    stage.step(0.0)
    stage.run(u)
    for model in (loop, plays):
        model.simulate(u)
    return time.perf_counter() - began


def _use(learner: Any, u: FloatArray, x: FloatArray) -> None:
    """Do with a copy what a loop may do."""
    if isinstance(learner, EstimatorBank):
        bank = EstimatorBank(learner.channel(0), 2)
        bank.step(u[:2], x[:2])
        bank.run(np.column_stack([u, u]), np.column_stack([x, x]))
        return
    copy = learner.copy()
    copy.step(0.0, 0.0)
    copy.run(u, x)
    _ = copy.model
