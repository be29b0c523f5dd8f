"""Cases of compensators: limits, faults in the reference, hand-over of models."""

from functools import partial
from typing import Any

import numpy as np

import piezoest as pz
from tests.oracle.filter_cases import BENT, PLAYS
from tests.oracle.model_cases import CREEPING, MODELS, VOLTAGES
from tests.oracle.outcome import Cases, Outcome, compensator_numbers, flat
from tests.oracle.records import LINE, RATE, START, Array, rounded

LIMITS = pz.VoltageLimits(-60.0, 60.0)
TIGHT = pz.VoltageLimits(-20.0, 25.0, slew_rate=1200.0, sample_rate=RATE)
FEED_FORWARD: dict[str, Any] = {
    "inverse": lambda limits: pz.InverseCompensator(START, limits),
    "inverse-integrated": lambda limits: pz.InverseCompensator(START, limits, method="bogacki-shampine"),
    "inverse-place": lambda limits: pz.InverseCompensator(
        START, limits, hand_over="place", transfer_samples=30
    ),
    "inverse-abrupt": lambda limits: pz.InverseCompensator(START, limits, transfer_samples=0),
    "inverse-line": lambda limits: pz.InverseCompensator(LINE, limits),
    "plays": lambda limits: pz.InverseCompensator(PLAYS, limits),
    "bent": lambda limits: pz.InverseCompensator(BENT, limits, sample_rate=RATE),
    "creeping": lambda limits: pz.InverseCompensator(CREEPING, limits, sample_rate=RATE, transfer_samples=50),
    "line": lambda limits: pz.LinearCompensator(LINE, limits),
    "line-slow": lambda limits: pz.LinearCompensator(LINE, limits, transfer_samples=900),
}
REFERENCES = {name: rounded(0.15 * u) for name, u in VOLTAGES.items()}


def faulty(wave: str) -> Array:
    r = REFERENCES[wave].copy()
    r[40:45], r[90], r[200], r[201] = np.nan, np.inf, 1e300, 60.0
    return r


def feed_forward(compensator: Any, r: Array) -> Outcome:
    steps = [compensator.step(None if np.isnan(r_k) else r_k) for r_k in r[:150].tolist()]
    outcome = {"step": flat(steps), "run": compensator.run(r[150:])}
    return outcome | {"status": compensator_numbers(compensator.status)}


def limited_to(name: str, limits: Any, wave: str) -> Outcome:
    return feed_forward(FEED_FORWARD[name](limits), faulty(wave) if limits else REFERENCES[wave])


def handed_over(name: str, limits: Any, models: tuple[str, ...]) -> Outcome:
    """Models of one type after the other, on the way."""
    compensator, r = FEED_FORWARD[name](limits), np.tile(faulty("sine"), 2)
    pieces, shown = [], []
    for piece, new in zip(np.array_split(r, len(models) + 1), (*models, None), strict=True):
        pieces.append(compensator.run(piece))
        shown.append((compensator.voltage, compensator.limited, compensator.hand_over_due))
        if new is not None:
            compensator.model = {**MODELS, "start": START, "wrong": pz.ColemanHodgdon(0.02, 0.12, 0.006)}[new]
            shown.append(
                (float(len(compensator.model.theta)), compensator.model.offset, compensator.model.theta[0])
            )
    return {
        "voltage": flat(*pieces),
        "shown": flat(*shown),
        "status": compensator_numbers(compensator.status),
    }


# Models that are handed over on the way, by compensator.
ORDERS: dict[str, str] = {
    "inverse": "coleman-hodgdon line coleman-hodgdon-offset plays wrong creeping start bent line",
    "plays": "no-plays bent start plays line creeping",
    "line": "line",
    "line-slow": "line",
    "inverse-place": "coleman-hodgdon coleman-hodgdon-offset line start",
    "inverse-abrupt": "coleman-hodgdon plays line bent start",
    "inverse-integrated": "coleman-hodgdon start line coleman-hodgdon-offset",
}
RANGES: dict[str, Any] = {"free": None, "limited": LIMITS, "tight": TIGHT}


def cases() -> Cases:
    made: Cases = {}
    for name in FEED_FORWARD:
        for limited, limits in RANGES.items():
            for wave in ("walk", "dwell" if limited == "tight" else "sine"):
                made[f"compensator/{name}-{limited}/{wave}"] = partial(limited_to, name, limits, wave)
    within = pz.VoltageLimits(-60.0, 60.0, sample_rate=RATE)
    for name, models in ORDERS.items():
        for limited, limits in {"limited": within, "tight": TIGHT}.items():
            case = partial(handed_over, name, limits, tuple(models.split()))
            made[f"hand-over/{name}-{limited}"] = case
    return made
