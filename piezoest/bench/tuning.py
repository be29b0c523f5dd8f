"""What may be tuned of each estimator: declared here, beside its name, and searched alike for all.

An estimator of one's own declares its space as an attribute of the class, the bounds of a value that
may be anything between them, evenly in its logarithm, or a list to choose from::

    class MyEstimator:
        tuning_space = {"memory": (0.05, 2.0), "order": [1, 2, 3]}
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from piezoest._checks import integer, positive
from piezoest.bench.campaign import PAPERS, default_estimators
from piezoest.bench.candidates import candidate, class_of


@dataclass(frozen=True, slots=True)
class Between:
    """Any value from low to high, evenly in its logarithm.

    Parameters
    ----------
    low, high : float
        Above zero.
    whole : bool
        Whole numbers only.

    Raises
    ------
    ValueError
        If the bounds are not above zero and in this order.
    """

    low: float
    high: float
    whole: bool = False

    def __post_init__(self) -> None:
        if positive("high", self.high) <= positive("low", self.low):
            raise ValueError(f"high must be above low, got {self.low} and {self.high}")

    def at(self, position: float) -> float | int:
        """Value at a position along the way, within [0, 1).

        Parameters
        ----------
        position : float
            0 for low.
        """
        if self.whole:
            first, last = math.log(self.low), math.log(self.high + 1.0)
            return min(int(math.exp(first + position * (last - first))), int(self.high))
        value = math.exp(math.log(self.low) + position * (math.log(self.high) - math.log(self.low)))
        return float(f"{value:.3g}")


@dataclass(frozen=True, slots=True)
class OneOf:
    """One of some values.

    Parameters
    ----------
    values : tuple
        Literals.
    """

    values: tuple[Any, ...]

    def at(self, position: float) -> Any:
        """Value at a position along the way, within [0, 1).

        Parameters
        ----------
        position : float
            0 for the first.
        """
        return self.values[min(int(position * len(self.values)), len(self.values) - 1)]


Space = Mapping[str, Between | OneOf]


@dataclass(frozen=True, slots=True)
class Tunable:
    """An estimator and what may be tuned of it.

    Parameters
    ----------
    name : str
        What it is called in the ranking.
    default : str
        As `piezoest.bench.candidates.candidate` reads it.
    template : str
        The same with ``{…}`` for each value; the default itself if nothing may be tuned.
    space : mapping
        From the names in the template.
    slow : bool
        Whether a run takes so long that it is judged on fewer seeds.
    """

    name: str
    default: str
    template: str = ""
    space: Space = field(default_factory=dict)
    slow: bool = False

    def text(self, point: Sequence[float]) -> str:
        """Description of the estimator at a point of its space.

        Parameters
        ----------
        point : sequence of float
            Within [0, 1), one for each value.
        """
        values = {
            name: repr(self.space[name].at(position))
            for name, position in zip(self.space, point, strict=True)
        }
        return self.template.format(**values)


FILTER: Space = {
    "drift": Between(0.02, 5.0),
    "mismatch": Between(0.02, 5.0),
    "uncertainty": Between(0.1, 1.0),
    "offset": OneOf((False, True)),
}

SPACES: dict[str, tuple[str, Space]] = {
    "HysteresisRLS": (
        "HysteresisRLS(noise={noise}, policies=(RandomWalk(memory={memory}, drift={drift}), DeadZone(), "
        "OutlierRejection()))",
        {"memory": Between(0.05, 1.0), "drift": Between(0.1, 2.0), "noise": Between(5e-4, 1e-2)},
    ),
    PAPERS: (
        "",
        {
            "memory": Between(0.05, 2.0),
            "uncertainty": Between(0.1, 1.0),
            "noise": Between(5e-4, 1e-2),
            "offset": OneOf((False, True)),
        },
    ),
    "OutputErrorRLS": (
        "OutputErrorRLS(noise={noise}, uncertainty={uncertainty}, policies=("
        "RandomWalk(memory={memory}, drift={drift}), "
        "OutlierRejection()))",
        {
            "memory": Between(0.05, 1.0),
            "drift": Between(0.1, 2.0),
            "uncertainty": Between(0.1, 1.0),
            "noise": Between(5e-4, 1e-2),
        },
    ),
    "HysteresisEKF": ("", FILTER),
    "FilterPyEKF": ("", FILTER),
    "FilterPyUKF": ("", FILTER),
    "MovingHorizon": (
        "",
        {
            "window": Between(0.25, 0.8),
            "hop": Between(0.05, 0.2),
            "process_noise": Between(0.01, 1.0),
            "offset": OneOf((False, True)),
        },
    ),
    "BatchFit": (
        "",
        {"hop": Between(0.08, 0.4), "offset": OneOf((False, True)), "loss": OneOf(("linear", "huber"))},
    ),
    "PrandtlIshlinskiiRLS": (
        "",
        {
            "thresholds": Between(6, 20, whole=True),
            "bends": OneOf((0, 1, 2, 3)),
            "uncertainty": Between(0.1, 2.0),
            "noise": Between(5e-4, 1e-2),
        },
    ),
}
NAMES = {PAPERS: "HysteresisRLS, the paper's law"}
SLOW = ("BatchFit", "FilterPyUKF")


def tunables(own: Sequence[str] = (), only: Sequence[str] = ()) -> list[Tunable]:
    """Estimators of the package and those of one's own, with their spaces.

    Parameters
    ----------
    own : sequence of str
        ``module:Class``, or anything else that `piezoest.bench.candidates.candidate` reads; what is
        written with arguments is taken as it stands.
    only : sequence of str
        Names of those of the package that are wanted; default all.

    Returns
    -------
    list of Tunable

    Raises
    ------
    ValueError
        If a name is unknown, or a class declares something that is no space.
    """
    known = [_of_the_package(text) for text in default_estimators()]
    if unknown := [name for name in only if name not in [each.name for each in known]]:
        raise ValueError(
            f"{', '.join(unknown)}: choose of {'; '.join(each.name for each in known)}, "
            "or name your own as module:Class"
        )
    return [each for each in known if not only or each.name in only] + [_own(text) for text in own]


def draws(tunable: Tunable, number: int, seed: int) -> list[str]:
    """Descriptions of the estimator all over its space: a Sobol sequence, shifted at random.

    Parameters
    ----------
    tunable : Tunable
        With its space.
    number : int
        A power of two, for the sequence to be balanced.
    seed : int
        Of the shift.

    Returns
    -------
    list of str
        The default comes first, whatever the number; without a space it is alone.

    Raises
    ------
    ValueError
        If the number is no power of two.
    """
    from scipy.stats import qmc

    if integer("number", number, 1) & (number - 1):
        raise ValueError(f"number of draws must be a power of two, got {number}")
    if not tunable.space:
        return [tunable.default]
    sequence = qmc.Sobol(len(tunable.space), scramble=False)
    shift = np.random.default_rng(seed).random(len(tunable.space))
    points = (sequence.random_base2(number.bit_length() - 1) + shift) % 1.0
    return list(dict.fromkeys([tunable.default, *(tunable.text(point) for point in points)]))


def _of_the_package(text: str) -> Tunable:
    name = text if text in SPACES else text.partition("(")[0]
    template, space = SPACES.get(name, ("", {}))
    return Tunable(
        NAMES.get(name, name), text, template or _call(text.partition("(")[0], space), space, name in SLOW
    )


def _own(text: str) -> Tunable:
    candidate(text)
    declared = {} if "(" in text else getattr(class_of(text), "tuning_space", {})
    space: dict[str, Between | OneOf] = {}
    for name, values in declared.items():
        match values:
            case tuple((low, high)):
                space[name] = Between(low, high)
            case list([_, *_]):
                space[name] = OneOf(tuple(values))
            case _:
                message = f"tuning_space[{name!r}] must be (low, high) or a list, got {values!r}"
                raise ValueError(f"{text}: {message}")
    return Tunable(text, text, _call(text, space), space)


def _call(name: str, space: Space) -> str:
    return f"{name}({', '.join(f'{value}={{{value}}}' for value in space)})" if space else name
