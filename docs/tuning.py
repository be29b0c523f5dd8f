"""Effect of memory, noise, excitation and delay on the default estimator: numbers of the page `tuning`.

Writes docs/data/tuning.json and docs/figures/tuning.png, in about a minute: python docs/tuning.py
"""

from dataclasses import replace
from typing import Any

import numpy as np
from page_parts import DOCS, Document

import piezoest as pz
from piezoest._files import save_figure
from piezoest.bench.figures import new_figure
from piezoest.bench.metrics import settles
from piezoest.bench.origin import origin, put
from piezoest.stage.paper import mechanics_and_instruments

RATE, FREQUENCY, AMPLITUDE = 10_000.0, 5.0, 5.0  # Hz, Hz, µm
SEEDS = 3
MEMORIES = (0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)  # s; the reference's period is 0.2 s
NOISES = (0.0, 1e-3, 10e-3, 30e-3, 100e-3)  # µm rms
NOISE_MEMORIES = (0.025, 0.1, 0.4)  # s
LAGS = (0, 2, 5, 10, 20)  # samples
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
LEARN, JUDGE = 3.0, 2.0  # s
BEFORE, AFTER = 4, 20  # periods before and after a change
LEVEL = 0.012  # of the amplitude: below it an error has settled
# Headings of the tables, which the figure reads.
WORST, SETTLED, NOISE, LAG = "worst [µm]", "settled [µm]", "noise [nm rms]", "lag [samples]"
DEFAULT, GIVEN, UNTOLD, TOLD = "default", "default, noise= given", "delay=0", "delay= the true lag"


def triangle(seconds: float, amplitude: float = AMPLITUDE) -> pz.Signal:
    return pz.signals.triangle(amplitude, FREQUENCY, seconds * FREQUENCY, RATE)


def late_stage(lag: int) -> pz.SimulatedStage:
    """The simulated stage, with a sensor that lags by whole samples."""
    paper, parts = pz.PaperStage(RATE), mechanics_and_instruments(RATE)
    parts["gauge"] = replace(parts["gauge"], delay=lag)
    return pz.SimulatedStage(hysteresis=paper.hysteresis, creep=paper.creep, **parts)


def learn(r: pz.Signal, stage: Any, estimator: Any, every: int = 50) -> pz.TrackingRecord:
    """Record of a loop that starts from `START`."""
    inverse = pz.InverseCompensator(START)
    return pz.track(r, stage=stage, compensator=inverse, estimator=estimator, update_interval=every)


def settled(stage: Any, **options: Any) -> float:
    """Largest error of the last two periods of a triangle [nm]."""
    estimator = pz.HysteresisRLS(RATE, initial_model=START, **options)
    return 1e3 * learn(triangle(LEARN), stage, estimator).max_error(last_periods=2)


def memories() -> list[Document]:
    """After the gain has fallen by 20 %: worst error, settled error, and periods until it has settled."""
    change = (BEFORE + 0.05) / FREQUENCY  # s, on a slope of the triangle
    schedule = [[0.0, 1.0], [change, 1.0], [change + 1.0 / RATE, 0.8]]
    rows = []
    for memory in ("period", *MEMORIES):
        errors = []
        for seed in range(SEEDS):
            stage = pz.PaperStage(RATE, seed, gain_schedule=schedule)
            estimator = pz.HysteresisRLS(RATE, initial_model=START, memory=memory)
            record = learn(triangle((BEFORE + AFTER) / FREQUENCY), stage, estimator, every=40)
            errors.append(record.max_error_per_period()[BEFORE:])
        error = np.median(errors, axis=0)
        rows.append(
            {
                "memory": "default" if memory == "period" else f"{memory:g} s",
                WORST: float(error.max()),
                SETTLED: float(error[AFTER // 2 :].max()),
                "settles after [periods]": settles(error, LEVEL * AMPLITUDE),
            }
        )
    return rows


def noises() -> list[Document]:
    """A sensor with noise; the estimator has the default `noise`, or the true one."""
    told: dict[str, dict[str, Any]] = {f"memory={memory:g}": {"memory": memory} for memory in NOISE_MEMORIES}
    return [
        {NOISE: 1e3 * noise}
        | {
            name: settled(pz.PaperStage(RATE, noise=noise), **options)
            for name, options in {DEFAULT: {}, GIVEN: {"noise": max(noise, 1e-4)}, **told}.items()
        }
        for noise in NOISES
    ]


def delays() -> list[Document]:
    """A sensor that lags; the estimator has no delay, or the true one."""
    return [
        {LAG: lag, UNTOLD: settled(late_stage(lag)), TOLD: settled(late_stage(lag), delay=float(lag))}
        for lag in LAGS
    ]


def references(seconds: float) -> dict[str, pz.Signal]:
    """Trajectories to learn on and to be judged on."""
    return {
        "triangle, 5 µm": triangle(seconds),
        "triangle, 2.5 µm": triangle(seconds, AMPLITUDE / 2.0),
        "growing and shrinking": pz.signals.amplitude_modulated(AMPLITUDE, FREQUENCY, 1.0, seconds, RATE),
        "two tones": pz.signals.two_tone([3.5, 1.5], [2.0, 7.0], seconds, RATE),
    }


def excitation() -> list[Document]:
    """Learnt on one trajectory, then frozen and used on all; largest error of the second half [nm]."""
    rows = []
    for new in (pz.HysteresisRLS, pz.PrandtlIshlinskiiRLS):
        for learnt, reference in references(LEARN).items():
            estimator = new(RATE, initial_model=START)
            learn(reference, pz.PaperStage(RATE), estimator)
            row: Document = {"estimator": new.__name__, "learnt on": learnt}
            for judged, other in references(JUDGE).items():
                inverse = pz.InverseCompensator(estimator.model)
                error = pz.track(other, stage=pz.PaperStage(RATE, seed=1), compensator=inverse).error
                row[judged] = 1e3 * float(np.max(np.abs(error[error.size // 2 :])))
            rows.append(row)
    return rows


def draw(document: Document) -> None:
    figure = new_figure(6, 9.5)
    first, middle, last = figure.subplots(3)
    default, *fixed = document["memories"]
    for name, color in ((WORST, "C3"), (SETTLED, "C0")):
        first.loglog(MEMORIES, [row[name] for row in fixed], "o-", color=color, label=f"memory=…: {name}")
        first.axhline(default[name], color=color, ls="--", lw=1.2, label=f"default: {name}")
    first.axvline(1.0 / FREQUENCY, color="0.6", lw=0.8, label="one period")
    first.set(xlabel="memory [s]", ylabel="largest error [µm]", title="The gain falls by 20 %")
    for axes, rows, x, title in (
        (middle, document["noises"], NOISE, "Noise of the sensor"),
        (last, document["delays"], LAG, "Lag of the sensor"),
    ):
        for name in list(rows[0])[1:]:
            axes.plot([row[x] for row in rows], [row[name] for row in rows], "o-", label=name)
        axes.set(xlabel=x, ylabel="largest error of the last 2 periods [nm]", title=title, ylim=(0.0, None))
    for axes in (first, middle, last):
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize="small")
    save_figure(figure, DOCS / "figures" / "tuning.png", dpi=130)


if __name__ == "__main__":
    found = {
        **origin(),
        "conditions": {"sample_rate_Hz": RATE, "amplitude_um": AMPLITUDE, "frequency_Hz": FREQUENCY},
        "memories": memories(),
        "noises": noises(),
        "excitation": excitation(),
        "delays": delays(),
    }
    put(found, DOCS / "data" / "tuning.json")
    draw(found)
