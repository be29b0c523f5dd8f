"""Every policy of adaptation in a combination that makes sense, to be put on the scenarios.

One that no combination here is about is put beside the default. `HysteresisRLS` alone is
`policies.RandomWalk`, `DeadZone` and `OutlierRejection`, and learns an offset; so do the others here, that
the policies make the difference and not the model.
"""

from __future__ import annotations

from dataclasses import dataclass

from piezoest.policies.base import REGISTERED, Policy

REST = "DeadZone(), OutlierRejection()"  # what is in the default beside the forgetting


@dataclass(frozen=True, slots=True)
class Combination:
    """Policies by a name that fits beside a panel.

    Parameters
    ----------
    name : str
        The policy it is about.
    said : str
        What goes with it, or what it is without.
    estimator : str
        As `piezoest.bench.candidates.candidate` reads it.
    """

    name: str
    said: str
    estimator: str


def _by_period(policies: str) -> str:
    return f"HysteresisRLS(policies=({policies}))"


def _seconds(memory: float | None, policies: str) -> str:
    return f"HysteresisRLS(memory={memory}, offset=True, policies=({policies}))"


_CHOSEN = (
    Combination("RandomWalk", "the default", "HysteresisRLS"),
    Combination("no OutlierRejection", "else the default", _by_period("RandomWalk(), DeadZone()")),
    Combination("no DeadZone", "else the default", _by_period("RandomWalk(), OutlierRejection()")),
    Combination("Projection", "and the default", _by_period(f"RandomWalk(), {REST}, Projection()")),
    Combination("Forgetting", "0.4 s, nothing else", _seconds(0.4, "")),
    Combination("NormBound", "Forgetting of 0.4 s", _seconds(0.4, "NormBound(),")),
    Combination(
        "ExcitationGate", "Forgetting of 0.4 s, DeadZone", _seconds(0.4, "DeadZone(), ExcitationGate()")
    ),
    Combination(
        "Normalisation", "continuous time, 0.4 s",
        "HysteresisRLS(memory=0.4, offset=True, time_base='continuous')",
    ),
    Combination("PeriodicForgetting", "2 periods", _by_period(f"PeriodicForgetting(memory=2.0), {REST}")),
    Combination("DirectionalForgetting", "1 period", _by_period(f"DirectionalForgetting(), {REST}")),
    Combination("VariableForgetting", "1 to 0.1 periods", _by_period(f"VariableForgetting(), {REST}")),
    Combination("no forgetting", "DeadZone", _seconds(None, "DeadZone(),")),
    Combination(
        "CovarianceResetting", "no forgetting, DeadZone",
        _seconds(None, "DeadZone(), CovarianceResetting(floor=1e-5)"),
    ),
    Combination("long memory", "1 s, DeadZone", _seconds(1.0, "DeadZone(),")),
    Combination("ChangeDetection", "1 s, DeadZone", _seconds(1.0, "DeadZone(), ChangeDetection()")),
    Combination(
        "ChangeDetection", "1 s, DeadZone; more sensitive",
        _seconds(1.0, "DeadZone(), ChangeDetection(threshold=0.5, drift=0.2)"),
    ),
    Combination("AmplitudeMemory", "1 s, DeadZone", _seconds(1.0, "DeadZone(), AmplitudeMemory()")),
)  # fmt: skip


def _with_the_default(policy: type[Policy]) -> Combination:
    name, forgetting = policy.__name__, "" if policy.forgets else "RandomWalk(), "
    return Combination(name, "and the default", _by_period(f"{forgetting}{REST}, {name}()"))


_NAMED = " ".join(f"{one.name} {one.estimator}" for one in _CHOSEN)
COMBINATIONS: tuple[Combination, ...] = (
    *_CHOSEN,
    *(_with_the_default(policy) for policy in REGISTERED.values() if policy.__name__ not in _NAMED),
)
