"""Policies of recursive least squares: each a small named rule with its source."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

import numpy as np

from piezoest._checks import fraction, integer, non_negative, positive

__all__ = [
    "AmplitudeMemory",
    "ChangeDetection",
    "CovarianceResetting",
    "DeadZone",
    "DirectionalForgetting",
    "ExcitationGate",
    "Forgetting",
    "NormBound",
    "Normalisation",
    "OutlierRejection",
    "PeriodicForgetting",
    "Projection",
    "RandomWalk",
    "VariableForgetting",
]

Unit = Literal["period", "second"]


def _check_memory(memory: float, unit: str) -> None:
    positive("memory", memory)
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

    Notes
    -----
    Source: the forgetting of (A4), on the reference's clock.
    """

    memory: float = 2.0

    def __post_init__(self) -> None:
        positive("memory", self.memory)


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
        If memory is not above zero, or the unit is another.
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
        If memory is not above zero, shortest not within (0, 1], or the unit is another.
    """

    memory: float = 1.0
    shortest: float = 0.1
    unit: Unit = "period"

    def __post_init__(self) -> None:
        _check_memory(self.memory, self.unit)
        positive("shortest", fraction("shortest", self.shortest))

    def least_factor(self, step: float) -> float:
        """Least weight that the past keeps over one step: exp(-step/(shortest memory)).

        Parameters
        ----------
        step : float
            Time between samples, in the unit of `memory`.
        """
        return float(np.exp(-step / (self.shortest * self.memory)))


@dataclass(frozen=True, slots=True)
class Projection:
    """Keep theta itself in the admissible set: after each update the nearest point in the metric of P.

    Without it theta goes where the data say, and only the model handed out is projected.

    P. Ioannou, J. Sun, Robust Adaptive Control (1996), sec. 4.4; G. Goodwin, K. Sin, Adaptive
    Filtering, Prediction and Control (1984), sec. 3.7; D. Simon, IET Control Theory Appl. 4 (2010)
    1303-1318.

    Parameters
    ----------
    margin : float
        Distance from the faces alpha beta < gamma <= 2 alpha beta, in parts of alpha beta.

    Raises
    ------
    ValueError
        If margin is not within (0, 0.4].
    """

    margin: float = 0.01

    def __post_init__(self) -> None:
        positive("margin", fraction("margin", self.margin, 0.0, 0.4))


@dataclass(frozen=True, slots=True)
class ChangeDetection:
    """Add the initial covariance to P when the innovation says that something changed.

    A cumulative sum over the travel of the voltage: of the innovation's energy in parts of its usual
    one, less 1 + drift. As long as nothing changes it gains nothing over a swing, whatever the loop
    does within it; after a detection the usual energy is learnt anew over two swings.

    E. Page, Biometrika 41 (1954) 100-115; F. Gustafsson, Adaptive Filtering and Change Detection
    (2000), sec. 2.6 and 5.1.

    Parameters
    ----------
    threshold : float
        Of the sum, in swings of the usual energy.
    drift : float
        Rise of the energy that is no change, in parts of the usual one.

    Raises
    ------
    ValueError
        If threshold is not above zero, or drift negative.
    """

    threshold: float = 2.0
    drift: float = 1.0

    def __post_init__(self) -> None:
        positive("threshold", self.threshold)
        non_negative("drift", self.drift)


@dataclass(frozen=True, slots=True)
class ExcitationGate:
    """Adapt only while every direction is excited: `HysteresisRLS.excitation` above a level.

    The condition (A8) of Eielsen et al. (2012) for convergence, over the last swing; Ioannou and Sun,
    Robust Adaptive Control (1996), sec. 4.3. Looked at once in 64 samples. While it is shut samples
    count as held, and P does not grow.

    Parameters
    ----------
    least : float
        Least excitation, of 0 to 1.

    Raises
    ------
    ValueError
        If least is not within (0, 1).
    """

    least: float = 1e-4

    def __post_init__(self) -> None:
        if not 0.0 < self.least < 1.0:
            raise ValueError(f"least must lie within (0, 1), got {self.least}")


@dataclass(frozen=True, slots=True)
class AmplitudeMemory:
    """Remember what was learnt at each swing of the voltage, and start from there on return.

    The last paragraph of sec. IV of Eielsen et al. (2012): parameters scheduled by amplitude. At the end
    of a swing like those before it the mean estimate over the swing is stored with its size; when
    the size changes and it, or one on either side of it, is known, theta goes to what was stored,
    interpolated. See `HysteresisRLS.profile` and `AmplitudeProfile`.

    Parameters
    ----------
    places : int
        Amplitudes that are remembered; a further one replaces the nearest.
    tolerance : float
        Sizes that differ by less, in parts, are the same amplitude.
    uncertainty : float
        Standard deviation of what was stored when it is taken up, in parts of the initial model.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    places: int = 8
    tolerance: float = 0.1
    uncertainty: float = 0.05

    def __post_init__(self) -> None:
        integer("places", self.places, 1)
        positive("tolerance", fraction("tolerance", self.tolerance, 0.0, 0.5))
        positive("uncertainty", self.uncertainty)


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
    Source: a rule of this library.
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

    Notes
    -----
    Source: P. A. Ioannou, J. Sun, Robust Adaptive Control, Prentice Hall 1996, ch. 8.
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
    | DirectionalForgetting
    | VariableForgetting
    | Projection
    | ChangeDetection
    | ExcitationGate
    | AmplitudeMemory
)

_FORGETTINGS = (Forgetting, RandomWalk, PeriodicForgetting, DirectionalForgetting, VariableForgetting)


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


def forgetting_of(policies: tuple[Policy, ...]) -> Policy | None:
    """Return the one policy that forgets, or None.

    Raises
    ------
    ValueError
        If there are two of them.
    """
    found = [one for kind in _FORGETTINGS if (one := select(policies, kind)) is not None]
    # `Forgetting` without end is none.
    found = [one for one in found if not (isinstance(one, Forgetting) and np.isinf(one.memory))]
    if len(found) > 1:
        names = " and ".join(type(one).__name__ for one in found)
        raise ValueError(f"policies: {names} exclude each other: pass one way to forget")
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
