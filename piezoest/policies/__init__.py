"""Policies of recursive least squares: each a small named rule with its source, in a file of its own.

A policy is registered by the import of its file, here.
"""

import dataclasses
from typing import Any

from piezoest._checks import class_named, fields, instance
from piezoest.policies.amplitude_memory import AmplitudeMemory as AmplitudeMemory
from piezoest.policies.base import REGISTERED, Conditions
from piezoest.policies.base import Policy as Policy
from piezoest.policies.change_detection import ChangeDetection as ChangeDetection
from piezoest.policies.covariance_resetting import CovarianceResetting as CovarianceResetting
from piezoest.policies.dead_zone import DeadZone as DeadZone
from piezoest.policies.directional_forgetting import DirectionalForgetting as DirectionalForgetting
from piezoest.policies.excitation_gate import ExcitationGate as ExcitationGate
from piezoest.policies.forgetting import Forgetting as Forgetting
from piezoest.policies.norm_bound import NormBound as NormBound
from piezoest.policies.normalisation import Normalisation as Normalisation
from piezoest.policies.outlier_rejection import OutlierRejection as OutlierRejection
from piezoest.policies.periodic_forgetting import PeriodicForgetting as PeriodicForgetting
from piezoest.policies.projection import Projection as Projection
from piezoest.policies.random_walk import RandomWalk as RandomWalk
from piezoest.policies.variable_forgetting import VariableForgetting as VariableForgetting

__all__ = sorted(policy.__name__ for policy in REGISTERED.values())


def default_policies(memory: Any, has_loop: bool) -> tuple[Policy, ...]:
    """Policies that go with a memory: the paper's with a dead zone, or those counted in swings."""
    if memory != "period":
        return NormBound(), DeadZone(), Normalisation()
    return (RandomWalk(), DeadZone(), OutlierRejection()) if has_loop else (PeriodicForgetting(), DeadZone())


def check_policies(policies: tuple[Policy, ...], at: Conditions) -> tuple[Policy, ...]:
    """Return policies, if there is one of each, and one way to forget, and all go with their conditions."""
    for policy in instance("policies", policies, tuple | list, "a tuple of policies"):
        if not isinstance(policy, Policy):
            raise ValueError(f"policies must hold policies such as policies.DeadZone(), got {policy!r}")
        same = [other for other in policies if type(other) is type(policy)]
        if len(same) > 1:
            raise ValueError(f"policies holds {len(same)} of {type(policy).__name__}: pass one")
        policy.check(at)
    # `Forgetting` without end is none.
    forgetting = [each for each in policies if each.forgets and each != Forgetting()]
    if len(forgetting) > 1:
        names = " and ".join(type(each).__name__ for each in forgetting)
        raise ValueError(f"policies: {names} exclude each other: pass one way to forget")
    return tuple(policies)


def policy_to_dict(policy: Policy) -> dict[str, Any]:
    """JSON-safe dictionary of a policy, its name under ``"policy"``."""
    values = dataclasses.asdict(policy)  # type: ignore[call-overload]
    plain = {name: value.item() if hasattr(value, "item") else value for name, value in values.items()}
    return {"policy": type(policy).__name__, **plain}


def policy_from_dict(data: Any) -> Policy:
    """Make the policy that `policy_to_dict` described."""
    cls = class_named(data, "policy", REGISTERED.values())
    names = [field.name for field in dataclasses.fields(cls)]
    values = dict(fields(cls.__name__, data, ["policy", *names]))
    del values["policy"]
    return cls(**values)
