"""What memory, noise, excitation and delay do to the default estimator: numbers of the page `tuning`.

Writes docs/data/tuning.json and docs/figures/tuning.png, in about a minute.

    python docs/tuning.py [--json FILE] [--figure FILE]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import piezoest as pz
from piezoest._files import save_figure
from piezoest.bench.origin import origin, put
from piezoest.bench.run import Task, play

RATE, FREQUENCY, AMPLITUDE = 10_000.0, 5.0, 5.0  # Hz, Hz, µm
SEEDS = 3
MEMORIES = (0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)  # s; the reference's period is 0.2 s
NOISES = (0.0, 1e-3, 10e-3, 30e-3, 100e-3)  # µm rms
NOISE_MEMORIES = (0.025, 0.1, 0.4)  # s
LAGS = (0, 2, 5, 10, 20)  # samples
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
LEARN, JUDGE = 3.0, 2.0  # s


def settled(reference: pz.Signal, gauge_noise: float, **options: Any) -> float:
    """Largest error of the last two periods on the simulated stage [µm]."""
    record = pz.track(
        reference,
        stage=pz.PaperStage(RATE, seed=0, noise=gauge_noise),
        compensator=pz.InverseCompensator(START),
        estimator=pz.HysteresisRLS(RATE, initial_model=START, **options),
    )
    return float(record.max_error(last_periods=2))


def memories() -> list[dict[str, Any]]:
    """After a step of the gain by 20 %: worst and settled error, and how long it takes."""
    names = ["HysteresisRLS", *(f"HysteresisRLS(memory={memory:g})" for memory in MEMORIES)]
    given = {"sample_rate": RATE, "after": 20}
    rows = {name: [play(Task("gain-step", name, seed, given)) for seed in range(SEEDS)] for name in names}
    return [
        {
            "estimator": name,
            "memory_s": memory,
            **{
                key: sorted(float("inf") if row[column] is None else row[column] for row in rows[name])[
                    SEEDS // 2
                ]
                for key, column in (
                    ("worst_um", "worst"),
                    ("settled_um", "settled"),
                    ("settling_periods", "settles"),
                )
            },
        }
        for name, memory in zip(names, (None, *MEMORIES), strict=True)
    ]


def noises() -> list[dict[str, Any]]:
    """With more noise in the gauge than the estimator is told, and as much."""
    r = pz.signals.triangle(AMPLITUDE, FREQUENCY, LEARN * FREQUENCY, RATE)
    return [
        {
            "noise_um": noise,
            "untold_um": settled(r, noise),
            "told_um": settled(r, noise, noise=max(noise, 1e-4)),
            **{f"memory_{memory:g}_um": settled(r, noise, memory=memory) for memory in NOISE_MEMORIES},
        }
        for noise in NOISES
    ]


def references(seconds: float) -> dict[str, pz.Signal]:
    """Trajectories to learn on and to be judged on."""
    signals = pz.signals
    return {
        "triangle, 5 µm": signals.triangle(AMPLITUDE, FREQUENCY, seconds * FREQUENCY, RATE),
        "triangle, 2.5 µm": signals.triangle(AMPLITUDE / 2.0, FREQUENCY, seconds * FREQUENCY, RATE),
        "growing and shrinking": signals.amplitude_modulated(
            AMPLITUDE, FREQUENCY, 1.0, seconds, RATE, depth=0.5
        ),
        "two tones": signals.two_tone([3.5, 1.5], [2.0, 7.0], seconds, RATE),
    }


def excitation() -> list[dict[str, Any]]:
    """Learnt on one trajectory, frozen, and judged on all [µm]."""
    kinds: dict[str, Callable[[], Any]] = {
        "HysteresisRLS": lambda: pz.HysteresisRLS(RATE, initial_model=START),
        "PrandtlIshlinskiiRLS": lambda: pz.PrandtlIshlinskiiRLS(RATE),
    }
    rows = []
    for name, new in kinds.items():
        for learnt, reference in references(LEARN).items():
            estimator = new()
            pz.track(
                reference,
                stage=pz.PaperStage(RATE, seed=0),
                compensator=pz.InverseCompensator(START),
                estimator=estimator,
            )
            row: dict[str, Any] = {"estimator": name, "learnt": learnt}
            for judged, other in references(JUDGE).items():
                record = pz.track(
                    other,
                    stage=pz.PaperStage(RATE, seed=1),
                    compensator=pz.InverseCompensator(estimator.model),
                )
                # Half of it, for the stage starts without a history.
                row[judged] = float(np.max(np.abs(record.error[record.error.size // 2 :])))
            rows.append(row)
    return rows


class LateStage:
    """The simulated stage, with a sensor that lags by whole samples."""

    sample_rate = RATE

    def __init__(self, lag: int) -> None:
        self._stage = pz.PaperStage(RATE, seed=0)
        self._waiting = [0.0] * lag

    def step(self, u: float) -> float:
        self._waiting.append(self._stage.step(u))
        return self._waiting.pop(0)

    @property
    def displacement(self) -> float:
        return float(self._stage.displacement)


def delays() -> list[dict[str, Any]]:
    """A sensor that lags, and an estimator that is told of it or not."""
    r = pz.signals.triangle(AMPLITUDE, FREQUENCY, LEARN * FREQUENCY, RATE)
    rows = []
    for lag in LAGS:
        row: dict[str, Any] = {"lag_samples": lag}
        for name, delay in (("untold", 0.0), ("told", float(lag))):
            record = pz.track(
                r,
                stage=LateStage(lag),
                compensator=pz.InverseCompensator(START),
                estimator=pz.HysteresisRLS(RATE, initial_model=START, delay=delay),
            )
            row[f"{name}_um"] = float(record.max_error(last_periods=2))
        rows.append(row)
    return rows


def draw(document: dict[str, Any], path: Path) -> None:
    """Memory, noise and delay, side by side."""
    import matplotlib.pyplot as plt

    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13, 3.9), layout="constrained")
    default, *fixed = document["memories"]
    memory = [row["memory_s"] for row in fixed]
    for key, color, label in (("worst_um", "C3", "worst, after the step"), ("settled_um", "C0", "settled")):
        left.loglog(memory, [row[key] for row in fixed], "o-", color=color, label=f"memory=…: {label}")
        left.axhline(default[key], color=color, ls="--", lw=1.2, label=f"default: {label}")
    left.axvline(1.0 / FREQUENCY, color="0.6", lw=0.8)
    left.annotate("one period", (1.0 / FREQUENCY, left.get_ylim()[1]), (3, -12), textcoords="offset points",
                  color="0.4", fontsize="small")  # fmt: skip
    left.set(xlabel="memory [s]", ylabel="largest error [µm]", title="The gain falls by 20 %")
    rows = document["noises"]
    noise = [1e3 * row["noise_um"] for row in rows]
    for key, style, label in (
        ("untold_um", "o-", "default"),
        ("told_um", "s--", "default, noise= as it is"),
        *((f"memory_{memory:g}_um", "^-", f"memory={memory:g}") for memory in NOISE_MEMORIES),
    ):
        middle.plot(noise, [1e3 * row[key] for row in rows], style, label=label)
    middle.set(
        xlabel="noise of the sensor [nm rms]", ylabel="largest settled error [nm]", title="Noise",
        ylim=(0.0, None),
    )  # fmt: skip
    rows = document["delays"]
    lag = [1e3 * row["lag_samples"] / RATE for row in rows]
    for key, style, label in (("untold_um", "o-", "delay=0"), ("told_um", "s--", "delay= as it is")):
        right.plot(lag, [1e3 * row[key] for row in rows], style, label=label)
    right.set(
        xlabel="lag of the sensor [ms]", ylabel="largest settled error [nm]", title="A sensor that lags",
        ylim=(0.0, None),
    )  # fmt: skip
    for axes in (left, middle, right):
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize="small")
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    docs = Path(__file__).resolve().parent
    parser.add_argument("--json", type=Path, default=docs / "data" / "tuning.json")
    parser.add_argument("--figure", type=Path, default=docs / "figures" / "tuning.png")
    given = parser.parse_args()
    document = {
        **origin(),
        "conditions": {"sample_rate_Hz": RATE, "amplitude_um": AMPLITUDE, "frequency_Hz": FREQUENCY},
        "memories": memories(),
        "noises": noises(),
        "excitation": excitation(),
        "delays": delays(),
    }
    put(document, given.json)
    draw(document, given.figure)


if __name__ == "__main__":
    main()
