"""How the past is forgotten; one policy of this kind at a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from piezoest._checks import fraction, moderate, positive

Unit = Literal["period", "second"]

# Least memory in periods, and least weight that the past keeps over a sample: nothing would be left below it.
SHORTEST, LEAST_WEIGHT = 1e-3, 1e-3


def _check_memory(memory: float, unit: str = "period") -> None:
    if moderate("memory", memory) < SHORTEST and unit == "period":
        raise ValueError(f"memory must be at least {SHORTEST:g} periods, got {memory:g}")
    if unit not in ("period", "second"):
        raise ValueError(f"unit must be 'period' or 'second', got {unit!r}")


@dataclass(frozen=True, slots=True)
class Forgetting:
    """Exponential forgetting: data of age t weigh exp(-t / memory) (A4).

    Parameters
    ----------
    memory : float
        Time constant in the estimator's unit of time (lambda = 1/memory); infinite: none.

    Raises
    ------
    ValueError
        If memory is not above zero.
    """

    memory: float = np.inf

    def __post_init__(self) -> None:
        if self.memory != np.inf:
            positive("memory", self.memory)

    def factor(self, step: float) -> float:
        """Weight that the past keeps over one step: exp(-step/memory), at least 0.001.

        Parameters
        ----------
        step : float
            Time between samples, in the unit of `memory`.
        """
        return max(float(np.exp(-step / self.memory)), LEAST_WEIGHT)


@dataclass(frozen=True, slots=True)
class RandomWalk:
    """Forgetting by parameters that walk: P grows by a constant, not by a factor.

    A direction without excitation is forgotten linearly and not exponentially, and each
    direction at the pace at which the data renew it. Everything is counted in travel of the
    voltage and not in time, for hysteresis knows no time: at rest nothing is forgotten, and one
    setting serves any amplitude, frequency and unit. A swing, from one turning point of the
    voltage to the next, is half a period.

    L. Ljung, System Identification, 2nd ed. (1999), sec. 11.2; L. Guo, L. Ljung, IEEE Trans.
    Autom. Control 40 (1995) 1353-1385.

    Parameters
    ----------
    memory : float
        Memory of the best excited direction, in periods.
    drift : float
        Random walk of each parameter over a period, in parts of its own value. It sets how fast the
        start is forgotten; once settled, only `memory` matters.

    Raises
    ------
    ValueError
        If memory is less than 0.001, or drift not above zero.
    """

    memory: float = 0.15
    drift: float = 0.4

    def __post_init__(self) -> None:
        _check_memory(self.memory)
        moderate("drift", self.drift)


@dataclass(frozen=True, slots=True)
class PeriodicForgetting:
    """Exponential forgetting with a memory in parts of the reference's own period.

    For a linear gain: over less than a period it would follow the shape of the loop.

    Parameters
    ----------
    memory : float
        Time constant in periods.

    Raises
    ------
    ValueError
        If memory is less than 0.001.

    Notes
    -----
    Source: the forgetting of (A4), on the reference's clock.
    """

    memory: float = 2.0

    def __post_init__(self) -> None:
        _check_memory(self.memory)


@dataclass(frozen=True, slots=True)
class DirectionalForgetting:
    """Forget only along the present regressor: what the data do not renew is kept.

    R. Kulhavy, Automatica 23 (1987) 589-600; L. Cao, H. Schwartz, Automatica 36 (2000) 1725-1731.
    See `piezoest.equations.least_squares.directional_update`.

    Parameters
    ----------
    memory : float
        Time constant along the regressor, in units of `unit`.
    unit : {"period", "second"}
        Of memory: the reference's own period, or seconds (the unit of `step` in
        `RecursiveLeastSquares`).

    Raises
    ------
    ValueError
        If memory is not above zero or less than 0.001 periods, or the unit is another.
    """

    memory: float = 1.0
    unit: Unit = "period"

    def __post_init__(self) -> None:
        _check_memory(self.memory, self.unit)


@dataclass(frozen=True, slots=True)
class VariableForgetting:
    """Exponential forgetting whose memory shortens as the innovation's energy rises.

    T. Fortescue, L. Kershenbaum, B. Ydstie, Automatica 17 (1981) 831-835. See
    `piezoest.equations.least_squares.variable_forgetting`. `HysteresisRLS` takes the innovation's
    usual variance over the memory for that of the noise: much of it is the model's own error.

    Parameters
    ----------
    memory : float
        Time constant while the innovation is as usual, in units of `unit`.
    shortest : float
        Least time constant, in parts of memory.
    unit : {"period", "second"}
        Of memory: the reference's own period, or seconds (the unit of `step` in
        `RecursiveLeastSquares`).

    Raises
    ------
    ValueError
        If memory is not above zero or less than 0.001 periods, shortest not within (0, 1], or the
        unit is another.
    """

    memory: float = 1.0
    shortest: float = 0.1
    unit: Unit = "period"

    def __post_init__(self) -> None:
        _check_memory(self.memory, self.unit)
        positive("shortest", fraction("shortest", self.shortest))

    def least_factor(self, step: float) -> float:
        """Least weight that the past keeps over one step: exp(-step/(shortest memory)), at least 0.001.

        Parameters
        ----------
        step : float
            Time between samples, in the unit of `memory`.
        """
        return max(float(np.exp(-step / (self.shortest * self.memory))), LEAST_WEIGHT)
