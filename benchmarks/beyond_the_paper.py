"""What a Prandtl-Ishlinskii estimator gains over the paper's, on two simulated stages and a recording.

python benchmarks/beyond_the_paper.py --json docs/data/beyond.json

Both stages stand side by side throughout: `PaperStage` is itself a Prandtl-Ishlinskii operator with
creep, of the estimator's own family; `PreisachStage` is of nobody's.
"""

from __future__ import annotations

import argparse
import datetime
import functools
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import piezoest as pz
from piezoest.bench.machine import describe_machine
from piezoest.bench.scenarios import SCENARIOS

RATE = 50_000.0  # Hz
UPDATE_INTERVAL = 50  # samples
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
STAGES = {"PaperStage": pz.PaperStage, "PreisachStage": pz.PreisachStage}
ESTIMATORS = {
    "linear": None,
    "HysteresisRLS": pz.HysteresisRLS,
    "PrandtlIshlinskiiRLS": pz.PrandtlIshlinskiiRLS,
}
RECORDING_START = pz.ColemanHodgdon(0.5, 8.0, 6.0)
PERIOD = 200  # samples of the recording


def references() -> dict[str, pz.Signal]:
    rows = ((2.5, 5.0), (5.0, 2.5), (5.0, 5.0), (7.5, 5.0))
    found = {f"triangle {a:g} µm {f:g} Hz": pz.signals.triangle(a, f, round(5.0 * f), RATE) for a, f in rows}
    found["PRBS"] = pz.signals.prbs(5.0, sample_rate=RATE, start="zero").repeat(8)
    return found


def follow(
    reference: pz.Signal, stage: Callable[[float], Any], estimator: Any, rate: float, **options: Any
) -> pz.TrackingRecord:
    """Send a reference round the ring; without an estimator, linear feed-forward with its gain estimated."""
    limits = pz.VoltageLimits(-100.0, 100.0)
    transfer = max(1, round(0.01 * rate))
    compensator: Any
    if estimator is None:
        line = pz.LinearGain(0.15)
        memory = 2.0 * (reference.period or rate / 5.0) / rate
        made: Any = pz.HysteresisRLS(rate, initial_model=line, memory=memory)
        compensator = pz.LinearCompensator(line, limits, transfer_samples=transfer)
    else:
        made = estimator(rate, initial_model=START, **options)
        compensator = pz.InverseCompensator(START, limits, transfer_samples=transfer)
    return pz.track(
        reference,
        stage=stage(rate),
        compensator=compensator,
        estimator=made,
        update_interval=max(1, round(1e-3 * rate)),
    )


def settled() -> list[dict[str, Any]]:
    """Largest error of the last two periods."""
    rows = []
    for name, reference in references().items():
        for stage, cls in STAGES.items():
            errors, periods = {}, {}
            for key, estimator in ESTIMATORS.items():
                record = follow(reference, cls, estimator, RATE)
                errors[key] = record.max_error(last_periods=2)
                periods[key] = record.max_error_per_period().tolist()
            rows.append({"reference": name, "stage": stage, "max_error_um": errors, "per_period_um": periods})
            print(name, stage, {key: round(value, 4) for key, value in errors.items()}, flush=True)
    return rows


def amplitudes(rate: float = 20_000.0) -> list[dict[str, Any]]:
    """From 2.5 µm to 7.5 µm and back and again, with the range learnt and known beforehand."""
    reference = pz.signals.multi_amplitude([2.5, 7.5, 2.5, 7.5], 5.0, [10, 10, 10, 10], rate)
    rows = []
    for stage, cls in STAGES.items():
        for way, options in (
            ("HysteresisRLS", {}),
            ("PrandtlIshlinskiiRLS", {}),
            ("PrandtlIshlinskiiRLS", {"voltage_range": (-55.0, 55.0)}),
        ):
            error = np.abs(follow(reference, cls, ESTIMATORS[way], rate, **options).error)
            periods = error.reshape(40, -1).max(axis=1)
            row = {
                "stage": stage,
                "estimator": way,
                "range_known": bool(options),
                "first_time": {"first_um": float(periods[10]), "settled_um": float(periods[18:20].max())},
                "second_time": {"first_um": float(periods[30]), "settled_um": float(periods[38:40].max())},
            }
            rows.append(row)
            print(row, flush=True)
    return rows


def scenarios(rate: float = 20_000.0) -> list[dict[str, Any]]:
    """Adaptation scenarios on the paper's stage: largest error per period."""
    from piezoest.bench.adaptation import follow as play

    rows = []
    for name, scenario in SCENARIOS.items():
        case = scenario.build(0, sample_rate=rate, rest=10.0)
        for estimator in ("HysteresisRLS", "PrandtlIshlinskiiRLS"):
            error = np.abs(play(case, estimator).error)
            period = int(case.period)
            n = error.size // period
            periods = error[: n * period].reshape(n, period).max(axis=1)
            after = int(case.change // period)
            rows.append(
                {
                    "scenario": name,
                    "estimator": estimator,
                    "worst_um": float(periods[after:].max()),
                    "settled_um": float(periods[-2:].max()),
                }
            )
            print(rows[-1], flush=True)
    return rows


# Of the simulated stages: resonance, delay of the amplifier's filter, and of the gauge's.
MECHANICS, AMPLIFIER_DELAY, GAUGE_DELAY = pz.MassSpringDamper(780.0, 0.02), 1.95e-5, 1.95e-5


def near_the_resonance() -> list[dict[str, Any]]:
    """Towards a twentieth of the resonance, with a lead and without; the sensor's delay is told to both."""
    rows = []
    for stage, cls in STAGES.items():
        for frequency, periods in ((5.0, 8), (20.0, 25), (39.0625, 40)):
            for shape in ("sine", "triangle"):
                reference = getattr(pz.signals, shape)(5.0, frequency, periods, RATE)
                errors = {}
                for way in ("without", "lead"):
                    compensator: Any = pz.InverseCompensator(START, pz.VoltageLimits(-100.0, 100.0))
                    options: dict[str, Any] = {"delay": GAUGE_DELAY * RATE}
                    if way == "lead":
                        compensator = pz.LeadFilter(
                            compensator, MECHANICS, sample_rate=RATE, delay=AMPLIFIER_DELAY
                        )
                        options = {"delay": (AMPLIFIER_DELAY + GAUGE_DELAY) * RATE, "mechanics": MECHANICS}
                    estimator = pz.PrandtlIshlinskiiRLS(RATE, initial_model=START, **options)
                    record = pz.track(
                        reference, stage=cls(RATE), compensator=compensator, estimator=estimator
                    )
                    errors[way] = {"max_um": record.max_error(2), "rms_um": record.rms_error(2)}
                rows.append({"stage": stage, "shape": shape, "frequency_Hz": frequency, "error": errors})
                print(rows[-1], flush=True)
    return rows


def small_triangle() -> list[dict[str, Any]]:
    """What is left of the smallest triangle on the paper's stage, and what of it has which cause."""
    reference = pz.signals.triangle(2.5, 5.0, 15, RATE)
    rows = []
    for name, parts, options in (
        ("as it is", {}, {}),
        ("sensor's delay told", {}, {"delay": GAUGE_DELAY * RATE}),
        ("without converter steps", {"quantisation": False}, {}),
        ("without resonance", {"mechanics": False}, {}),
        ("without noise", {"noise": 0.0}, {}),
    ):
        stage = functools.partial(pz.PaperStage, **parts)
        record = follow(reference, stage, pz.PrandtlIshlinskiiRLS, RATE, **options)
        rows.append({"case": name, "max_um": record.max_error(2), "rms_um": record.rms_error(2)})
        print(rows[-1], flush=True)
    return rows


def recording(folder: Path) -> dict[str, float]:
    """Rms errors [µm] of a model learnt in one pass over recorded data, the sensor one sample late."""
    model_file, test_file = (pz.read_record(folder / name) for name in ("model_1hz.csv", "test_1hz.csv"))
    u, x, rate = test_file.voltage, test_file.displacement, test_file.sample_rate
    late = np.concatenate([u[:1], u[:-1]])

    def learnt(voltage: Any, displacement: Any) -> pz.PrandtlIshlinskiiRLS:
        estimator = pz.PrandtlIshlinskiiRLS(rate, initial_model=RECORDING_START, delay=1.0)
        estimator.run(voltage, displacement)
        return estimator

    def free(estimator: pz.PrandtlIshlinskiiRLS, stop: int) -> Any:
        model = estimator.model
        assert isinstance(model, pz.PrandtlIshlinskii)
        return x[:stop] - model.simulate(late[:stop])

    half = u.size // 2
    first = free(learnt(u[:half], x[:half]), u.size)
    other = free(learnt(model_file.voltage, model_file.displacement), u.size)
    estimator = learnt(u[: 5 * PERIOD], x[: 5 * PERIOD])
    ahead = []
    for start in range(5 * PERIOD, u.size, PERIOD):
        stop = min(start + PERIOD, u.size)
        ahead.append(free(estimator, stop)[start:])
        estimator.run(u[start:stop], x[start:stop])
    rms = {
        "held_out_half_um": first[half:],
        "other_file_um": other,
        "other_file_without_mean_um": other - other.mean(),
        "one_period_ahead_um": np.concatenate(ahead),
    }
    found = {name: float(np.sqrt(np.mean(error**2))) for name, error in rms.items()}
    print(found, flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file to write")
    data = Path(os.environ.get("PIEZOEST_DATA") or Path(__file__).resolve().parents[2] / "shared" / "data")
    parser.add_argument("--data", type=Path, default=data, help="folder of the recordings")
    parser.add_argument("--only", nargs="*", help="parts to run; the file keeps its others")
    given = parser.parse_args()
    folder = given.data / "discrete_backlash_operator"
    document = {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "machine": describe_machine(),
        "versions": {"piezoest": pz.__version__},
        "conditions": {"sample_rate_Hz": RATE, "start": START.to_dict(), "seed": 0},
    }
    if given.only and given.json and given.json.is_file():
        # The date stays that of the parts that are kept; those run now have their own.
        document |= json.loads(given.json.read_text(encoding="utf-8"))
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    parts: dict[str, Callable[[], Any]] = {
        "recording": lambda: recording(folder) if folder.is_dir() else None,
        "amplitudes": amplitudes,
        "settled": settled,
        "scenarios": scenarios,
        "near_the_resonance": near_the_resonance,
        "small_triangle": small_triangle,
    }
    for name, part in parts.items():
        if not given.only or name in given.only:
            document[name] = part()
            document.setdefault("dates", {})[name] = now
    if given.json:
        given.json.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
