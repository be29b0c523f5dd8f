"""The paper's procedure on the whole simulated experiment: the ring at 50 kHz, online, with noise."""

from __future__ import annotations

from typing import Any

import numpy as np

import piezoest as pz
from piezoest.bench.paper_experiment import PRBS, START, START_GAIN, STATIONARY_PERIODS, UPDATE_INTERVAL

SAMPLE_RATE = 50_000.0  # Hz, the paper's
# Long against the slowest reference's period of 0.4 s: the parameters hardly move within a period.
MEMORY = 1.0  # s
SETTLING = 8.0  # s


def triangle(amplitude: float, frequency: float) -> Any:
    """A row's reference, long enough for the ring to settle."""
    periods = round(SETTLING * frequency) + STATIONARY_PERIODS
    return pz.signals.triangle(amplitude, frequency, periods, SAMPLE_RATE)


def prbs() -> Any:
    """The reference of the held-out row."""
    return PRBS.signal(SETTLING + 2.0)


def numbers(stage: Any, r: Any) -> Any:
    """(alpha, beta, gamma, K, linear error, compensated error), all estimated while running."""
    gain, linear = _follow(stage, r, pz.LinearCompensator(START_GAIN), _estimator(START_GAIN))
    theta, compensated = _follow(stage, r, pz.InverseCompensator(START, hand_over="place"), _estimator(START))
    return np.array([*theta, gain[0], linear, compensated])


def with_parameters_of(stage: Any, r: Any, theta: Any) -> float:
    """Compensated error with parameters that were found elsewhere."""
    model = pz.ColemanHodgdon(*(float(value) for value in theta))
    return _follow(stage, r, pz.InverseCompensator(model, hand_over="place"), None)[1]


def _estimator(model: Any) -> Any:
    return pz.HysteresisRLS(SAMPLE_RATE, initial_model=model, memory=MEMORY)


def _follow(stage: Any, r: Any, compensator: Any, estimator: Any) -> tuple[Any, float]:
    stage.reset()
    record = pz.track(
        r, stage=stage, compensator=compensator, estimator=estimator, update_interval=UPDATE_INTERVAL
    )
    return record.theta[-record.period :].mean(axis=0), record.max_error(STATIONARY_PERIODS)
