"""The estimators of a controller, made for a stage of gain one and a voltage from -1 to 1.

A controller gives them voltages and readings in units of half the swing, z = (x - zero)/unit. They must begin
with a model in these units, which is why the controller makes them itself.
"""

from collections.abc import Callable, Iterator
from typing import Any

from piezoest._checks import class_named, dictionary, instance
from piezoest.controller import slots
from piezoest.equations import loop_inverse, play_inverse
from piezoest.estimators.compiled import CompiledEstimator
from piezoest.estimators.ekf import HysteresisEKF
from piezoest.estimators.output_error import OutputErrorRLS
from piezoest.estimators.play_rls import PrandtlIshlinskiiRLS
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import ColemanHodgdon

# factory(sample_rate, initial_model=, noise=) is an estimator, as the classes of estimators are.
Factory = Callable[..., Any]

DEFAULT: tuple[Factory, ...] = (HysteresisRLS, OutputErrorRLS, PrandtlIshlinskiiRLS)
KNOWN = (*DEFAULT, HysteresisEKF)
# Inverses whose numbers a controller can hand over.
INVERSES = (loop_inverse, play_inverse)
# Names of what a controller with at least one estimator has beside them.
DUHEM, RECORDED = "Duhem model", "recorded loop"
# Least and largest gain of a first model.
LEAST, MOST = 0.1, 10.0
# What they begin with: a loop of the usual width, and noise, in half swings.
START, NOISE = ColemanHodgdon(alpha=0.8, beta=0.8, gamma=0.96), 2.5e-4


def made(factories: Any, sample_rate: float) -> tuple[CompiledEstimator, ...]:
    """Estimators for a controller."""
    hint = "a tuple of classes: pass (HysteresisRLS,), or () for the straight line alone"
    factories = tuple(instance("estimators", factories, tuple | list, hint))
    if len(factories) > slots.MOST:
        raise ValueError(f"estimators must be at most {slots.MOST}, got {len(factories)}: choose")
    given = {"initial_model": START, "noise": NOISE}
    return tuple(_made(f"estimators[{i}]", each, sample_rate, given) for i, each in enumerate(factories))


def _made(name: str, factory: Any, sample_rate: float, given: dict[str, Any]) -> CompiledEstimator:
    if not callable(factory):
        raise ValueError(
            f"{name} must be a class, as HysteresisRLS, or functools.partial(HysteresisRLS, memory=0.4), "
            f"got {type(factory).__name__}: a controller makes its estimators itself, for a gain of one"
        )
    try:
        estimator = factory(sample_rate, **given)
    except TypeError as error:
        raise ValueError(
            f"{name} must go by factory(sample_rate, initial_model=..., noise=...): {error}"
        ) from error
    checked(name, estimator)
    gain = estimator.model.line[0]
    if estimator.status.samples or not LEAST < gain < MOST:
        raise ValueError(
            f"{name} must begin anew from the initial_model that it is given, of a gain of about one, "
            f"got {estimator.model} after {estimator.status.samples} samples: pass it on"
        )
    return estimator


def checked(name: str, estimator: Any) -> None:
    """Refuse what a controller cannot use."""
    kernel = getattr(estimator, "kernel", None)
    if not isinstance(estimator, CompiledEstimator) or not hasattr(kernel, "write_model"):
        raise ValueError(
            f"{name} must make a compiled estimator with `write_model`, as "
            f"{', '.join(cls.__name__ for cls in KNOWN)}, got {type(estimator).__name__}"
        )
    if estimator.model.inverse not in INVERSES:
        raise ValueError(f"{name} has a model without a known inverse: {type(estimator.model).__name__}")


def names(estimators: tuple[CompiledEstimator, ...]) -> tuple[str, ...]:
    """Names of all candidates, the line first; a second estimator of a class is numbered."""
    found = ["line"]
    for estimator in estimators:
        name, number = type(estimator).__name__, 2
        while name in found:
            name, number = f"{type(estimator).__name__} {number}", number + 1
        found.append(name)
    return (*found, DUHEM, RECORDED) if estimators else tuple(found)


def saved(estimator: CompiledEstimator) -> dict[str, Any]:
    """Return class and arguments as a JSON-safe dictionary."""
    return {name: value for name, value in estimator.to_dict().items() if name != "state"}


def revived(data: Any, state: Any) -> CompiledEstimator:
    """Return an estimator as it was made."""
    cls = class_named(dictionary(data), "estimator", _known(CompiledEstimator))
    estimator: CompiledEstimator = cls.from_dict({**data, "state": state})
    checked("estimator", estimator)
    estimator.reset()
    return estimator


def _known(cls: Any) -> Iterator[Any]:
    """All compiled estimators, those of users too."""
    for inner in cls.__subclasses__():
        yield inner
        yield from _known(inner)
