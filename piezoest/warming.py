"""Compile and load everything that a live loop will call, before it runs."""

import time
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, instance
from piezoest.compensators import Compensator, InverseCompensator, LinearCompensator, VoltageLimits
from piezoest.controller.adaptive_feedforward import AdaptiveFeedforward
from piezoest.estimators.bank import EstimatorBank
from piezoest.estimators.base import EstimatorBase
from piezoest.estimators.ekf import HysteresisEKF
from piezoest.estimators.play_rls import PrandtlIshlinskiiRLS
from piezoest.estimators.recursive_least_squares import RecursiveLeastSquares
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import ColemanHodgdon, LinearGain, PrandtlIshlinskii
from piezoest.stage import PaperStage


def warmup(*used: Any) -> float:
    """Compile and load the machine code that a live loop will call.

    Call it before the loop starts, or once after the installation. The first call after an installation
    compiles. This takes about a minute, and up to another minute for a controller. Later calls load the
    compiled code from the disk, in about a second.

    Parameters
    ----------
    *used : estimator, compensator, EstimatorBank, AdaptiveFeedforward or the class AdaptiveFeedforward
        The objects that the loop will use. Their state is not changed. The class `AdaptiveFeedforward`
        stands for a controller with default settings, at any sample rate and with any limits. Estimators
        and compensators with default settings are always compiled; a controller only if it is given.

    Returns
    -------
    float
        Seconds it took.

    Raises
    ------
    ValueError
        If one of them is none of these.

    Examples
    --------
    >>> import piezoest as pz
    >>> seconds = pz.warmup(pz.HysteresisRLS(50_000.0, delay=1.0))
    >>> seconds = pz.warmup(pz.AdaptiveFeedforward)  # the next one is there at once
    """
    expected = (
        "estimators of piezoest, compensators, an EstimatorBank or a controller: call step once to compile "
        "one of your own"
    )
    for each in used:
        if each is not AdaptiveFeedforward:
            instance(
                "used", each, EstimatorBase | EstimatorBank | Compensator | AdaptiveFeedforward, expected
            )
    began = time.perf_counter()
    sample_rate = 50_000.0
    u = np.linspace(0.0, 1.0, 8)
    loop, plays = ColemanHodgdon(0.02, 0.12, 0.0036), PrandtlIshlinskii(0.1, [1.0], [0.02])
    rls, ekf = HysteresisRLS(sample_rate), HysteresisEKF(sample_rate)
    learners = (rls, ekf, PrandtlIshlinskiiRLS(sample_rate))
    inverses = (InverseCompensator(loop), InverseCompensator(plays), LinearCompensator(LinearGain(0.15)))
    banks = (EstimatorBank(rls, 2), EstimatorBank(ekf, 2))
    for each in (*learners, *inverses, *banks, *used):
        _use(each, u, 0.15 * u)
    RecursiveLeastSquares(2).update(1.0, np.ones(2))
    stage = PaperStage(sample_rate)
    stage.step(0.0)
    stage.run(u)
    for model in (loop, plays):
        model.simulate(u)
    return time.perf_counter() - began


def _use(used: Any, u: FloatArray, x: FloatArray) -> None:
    """Do with a copy what a loop may do."""
    if isinstance(used, EstimatorBank):
        bank = EstimatorBank(used.channel(0), 2)
        bank.step(u[:2], x[:2])
        bank.run(np.column_stack([u, u]), np.column_stack([x, x]))
        return
    # What is compiled goes neither by sample rate nor by limits.
    copy = used(50_000.0, limits=VoltageLimits(0.0, 100.0)) if used is AdaptiveFeedforward else used.copy()
    if isinstance(copy, AdaptiveFeedforward):
        copy.learn(copy.step(0.0), 0.0)
        copy.learn(copy.run(x), x)
    elif isinstance(copy, Compensator):
        copy.step(0.0)
        copy.run(x)
        copy.model = copy.model
    else:
        copy.step(0.0, 0.0)
        copy.run(u, x)
        _ = copy.model
