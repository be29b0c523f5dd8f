"""What may be tuned of each estimator of the package, beside its name, and searched alike for all."""

import math
from collections.abc import Callable, Mapping, Sequence
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


# Descriptions with ``{…}`` for each value, where these are not just arguments; what may be turned, how far.
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


def tunable(text: str) -> tuple[str, Space]:
    """Template and space of an estimator; one of one's own, or with arguments, is taken as it stands."""
    name = name_of(text)
    if ":" in name or ("(" in text and text != KNOWN.get(name)):
        return text, {}
    template, space = SPACES.get(name, ("", {}))
    arguments = [f"{value}={{{value}}}" for value in space]
    if "offset=True" in text:
        arguments.append("offset=True")
    return template or f"{name}({', '.join(arguments)})", space


def draws(text: str, number: int) -> list[str]:
    """An estimator, then others all over its space: a Sobol sequence, shifted at random, alike for all."""
    from scipy.stats import qmc

    if integer("number", number, 1) & (number - 1):
        raise ValueError(f"number of draws must be a power of two, got {number}")
    template, space = tunable(text)
    shift = np.random.default_rng(SHIFT).random(len(space))
    points = (qmc.Sobol(len(space), scramble=False).random_base2(number.bit_length() - 1) + shift) % 1.0
    found = [text]
    for point in points:
        values = {name: repr(value_at(space[name], at)) for name, at in zip(space, point, strict=True)}
        found.append(template.format(**values))
    return list(dict.fromkeys(found))


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
    trials = {text: draws(text, number) for text in estimators if not is_slow(text) and tunable(text)[1]}
    tasks = [
        Task(scenario, text, seed, {**given, "stage": PAPER}, code_of(text))
        for seed in TRAINING_SEEDS
        for scenario in TRAINING
        for text in dict.fromkeys(text for some in trials.values() for text in some)
    ]
    runs = relative(table_of(play(tasks), COLUMNS))
    scores = {str(text): over_scenarios(group, "typical") for text, group in runs.groupby("estimator")}
    return [
        {
            "default": default,
            "trials": [{"estimator": text, "score": scores[text]} for text in texts],
            "chosen": min(texts, key=scores.__getitem__),
        }
        for default, texts in trials.items()
    ]
