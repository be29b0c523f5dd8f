"""The runs of a campaign: what each is, the key it is kept under, and what happens if its process dies."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from piezoest.bench.executors import in_processes, quiet
from piezoest.bench.origin import code_of, json_safe
from piezoest.bench.store import Keyed, Row
from piezoest.bench.zoo.contenders import contender
from piezoest.bench.zoo.drawing import draw
from piezoest.bench.zoo.judging import play
from piezoest.bench.zoo.running import Factory


class Played(Protocol):
    """What a run is: `Drawn`, a `settling.Cell` of the map or a long rest, a `dwelling.Dwell`."""

    def play(self, factory: Factory) -> Row:
        """Let a controller do it."""

    def drawn(self) -> Row:
        """What is known of it before."""


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
    of: Any  # `Played`
    code: str  # fingerprint of what is run


@quiet()
def carry_out(task: Task) -> Row:
    """Run a task."""
    known = {"key": task.key, "controller": task.controller}
    return {**known, **task.of.play(contender(task.controller))}


def died(task: Task) -> Row:
    """Row of a task whose process died over it."""
    row = {"key": task.key, "controller": task.controller, **task.of.drawn()}
    return dict(json_safe({**row, "failure": "the process died"}))


def tasks(controller: str, of: Iterable[Played]) -> list[Task]:
    """Runs of a controller."""
    code = code_of(controller)
    return [Task(controller, each, code) for each in of]


def runs(controller: str, seeds: range, given: dict[str, Any] | None = None) -> list[Task]:
    """Runs of a controller on the rigs of these seeds."""
    return tasks(controller, [Drawn(seed, dict(given or {})) for seed in seeds])


def over_cores(workers: int | None = None) -> Callable[[Iterable[Task]], Iterator[Row]]:
    """Run tasks in processes of this machine."""
    return partial(in_processes, carry_out, processes=workers, crashed=died)
