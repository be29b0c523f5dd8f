"""Every policy of adaptation in a combination that makes sense, to be put on the scenarios.

`HysteresisRLS` alone is `policies.RandomWalk`, `DeadZone` and `OutlierRejection`, and learns an offset;
so do the others here, that the policies make the difference and not the model.
"""

from __future__ import annotations

from dataclasses import dataclass

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


def _clocked(policies: str) -> str:
    return f"HysteresisRLS(policies=({policies}))"


def _seconds(memory: float | None, policies: str) -> str:
    return f"HysteresisRLS(memory={memory}, offset=True, policies=({policies}))"


COMBINATIONS: tuple[Combination, ...] = (
    Combination("RandomWalk", "the default", "HysteresisRLS"),
    Combination("no OutlierRejection", "else the default", _clocked("RandomWalk(), DeadZone()")),
    Combination("no DeadZone", "else the default", _clocked("RandomWalk(), OutlierRejection()")),
    Combination("Projection", "and the default", _clocked(f"RandomWalk(), {REST}, Projection()")),
    Combination("Forgetting", "0.4 s, nothing else", _seconds(0.4, "")),
    Combination("NormBound", "Forgetting of 0.4 s", _seconds(0.4, "NormBound(),")),
    Combination(
        "ExcitationGate", "Forgetting of 0.4 s, DeadZone", _seconds(0.4, "DeadZone(), ExcitationGate()")
    ),
    Combination(
        "Normalisation", "continuous time, 0.4 s",
        "HysteresisRLS(memory=0.4, offset=True, time_base='continuous')",
    ),
    Combination("PeriodicForgetting", "2 periods", _clocked(f"PeriodicForgetting(memory=2.0), {REST}")),
    Combination("DirectionalForgetting", "1 period", _clocked(f"DirectionalForgetting(), {REST}")),
    Combination("VariableForgetting", "1 to 0.1 periods", _clocked(f"VariableForgetting(), {REST}")),
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
