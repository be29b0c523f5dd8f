"""All cases of the oracle: what estimators, and a compensator, give, by public names alone.

A case is a function without arguments that returns named arrays of numbers, and makes all that it needs.
Models and stages have exact tests; what a solver ends at depends on its tolerance.
"""

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import piezoest as pz
from piezoest import policies as p

Array = NDArray[np.float64]
Outcome = dict[str, Array]

RATE = 1000.0
LENGTH = 2000
TRUE = pz.ColemanHodgdon(0.021, 0.147, 0.00429)
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
LINE = pz.LinearGain(0.15)


def rounded(values: Any) -> Array:
    """Values on a grid of 2^-30, so that another computer's `sin` and `exp` give the same records."""
    return np.asarray(np.round(np.asarray(values, dtype=np.float64) * 2.0**30) * 2.0**-30)


def sine(length: int = LENGTH) -> Array:
    return rounded(33.0 * np.sin(2.0 * np.pi * 5.0 / RATE * np.arange(length)))


def triangle(volts: float, frequency: float = 5.0) -> Array:
    turns = frequency / RATE * np.arange(LENGTH) + 0.25
    return rounded(volts * (4.0 * np.abs(turns - np.floor(turns) - 0.5) - 1.0) * -1.0)


def growing() -> Array:
    """One amplitude after the other, two of them twice."""
    sizes = np.repeat([10.0, 33.0, 20.0, 33.0, 10.0, 45.0], -(-LENGTH // 6))[:LENGTH]
    return rounded(sizes * triangle(1.0, 10.0))


def dwelling() -> Array:
    """A triangle that rests three times, once at zero and twice on a branch."""
    index = np.arange(LENGTH)
    for start, rest in ((150, 100), (430, 150), (800, 200)):
        index = np.where(index < start, index, np.maximum(index - rest, start))
    return triangle(33.0)[index]


def answer(u: Array, noise: float = 1.5e-3) -> Array:
    return rounded(TRUE.simulate(u) + noise * np.random.default_rng(1).standard_normal(u.size))


def jump() -> tuple[Array, Array]:
    """The stage's gain changes, then its level."""
    u, x = triangle(33.0), answer(triangle(33.0))
    x[500:] *= 1.25
    x[900:] += 0.75
    return u, rounded(x)


def wild() -> tuple[Array, Array]:
    u, x, rng = sine(), answer(sine()), np.random.default_rng(4)
    odd = np.array([np.inf, -np.inf, np.nan, 1e300, -1e300, 1e30, 9e8, 5e-324])
    for values, share in ((u, 0.01), (x, 0.03)):
        places = rng.random(u.size) < share
        values[places] = rng.choice(odd, int(places.sum()))
    return u, x


def rough() -> tuple[Array, Array]:
    """Rests, spikes, gaps, a bias that drifts, a delay, missing voltages, a sensor that ends: all of it."""
    u, rng = dwelling(), np.random.default_rng(5)
    index = np.arange(u.size)
    x = answer(rounded(np.interp(index - 1.3, index, u)), 5e-3) + 2.0 + rounded(2e-4 * index)
    x[rng.random(u.size) < 0.01] += 4.0
    x[rng.random(u.size) < 0.03] = np.nan
    x[600:680], u[950:960] = np.nan, np.nan
    return u, np.clip(x, -4.0, 9.0)


SCENARIOS: dict[str, Any] = {
    "growing": lambda: (growing(), answer(growing())),
    "unipolar": lambda: (triangle(25.0) + 50.0, answer(triangle(25.0) + 50.0)),
    "jump": jump,
    "wild": wild,
    "rough": rough,
}
# The three that hold most.
SOME = ("rough", "growing", "jump")

COUNTS = ("samples", "updates", "missing", "held", "resets", "projected", "outliers")
COMPENSATOR_COUNTS = ("samples", "saturated", "slewed", "missing", "projected")
LAST = ("waiting", "updated", "missing", "held", "rejected")
# Public attributes at the end of a record, where the estimator has them.
ATTRIBUTES = ("theta", "y", "S", "K", "standard_errors", "excitation", "s", "thresholds", "decays")
MATRICES = ("P", "state_covariance")


def flat(*values: Any) -> Array:
    return np.concatenate([np.asarray(value, dtype=np.float64).ravel() for value in values])


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
    outcome["model"] = flat(estimator.model.theta, estimator.model.offset)
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


RLS, EKF = partial(pz.HysteresisRLS, RATE), partial(pz.HysteresisEKF, RATE)
PLAYS = partial(pz.PrandtlIshlinskiiRLS, RATE)
ALL_POLICIES = (
    p.VariableForgetting(), p.Projection(), p.ChangeDetection(), p.ExcitationGate(), p.AmplitudeMemory(),
    p.DeadZone(), p.OutlierRejection(),
)  # fmt: skip
# Those named default get all scenarios, the others, each of which compiles an estimator of its own, some.
STREAMING: dict[str, Callable[[], Any]] = {
    "rls/default": RLS,
    "rls/paper": partial(RLS, memory=0.4),
    "rls/line": partial(RLS, initial_model=LINE),
    "rls/continuous": partial(RLS, time_base="continuous"),
    "rls/all-policies": partial(RLS, policies=ALL_POLICIES),
    "ekf/default": EKF,
    "ekf/line-offset": partial(EKF, initial_model=LINE, offset=True, delay=1.5),
    "output-error/default": partial(pz.OutputErrorRLS, RATE),
    "plays/default": PLAYS,
    "plays/mechanics-delay": partial(PLAYS, mechanics=pz.MassSpringDamper(80.0, 0.1), delay=1.4, creep=()),
}

# Models handed over one after the other: of all types, and one without an inverse.
OTHER_LINE = pz.LinearGain(0.2, -1.0)
CREEP = pz.Creep([0.02], [0.1])
CREEPING = pz.PrandtlIshlinskii(0.1, [5.0, 15.0], [0.02, 0.03], creep=CREEP, sample_rate=RATE)
BENT = pz.PrandtlIshlinskii(
    0.1, np.linspace(4.0, 30.0, 5), np.full(5, 8e-3), 0.1, creep=pz.Creep([0.01, 0.02], [0.01, 1.0]),
    bends=[-10.0, 12.0], bend_weights=np.full((2, 6), 5e-4), sample_rate=RATE,
)  # fmt: skip
MODELS: tuple[Any, ...] = (
    TRUE, OTHER_LINE, pz.ColemanHodgdon(0.03, 0.2, 0.009, offset=1.5),
    pz.PrandtlIshlinskii(0.1, np.linspace(3.0, 30.0, 6), np.full(6, 8e-3), 0.1),
    pz.ColemanHodgdon(0.02, 0.12, 0.006), CREEPING, START, BENT, OTHER_LINE,
)  # fmt: skip


def handed_over() -> Outcome:
    limits = pz.VoltageLimits(-20.0, 25.0, slew_rate=1200.0, sample_rate=RATE)
    compensator, r = pz.InverseCompensator(START, limits), rounded(0.15 * sine(500))
    r[40:45], r[90], r[200], r[201] = np.nan, np.inf, 1e300, 60.0
    pieces: list[Array] = []
    seen: list[Any] = []
    for piece, model in zip(np.array_split(np.tile(r, 2), len(MODELS) + 1), (*MODELS, None), strict=True):
        pieces.append(compensator.run(piece))
        seen.append((compensator.voltage, compensator.limited, compensator.hand_over_due))
        if model is not None:
            compensator.model = model
            theta = compensator.model.theta
            seen.append((float(len(theta)), compensator.model.offset, theta[0]))
    counts = [float(getattr(compensator.status, name)) for name in COMPENSATOR_COUNTS]
    return {"voltage": flat(*pieces), "shown": flat(*seen), "status": flat(counts)}


CASES: dict[str, Callable[[], Outcome]] = {
    f"{name}/{scenario}": partial(observed, make, scenario)
    for name, make in STREAMING.items()
    for scenario in (SCENARIOS if name.endswith("/default") else SOME)
} | {"hand-over/default": handed_over}
