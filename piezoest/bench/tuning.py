"""What may be tuned of each estimator: declared here, beside its name, and searched alike for all.

An estimator of one's own declares its space as an attribute of the class, the bounds of a value that
may be anything between them, evenly in its logarithm, or a list to choose from::

    class MyEstimator:
        tuning_space = {"memory": (0.05, 2.0), "order": [1, 2, 3]}
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from piezoest._checks import integer, positive
from piezoest.bench.estimators import KNOWN, class_of, is_slow, name_of
from piezoest.bench.run import COLUMNS, Task, code_of
from piezoest.bench.stages import PAPER
from piezoest.bench.statistics import over_scenarios, relative
from piezoest.bench.store import Store, carry_out
from piezoest.bench.tables import table_of

TRAINING = ("cold-start", "amplitude-drop", "gain-step", "two-tone")
TRAINING_SEEDS = (1000, 1001)  # no campaign judges by these
SHIFT = 2026  # seed of the shift of the settings that are tried


@dataclass(frozen=True, slots=True)
class Between:
    """Any value from low to high, evenly in its logarithm."""

    low: float
    high: float
    whole: bool = False  # whole numbers only

    def __post_init__(self) -> None:
        if positive("high", self.high) <= positive("low", self.low):
            raise ValueError(f"high must be above low, got {self.low} and {self.high}")

    def at(self, position: float) -> float | int:
        """Value at a position along the way, within [0, 1). `position`: 0 for low."""
        if self.whole:
            first, last = math.log(self.low), math.log(self.high + 1.0)
            return min(int(math.exp(first + position * (last - first))), int(self.high))
        value = math.exp(math.log(self.low) + position * (math.log(self.high) - math.log(self.low)))
        return float(f"{value:.3g}")


@dataclass(frozen=True, slots=True)
class OneOf:
    """One of some values."""

    values: tuple[Any, ...]  # literals

    def at(self, position: float) -> Any:
        """Value at a position along the way, within [0, 1). `position`: 0 for the first."""
        return self.values[min(int(position * len(self.values)), len(self.values) - 1)]


Space = Mapping[str, Between | OneOf]


@dataclass(frozen=True, slots=True)
class Tunable:
    """An estimator and what may be tuned of it."""

    default: str  # as `piezoest.bench.estimators.candidate` reads it
    template: str = ""  # the same with ``{…}`` for each value
    space: Space = field(default_factory=dict)  # from the names in the template

    def text(self, point: Sequence[float]) -> str:
        """Description of the estimator at a point of its space."""
        values = {
            name: repr(self.space[name].at(position))
            for name, position in zip(self.space, point, strict=True)
        }
        return self.template.format(**values)


# All know of the offset alike; what else may be turned, and how far.
FILTER: Space = {
    "drift": Between(0.02, 5.0),
    "mismatch": Between(0.02, 5.0),
    "uncertainty": Between(0.1, 1.0),
}
NOISE = Between(5e-4, 1e-2)

SPACES: dict[str, tuple[str, Space]] = {
    "HysteresisRLS": (
        "HysteresisRLS(noise={noise}, policies=(RandomWalk(memory={memory}, drift={drift}), DeadZone(), "
        "OutlierRejection()))",
        {"memory": Between(0.05, 1.0), "drift": Between(0.1, 2.0), "noise": NOISE},
    ),
    "OutputErrorRLS": (
        "OutputErrorRLS(noise={noise}, uncertainty={uncertainty}, policies=("
        "RandomWalk(memory={memory}, drift={drift}), OutlierRejection()))",
        {
            "memory": Between(0.05, 1.0),
            "drift": Between(0.1, 2.0),
            "uncertainty": Between(0.1, 1.0),
            "noise": NOISE,
        },
    ),
    **dict.fromkeys(("HysteresisEKF", "FilterPyEKF", "FilterPyUKF"), ("", FILTER)),
    "MovingHorizon": (
        "",
        {"window": Between(0.25, 0.8), "hop": Between(0.05, 0.2), "process_noise": Between(0.01, 1.0)},
    ),
    "BatchFit": ("", {"hop": Between(0.08, 0.4), "loss": OneOf(("linear", "huber"))}),
    "PrandtlIshlinskiiRLS": (
        "",
        {
            "thresholds": Between(6, 20, whole=True),
            "bends": OneOf((0, 1, 2, 3)),
            "uncertainty": Between(0.1, 2.0),
            "noise": NOISE,
        },
    ),
}


def tunable(text: str) -> Tunable:
    """What may be tuned of an estimator; what is written with arguments is taken as it stands."""
    name = name_of(text)
    if "(" in text and text != KNOWN.get(name):
        return Tunable(text)
    if ":" not in name:
        template, space = SPACES.get(name, ("", {}))
        given = ", offset=True" if "offset=True" in text else ""
        return Tunable(text, template or _call(name, space, given), space)
    space = {}
    for key, values in getattr(class_of(name), "tuning_space", {}).items():
        match values:
            case tuple((low, high)):
                space[key] = Between(low, high)
            case list([_, *_]):
                space[key] = OneOf(tuple(values))
            case _:
                message = f"tuning_space[{key!r}] must be (low, high) or a list, got {values!r}"
                raise ValueError(f"{text}: {message}")
    return Tunable(text, _call(name, space), space)


def _call(name: str, space: Space, given: str = "") -> str:
    return f"{name}({', '.join(f'{value}={{{value}}}' for value in space)}{given})" if space else name


def draws(tunable: Tunable, number: int, seed: int) -> list[str]:
    """The default, then descriptions all over its space: a Sobol sequence, shifted at random."""
    from scipy.stats import qmc

    if integer("number", number, 1) & (number - 1):
        raise ValueError(f"number of draws must be a power of two, got {number}")
    if not tunable.space:
        return [tunable.default]
    sequence = qmc.Sobol(len(tunable.space), scramble=False)
    shift = np.random.default_rng(seed).random(len(tunable.space))
    points = (sequence.random_base2(number.bit_length() - 1) + shift) % 1.0
    return list(dict.fromkeys([tunable.default, *(tunable.text(point) for point in points)]))


def tune(
    estimators: Sequence[str],
    number: int,
    given: dict[str, Any],
    store: Store,
    execute: Any,
    progress: Callable[[int, int], None],
) -> list[dict[str, Any]]:
    """Find the best settings of each estimator, by the same budget, on seeds that nothing is judged on.

    Slow ones are left out. Returns trials with their scores, geometric means of the typical errors relative
    to the amplitude, and the ``chosen`` one.
    """
    spaces = [each for text in estimators if not is_slow(text) and (each := tunable(text)).space]
    # The same points for all: two with the same space get the same settings.
    trials = {each.default: draws(each, number, SHIFT) for each in spaces}
    tasks = [
        Task(scenario, text, seed, {**given, "stage": PAPER}, code_of(text))
        for seed in TRAINING_SEEDS
        for scenario in TRAINING
        for text in dict.fromkeys(text for some in trials.values() for text in some)
    ]
    carry_out(tasks, store, execute, progress)
    runs = relative(table_of(store.rows(task.key for task in tasks), COLUMNS))
    scores = {str(text): over_scenarios(group, "typical") for text, group in runs.groupby("estimator")}
    found = []
    for each in spaces:
        scored: list[dict[str, Any]] = [
            {"estimator": text, "score": scores[text]} for text in trials[each.default]
        ]
        found.append(
            {
                "default": each.default,
                "space": {name: asdict(values) for name, values in each.space.items()},
                "trials": scored,
                "chosen": min(scored, key=lambda trial: trial["score"])["estimator"],
            }
        )
    return found
