"""The runs of a campaign: what each is, the key it is kept under, and what happens if its process dies."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

from piezoest.bench.executors import in_processes
from piezoest.bench.origin import json_safe
from piezoest.bench.quiet import quiet
from piezoest.bench.zoo.contenders import code_of, contender
from piezoest.bench.zoo.drawing import draw
from piezoest.bench.zoo.dwelling import Dwell, play_dwell
from piezoest.bench.zoo.dwelling import died as dwell_died
from piezoest.bench.zoo.playing import Row, play
from piezoest.bench.zoo.settling import Cell, settle


@dataclass(frozen=True, slots=True)
class Task:
    """One run: a rig of the zoo, one cell of the map, or a long rest."""

    controller: str  # as `piezoest.bench.zoo.contenders.contender` reads it
    seed: int  # of the rig
    code: str  # fingerprint of what is run
    given: dict[str, Any] = field(default_factory=dict)  # what is not drawn, see `piezoest.bench.zoo.draw`
    cell: Cell | None = None  # of the map; then the run is `settle`
    dwell: Dwell | None = None  # a rest; then the run is `play_dwell`

    @property
    def key(self) -> str:
        """What the run's row is kept under."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


@quiet()
def carry_out(task: Task) -> Row:
    """Run a task."""
    known = {"key": task.key, "controller": task.controller}
    factory = contender(task.controller)
    if task.cell is not None:
        return {**known, **settle(task.cell, factory)}
    if task.dwell is not None:
        return {**known, **play_dwell(task.dwell, factory)}
    return {**known, **play(draw(task.seed, **task.given), factory)}


def died(task: Task) -> Row:
    """Row of a task whose process died over it."""
    if task.cell is not None:
        drawn: Row = {**asdict(task.cell), "segments": [], "asked": True}
    elif task.dwell is not None:
        drawn = dwell_died(task.dwell)
    else:
        drawn = draw(task.seed, **task.given).to_dict()
    row = {"key": task.key, "controller": task.controller, "seed": task.seed, **drawn}
    return dict(json_safe({**row, "failure": "the process died"}))


def runs(controller: str, seeds: range, given: dict[str, Any] | None = None) -> list[Task]:
    """Runs of a controller on the rigs of these seeds."""
    code = code_of(controller)
    return [Task(controller, seed, code, dict(given or {})) for seed in seeds]


def cells(controller: str, of: Sequence[Cell]) -> list[Task]:
    """Runs of a controller over the cells of the map. `of`: from `piezoest.bench.zoo.settling.cells`."""
    code = code_of(controller)
    return [Task(controller, cell.seed, code, cell=cell) for cell in of]


def rests(controller: str, of: Sequence[Dwell]) -> list[Task]:
    """Runs of a controller over long rests. `of`: from `piezoest.bench.zoo.dwelling.dwells`."""
    code = code_of(controller)
    return [Task(controller, dwell.seed, code, dwell=dwell) for dwell in of]


def over_cores(workers: int | None = None) -> Callable[[Iterable[Task]], Iterator[Row]]:
    """Run tasks in processes of this machine."""
    return partial(in_processes, carry_out, processes=workers, crashed=died)
