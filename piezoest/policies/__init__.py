"""Policies of recursive least squares: each a small named rule with its source."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, cast, get_args

from piezoest._checks import fields
from piezoest.policies.covariance import (
    ChangeDetection,
    CovarianceResetting,
    Normalisation,
    NormBound,
    Projection,
)
from piezoest.policies.forgetting import (
    DirectionalForgetting,
    Forgetting,
    PeriodicForgetting,
    RandomWalk,
    VariableForgetting,
)
from piezoest.policies.gates import DeadZone, ExcitationGate, OutlierRejection
from piezoest.policies.memories import AmplitudeMemory

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
    found = [one for one in found if not (isinstance(one, Forgetting) and math.isinf(one.memory))]
    if len(found) > 1:
        names = " and ".join(type(one).__name__ for one in found)
        raise ValueError(f"policies: {names} exclude each other: pass one way to forget")
    return found[0] if found else None


def policy_to_dict(policy: Policy) -> dict[str, Any]:
    """JSON-safe dictionary of a policy, its name under ``"policy"``."""
    return {"policy": type(policy).__name__, **dataclasses.asdict(policy)}


def policy_from_dict(data: Any) -> Policy:
    """Make the policy that `policy_to_dict` described.

    Raises
    ------
    ValueError
        If there is no policy of that name, a field is missing or unknown, or a value is refused.
    """
    kinds = {kind.__name__: kind for kind in get_args(Policy)}
    name = data.get("policy") if isinstance(data, dict) else data
    if not isinstance(name, str) or name not in kinds:
        raise ValueError(f"policy {name!r} is unknown: choose of {sorted(kinds)}")
    names = [field.name for field in dataclasses.fields(kinds[name])]
    values = {key: value for key, value in fields(name, data, ["policy", *names]).items() if key != "policy"}
    return cast(Policy, kinds[name](**values))
