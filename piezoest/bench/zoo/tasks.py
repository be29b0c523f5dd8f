"""The runs of a campaign: what each is, the key it is kept under, and what happens if its process dies."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

from piezoest.bench.adaptation import json_safe
from piezoest.bench.executors import in_processes
from piezoest.bench.quiet import quiet
from piezoest.bench.store import Store
from piezoest.bench.zoo.contenders import code_of, contender
from piezoest.bench.zoo.drawing import draw
from piezoest.bench.zoo.playing import Row, play
from piezoest.bench.zoo.settling import Cell, settle


@dataclass(frozen=True, slots=True)
class Task:
    """One run: a rig of the zoo, or one cell of the map.

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
    """

    controller: str
    seed: int
    code: str
    given: dict[str, Any] = field(default_factory=dict)
    cell: Cell | None = None

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
    return {**known, **play(draw(task.seed, **task.given), factory)}


def died(task: Task) -> Row:
    """Row of a task whose process died over it.

    Parameters
    ----------
    task : Task
        What was to be run.
    """
    cell = {} if task.cell is None else {**asdict(task.cell), "segments": [], "asked": True}
    drawn = draw(task.seed, **task.given).to_dict() if task.cell is None else {}
    row = {"key": task.key, "controller": task.controller, "seed": task.seed, **drawn, **cell}
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


def carry_out_all(
    tasks: Sequence[Task],
    store: Store,
    workers: int | None = None,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> int:
    """Run what the store does not hold yet; returns how many that were.

    Parameters
    ----------
    tasks : sequence of Task
        The whole campaign.
    store : Store
        Open; holds all of their rows afterwards.
    workers : int, optional
        Processes; default one for each core.
    progress : callable
        Called with the number of finished runs and of all, at first and after each.
    """
    execute: Any = partial(in_processes, carry_out, processes=workers, crashed=died)
    todo = [task for task in tasks if task.key not in store]
    done = len(tasks) - len(todo)
    progress(done, len(tasks))
    for row in execute(todo):
        if store.append(row):
            done += 1
            progress(done, len(tasks))
    return len(todo)
