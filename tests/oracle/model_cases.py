"""Cases of models and simulated stages."""

from functools import partial
from typing import Any

import numpy as np

import piezoest as pz
from tests.oracle.filter_cases import BENT, OTHER, PLAYS
from tests.oracle.outcome import Cases, Outcome, flat
from tests.oracle.records import LINE, RATE, START, TRUE, Array, dwelling, sine, triangle, walk

PROFILE = pz.AmplitudeProfile(
    np.array([20.0, 40.0, 66.0]), np.array([TRUE.theta, START.theta, 1.1 * TRUE.theta])
)
PREISACH = pz.Preisach(0.08, np.linspace(3.0, 30.0, 5), np.full(5, 0.02), 15.0, 40.0, 0.2)
NO_PLAYS = pz.PrandtlIshlinskii(0.15, [], [], 0.3)
CREEPING = pz.PrandtlIshlinskii(
    0.1, [5.0, 15.0], [0.02, 0.03], creep=pz.Creep([0.02], [0.1]), sample_rate=RATE
)
MODELS: dict[str, Any] = {
    "coleman-hodgdon": TRUE,
    "coleman-hodgdon-offset": OTHER,
    "line": pz.LinearGain(0.2, -1.0),
    "plays": PLAYS,
    "bent": BENT,
    "creeping": CREEPING,
    "no-plays": NO_PLAYS,
}
VOLTAGES: dict[str, Array] = {
    "sine": sine(33.0, length=500),
    "triangle": triangle(45.0, 8.0, 500),
    "walk": walk(30.0, 7, 500),
    "dwell": dwelling()[:700],
}


def model(name: str, wave: str) -> Outcome:
    u, of = VOLTAGES[wave], MODELS[name]
    return {"simulated": of.simulate(u), "inverted": of.invert(0.1 * u)}


def model_methods() -> Outcome:
    u = VOLTAGES["walk"]
    wrong = pz.ColemanHodgdon(0.02, 0.12, 0.006)
    creep = pz.Creep.logarithmic(0.02, shortest=0.01, longest=10.0, terms_per_decade=2)
    mechanics = pz.MassSpringDamper(80.0, 0.05)
    jumps = np.sign(sine(1.0, 20.0, 300)) * 30.0
    return {
        "second form": flat(TRUE.a, TRUE.b, TRUE.c, pz.ColemanHodgdon.from_loop(0.02, 0.03, 0.2).theta),
        "admissible": flat(
            wrong.is_admissible, wrong.nearest_admissible().theta, wrong.nearest_admissible(0.1).theta
        ),
        "state": TRUE.simulate(u, initial_state=-0.7),
        "inverse": TRUE.invert(0.1 * u, initial_state=0.4),
        "jumps": TRUE.simulate(jumps, allow_jumps=True),
        "inverse jumps": TRUE.invert(0.1 * jumps, allow_jumps=True),
        "plays": PLAYS.simulate(u, initial_state=np.linspace(-1.0, 1.0, 6)),
        "preisach": PREISACH.simulate(u),
        "profile": flat(
            *(PROFILE.at(swing).theta for swing in (5.0, 30.0, 60.0, 90.0)), PROFILE.swing_for(4.0)
        ),
        "creep": creep.simulate(u, sample_rate=RATE),
        "mechanics": mechanics.simulate(u, sample_rate=RATE),
        "coefficients": flat(creep.decays(RATE), mechanics.coefficients(RATE)),
    }


# ---------------------------------------------------------------- stages

STAGE_OPTIONS: dict[str, dict[str, Any]] = {
    "bare": {},
    "creep": {"creep": pz.Creep([0.01, 0.02], [0.01, 0.1])},
    "mechanics": {"mechanics": pz.MassSpringDamper(80.0, 0.1)},
    "amplifier": {"amplifier": pz.Amplifier(-20.0, 25.0, resolution=0.01, slew_rate=1e3, cutoff=200.0)},
    "gauge": {"gauge": pz.Gauge(1e-3, 0.1, 200.0, delay=2, resolution=1e-3, minimum=-4.0, maximum=4.0)},
    "ageing": {"gain_schedule": np.array([[0.05, 1.0], [0.2, 1.2]])},
    "warm": {
        "temperature": np.array([[0.0, 20.0], [0.3, 60.0]]),
        "temperature_law": pz.TemperatureLaw(25.0, 0.01, -0.01),
    },
}  # fmt: skip
EVERYTHING = {key: value for options in STAGE_OPTIONS.values() for key, value in options.items()}
HYSTERESES: dict[str, Any] = {"coleman-hodgdon": OTHER, "line": LINE, "plays": PLAYS, "preisach": PREISACH}
PAPER_OPTIONS: dict[str, dict[str, Any]] = {
    "default": {},
    "bare": {"noise": 0.0, "quantisation": False, "filters": False, "creep": False, "mechanics": False},
    "fine": {"quantisation": False},
    "unfiltered": {"filters": False},
    "no-creep": {"creep": False},
    "stiff": {"mechanics": False},
    "warm": {"temperature": 45.0, "gain_schedule": np.array([[0.0, 1.0], [0.2, 0.8]]), "noise": 0.01},
}


def stage(make: Any) -> Outcome:
    made, u = make(), VOLTAGES["walk"]
    steps = [made.step(u_k) for u_k in u[:100].tolist()]
    outcome = {
        "step": flat(steps),
        "run": made.run(u[100:]),
        "true": made.displacement,
        "time": flat(made.time),
    }
    made.reset()
    return outcome | {"anew": made.run(VOLTAGES["dwell"])}


def stage_cases() -> Cases:
    cases: Cases = {}
    for name, options in STAGE_OPTIONS.items():
        cases[f"stage/{name}"] = partial(stage, partial(pz.SimulatedStage, RATE, TRUE, **options))
    for name, hysteresis in HYSTERESES.items():
        options = {**EVERYTHING, "seed": 3}
        cases[f"stage-whole/{name}"] = partial(stage, partial(pz.SimulatedStage, RATE, hysteresis, **options))
    for name, options in PAPER_OPTIONS.items():
        for group, make in {"paper": pz.PaperStage, "preisach": pz.PreisachStage}.items():
            rate = 5_000.0 if name in ("bare", "warm") else 50_000.0
            cases[f"stage-{group}/{name}"] = partial(stage, partial(make, rate, 5, **options))
    return cases


def cases() -> Cases:
    made: Cases = {f"model/{name}/{wave}": partial(model, name, wave) for name in MODELS for wave in VOLTAGES}
    return made | {"model-methods": model_methods} | stage_cases()
