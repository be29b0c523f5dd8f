"""Estimators as one writes them on a command line: a name, a class of one's own, with arguments."""

import ast
import inspect
from collections.abc import Callable
from typing import Any

from piezoest import policies
from piezoest.bench.cases import REACH
from piezoest.bench.origin import imported, name_of
from piezoest.compensators import VoltageLimits
from piezoest.controller.adaptive_feedforward import AdaptiveFeedforward
from piezoest.estimators.base import EstimatorBase
from piezoest.models import Model

LINEAR = "linear feed-forward"
LIMITS = VoltageLimits(REACH.low, REACH.high)  # of every stage of the bench

# All are given the same to know: that readings may have an offset, which some learn only on request. The two
# fits solve as often as each other; they forget slowly, for with an offset a window tells the rest less well.
KNOWN: dict[str, str] = {
    "BatchFit": "BatchFit(hop=0.1, offset=True)",
    "FilterPyEKF": "FilterPyEKF(offset=True)",
    "FilterPyUKF": "FilterPyUKF(offset=True)",
    "HysteresisEKF": "HysteresisEKF(offset=True)",
    "MovingHorizon": "MovingHorizon(process_noise=0.03, offset=True)",
}
# The paper's law, with a memory of two periods at 5 Hz.
PAPERS = "HysteresisRLS(memory=0.4, offset=True)"
SLOW = ("BatchFit", "FilterPyEKF", "FilterPyUKF", "MovingHorizon")


def defaults(*, drivers: bool = True) -> list[str]:
    """What is compared where nothing is asked for: the controller, every estimator, and the paper's law.

    `drivers`: also what drives a stage, which a log does not have.
    """
    names = [KNOWN.get(name, name) for name, cls in found().items() if drivers or not hasattr(cls, "learn")]
    names.insert(names.index("HysteresisRLS") + 1, PAPERS)
    return names


def found() -> dict[str, type]:
    """Return the controller and every estimator among the public names of the package, by name."""
    import piezoest

    public = {name: getattr(piezoest, name) for name in piezoest.__all__}
    return {
        name: value
        for name, value in sorted(public.items())
        if inspect.isclass(value)
        and issubclass(value, (EstimatorBase, AdaptiveFeedforward))
        and not inspect.isabstract(value)
    }


def is_slow(text: str) -> bool:
    """Whether an estimator takes so long that it is run on fewer seeds and stages."""
    return name_of(text) in SLOW


def candidate(text: str) -> Callable[..., Any]:
    """Maker of new estimators from their description: ``make(sample_rate, initial_model)``.

    `text`: ``HysteresisRLS``, ``my_module:MyEstimator``, or either with keyword arguments as in
    ``HysteresisRLS(memory=0.4, policies=(NormBound(), DeadZone()))``. What a class does not take is left out.
    """
    name = name_of(text)
    cls = class_of(name)
    given = _arguments(text) if "(" in text else {}
    accepted = inspect.signature(cls).parameters
    if unknown := [key for key in given if key not in accepted]:
        raise ValueError(f"{text}: {name} takes no {', '.join(unknown)}; it takes {', '.join(accepted)}")

    def make(sample_rate: float, initial_model: Model) -> Any:
        offered = {"sample_rate": sample_rate, "initial_model": initial_model, "limits": LIMITS}
        return cls(**{key: value for key, value in offered.items() if key in accepted}, **given)

    return make


def class_of(name: str) -> type:
    """Class of the package, or of one's own as ``module:Class``."""
    if ":" not in name:
        known = found()
        if name not in known:
            raise ValueError(f"{name}: choose one of {', '.join(known)}, or name your own as module:Class")
        return known[name]
    cls = imported(name)
    if not inspect.isclass(cls):
        raise ValueError(f"{name} is no class")
    if not hasattr(cls, "step"):
        raise ValueError(f"{name} has no step: see piezoest.Estimator")
    return cls


def _arguments(text: str) -> dict[str, Any]:
    """Keyword arguments of a call that need nothing but literals and policies."""
    try:
        # What comes before the parenthesis may be module:Class, which is no Python.
        call = ast.parse("_" + text[text.index("(") :].strip(), mode="eval").body
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name)):
            raise ValueError("write it as Name(argument=value, ...)")
        return _keywords(call)
    except (SyntaxError, TypeError, ValueError) as error:
        raise ValueError(f"{text}: {error.msg if isinstance(error, SyntaxError) else error}") from None


def _keywords(call: ast.Call) -> dict[str, Any]:
    if call.args or any(keyword.arg is None for keyword in call.keywords):
        raise ValueError("every argument needs its name, as in memory=0.4")
    return {str(keyword.arg): _value(keyword.value) for keyword in call.keywords}


def _value(node: ast.expr) -> Any:
    match node:
        case ast.Tuple(elts=items) | ast.List(elts=items):
            return tuple(map(_value, items))
        case ast.Call(func=ast.Name(id=name)) if name in policies.__all__:
            return getattr(policies, name)(**_keywords(node))
        case ast.Call(func=ast.Name(id=name)):
            raise ValueError(f"{name} is no policy: choose one of {', '.join(policies.__all__)}")
    try:
        return ast.literal_eval(node)
    except ValueError:
        raise ValueError(f"{ast.unparse(node)} is no number, string, tuple or policy") from None
