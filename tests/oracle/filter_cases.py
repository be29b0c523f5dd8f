"""Cases of the Kalman filters, of output error, of Prandtl-Ishlinskii and of the fits."""

import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import piezoest as pz
from piezoest import policies as p
from tests.oracle.outcome import Cases, Outcome, end, flat, model_numbers, on
from tests.oracle.records import LINE, NAMES, RATE, SCENARIOS, SOME, START, TRUE, growing, rounded

OTHER = pz.ColemanHodgdon(0.03, 0.2, 0.009, offset=1.5)
PLAYS = pz.PrandtlIshlinskii(0.1, np.linspace(3.0, 30.0, 6), np.full(6, 8e-3), 0.1)
BENT = pz.PrandtlIshlinskii(
    0.1, np.linspace(4.0, 30.0, 5), np.full(5, 8e-3), 0.1, creep=pz.Creep([0.01, 0.02], [0.01, 1.0]),
    bends=[-10.0, 12.0], bend_weights=np.full((2, 6), 5e-4), sample_rate=RATE,
)  # fmt: skip

EKF: dict[str, dict[str, Any]] = {
    "default": {},
    "line-offset": {"initial_model": LINE, "offset": True, "delay": 1.5},
    "delay-fraction": {"delay": 1.3, "offset": True},
    "free": {"project": False},
    "no-drift": {"drift": 0.0},
    "mismatch": {"mismatch": 2.0, "offset": True},
    "other-start": {"initial_model": OTHER, "offset": True},
}
OUTPUT_ERROR: dict[str, dict[str, Any]] = {
    "default": {},
    "span": {"span": 2.0},
    "members": {"members": 9, "span": 3.0},
    "delay": {"delay": 2.4},
    "no-rejection": {"policies": (p.RandomWalk(),)},
    "other-start": {"initial_model": OTHER},
}
PLAY_RLS: dict[str, dict[str, Any]] = {
    "default": {},
    "range-small": {"voltage_range": (-10.0, 15.0), "bends": 1},
    "thresholds-none": {"thresholds": 0},
    "bends": {"bends": 3, "thresholds": 4},
    "creep": {"creep": (0.05,), "bends": 0},
    "plain": {"creep": (), "bends": 0, "thresholds": 6},
    "delay-fraction": {"delay": 1.4, "bends": 0},
    "mechanics-delay": {"mechanics": pz.MassSpringDamper(80.0, 0.1), "delay": 1.4, "creep": ()},
    "from-bent": {"initial_model": BENT},
    "from-line": {"initial_model": LINE},
}


def streaming_cases() -> Cases:
    """Estimators with a compiled loop: the first of their options on every scenario."""
    cases: Cases = {}
    groups = {
        "ekf": (pz.HysteresisEKF, EKF),
        "output-error": (pz.OutputErrorRLS, OUTPUT_ERROR),
        "plays": (pz.PrandtlIshlinskiiRLS, PLAY_RLS),
    }
    for group, (make, table) in groups.items():
        for name, options in table.items():
            estimator = partial(make, RATE, **options)
            for scenario in NAMES if name == "default" else SOME:
                cases[f"{group}/{name}/{scenario}"] = on(estimator, scenario)
    return cases


# ---------------------------------------------------------------- fits

HORIZON: dict[str, dict[str, Any]] = {
    "default": {},
    "offset": {"offset": True},
    "short": {"window": 0.25, "hop": 0.05, "decimation": 2},
    "odd": {"decimation": 3, "process_noise": 0.5, "noise": 0.01},
    "line": {"initial_model": LINE, "offset": True},
    "certain": {"uncertainty": 0.05, "max_iterations": 5},
    "other-start": {"initial_model": pz.ColemanHodgdon(0.022, 0.13, 0.004), "process_noise": 0.0},
}
BATCH: dict[str, dict[str, Any]] = {
    "default": {},
    "offset": {"offset": True},
    "line": {"initial_model": LINE, "offset": True},
    "creep": {"creep": pz.Creep([0.01, 0.01], [0.02, 0.3])},
    "multiple": {"method": "multiple-shooting"},
    "multiple-offset": {"method": "multiple-shooting", "offset": True, "loss": "huber"},
    "huber": {"loss": "huber", "offset": True},
    "soft": {"loss": "soft_l1"},
    "cauchy": {"loss": "cauchy", "offset": True},
    "noise": {"noise": 0.01, "initial_model": OTHER},
    "fixed": {"fixed": {"gamma": 0.00429, "initial_state": 0.0}, "initial_model": START},
    "iterations": {"max_iterations": 6, "initial_model": START},
}
# A linear gain is fitted by what is linear: the solver has no tolerance there.
FIT_SCENARIOS = ("sine", "nan", "growing")


def batch(options: dict[str, Any], scenario: str) -> Outcome:
    u, x = SCENARIOS[scenario]()
    fit = pz.BatchFit(RATE, **options)
    result = fit.fit(u[:600], x[:600])
    outcome = {"theta": result.theta, "P": flat(result.P), "model": model_numbers(result.model)}
    outcome["noise"] = flat(result.noise, result.success, len(result.at_bound), result.initial_state)
    outcome["residual"] = result.residual
    if result.creep is not None:
        outcome["creep"] = result.creep.gains
    return outcome


def streamed_batch(hop: float | None) -> Outcome:
    """The face of a streaming estimator."""
    u, x = SCENARIOS["rough"]()
    fit = pz.BatchFit(RATE, hop=hop, offset=True, loss="huber")
    for k in range(100):
        fit.step(float(u[k]), float(x[k]))
    fit.run(u[100:900], x[100:900])
    return end(fit)


def horizon(options: dict[str, Any], scenario: str) -> Outcome:
    u, x = SCENARIOS[scenario]()
    estimator = pz.MovingHorizon(RATE, **options)
    trace = estimator.run(u, x, every=50, record=("y", "S", "P"))
    outcome = {name: flat(getattr(trace, name)) for name in ("theta", "y", "S", "P")}
    return outcome | end(estimator) | {"solves": flat(estimator.solves, estimator.failures)}


def log(centre: float = 0.0, faults: bool = False, delay: float = 2.3) -> pz.Record:
    u = np.concatenate([growing(1500), growing(1500)]) + centre
    index = np.arange(u.size)
    x = TRUE.simulate(np.interp(index - delay, index, u), initial_state=-0.5)
    x = rounded(x + 3.0 + 2e-3 * np.random.default_rng(6).standard_normal(u.size))
    if faults:
        x[100:130], x[2000], u[500] = np.nan, np.nan, np.nan
    return pz.Record.from_arrays(u, x, RATE)


def streamed_log(options: dict[str, Any]) -> Outcome:
    """A log read block by block from a file."""
    record = log(faults=True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        columns = np.column_stack([record.time, record.voltage, record.displacement])
        np.savetxt(path, columns, "%.17g", ",", header="time [s],voltage [V],displacement [um]", comments="")
        found = pz.identify_stream(pz.stream_record(path), **options)
    misfits = (found.train, found.held_out, found.line_train, found.line_held_out)
    return {
        "model": flat(found.model.line, model_numbers(found.line), found.delay),
        "blocks": flat(list(found.cross_validated.values())),
        "misfit": flat([(misfit.rms, misfit.max) for misfit in misfits]),
        "prediction": found.prediction,
    }


def identified(about: dict[str, Any], options: dict[str, Any]) -> Outcome:
    found = pz.identify(log(**about), model="coleman-hodgdon", **options)
    outcome = {"model": model_numbers(found.model), "line": model_numbers(found.line)}
    outcome["errors"] = flat(
        [found.standard_errors[name] for name in ("alpha", "beta", "gamma", "offset", "delay")]
    )
    misfits = (found.train, found.held_out, found.line_train, found.line_held_out)
    outcome["misfit"] = flat([(misfit.rms, misfit.max) for misfit in misfits])
    outcome["rest"] = flat(found.delay, found.initial_state, found.drift, found.left_out, found.trained)
    outcome["whiteness"] = flat(found.whiteness.statistic, found.whiteness.first_autocorrelation)
    return outcome | {"prediction": found.prediction}


def chosen(about: dict[str, Any], options: dict[str, Any]) -> Outcome:
    found = pz.identify(log(**about), **options)
    outcome = {"best": flat(found.candidates.index(found.best), found.delay)}
    for each in found.candidates:
        outcome[each.name] = flat(each.parameters, each.cross_validated, each.train.rms, each.held_out.rms)
        # Rounding decides which of two plays that hardly differ has a slope.
        outcome[f"{each.name} prediction"] = each.prediction.x
    return outcome


def fit_cases() -> Cases:
    """Fits of windows and of whole records."""
    cases: Cases = {}
    for name, options in BATCH.items():
        for scenario in FIT_SCENARIOS[:1] if name.startswith("multiple") else FIT_SCENARIOS:
            cases[f"batch/{name}/{scenario}"] = partial(batch, options, scenario)
    cases |= {f"batch-streamed/{hop}": partial(streamed_batch, hop) for hop in (None, 0.25)}
    for name, options in HORIZON.items():
        for scenario in SOME:
            cases[f"horizon/{name}/{scenario}"] = partial(horizon, options, scenario)
    settings: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
        "default": ({}, {}),
        "faults": ({"faults": True}, {}),
        "unipolar": ({"centre": 60.0}, {"train": 0.7}),
        "delay": ({}, {"delay": 2.3, "settle": 0.1}),
    }
    for name, (about, options) in settings.items():
        cases[f"identify/{name}"] = partial(identified, about, options)
        cases[f"identify-auto/{name}"] = partial(chosen, about, options)
    cases |= {f"identify/stream-{delay}": partial(streamed_log, {"delay": delay}) for delay in (2.3, "auto")}
    return cases


def cases() -> Cases:
    return streaming_cases() | fit_cases()
