"""The runs of a campaign: what each is, the key it is kept under, and what happens if it fails."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from piezoest.bench.executors import in_processes, quiet
from piezoest.bench.origin import code_of, json_safe
from piezoest.bench.store import Keyed, Row
from piezoest.bench.zoo.contenders import contender
from piezoest.bench.zoo.drawing import draw
from piezoest.bench.zoo.judging import play
from piezoest.bench.zoo.running import Factory


@dataclass(frozen=True, slots=True)
class Drawn:
    """A rig of the zoo."""

    seed: int
    given: dict[str, Any]  # what is not drawn, see `piezoest.bench.zoo.draw`

    def play(self, factory: Factory) -> Row:
        """Let a controller drive it."""
        return play(draw(self.seed, **self.given), factory)

    def drawn(self) -> Row:
        """The rig's numbers."""
        return draw(self.seed, **self.given).to_dict()


@dataclass(frozen=True, slots=True)
class Task(Keyed):
    """One run."""

    controller: str  # as `piezoest.bench.zoo.contenders.contender` reads it
    of: Any  # what is played: `Drawn`, a `settling.Cell` of the map, or a long rest, a `dwelling.Dwell`
    code: str  # fingerprint of what is run


@quiet()
def carry_out(task: Task) -> Row:
    """Run a task; what it raises is its ``failure``."""
    try:
        return _row(task, task.of.play(contender(task.controller)))
    except Exception as error:
        return _row(task, {**task.of.drawn(), "failure": f"{type(error).__name__}: {error}"})


def died(task: Task) -> Row:
    """Row of a task whose process died over it."""
    return _row(task, {**task.of.drawn(), "failure": "the process died"})


def _row(task: Task, found: Row) -> Row:
    return json_safe({"key": task.key, "controller": task.controller, **found})


def tasks(controller: str, of: Iterable[Any]) -> list[Task]:
    """Runs of a controller."""
    code = code_of(controller)
    return [Task(controller, each, code) for each in of]


def runs(controller: str, seeds: range, given: dict[str, Any] | None = None) -> list[Task]:
    """Runs of a controller on the rigs of these seeds."""
    return tasks(controller, [Drawn(seed, dict(given or {})) for seed in seeds])


def over_cores(workers: int | None = None) -> Callable[[Iterable[Task]], Iterator[Row]]:
    """Run tasks in processes of this machine."""
    return partial(in_processes, carry_out, processes=workers, crashed=died)
