"""Cases of the ring: estimator, compensator and a stage, in Python and in exported C."""

from functools import partial
from typing import Any

import numpy as np

import piezoest as pz
from piezoest import policies as p
from tests.oracle.compensator_cases import LIMITS
from tests.oracle.outcome import Cases, Outcome, flat
from tests.oracle.records import LINE, START, rounded

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


def cases() -> Cases:
    return ring_cases()
