"""All cases of the oracle, of estimators and compensators: what each of them gives, by public names alone.

A case is a function without arguments that returns named arrays of numbers, and makes all that it needs.
Models and stages have exact tests; what a solver ends at depends on its tolerance.
"""

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import piezoest as pz
from piezoest import policies as p
from tests.oracle.records import (
    LINE,
    RATE,
    SCENARIOS,
    SOME,
    START,
    TRUE,
    Array,
    dwelling,
    rounded,
    sine,
    walk,
)  # fmt: skip

Outcome = dict[str, Array]
Cases = dict[str, Callable[[], Outcome]]

COUNTS = ("samples", "updates", "missing", "held", "resets", "projected", "outliers")
COMPENSATOR_COUNTS = ("samples", "saturated", "slewed", "missing", "projected")
LAST = ("waiting", "updated", "missing", "held", "rejected")
# Public attributes at the end of a record, where the estimator has them.
ATTRIBUTES = ("theta", "y", "S", "K", "standard_errors", "excitation", "s", "thresholds", "decays")
MATRICES = ("P", "state_covariance")

OTHER = pz.ColemanHodgdon(0.03, 0.2, 0.009, offset=1.5)
PLAYS = pz.PrandtlIshlinskii(0.1, np.linspace(3.0, 30.0, 6), np.full(6, 8e-3), 0.1)
BENT = pz.PrandtlIshlinskii(
    0.1, np.linspace(4.0, 30.0, 5), np.full(5, 8e-3), 0.1, creep=pz.Creep([0.01, 0.02], [0.01, 1.0]),
    bends=[-10.0, 12.0], bend_weights=np.full((2, 6), 5e-4), sample_rate=RATE,
)  # fmt: skip
CREEPING = pz.PrandtlIshlinskii(
    0.1, [5.0, 15.0], [0.02, 0.03], creep=pz.Creep([0.02], [0.1]), sample_rate=RATE
)
MODELS: dict[str, Any] = {
    "coleman-hodgdon": TRUE, "coleman-hodgdon-offset": OTHER, "line": pz.LinearGain(0.2, -1.0),
    "plays": PLAYS, "bent": BENT, "creeping": CREEPING,
}  # fmt: skip
VOLTAGES: dict[str, Array] = {
    "sine": sine(33.0, length=500), "walk": walk(30.0, 7, 500), "dwell": dwelling()[:700],
}  # fmt: skip


def flat(*values: Any) -> Array:
    return np.concatenate([np.asarray(value, dtype=np.float64).ravel() for value in values])


def model_numbers(model: Any) -> Array:
    return flat(model.theta, model.offset)


def compensator_numbers(status: Any) -> Array:
    return flat([float(getattr(status, name)) for name in COMPENSATOR_COUNTS])


def shown(estimator: Any, name: str) -> Any:
    """An attribute; not a number where this estimator does not follow it."""
    try:
        return getattr(estimator, name)
    except ValueError:
        return np.nan


def end(estimator: Any) -> Outcome:
    has = partial(hasattr, type(estimator))
    outcome = {"end": flat(*(shown(estimator, name) for name in ATTRIBUTES if has(name)))}
    outcome |= {f"end.{name}": flat(shown(estimator, name)) for name in MATRICES if has(name)}
    outcome["model"] = model_numbers(estimator.model)
    status = estimator.status
    outcome["status"] = flat([float(getattr(status, name)) for name in COUNTS], LAST.index(status.last))
    return outcome


def observed(make: Callable[[], Any], scenario: str) -> Outcome:
    """A record by `step`, by `predict` and `update`, and by `run`; then all that the estimator shows."""
    estimator, (u, x) = make(), SCENARIOS[scenario]()
    rows: dict[str, list[Array]] = {"step.theta": [], "step.y": [], "step.S": [], "step.K": []}
    nothing = itertools.cycle((None, np.nan))
    first, second = u.size // 4, u.size // 4 + 40
    for k in range(first):
        estimator.step(float(u[k]), next(nothing) if np.isnan(x[k]) else float(x[k]))
        if k % 5 == 0:
            for name, values in rows.items():
                values.append(flat(getattr(estimator, name.removeprefix("step."))))
    for k in range(first, second):
        estimator.predict(float(u[k]))
        estimator.update(float(x[k]))
    trace = estimator.run(u[second:], x[second:], every=7, record=("y", "S", "P"))
    outcome = {name: flat(*values) for name, values in rows.items()}
    outcome |= {name: flat(getattr(trace, name)) for name in ("theta", "y", "S", "P")}
    return outcome | end(estimator)


STREAMING: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "rls/default": (partial(pz.HysteresisRLS, RATE), tuple(SCENARIOS)),
    "rls/paper": (partial(pz.HysteresisRLS, RATE, memory=0.4), tuple(SCENARIOS)),
    "rls/line": (partial(pz.HysteresisRLS, RATE, initial_model=LINE), SOME),
    "rls/continuous": (partial(pz.HysteresisRLS, RATE, time_base="continuous"), SOME),
    "rls/all-policies": (
        partial(pz.HysteresisRLS, RATE, policies=(
            p.VariableForgetting(), p.Projection(), p.ChangeDetection(), p.ExcitationGate(),
            p.AmplitudeMemory(), p.DeadZone(), p.OutlierRejection(),
        )), SOME,
    ),
    "ekf/default": (partial(pz.HysteresisEKF, RATE), tuple(SCENARIOS)),
    "ekf/line-offset": (
        partial(pz.HysteresisEKF, RATE, initial_model=LINE, offset=True, delay=1.5), SOME,
    ),
    "output-error/default": (partial(pz.OutputErrorRLS, RATE), tuple(SCENARIOS)),
    "plays/default": (partial(pz.PrandtlIshlinskiiRLS, RATE), tuple(SCENARIOS)),
    "plays/mechanics-delay": (
        partial(pz.PrandtlIshlinskiiRLS, RATE, mechanics=pz.MassSpringDamper(80.0, 0.1), delay=1.4, creep=()),
        SOME,
    ),
}  # fmt: skip


def estimator_cases() -> Cases:
    return {
        f"{name}/{scenario}": partial(observed, make, scenario)
        for name, (make, scenarios) in STREAMING.items() for scenario in scenarios
    }  # fmt: skip


LIMITS = pz.VoltageLimits(-60.0, 60.0)
TIGHT = pz.VoltageLimits(-20.0, 25.0, slew_rate=1200.0, sample_rate=RATE)
FEED_FORWARD: dict[str, Any] = {
    "inverse": lambda limits: pz.InverseCompensator(START, limits),
    "bent": lambda limits: pz.InverseCompensator(BENT, limits, sample_rate=RATE),
    "line": lambda limits: pz.LinearCompensator(LINE, limits),
}
ORDER = ["coleman-hodgdon", "line", "coleman-hodgdon-offset", "plays", "wrong"]
ORDER += ["creeping", "start", "bent", "line"]


def faulty(wave: str) -> Array:
    r = rounded(0.15 * VOLTAGES[wave])
    r[40:45], r[90], r[200], r[201] = np.nan, np.inf, 1e300, 60.0
    return r


def feed_forward(name: str, limits: Any, wave: str) -> Outcome:
    compensator, r = FEED_FORWARD[name](limits), faulty(wave) if limits else rounded(0.15 * VOLTAGES[wave])
    steps = [compensator.step(None if np.isnan(r_k) else r_k) for r_k in r[:150].tolist()]
    outcome = {"step": flat(steps), "run": compensator.run(r[150:])}
    return outcome | {"status": compensator_numbers(compensator.status)}


def handed_over() -> Outcome:
    """Models of one type after the other, on the way."""
    compensator, r = FEED_FORWARD["inverse"](TIGHT), np.tile(faulty("sine"), 2)
    known = {**MODELS, "start": START, "wrong": pz.ColemanHodgdon(0.02, 0.12, 0.006)}
    pieces, seen = [], []
    for piece, new in zip(np.array_split(r, len(ORDER) + 1), (*ORDER, None), strict=True):
        pieces.append(compensator.run(piece))
        seen.append((compensator.voltage, compensator.limited, compensator.hand_over_due))
        if new is not None:
            compensator.model = known[new]
            theta = compensator.model.theta
            seen.append((float(len(theta)), compensator.model.offset, theta[0]))
    outcome = {"voltage": flat(*pieces), "shown": flat(*seen)}
    return outcome | {"status": compensator_numbers(compensator.status)}


def compensator_cases() -> Cases:
    cases: Cases = {"hand-over/inverse-tight": handed_over}
    for name in FEED_FORWARD:
        for limited, limits, waves in (("free", None, ("walk", "sine")), ("tight", TIGHT, ("walk", "dwell"))):
            for wave in waves:
                cases[f"compensator/{name}-{limited}/{wave}"] = partial(feed_forward, name, limits, wave)
    return cases


CASES = estimator_cases() | compensator_cases()
