"""Whether a controller goes on after a long rest as it did before.

A healthy rig follows a wave, rests for a minute at a point of it, exactly or with noise in the reference, and
follows it again, with feedback and without. In the very first period its largest error is to be as it was.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piezoest.bench.origin import json_safe
from piezoest.bench.store import Row
from piezoest.bench.zoo.drawing import draw
from piezoest.bench.zoo.families import FAMILIES, log_uniform
from piezoest.bench.zoo.faults import NONE
from piezoest.bench.zoo.judging import BACK, NEGLIGIBLE, NOISES, settled
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Factory, run_controller
from piezoest.bench.zoo.summary import failures, grouped, median, values

DURATION = 60.0  # s
SHAPES = ("triangle", "sine", "raster")
SAMPLE_RATES = (1e3, 1e4)  # Hz: a minute at more takes long
FREQUENCIES = (1.0, 20.0)  # Hz
BEFORE, AFTER = 12, 4  # periods
CALLS = 32  # in a period
NOISE = (1e-4, 1e-3)  # µm, of the reference that rests
FEEDBACK = (0.5, 5.0)  # 1/s
PERIODS = ("first", "second", "third")
WAYS = ("creep", "feedback", "noise")


@dataclass(frozen=True, slots=True)
class Dwell:
    """A rest on some rig."""

    seed: int  # of all that is drawn
    feedback: bool  # whether the controller is given ``feedback=``
    duration: float = DURATION  # of the rest [s]

    def play(self, factory: Factory) -> Row:
        """Let a controller rest, and go on.

        Returns ``settled``: median of the largest errors of the last three periods before; ``allowed``: 1.2
        times the largest of it, three times the noise and 0.2 % of the swing; ``first``, ``second``,
        ``third``: largest errors of the periods after, all [µm]; ``kept``: whether the first is allowed;
        ``excursion``: how far the voltage went in the rest, over its swing before.
        """
        rig, rest, drawn = dwell_rig(self)
        options = {"feedback": drawn["feedback"]} if self.feedback else {}
        run, _ = run_controller(rig, factory(rig.sample_rate, limits=rig.limits, **options))
        off, cycle, u = np.abs(run.error), rig.plain.cycle, run.voltage
        level = settled(off[: rest.start], cycle) or 0.0
        allowed = BACK * max(level, NOISES * rig.noise, 2.0 * NEGLIGIBLE * rig.plain.amplitude)
        after = off[rest.stop : rest.stop + len(PERIODS) * cycle].reshape(-1, cycle).max(axis=1).tolist()
        swing = float(np.ptp(u[rest.start - cycle : rest.start]))
        gone = float(np.max(np.abs(u[rest] - u[rest.start - 1])))
        return json_safe(
            {
                **self._row(rig, drawn),
                "settled": level,
                "allowed": allowed,
                **dict(zip(PERIODS, after, strict=True)),
                "kept": after[0] <= allowed,
                "excursion": gone / swing if swing > 0.0 else None,
            }
        )

    def drawn(self) -> Row:
        """What the rig is, and the rest."""
        rig, _, drawn = dwell_rig(self)
        return self._row(rig, drawn)

    def _row(self, rig: Rig, drawn: dict[str, float]) -> Row:
        return {**rig.to_dict(), **drawn, "duration": self.duration, "failure": None}


def dwells(seeds: Sequence[int], duration: float = DURATION) -> list[Dwell]:
    """All rests on the rigs of these seeds, without feedback and with it. `duration`: [s]."""
    return [Dwell(seed, feedback, duration) for seed in seeds for feedback in (False, True)]


def dwell_rig(dwell: Dwell) -> tuple[Rig, slice, dict[str, float]]:
    """Rig of a dwell, the samples in which its reference rests, and what is drawn beside."""
    rng = np.random.default_rng([dwell.seed, 25])
    sample_rate = float(rng.choice(SAMPLE_RATES))
    period = round(sample_rate / log_uniform(rng, *FREQUENCIES))
    rig = draw(
        dwell.seed, family=list(FAMILIES)[dwell.seed % len(FAMILIES)], sample_rate=sample_rate,
        reference=str(rng.choice(SHAPES)), frequency=sample_rate / period, waves=float(BEFORE + AFTER + 1),
        fault=NONE, drift=0.0, block=max(1, period // CALLS),
    )  # fmt: skip
    plain = rig.plain
    start = plain.begins + BEFORE * period + int(rng.integers(period))
    noise = log_uniform(rng, *NOISE) if rng.random() < 0.5 else 0.0
    gain = log_uniform(rng, *FEEDBACK)
    rest = plain.values[start - 1] + noise * rng.normal(size=round(dwell.duration * sample_rate))
    values = np.concatenate((plain.values[:start], rest, plain.values[start : start + AFTER * period]))
    drawn = {"setpoint_noise": noise, "feedback": gain if dwell.feedback else 0.0}
    return replace(rig, plain=replace(plain, values=values)), slice(start, start + rest.size), drawn


def summarise_dwells(rows: Iterable[Row]) -> dict[str, Any]:
    """Sum up rests: by whether the stage creeps, and there is feedback, and noise in the reference."""
    given = dict(zip(WAYS, ("creep", "feedback", "setpoint_noise"), strict=True))
    rows = [{**row, **{name: row[column] > 0.0 for name, column in given.items()}} for row in rows]
    judged = [row for row in rows if row["failure"] is None]
    broken = sorted((row for row in judged if not row["kept"]), key=_ratio, reverse=True)
    summary = {
        "runs": len(rows),
        "failures": failures(rows),
        "rigs": len({row["seed"] for row in rows}),
        "kept": sum(row["kept"] for row in judged),
        "duration": max((row["duration"] for row in rows), default=0.0),
        "groups": grouped(rows, *WAYS, of=_summed),
        "by_family": grouped(rows, "family", of=_summed),
        "worst": [
            {"seed": row["seed"], "feedback": row["feedback"], "ratio": _ratio(row)} for row in broken[:10]
        ],
    }
    return json_safe(summary)


def _ratio(row: Row, period: str = "first") -> float:
    """Largest error of a period over what is allowed; infinite where it is no number."""
    value = row[period]
    return np.inf if value is None else float(value / row["allowed"])


def _summed(rows: Sequence[Row]) -> dict[str, Any]:
    judged = [row for row in rows if row["failure"] is None]
    gone = values(judged, "excursion")
    return {
        "runs": len(rows),
        "kept": sum(row["kept"] for row in judged),
        **{period: median([_ratio(row, period) for row in judged]) for period in PERIODS},
        "largest": max(map(_ratio, judged), default=None),
        "excursion": median(gone),
        "farthest": max(gone, default=None),
    }
