"""Policies of recursive least squares: each a small named rule with its source."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, cast, get_args

import numpy as np

from piezoest._checks import fraction, integer, non_negative, positive

__all__ = [
    "CovarianceResetting",
    "DeadZone",
    "Forgetting",
    "NormBound",
    "Normalisation",
    "OutlierRejection",
    "PeriodicForgetting",
    "RandomWalk",
]


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
        if not self.memory > 0.0:
            raise ValueError(f"memory must be above zero (infinite for no forgetting), got {self.memory}")

    def factor(self, step: float) -> float:
        """Weight that the past keeps over one step: exp(-step/memory).

        Parameters
        ----------
        step : float
            Time between samples, in the unit of `memory`.
        """
        return float(np.exp(-step / self.memory))


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
        If a value is not above zero.
    """

    memory: float = 0.15
    drift: float = 0.4

    def __post_init__(self) -> None:
        positive("memory", self.memory)
        positive("drift", self.drift)


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
        If memory is not above zero.
    """

    memory: float = 2.0

    def __post_init__(self) -> None:
        positive("memory", self.memory)


@dataclass(frozen=True, slots=True)
class OutlierRejection:
    """Leave out measurements that the stage cannot have made: spikes, and jumps of the sensor.

    Parameters
    ----------
    warm_up : int
        Samples from which the usual change between two samples is taken.

    Raises
    ------
    ValueError
        If warm_up is not a whole number above zero.

    Notes
    -----
    A change is believed up to 20 times the usual one plus three times what the present slope
    explains. Where x stays at its new level, it is taken for the new one after 2 ms.
    """

    warm_up: int = 100

    def __post_init__(self) -> None:
        integer("warm_up", self.warm_up, 1)


@dataclass(frozen=True, slots=True)
class NormBound:
    """Bound R0 on the trace of the covariance (A6): P is not updated where that would pass it.

    To the letter (A6) freezes P for as long as ||P|| > R0, which is for good once it
    happened; here only an update that would pass the bound is left out.

    Parameters
    ----------
    limit : float
        R0, as a multiple of the trace of the initial covariance.

    Raises
    ------
    ValueError
        If limit is below 1: the initial covariance itself must satisfy the bound.
    """

    limit: float = 100.0

    def __post_init__(self) -> None:
        if not self.limit >= 1.0:
            raise ValueError(
                f"limit must be at least 1, got {self.limit}: the initial covariance must satisfy the bound"
            )


@dataclass(frozen=True, slots=True)
class Normalisation:
    """Normalisation m² = 1 + phi' P phi of the continuous law (A7); without it m² = 1.

    The discrete law has it by construction: its gain P phi/(R + phi' P phi) is the
    normalised one.
    """


@dataclass(frozen=True, slots=True)
class CovarianceResetting:
    """Put P back to its start when it became too small to adapt: lambda_min(P) <= floor.

    Ioannou and Sun, Robust Adaptive Control, sec. 4.3.6.

    Parameters
    ----------
    floor : float
        rho_1, as a multiple of the smallest eigenvalue of the initial covariance.

    Raises
    ------
    ValueError
        If floor is not within [0, 1).
    """

    floor: float

    def __post_init__(self) -> None:
        if fraction("floor", self.floor) == 1.0:
            raise ValueError("floor must be below 1: at 1 the initial covariance itself would be reset")


@dataclass(frozen=True, slots=True)
class DeadZone:
    """Leave the estimate and its covariance alone where the regressor says nothing.

    Without it a dwell lets forgetting grow P on no information (wind-up).

    Parameters
    ----------
    threshold : float
        Least phi' P0 phi, in units of the noise variance, that counts as information.

    Raises
    ------
    ValueError
        If threshold is negative.
    """

    threshold: float = 1e-9

    def __post_init__(self) -> None:
        non_negative("threshold", self.threshold)


Policy = (
    Forgetting
    | RandomWalk
    | PeriodicForgetting
    | NormBound
    | Normalisation
    | CovarianceResetting
    | DeadZone
    | OutlierRejection
)


def select(policies: tuple[Policy, ...], kind: type[Policy]) -> Policy | None:
    """Return the one policy of a kind, or None.

    Raises
    ------
    ValueError
        If there are two of the kind, or something that is no policy.
    """
    if not isinstance(policies, tuple | list):
        raise ValueError(f"policies must be a tuple of policies, got {policies!r}")
    for policy in policies:
        if not isinstance(policy, Policy):
            raise ValueError(f"policies must be made of policies, got {policy!r}: see piezoest.policies")
    found = [policy for policy in policies if isinstance(policy, kind)]
    if len(found) > 1:
        raise ValueError(f"policies holds {len(found)} of {kind.__name__}: pass one")
    return found[0] if found else None


def policy_to_dict(policy: Policy) -> dict[str, Any]:
    """JSON-safe dictionary of a policy, its name under ``"policy"``."""
    return {"policy": type(policy).__name__, **dataclasses.asdict(policy)}


def policy_from_dict(data: dict[str, Any]) -> Policy:
    """Make the policy that `policy_to_dict` described.

    Raises
    ------
    ValueError
        If there is no policy of that name.
    """
    kinds = {kind.__name__: kind for kind in get_args(Policy)}
    fields = {key: value for key, value in data.items() if key != "policy"}
    if data.get("policy") not in kinds:
        raise ValueError(f"policy {data.get('policy')!r} is unknown: choose of {sorted(kinds)}")
    return cast(Policy, kinds[data["policy"]](**fields))
