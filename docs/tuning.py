"""Effect of memory, noise, excitation and delay on the default estimator: numbers of the page `tuning`.

Writes docs/data/tuning.json and docs/figures/tuning.png, in about a minute: python docs/tuning.py
"""

from typing import Any

import numpy as np
from page_parts import DOCS, Document

import piezoest as pz
from piezoest._files import save_figure
from piezoest.bench.origin import origin, put
from piezoest.stage import PaperStage

RATE, FREQUENCY, AMPLITUDE = 10_000.0, 5.0, 5.0  # Hz, Hz, µm
SEEDS = 3
MEMORIES = (0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)  # s; the reference's period is 0.2 s
NOISES = (0.0, 1e-3, 10e-3, 30e-3, 100e-3)  # µm rms
NOISE_MEMORIES = (0.025, 0.1, 0.4)  # s
LAGS = (0, 2, 5, 10, 20)  # samples
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
LEARN, JUDGE = 3.0, 2.0  # s
BEFORE, AFTER = 4, 20  # periods before and after a change
INTERVAL = 40  # samples between two models
LEVEL = 0.012  # of the amplitude: below it an error has settled
# Headings of the tables, which the figure reads.
WORST, SETTLED, NOISE, LAG = "worst [µm]", "settled [µm]", "noise [nm rms]", "lag [samples]"
DEFAULT, GIVEN, UNTOLD, TOLD = "default", "default, noise= given", "delay=0", "delay= the true lag"


class LateStage:
    """The simulated stage, with a sensor that lags by whole samples."""

    sample_rate = RATE

    def __init__(self, lag: int = 0, **options: Any) -> None:
        self._stage = PaperStage(RATE, **{"seed": 0, **options})
        self._waiting = [0.0] * lag

    def step(self, u: float) -> float:
        self._waiting.append(self._stage.step(u))
        return self._waiting.pop(0)

    @property
    def displacement(self) -> float:
        return float(self._stage.displacement)


def settled(stage: LateStage, **options: Any) -> float:
    """Largest error of the last two periods of a triangle [nm]."""
    record = pz.track(
        pz.signals.triangle(AMPLITUDE, FREQUENCY, LEARN * FREQUENCY, RATE),
        stage=stage,
        compensator=pz.InverseCompensator(START),
        estimator=pz.HysteresisRLS(RATE, initial_model=START, **options),
    )
    return 1e3 * float(record.max_error(last_periods=2))


def follow(r: pz.Signal, stage: PaperStage, estimator: pz.HysteresisRLS) -> Any:
    """True errors of a plain loop [µm]: every model that is learnt is used."""
    compensator, errors = pz.InverseCompensator(START), []
    for k, r_k in enumerate(r.values.tolist()):
        u = compensator.step(r_k)
        estimator.step(u, stage.step(u))
        errors.append(r_k - stage.displacement)
        if k % INTERVAL == 0:
            compensator.model = estimator.model
    return np.array(errors)


def memories() -> list[Document]:
    """After the gain has fallen by 20 %: worst error, settled error, and periods until it has settled."""
    r = pz.signals.triangle(AMPLITUDE, FREQUENCY, BEFORE + AFTER, RATE)
    change = (BEFORE + 0.05) / FREQUENCY  # s, on a slope of the triangle
    schedule = [[0.0, 1.0], [change, 1.0], [change + 1.0 / RATE, 0.8]]
    rows = []
    for memory in ("period", *MEMORIES):
        errors = []
        for seed in range(SEEDS):
            estimator = pz.HysteresisRLS(RATE, initial_model=START, memory=memory)
            error = follow(r, PaperStage(RATE, seed=seed, gain_schedule=schedule), estimator)
            errors.append(np.abs(error).reshape(BEFORE + AFTER, -1).max(axis=1)[BEFORE:])
        error = np.median(errors, axis=0)
        late = np.flatnonzero(error > LEVEL * AMPLITUDE)
        settled = 0 if late.size == 0 else int(late[-1]) + 1
        rows.append(
            {
                "memory": "default" if memory == "period" else f"{memory:g} s",
                WORST: float(error.max()),
                SETTLED: float(error[AFTER // 2 :].max()),
                "settles after [periods]": settled if settled < AFTER else None,
            }
        )
    return rows


def noises() -> list[Document]:
    """A sensor with noise; the estimator has the default `noise`, or the true one."""
    return [
        {
            NOISE: 1e3 * noise,
            DEFAULT: settled(LateStage(noise=noise)),
            GIVEN: settled(LateStage(noise=noise), noise=max(noise, 1e-4)),
            **{
                f"memory={memory:g}": settled(LateStage(noise=noise), memory=memory)
                for memory in NOISE_MEMORIES
            },
        }
        for noise in NOISES
    ]


def delays() -> list[Document]:
    """A sensor that lags; the estimator has no delay, or the true one."""
    return [
        {LAG: lag, UNTOLD: settled(LateStage(lag)), TOLD: settled(LateStage(lag), delay=float(lag))}
        for lag in LAGS
    ]


def references(seconds: float) -> dict[str, pz.Signal]:
    """Trajectories to learn on and to be judged on."""
    signals = pz.signals
    return {
        "triangle, 5 µm": signals.triangle(AMPLITUDE, FREQUENCY, seconds * FREQUENCY, RATE),
        "triangle, 2.5 µm": signals.triangle(AMPLITUDE / 2.0, FREQUENCY, seconds * FREQUENCY, RATE),
        "growing and shrinking": signals.amplitude_modulated(AMPLITUDE, FREQUENCY, 1.0, seconds, RATE),
        "two tones": signals.two_tone([3.5, 1.5], [2.0, 7.0], seconds, RATE),
    }


def excitation() -> list[Document]:
    """Learnt on one trajectory, then frozen and used on all; largest error of the second half [nm]."""
    rows = []
    for new in (pz.HysteresisRLS, pz.PrandtlIshlinskiiRLS):
        for learnt, reference in references(LEARN).items():
            estimator, compensator = new(RATE, initial_model=START), pz.InverseCompensator(START)
            pz.track(reference, stage=PaperStage(RATE, seed=0), compensator=compensator, estimator=estimator)
            row: Document = {"estimator": new.__name__, "learnt on": learnt}
            for judged, other in references(JUDGE).items():
                inverse = pz.InverseCompensator(estimator.model)
                error = pz.track(other, stage=PaperStage(RATE, seed=1), compensator=inverse).error
                row[judged] = 1e3 * float(np.max(np.abs(error[error.size // 2 :])))
            rows.append(row)
    return rows


def draw(document: Document) -> None:
    import matplotlib.pyplot as plt

    figure, (first, middle, last) = plt.subplots(3, 1, figsize=(6, 9.5), layout="constrained")
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
        axes.set(xlabel=x, ylabel="largest settled error [nm]", title=title, ylim=(0.0, None))
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
