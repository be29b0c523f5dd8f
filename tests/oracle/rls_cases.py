"""Cases of recursive least squares: every option, every policy."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import piezoest as pz
from piezoest import policies as p
from tests.oracle.outcome import Cases, Outcome, end, flat, model_numbers, on
from tests.oracle.records import LINE, NAMES, RATE, SCENARIOS, START, TRUE, some

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
    "memory-short": {"memory": 0.05},
    "continuous": {"time_base": "continuous"},
    "continuous-memory": {"time_base": "continuous", "memory": 0.1, "offset": True},
    "continuous-line": {"time_base": "continuous", "initial_model": LINE},
    "continuous-bound": {
        "time_base": "continuous", "memory": 0.1, "policies": (p.NormBound(2.0), p.DeadZone(1e-3)),
    },
    "continuous-resetting": {
        "time_base": "continuous", "policies": (p.CovarianceResetting(0.1), p.Normalisation()),
    },
    "continuous-normalised": {"time_base": "continuous", "policies": (p.Normalisation(),)},
    "continuous-plain": {"time_base": "continuous", "policies": ()},
    "continuous-delay": {"time_base": "continuous", "delay": 1.6, "errors": False},
    "forgetting-only": {"memory": 0.3, "policies": ()},
    "forgetting-bound": {"memory": 0.05, "policies": (p.NormBound(3.0), p.DeadZone())},
    "forgetting-resetting": {"memory": 0.1, "policies": (p.CovarianceResetting(0.01), p.OutlierRejection())},
    "forgetting-detection": {"memory": 0.5, "policies": (p.ChangeDetection(), p.DeadZone())},
    "forgetting-projection": {"memory": 0.3, "policies": (p.Projection(), p.ExcitationGate(1e-3))},
    "forgetting-amplitudes": {"memory": 0.2, "policies": (p.AmplitudeMemory(), p.Normalisation())},
    "uncertainty": {"uncertainty": 0.1},
    "noise": {"noise": 0.02},
    "cutoff": {"cutoff": 100.0},
    "high-pass": {"high_pass": 0.5},
    "high-pass-paper": {"high_pass": 1.0, "memory": 0.3, "offset": False},
    "no-offset": {"offset": False},
    "paper-offset": {"memory": 0.3, "offset": True},
    "delay": {"delay": 1.0},
    "delay-fraction": {"delay": 2.4},
    "delay-long": {"delay": 57.5, "memory": 0.3},
    "no-errors": {"errors": False},
    "no-errors-delay": {"errors": False, "delay": 2.4, "memory": 0.3},
    "bare": {"memory": 0.3, "policies": (), "errors": False},
    "bare-offset": {"memory": None, "policies": (), "errors": False, "offset": True},
    "other-start": {"initial_model": OTHER},
    "line-offset": {"initial_model": LINE, "offset": True},
    "line-paper": {"initial_model": LINE, "memory": 0.2, "delay": 1.5},
    "line-bare": {"initial_model": LINE, "memory": 0.2, "policies": (), "errors": False},
    "line-walk": {"initial_model": LINE, "policies": (p.RandomWalk(), p.DeadZone())},
    "line-gate": {
        "initial_model": LINE,
        "policies": (p.PeriodicForgetting(0.5), p.ExcitationGate(), p.ChangeDetection()),
    },
    "line-falling": {"initial_model": pz.LinearGain(-0.15)},
    "line-variable": {"initial_model": LINE, "policies": (p.VariableForgetting(0.5),)},
    "line-directional": {"initial_model": LINE, "offset": True, "policies": (p.DirectionalForgetting(0.5),)},
    "line-high-pass": {"initial_model": pz.LinearGain(0.3, 2.0), "high_pass": 0.5, "cutoff": 50.0},
}  # fmt: skip
# Every policy for itself, twice, ...
ALONE: dict[str, tuple[Any, ...]] = {
    "random-walk": (p.RandomWalk(),),
    "random-walk-long": (p.RandomWalk(0.6, 0.1),),
    "periodic": (p.PeriodicForgetting(),),
    "periodic-short": (p.PeriodicForgetting(0.3),),
    "directional": (p.DirectionalForgetting(),),
    "directional-seconds": (p.DirectionalForgetting(0.1, "second"),),
    "variable": (p.VariableForgetting(),),
    "variable-seconds": (p.VariableForgetting(0.2, 0.3, "second"),),
    "norm-bound": (p.NormBound(),),
    "normalisation": (p.Normalisation(),),
    "resetting": (p.CovarianceResetting(1e-3),),
    "resetting-often": (p.CovarianceResetting(0.3),),
    "dead-zone": (p.DeadZone(),),
    "dead-zone-wide": (p.DeadZone(1.0),),
    "outliers": (p.OutlierRejection(),),
    "outliers-soon": (p.OutlierRejection(20),),
    "gate": (p.ExcitationGate(),),
    "gate-high": (p.ExcitationGate(0.05),),
    "detection": (p.ChangeDetection(),),
    "detection-soon": (p.ChangeDetection(0.3, 0.1),),
    "projection": (p.Projection(),),
    "projection-wide": (p.Projection(0.3),),
    "amplitudes": (p.AmplitudeMemory(),),
    "amplitudes-few": (p.AmplitudeMemory(2, 0.3, 0.3),),
}
# ... and together.
TOGETHER: dict[str, tuple[Any, ...]] = {
    "walk-projection": (*WALK, p.Projection()),
    "walk-detection": (*WALK, p.ChangeDetection(1.0, 0.5)),
    "walk-gate": (*WALK, p.ExcitationGate(1e-3)),
    "walk-amplitudes": (*WALK, p.AmplitudeMemory(4, 0.2)),
    "walk-resetting": (*WALK, p.CovarianceResetting(1e-3), p.NormBound(5.0)),
    "directional-projection": (p.DirectionalForgetting(0.5), p.Projection(0.05), p.NormBound()),
    "variable-bound": (p.VariableForgetting(0.5, 0.05), p.NormBound(10.0), *ROUGH),
    "gate-amplitudes": (p.DirectionalForgetting(), p.ExcitationGate(1e-2), p.AmplitudeMemory(), *ROUGH),
}
PROFILE = pz.AmplitudeProfile(
    np.array([20.0, 40.0, 66.0]), np.array([TRUE.theta, START.theta, 1.1 * TRUE.theta])
)
CALLS: dict[str, dict[str, Any]] = {
    "default": {},
    "paper": {"memory": 0.4},
    "amplitudes": {"policies": TOGETHER["walk-amplitudes"]},
    "line": {"initial_model": LINE},
    "continuous": {"time_base": "continuous"},
}


def hysteresis_cases() -> Cases:
    """`HysteresisRLS`."""
    cases: Cases = {}
    for name, options in CORE.items():
        make = partial(pz.HysteresisRLS, RATE, **options)
        cases |= {f"rls/{name}/{scenario}": on(make, scenario) for scenario in NAMES}
    rest = OPTIONS | {f"alone-{name}": {"policies": policies} for name, policies in ALONE.items()}
    rest |= {f"together-{name}": {"policies": policies} for name, policies in TOGETHER.items()}
    for number, (name, options) in enumerate(rest.items()):
        make = partial(pz.HysteresisRLS, RATE, **options)
        cases |= {f"rls/{name}/{scenario}": on(make, scenario) for scenario in some(number)}
    for name, options in CALLS.items():
        cases[f"rls-calls/{name}"] = partial(calls, options)
    return cases


def calls(options: dict[str, Any]) -> Outcome:
    """What a user may do between samples: hold, announce, reset, copy, save, start from a profile."""
    u, x = SCENARIOS["growing"]()
    estimator = pz.HysteresisRLS(RATE, **options)
    remembers = any(isinstance(policy, p.AmplitudeMemory) for policy in options.get("policies", ()))
    outcome: Outcome = {}

    def note(name: str) -> None:
        outcome.update({f"{name}.{key}": values for key, values in end(estimator).items() if key != "end.P"})

    estimator.run(u[:300], x[:300])
    estimator.frozen = True
    estimator.run(u[300:350], x[300:350])
    note("frozen")
    estimator.frozen = False
    estimator.announce_change()
    estimator.run(u[350:500], x[350:500])
    note("announced")
    estimator.announce_change(3.0 if remembers else None)
    estimator.run(u[500:700], x[500:700])
    estimator.reset_covariance()
    estimator.run(u[700:800], x[700:800])
    note("covariance")
    other = pz.HysteresisRLS.from_dict(json.loads(json.dumps(estimator.copy().to_dict())))
    estimator.reset()
    if remembers:
        outcome["profile"] = flat(other.profile.swings, other.profile.theta)
        estimator.profile = PROFILE
    estimator.run(u, x)
    note("anew")
    other.run(u[800:], x[800:])
    return outcome | {f"other.{key}": values for key, values in end(other).items()}


# ---------------------------------------------------------------- any regression

LAW: dict[str, dict[str, Any]] = {
    "default": {},
    "theta": {"theta": [0.5, -1.0, 2.0], "P": 10.0},
    "diagonal": {"P": [1.0, 10.0, 100.0], "noise_variance": 0.01},
    "matrix": {"P": [[2.0, 0.5, 0.1], [0.5, 1.0, 0.2], [0.1, 0.2, 3.0]]},
    "no-policy": {"policies": ()},
    "forgetting": {"policies": (p.Forgetting(50.0),)},
    "forgetting-step": {"policies": (p.Forgetting(0.1),), "step": 1e-3},
    "directional": {"policies": (p.DirectionalForgetting(30.0, "second"),)},
    "variable": {"policies": (p.VariableForgetting(50.0, 0.2, "second"), p.Normalisation())},
    "bound": {"policies": (p.Forgetting(20.0), p.NormBound(1.5)), "P": 10.0},
    "resetting": {"policies": (p.CovarianceResetting(1e-3), p.DeadZone(1e-3)), "P": 10.0},
    "dead-zone": {"policies": (p.DeadZone(0.5), p.Forgetting(50.0)), "P": 10.0},
    "all": {
        "policies": (
            p.Forgetting(50.0), p.NormBound(), p.Normalisation(),
            p.CovarianceResetting(1e-4), p.DeadZone(),
        ),
        "P": 10.0,
    },
    "continuous": {"time_base": "continuous", "step": 1e-3, "P": 10.0},
    "continuous-plain": {"time_base": "continuous", "step": 1e-3, "policies": (), "P": 10.0},
    "continuous-all": {
        "policies": (
            p.Forgetting(0.1), p.NormBound(2.0), p.Normalisation(),
            p.CovarianceResetting(1e-2), p.DeadZone(1e-2),
        ),
        "time_base": "continuous", "step": 1e-3, "P": 10.0,
    },
}  # fmt: skip


def regression(n: int, options: dict[str, Any]) -> Outcome:
    rng = np.random.default_rng(n)
    law = pz.RecursiveLeastSquares(n, **options)
    truth = rng.uniform(-2.0, 2.0, n)
    rows: dict[str, list[Any]] = {"theta": [], "P": [], "y": [], "S": []}
    for k in range(400):
        phi = rng.uniform(-1.0, 1.0, n) * (0.0 if 100 <= k < 160 else 1.0)
        z = float(truth @ phi) + 0.01 * rng.uniform(-1.0, 1.0)
        law.update({90: np.nan, 200: np.inf, 201: 1e300}.get(k, z), phi)
        if k == 300:
            law.reset_covariance()
            truth = -truth
        if k % 3 == 0:
            for name, values in rows.items():
                values.append(getattr(law, name))
    return {name: flat(*values) for name, values in rows.items()} | {"resets": flat(law.resets)}


def regression_cases() -> Cases:
    """`RecursiveLeastSquares`."""
    cases: Cases = {f"law/{name}": partial(regression, 3, options) for name, options in LAW.items()}
    for n in (1, 2, 6):
        for name in ("default", "forgetting", "directional", "continuous"):
            cases[f"law/{name}-{n}"] = partial(regression, n, LAW[name])
    return cases


# ---------------------------------------------------------------- many channels

BANKED: dict[str, Callable[[], Any]] = {
    "default": lambda: pz.HysteresisRLS(RATE),
    "paper": lambda: pz.HysteresisRLS(RATE, memory=0.4),
    "bare": lambda: pz.HysteresisRLS(RATE, memory=0.01, policies=(), errors=False),
    "delay": lambda: pz.HysteresisRLS(RATE, delay=1.5),
    "line": lambda: pz.HysteresisRLS(RATE, initial_model=LINE),
    "policies": lambda: pz.HysteresisRLS(RATE, **CORE["all-policies"]),
    "continuous": lambda: pz.HysteresisRLS(RATE, time_base="continuous"),
    "ekf": lambda: pz.HysteresisEKF(RATE),
    "ekf-offset": lambda: pz.HysteresisEKF(RATE, offset=True, delay=1.5),
    "ekf-line": lambda: pz.HysteresisEKF(RATE, initial_model=LINE),
}


def bank(name: str, masked: bool) -> Outcome:
    """Each scenario is a channel; missing samples are NaN, or masked with a number behind the mask."""
    channels = [SCENARIOS[scenario]() for scenario in NAMES]
    u, x = (np.column_stack([channel[i][:500] for channel in channels]) for i in range(2))
    many = pz.EstimatorBank(BANKED[name](), len(NAMES), threads=2 if masked else 1)
    given: list[Any] = [u, x]
    if masked:
        given = [np.ma.array(np.where(np.isnan(v), 7.0, v), mask=np.isnan(v)) for v in (u, x)]
    theta = many.run(given[0][:450], given[1][:450], every=9)
    for k in range(450, 500):
        many.step(given[0][k], given[1][k])
    outcome = {"theta": flat(theta), "end": flat(many.theta)}
    outcome["models"] = flat(*map(model_numbers, many.models))
    outcome["status"] = flat(
        *([s.samples, s.updates, s.missing, s.held, s.resets, s.outliers] for s in many.status)
    )
    for c in (0, 7, 19):
        outcome |= {f"channel {c}.{key}": values for key, values in end(many.channel(c)).items()}
    many.reset()
    many.run(u[:90], x[:90])
    return outcome | {"anew": flat(many.theta)}


def bank_cases() -> Cases:
    """`EstimatorBank`."""
    cases: Cases = {}
    for name in BANKED:
        cases[f"bank/{name}/nan"] = partial(bank, name, False)
        cases[f"bank/{name}/masked"] = partial(bank, name, True)
    return cases


def cases() -> Cases:
    return hysteresis_cases() | regression_cases() | bank_cases()
