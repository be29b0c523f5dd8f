"""Estimators as one writes them on a command line: a name, a class of one's own, with arguments."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable
from typing import Any

from piezoest import policies
from piezoest.bench.estimators import find_estimators, load_estimator
from piezoest.models import Model


def candidate(text: str) -> Callable[..., Any]:
    """Maker of new estimators from their description.

    Parameters
    ----------
    text : str
        ``HysteresisRLS``, ``my_module:MyEstimator``, or either with keyword arguments as in
        ``HysteresisRLS(memory=0.4, policies=(NormBound(), DeadZone()))``: numbers, strings,
        tuples, and the policies of `piezoest.policies`.

    Returns
    -------
    callable
        ``make(sample_rate, initial_model)``, a new estimator; what its class does not take is
        left out.

    Raises
    ------
    ValueError
        If there is no such class, or the arguments cannot be read.
    """
    name, parenthesis, _ = text.partition("(")
    cls = class_of(name.strip())
    given = _arguments(text) if parenthesis else {}
    accepted = inspect.signature(cls).parameters
    if unknown := [key for key in given if key not in accepted]:
        raise ValueError(f"{text}: {name} takes no {', '.join(unknown)}; it takes {', '.join(accepted)}")

    def make(sample_rate: float, initial_model: Model) -> Any:
        offered = {"sample_rate": sample_rate, "initial_model": initial_model}
        return cls(**{key: value for key, value in offered.items() if key in accepted}, **given)

    return make


def class_of(name: str) -> type:
    """Class of the package, or of one's own as ``module:Class``.

    Parameters
    ----------
    name : str
        Without arguments.

    Raises
    ------
    ValueError
        If there is none.
    """
    if ":" in name:
        return load_estimator(name)
    found = find_estimators()
    if name not in found:
        raise ValueError(f"{name}: choose of {', '.join(found)}, or name your own as module:Class")
    return found[name]


def _arguments(text: str) -> dict[str, Any]:
    """Keyword arguments of a call that need nothing but literals and policies."""
    try:
        # What comes before the parenthesis may be module:Class, which is no Python.
        call = ast.parse("_" + text[text.index("(") :].strip(), mode="eval").body
    except SyntaxError as error:
        raise ValueError(f"{text}: {error.msg}") from None
    match call:
        case ast.Call(func=ast.Name()):
            return _keywords(call, text)
    raise ValueError(f"{text}: write it as Name(argument=value, ...)")


def _keywords(call: ast.Call, text: str) -> dict[str, Any]:
    if call.args or any(keyword.arg is None for keyword in call.keywords):
        raise ValueError(f"{text}: every argument needs its name, as in memory=0.4")
    return {str(keyword.arg): _value(keyword.value, text) for keyword in call.keywords}


def _value(node: ast.expr, text: str) -> Any:
    match node:
        case ast.Tuple(elts=items) | ast.List(elts=items):
            return tuple(_value(item, text) for item in items)
        case ast.Call(func=ast.Name(id=name)):
            return _policy(name, _keywords(node, text), text)
    try:
        return ast.literal_eval(node)
    except ValueError:
        raise ValueError(f"{text}: {ast.unparse(node)} is no number, string, tuple or policy") from None


def _policy(name: str, arguments: dict[str, Any], text: str) -> Any:
    if name not in policies.__all__:
        raise ValueError(f"{text}: {name} is no policy: choose of {', '.join(policies.__all__)}")
    try:
        return getattr(policies, name)(**arguments)
    except TypeError as error:
        raise ValueError(f"{text}: {error}") from None
