"""How soon a controller settles: over amplitude, frequency and family, after each kind of change.

A run goes through `SEGMENTS`. It is settled from the period on after which the largest error of each stays
within 1.2 % of the amplitude, or three times the noise. The stage has a resonance. Settling soon is asked for
where the reference is slow beside it, and large beside the noise.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from piezoest import signals
from piezoest.bench.metrics import SETTLED, settles
from piezoest.bench.origin import json_safe
from piezoest.bench.store import Row
from piezoest.bench.zoo.drawing import draw
from piezoest.bench.zoo.families import log_uniform
from piezoest.bench.zoo.faults import Fault
from piezoest.bench.zoo.references import Reference
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Factory, run_controller
from piezoest.bench.zoo.summary import failures, grouped

AMPLITUDES = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0)  # µm
FREQUENCIES = (1.0, 3.0, 10.0, 30.0)  # Hz
NOISES = 3.0
PERIOD, SLOWEST = 1000, 4000.0  # samples in a period, and Hz of the sample rate, at least
REACH = 100.0  # V, to both sides
GAINS = (0.05, 0.5)  # µm/V
FREE = 1.3  # reach over what the amplitude needs, at least
NOISE = (2e-4, 2e-3)  # µm
# Steps of both converters. With 16 bits those of the voltage shake the resonance: even an inverse without any
# error would miss by more than is allowed in up to 8 of 20 runs of a place with small waves.
STEPS = 2.0**20
RESONANCES = (400.0, 780.0)  # Hz
SLOW, LARGE = 0.025, 100.0  # frequency over the resonance at most, amplitude over the noise at least
SOON, ENOUGH = 2, 0.95  # periods in which all is to settle, in so many of the runs of a cell
# Kinds of stages, of which the first and the last are of the families that some estimators learn.
KINDS = ("paper", "relays", "bouc-wen", "duhem", "coleman-hodgdon")

# Name, factor of the amplitude, and periods; the last one starts with a step of the gain.
SEGMENTS = (
    ("cold-start", 1.0, 6), ("switch", 0.6, 4), ("drop", 0.2, 4), ("switch-back", 1.0, 4),
    ("gain-step", 1.0, 6),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Cell:
    """A place of the map, and a seed."""

    family: str  # name in `piezoest.bench.zoo.families.FAMILIES`
    amplitude: float  # [µm]
    frequency: float  # [Hz]
    seed: int  # of what is drawn

    def play(self, factory: Factory) -> Row:
        """Run a controller over it; with the periods until it settled in each segment, None if it did not."""
        rig = cell_rig(self)
        row = self._row(rig)
        run, _ = run_controller(rig, factory(rig.sample_rate, limits=rig.limits))
        worst = np.abs(run.error).reshape(-1, rig.plain.cycle).max(axis=1)
        first = 0
        for name, factor, periods in SEGMENTS:
            allowed = max(SETTLED * factor * self.amplitude, NOISES * rig.noise)
            part = worst[first : first + periods]
            found = {"periods": settles(part, allowed), "error": float(part[-1]), "allowed": allowed}
            row["segments"].append({"change": name, **found})
            first += periods
        return json_safe(row)

    def drawn(self) -> Row:
        """The place, and what was drawn."""
        return self._row(cell_rig(self))

    def _row(self, rig: Rig) -> Row:
        return {**asdict(self), "gain": rig.gain, "width": rig.width, "block": rig.block, "noise": rig.noise,
                "mechanics": rig.around.mechanics, "asked": asked(rig), "failure": None,
                "segments": []}  # fmt: skip


def tidy_cells(rows: Iterable[Row]) -> Iterator[Row]:
    """A row for each change of each run of the map."""
    for row in rows:
        place = {name: value for name, value in row.items() if name != "segments"}
        for segment in row["segments"] or [{}]:
            yield {**place, **segment}


def cells(seeds: Sequence[int], families: Sequence[str] = KINDS) -> list[Cell]:
    """All places of the map."""
    return [Cell(*each) for each in itertools.product(families, AMPLITUDES, FREQUENCIES, seeds)]


def cell_rig(cell: Cell) -> Rig:
    """Rig of a cell: an ideal one but for noise and steps, and for the gain that changes in the end."""
    rng = np.random.default_rng([cell.seed, 24])
    gain = log_uniform(rng, max(GAINS[0], FREE * cell.amplitude / REACH), GAINS[1])
    period = max(PERIOD, round(SLOWEST / cell.frequency))
    rig = draw(
        cell.seed, family=cell.family, limits="±100", gain=gain, sample_rate=period * cell.frequency,
        reference="triangle", amplitude=cell.amplitude, frequency=cell.frequency, waves=12,
        mechanics=f"{rng.uniform(*RESONANCES):.0f} Hz", delay=0, slew=np.inf,
        noise=log_uniform(rng, *NOISE),
        resolution=2.0 * REACH * gain / STEPS, volts=2.0 * REACH / STEPS, creep=0.0,
        hum=0.0, drift=0.0, fault="none",
        block=int(rng.choice([10, 50])) * period // PERIOD,
    )  # fmt: skip
    parts = [
        signals.triangle(factor * cell.amplitude, cell.frequency, periods, rig.sample_rate).values
        for _, factor, periods in SEGMENTS
    ]
    values = np.concatenate(parts)
    begins = values.size - SEGMENTS[-1][2] * period
    size = float(rng.choice([0.7, 1.3])) if FREE * cell.amplitude < 0.6 * gain * REACH else 1.3
    return replace(
        rig,
        plain=Reference("triangle", values, cell.amplitude, 0.0, cell.frequency, float(period), period, 0),
        fault=Fault("gain-step", begins, values.size, size, lasting=True),
    )


def asked(rig: Rig) -> bool:
    """Whether it is asked for that all settles soon."""
    slow = rig.plain.frequency <= SLOW * rig.around.resonance[0]
    return bool(slow and rig.plain.amplitude >= LARGE * rig.noise)


def summarise_cells(rows: Iterable[Row]) -> dict[str, Any]:
    """Sum up the map: shares of runs that settled soon."""
    rows = list(rows)
    asked = [row for row in rows if row["asked"]]
    others = [row for row in rows if not row["asked"]]
    found = grouped(asked, "family", "amplitude", "frequency", of=_shares)
    return {
        "runs": len(rows),
        "failures": failures(rows),
        "others": len(others),
        "cells": {
            "asked": len(found),
            "kept": {name: sum(cell[name] >= ENOUGH for cell in found) for name, _, _ in SEGMENTS},
        },
        "by_family": grouped(asked, "family", of=_shares),
        "by_place": grouped(asked, "amplitude", "frequency", of=_shares),
        "other_places": grouped(others, "amplitude", "frequency", of=_shares),
    }


def _shares(rows: Sequence[Row]) -> dict[str, Any]:
    """Share of runs that settled soon after each change, and median of the periods."""
    found: dict[str, Any] = {"runs": len(rows)}
    for k, (name, _, _) in enumerate(SEGMENTS):
        periods = [row["segments"][k]["periods"] if row["segments"] else None for row in rows]
        found[name] = float(np.mean([each is not None and each <= SOON for each in periods]))
        median = float(np.median([np.inf if each is None else each for each in periods]))
        found[f"{name} periods"] = None if np.isinf(median) else median
    return found
