"""Cases of recursive least squares: every option, every policy."""

from functools import partial
from typing import Any

import piezoest as pz
from piezoest import policies as p
from tests.oracle.outcome import Cases, on
from tests.oracle.records import LINE, NAMES, RATE, SOME

ROUGH = (p.DeadZone(), p.OutlierRejection())
PAPER = (p.NormBound(), p.DeadZone(), p.Normalisation())
WALK = (p.RandomWalk(), *ROUGH)
OTHER = pz.ColemanHodgdon(0.03, 0.2, 0.009, offset=1.5)

# Options that get every scenario, and those that get some.
CORE: dict[str, dict[str, Any]] = {
    "default": {},
    "line": {"initial_model": LINE},
    "paper": {"memory": 0.4},
    "alone-none": {"policies": ()},
    "all-policies": {
        "policies": (
            p.VariableForgetting(), p.Projection(), p.ChangeDetection(), p.ExcitationGate(),
            p.AmplitudeMemory(), *ROUGH,
        ),
    },
}  # fmt: skip
OPTIONS: dict[str, dict[str, Any]] = {
    "memory-none": {"memory": None},
    "continuous": {"time_base": "continuous"},
    "continuous-line": {"time_base": "continuous", "initial_model": LINE},
    "continuous-bound": {
        "time_base": "continuous", "memory": 0.1, "policies": (p.NormBound(2.0), p.DeadZone(1e-3)),
    },
    "continuous-delay": {"time_base": "continuous", "delay": 1.6, "errors": False},
    "forgetting-resetting": {"memory": 0.1, "policies": (p.CovarianceResetting(0.01), p.OutlierRejection())},
    "forgetting-projection": {"memory": 0.3, "policies": (p.Projection(), p.ExcitationGate(1e-3))},
    "high-pass": {"high_pass": 0.5},
    "delay-fraction": {"delay": 2.4},
    "no-errors": {"errors": False},
    "bare": {"memory": 0.3, "policies": (), "errors": False},
    "other-start": {"initial_model": OTHER},
    "line-offset": {"initial_model": LINE, "offset": True},
    "line-gate": {
        "initial_model": LINE,
        "policies": (p.PeriodicForgetting(0.5), p.ExcitationGate(), p.ChangeDetection()),
    },
    "line-falling": {"initial_model": pz.LinearGain(-0.15)},
    "line-directional": {"initial_model": LINE, "offset": True, "policies": (p.DirectionalForgetting(0.5),)},
}  # fmt: skip
# Every policy for itself, twice, ...
ALONE: dict[str, tuple[Any, ...]] = {
    "random-walk": (p.RandomWalk(),),
    "periodic": (p.PeriodicForgetting(),),
    "directional": (p.DirectionalForgetting(),),
    "variable": (p.VariableForgetting(),),
    "norm-bound": (p.NormBound(),),
    "normalisation": (p.Normalisation(),),
    "resetting": (p.CovarianceResetting(1e-3),),
    "dead-zone": (p.DeadZone(),),
    "outliers": (p.OutlierRejection(),),
    "gate": (p.ExcitationGate(),),
    "detection": (p.ChangeDetection(),),
    "projection": (p.Projection(),),
    "amplitudes": (p.AmplitudeMemory(),),
}
# ... and together.
TOGETHER: dict[str, tuple[Any, ...]] = {
    "walk-projection": (*WALK, p.Projection()),
    "walk-resetting": (*WALK, p.CovarianceResetting(1e-3), p.NormBound(5.0)),
    "directional-projection": (p.DirectionalForgetting(0.5), p.Projection(0.05), p.NormBound()),
    "gate-amplitudes": (p.DirectionalForgetting(), p.ExcitationGate(1e-2), p.AmplitudeMemory(), *ROUGH),
}


def hysteresis_cases() -> Cases:
    """`HysteresisRLS`."""
    cases: Cases = {}
    for name, options in CORE.items():
        make = partial(pz.HysteresisRLS, RATE, **options)
        cases |= {f"rls/{name}/{scenario}": on(make, scenario) for scenario in NAMES}
    rest = OPTIONS | {f"alone-{name}": {"policies": policies} for name, policies in ALONE.items()}
    rest |= {f"together-{name}": {"policies": policies} for name, policies in TOGETHER.items()}
    for name, options in rest.items():
        make = partial(pz.HysteresisRLS, RATE, **options)
        cases |= {f"rls/{name}/{scenario}": on(make, scenario) for scenario in SOME}
    return cases


def cases() -> Cases:
    return hysteresis_cases()
