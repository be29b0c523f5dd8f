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
    """One run: a rig of the zoo, one cell of the map, or a long rest.

    Parameters
    ----------
    controller : str
        As `piezoest.bench.zoo.contenders.contender` reads it.
    seed : int
        Of the rig.
    code : str
        Fingerprint of what is run.
    given : dict
        What is not drawn, see `piezoest.bench.zoo.draw`.
    cell : Cell, optional
        Of the map; then the run is `settle`.
    dwell : Dwell, optional
        A rest; then the run is `play_dwell`.
    """

    controller: str
    seed: int
    code: str
    given: dict[str, Any] = field(default_factory=dict)
    cell: Cell | None = None
    dwell: Dwell | None = None

    @property
    def key(self) -> str:
        """What the run's row is kept under."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


@quiet()
def carry_out(task: Task) -> Row:
    """Run a task.

    Parameters
    ----------
    task : Task
        What to run.
    """
    known = {"key": task.key, "controller": task.controller}
    factory = contender(task.controller)
    if task.cell is not None:
        return {**known, **settle(task.cell, factory)}
    if task.dwell is not None:
        return {**known, **play_dwell(task.dwell, factory)}
    return {**known, **play(draw(task.seed, **task.given), factory)}


def died(task: Task) -> Row:
    """Row of a task whose process died over it.

    Parameters
    ----------
    task : Task
        What was to be run.
    """
    if task.cell is not None:
        drawn: Row = {**asdict(task.cell), "segments": [], "asked": True}
    elif task.dwell is not None:
        drawn = dwell_died(task.dwell)
    else:
        drawn = draw(task.seed, **task.given).to_dict()
    row = {"key": task.key, "controller": task.controller, "seed": task.seed, **drawn}
    return dict(json_safe({**row, "failure": "the process died"}))


def runs(controller: str, seeds: range, given: dict[str, Any] | None = None) -> list[Task]:
    """Runs of a controller on the rigs of these seeds.

    Parameters
    ----------
    controller : str
        As `contender` reads it.
    seeds : range
        Of the rigs.
    given : dict, optional
        What is not drawn.
    """
    code = code_of(controller)
    return [Task(controller, seed, code, dict(given or {})) for seed in seeds]


def cells(controller: str, of: Sequence[Cell]) -> list[Task]:
    """Runs of a controller over the cells of the map.

    Parameters
    ----------
    controller : str
        As `contender` reads it.
    of : sequence of Cell
        From `piezoest.bench.zoo.settling.cells`.
    """
    code = code_of(controller)
    return [Task(controller, cell.seed, code, cell=cell) for cell in of]


def rests(controller: str, of: Sequence[Dwell]) -> list[Task]:
    """Runs of a controller over long rests.

    Parameters
    ----------
    controller : str
        As `contender` reads it.
    of : sequence of Dwell
        From `piezoest.bench.zoo.dwelling.dwells`.
    """
    code = code_of(controller)
    return [Task(controller, dwell.seed, code, dwell=dwell) for dwell in of]


def over_cores(workers: int | None = None) -> Callable[[Iterable[Task]], Iterator[Row]]:
    """Run tasks in processes of this machine.

    Parameters
    ----------
    workers : int, optional
        How many; default one for each core.
    """
    return partial(in_processes, carry_out, processes=workers, crashed=died)
