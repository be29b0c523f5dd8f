"""Cases of the ring: estimator, compensator and a stage, in Python and in exported C."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

import piezoest as pz
from piezoest import policies as p
from tests.oracle.compensator_cases import FEED_FORWARD, LIMITS, TIGHT
from tests.oracle.model_cases import NO_PLAYS
from tests.oracle.outcome import Cases, Outcome, flat, model_numbers
from tests.oracle.records import LINE, RATE, SCENARIOS, START, rounded
from tests.oracle.rls_cases import CORE

FAST = 5000.0
ESTIMATORS: dict[str, Any] = {
    "none": lambda: None,
    "rls": lambda: pz.HysteresisRLS(FAST),
    "rls-paper": lambda: pz.HysteresisRLS(FAST, memory=0.4),
    "rls-amplitudes": lambda: pz.HysteresisRLS(
        FAST, policies=(p.RandomWalk(), p.DeadZone(), p.AmplitudeMemory())
    ),
    "rls-line": lambda: pz.HysteresisRLS(FAST, initial_model=LINE),
    "ekf": lambda: pz.HysteresisEKF(FAST, offset=True),
    "output-error": lambda: pz.OutputErrorRLS(FAST),
    "plays": lambda: pz.PrandtlIshlinskiiRLS(FAST),
    "bad": lambda: pz.HysteresisEKF(FAST, noise=1e-6, drift=50.0, mismatch=0.0),
}


class Faulty:
    """A stage whose gain drops and whose reading is spoilt for a while."""

    def __init__(self, seed: int) -> None:
        schedule = np.array([[0.3, 1.0], [0.31, 0.7]])
        self.inner = pz.PaperStage(FAST, seed, gain_schedule=schedule)
        self.samples = 0

    @property
    def displacement(self) -> float:
        return float(self.inner.displacement)

    def step(self, u: float) -> float:
        x = self.inner.step(u)
        self.samples += 1
        if 900 <= self.samples < 1000:
            return float("nan")
        return 12.0 if 2200 <= self.samples < 2400 or self.samples % 97 == 0 else x


def ring(name: str, plant: str, interval: int, compensator: Any) -> Outcome:
    if plant == "faulty":
        r = pz.signals.Signal(rounded(pz.signals.triangle(5.0, 10.0, 6, FAST).values), FAST, 500.0)
    else:
        r = pz.signals.Signal(
            rounded(pz.signals.multi_amplitude([3.0, 5.0], 10.0, 3, FAST).values), FAST, 500.0
        )
    record = pz.track(
        r, stage=Faulty(1) if plant == "faulty" else pz.PaperStage(FAST, 2), compensator=compensator(),
        estimator=ESTIMATORS[name](), update_interval=interval, sample_rate=FAST,
    )  # fmt: skip
    outcome = {
        name: flat(getattr(record, name)) for name in ("voltage", "measured", "displacement", "parameters")
    }
    outcome["errors"] = flat(record.max_error(), record.rms_error(), record.periods)
    return outcome


def ring_cases() -> Cases:
    inverse = partial(pz.InverseCompensator, START, LIMITS)
    straight = partial(pz.LinearCompensator, LINE, LIMITS)
    creeping = partial(pz.InverseCompensator, START, LIMITS, sample_rate=FAST)
    controller: Any = lambda: pz.export.Controller(ESTIMATORS["ekf"](), inverse())  # noqa: E731
    cases: Cases = {}
    for number, name in enumerate(ESTIMATORS):
        compensator: Any = {"rls-line": straight, "plays": creeping}.get(name, inverse)
        for plant in ("paper", "faulty"):
            interval = (5, 50, 23)[number % 3]
            cases[f"ring/{name}/{plant}-free"] = partial(ring, name, plant, interval, compensator)
    cases["ring/controller"] = partial(ring, "none", "faulty", 5, controller)
    return cases


# ---------------------------------------------------------------- exported C

EXPORTED: dict[str, Any] = {
    "inverse": lambda: (None, FEED_FORWARD["inverse"](TIGHT)),
    "inverse-integrated": lambda: (None, FEED_FORWARD["inverse-integrated"](LIMITS)),
    "plays": lambda: (None, FEED_FORWARD["plays"](LIMITS)),
    "bent": lambda: (None, FEED_FORWARD["bent"](TIGHT)),
    "no-plays": lambda: (None, pz.InverseCompensator(NO_PLAYS, LIMITS)),
    "line": lambda: (None, FEED_FORWARD["line"](LIMITS)),
    "rls": lambda: (pz.HysteresisRLS(RATE), FEED_FORWARD["inverse"](LIMITS)),
    "rls-paper": lambda: (pz.HysteresisRLS(RATE, memory=0.4), FEED_FORWARD["inverse-place"](LIMITS)),
    "rls-bare": lambda: (
        pz.HysteresisRLS(RATE, memory=0.4, policies=(), errors=False), FEED_FORWARD["inverse-abrupt"](LIMITS)
    ),
    "rls-continuous": lambda: (
        pz.HysteresisRLS(RATE, time_base="continuous"), FEED_FORWARD["inverse-integrated"](TIGHT)
    ),
    "rls-delay": lambda: (
        pz.HysteresisRLS(RATE, delay=2.3, high_pass=0.5, memory=0.2), FEED_FORWARD["inverse"](LIMITS)
    ),
    "rls-resetting": lambda: (
        pz.HysteresisRLS(RATE, memory=0.05, policies=(p.CovarianceResetting(1e-3), p.DeadZone())),
        FEED_FORWARD["inverse"](LIMITS),
    ),
    "rls-policies": lambda: (
        pz.HysteresisRLS(RATE, **CORE["all-policies"]),
        FEED_FORWARD["inverse"](LIMITS),
    ),
    "rls-directional": lambda: (
        pz.HysteresisRLS(RATE, policies=(p.DirectionalForgetting(), p.NormBound(5.0))),
        FEED_FORWARD["inverse"](TIGHT),
    ),
    "rls-line": lambda: (pz.HysteresisRLS(RATE, initial_model=LINE), FEED_FORWARD["line"](LIMITS)),
    "rls-line-offset": lambda: (
        pz.HysteresisRLS(RATE, initial_model=LINE, offset=True), FEED_FORWARD["inverse-line"](TIGHT)
    ),
    "ekf": lambda: (pz.HysteresisEKF(RATE), FEED_FORWARD["inverse"](LIMITS)),
    "ekf-offset": lambda: (pz.HysteresisEKF(RATE, offset=True, delay=1.5), FEED_FORWARD["inverse"](LIMITS)),
    "ekf-line": lambda: (pz.HysteresisEKF(RATE, initial_model=LINE), FEED_FORWARD["inverse-line"](LIMITS)),
}  # fmt: skip


def exported(name: str) -> Outcome:
    """Generated code against two logs, held and given other limits on the way."""
    controller = pz.export.CompiledController(
        pz.export.c(*EXPORTED[name](), name="oracle", update_interval=10)
    )
    outcome: Outcome = {}
    for scenario in ("growing", "rough"):
        u, x = SCENARIOS[scenario]()
        r = np.nan_to_num(0.15 * u, nan=np.inf)
        controller.reset()
        outcome[f"{scenario}.start"] = controller.run(r[:500], x[:500])
        controller.frozen = True
        outcome[f"{scenario}.held"] = controller.run(r[500:550], x[500:550])
        controller.frozen = False
        outcome[f"{scenario}.on"] = controller.run(r[550:900], x[550:900])
        controller.set_limits(-10.0, 15.0)
        outcome[f"{scenario}.limited"] = controller.run(r[900:], x[900:])
        outcome[f"{scenario}.parameters"] = controller.parameters
    if not isinstance(EXPORTED[name]()[1].model, pz.PrandtlIshlinskii):
        controller.parameters = [0.021, 0.14, 0.0042, 0.1]
        outcome["set"] = flat([controller.step(r_k, None) for r_k in r[:50].tolist()], controller.parameters)
    return outcome


def ring_in_python(name: str) -> Outcome:
    """The same ring in Python, on the same log."""
    u, x = SCENARIOS["rough"]()
    controller = pz.export.Controller(*EXPORTED[name](), update_interval=10)
    voltage = controller.run(np.nan_to_num(0.15 * u, nan=np.inf), x)
    return {"voltage": voltage, "model": model_numbers(controller.model)}


def cases() -> Cases:
    made = ring_cases() | {f"c/{name}": partial(exported, name) for name in EXPORTED}
    return made | {f"controller/{name}": partial(ring_in_python, name) for name in EXPORTED}
