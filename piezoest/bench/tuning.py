"""What may be tuned of each estimator of the package, beside its name, and searched alike for all."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from piezoest._checks import integer
from piezoest.bench.cases import PAPER
from piezoest.bench.estimators import KNOWN, is_slow
from piezoest.bench.origin import code_of, name_of
from piezoest.bench.run import COLUMNS, Task
from piezoest.bench.statistics import over_scenarios, relative
from piezoest.bench.store import Row
from piezoest.bench.tables import table_of

TRAINING = ("cold-start", "amplitude-drop", "gain-step", "two-tone")
TRAINING_SEEDS = (1000, 1001)  # no campaign judges by these
SHIFT = 2026  # seed of the shift of the settings that are tried

# What a value may be: anything between two numbers, a whole number of a range, both evenly in the logarithm,
# or one of a list of literals.
Values = tuple[float, float] | range | list[Any]
Space = Mapping[str, Values]


def value_at(values: Values, position: float) -> Any:
    """Value at a position along the way, within [0, 1). `position`: 0 for the first."""
    if isinstance(values, list):
        return values[min(int(position * len(values)), len(values) - 1)]
    low, high = (values.start, values.stop) if isinstance(values, range) else values
    value = math.exp(math.log(low) + position * (math.log(high) - math.log(low)))
    return min(int(value), high - 1) if isinstance(values, range) else float(f"{value:.3g}")


@dataclass(frozen=True, slots=True)
class Tunable:
    """An estimator and what may be tuned of it."""

    default: str  # as `piezoest.bench.estimators.candidate` reads it
    template: str = ""  # the same with ``{…}`` for each value
    space: Space = field(default_factory=dict)  # from the names in the template

    def text(self, point: Sequence[float]) -> str:
        """Description of the estimator at a point of its space."""
        places = zip(self.space.items(), point, strict=True)
        return self.template.format(**{name: repr(value_at(of, position)) for (name, of), position in places})


# All know of the offset alike; what else may be turned, and how far.
FILTER: Space = {"drift": (0.02, 5.0), "mismatch": (0.02, 5.0), "uncertainty": (0.1, 1.0)}
NOISE = (5e-4, 1e-2)

SPACES: dict[str, tuple[str, Space]] = {
    "HysteresisRLS": (
        "HysteresisRLS(noise={noise}, policies=(RandomWalk(memory={memory}, drift={drift}), DeadZone(), "
        "OutlierRejection()))",
        {"memory": (0.05, 1.0), "drift": (0.1, 2.0), "noise": NOISE},
    ),
    "OutputErrorRLS": (
        "OutputErrorRLS(noise={noise}, uncertainty={uncertainty}, policies=("
        "RandomWalk(memory={memory}, drift={drift}), OutlierRejection()))",
        {"memory": (0.05, 1.0), "drift": (0.1, 2.0), "uncertainty": (0.1, 1.0), "noise": NOISE},
    ),
    **dict.fromkeys(("HysteresisEKF", "FilterPyEKF", "FilterPyUKF"), ("", FILTER)),
    "MovingHorizon": (
        "",
        {"window": (0.25, 0.8), "hop": (0.05, 0.2), "process_noise": (0.01, 1.0)},
    ),
    "BatchFit": ("", {"hop": (0.08, 0.4), "loss": ["linear", "huber"]}),
    "PrandtlIshlinskiiRLS": (
        "",
        {"thresholds": range(6, 21), "bends": [0, 1, 2, 3], "uncertainty": (0.1, 2.0), "noise": NOISE},
    ),
}


def tunable(text: str) -> Tunable:
    """What may be tuned of an estimator; one of one's own, or with arguments, is taken as it stands."""
    name = name_of(text)
    if ":" in name or ("(" in text and text != KNOWN.get(name)):
        return Tunable(text)
    template, space = SPACES.get(name, ("", {}))
    arguments = [f"{value}={{{value}}}" for value in space]
    if "offset=True" in text:
        arguments.append("offset=True")
    return Tunable(text, template or f"{name}({', '.join(arguments)})", space)


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
    play: Callable[[Sequence[Task]], list[Row]],
) -> list[dict[str, Any]]:
    """Find the best settings of each estimator, by the same budget, on seeds that nothing is judged on.

    `play`: rows of tasks. Slow ones are left out. Returns trials with their scores, geometric means of the
    typical errors relative to the amplitude, and the ``chosen`` one.
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
    runs = relative(table_of(play(tasks), COLUMNS))
    scores = {str(text): over_scenarios(group, "typical") for text, group in runs.groupby("estimator")}
    found = []
    for each in spaces:
        scored: list[dict[str, Any]] = [
            {"estimator": text, "score": scores[text]} for text in trials[each.default]
        ]
        found.append(
            {
                "default": each.default,
                "space": {name: str(values) for name, values in each.space.items()},
                "trials": scored,
                "chosen": min(scored, key=lambda trial: trial["score"])["estimator"],
            }
        )
    return found
