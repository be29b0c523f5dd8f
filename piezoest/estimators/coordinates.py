"""What an output-error fit varies, and what that means in parameters."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.equations import admissible
from piezoest.equations import coleman_hodgdon as equations
from piezoest.models import ColemanHodgdon, LinearGain
from piezoest.symbolic import jacobian, trace

# Distance kept from gamma = alpha beta and gamma = 2 alpha beta, in parts of alpha beta.
MARGIN = 1e-6
# Least alpha, beta and gain, in parts of their start.
LEAST = 1e-6
# Least gain, c and a of the model handed out, in parts of the start's.
LEAST_HANDED_OUT = 1e-2


class Coordinates:
    """Coordinates q of a fit, the parameters they stand for, and the derivative of the one by the other.

    The admissible Coleman-Hodgdon set alpha > 0, beta > 0, alpha beta < gamma <= 2 alpha beta is a box in
    (alpha, beta, ratio) with ratio = gamma/(alpha beta), that is c/beta: a > 0, b > 0 and c >= 2b
    become bounds. Parameters that are held drop out.

    Parameters
    ----------
    hysteretic : bool
        (alpha, beta, gamma) and the start state w_h, or the linear gain alone.
    held : tuple of str
        Names out of `parameters` whose values are given.
    creep_terms : int
        Number of creep terms.

    Attributes
    ----------
    parameters : tuple of str
        alpha, beta, gamma or gain; offset, initial_state, creep_gains[0], …
    free : tuple of str
        Names of the coordinates q.
    """

    __slots__ = ("_derivative", "_hysteretic", "_inputs", "_size", "_terms", "_value", "free", "parameters")

    def __init__(self, hysteretic: bool, held: tuple[str, ...], creep_terms: int) -> None:
        own = ("alpha", "beta", "gamma") if hysteretic else ("gain",)
        others = ("offset", "initial_state") if hysteretic else ("offset",)
        gains = tuple(f"creep_gains[{i}]" for i in range(creep_terms))
        self.parameters = (*own, *others, *gains)
        self.free = tuple(
            "ratio" if name == _replaced(held) else name for name in self.parameters if name not in held
        )
        known = tuple(name for name in held if name in self.parameters)
        self._hysteretic, self._terms = hysteretic, creep_terms
        self._inputs = (*self.free, *known)
        # Simulation's p = (a, b, c, offset, gains...) and s = (w_h, z...).
        self._size = 5 + 2 * creep_terms
        sizes = [0] * len(self._inputs)
        self._value = trace(self._physical, *sizes)
        self._derivative: Callable[..., FloatArray] = jacobian(self._physical, *sizes)

    def _physical(self, *values: Any) -> tuple[Any, ...]:
        """Simulation's (p, s), then `parameters`, from the values of the coordinates and the held ones."""
        value = dict(zip(self._inputs, values, strict=True))
        gains = [value[f"creep_gains[{i}]"] for i in range(self._terms)]
        a, b, c, w_h = 0.0, 0.0, value.get("gain"), 0.0
        if self._hysteretic:
            _complete(value)
            a, b, c = equations.loop_parameters(value["alpha"], value["beta"], value["gamma"])
            w_h = value["initial_state"]
        v = (a, b, c, value["offset"], *gains, w_h, *[0.0] * self._terms)
        return (*v, *(value[name] for name in self.parameters))

    def __call__(
        self, q: FloatArray, held: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Simulation's (p, s), its derivative by q, `parameters`' values, and theirs."""
        values = (*q.tolist(), *held.tolist())
        both, by_all = self._value(*values).full()[:, 0], self._derivative(*values)
        by_q, k = by_all[:, : q.size], self._size
        return both[:k], by_q[:k], both[k:], by_q[k:]

    def of(
        self, model: ColemanHodgdon | LinearGain, initial_state: float, creep_gains: FloatArray
    ) -> FloatArray:
        """Coordinates of a model, moved into the admissible set."""
        value = {"offset": model.offset, "initial_state": initial_state}
        value |= {f"creep_gains[{i}]": float(gain) for i, gain in enumerate(creep_gains)}
        if isinstance(model, ColemanHodgdon):
            model = model.nearest_admissible()
            ratio = model.gamma / (model.alpha * model.beta)
            value |= {"alpha": model.alpha, "beta": model.beta}
            value["ratio"] = float(np.clip(ratio, 1.0 + 2.0 * MARGIN, 2.0 - 2.0 * MARGIN))
        else:
            value["gain"] = model.gain
        return np.array([value[name] for name in self.free])

    def bounds(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Admissible set of the coordinates; alpha, beta and gain keep their start's sign and part of it."""
        names = np.array(self.free)
        lower, upper = np.full(names.size, -np.inf), np.full(names.size, np.inf)
        positive = np.isin(names, ("alpha", "beta"))
        lower[positive] = LEAST * start[positive]
        if "gain" in self.free:
            i = self.free.index("gain")
            (lower if start[i] > 0.0 else upper)[i] = LEAST * start[i]
        lower[names == "ratio"], upper[names == "ratio"] = 1.0 + MARGIN, 2.0 - MARGIN
        return lower, upper


def large_enough(
    model: ColemanHodgdon | LinearGain, start: ColemanHodgdon | LinearGain
) -> ColemanHodgdon | LinearGain:
    """The model, its gain or slope and its decay lifted to 1 % of the start's.

    A smaller gain commands a larger voltage: what a sensor that reads zero teaches must not.

    Parameters
    ----------
    model, start : ColemanHodgdon or LinearGain
        Of one kind.
    """
    if isinstance(model, LinearGain) or isinstance(start, LinearGain):
        gain = admissible.kept_gain(model.theta[0], start.theta[0], LEAST_HANDED_OUT)
        return model if gain == model.theta[0] else LinearGain(float(gain), model.offset)
    a, c = LEAST_HANDED_OUT * start.a, LEAST_HANDED_OUT * start.c
    if model.a >= a and model.c >= c:
        return model
    return ColemanHodgdon.from_loop(
        max(model.a, a), max(model.c, c) * (model.b / model.c), max(model.c, c), model.offset
    )


def _replaced(held: tuple[str, ...]) -> str | None:
    """Parameter in whose place the ratio is varied: the last one that is not held."""
    return next((name for name in ("gamma", "beta", "alpha") if name not in held), None)


def _complete(value: dict[str, Any]) -> None:
    """The parameter that the ratio stands for."""
    if "gamma" not in value:
        value["gamma"] = value["ratio"] * value["alpha"] * value["beta"]
    elif "beta" not in value:
        value["beta"] = value["gamma"] / (value["alpha"] * value["ratio"])
    elif "alpha" not in value:
        value["alpha"] = value["gamma"] / (value["beta"] * value["ratio"])


@lru_cache(maxsize=64)
def coordinates(hysteretic: bool, held: tuple[str, ...], creep_terms: int) -> Coordinates:
    """Coordinates of a fit; made once.

    Parameters
    ----------
    hysteretic : bool
        Coleman-Hodgdon, or the linear gain.
    held : tuple of str
        Names of the parameters that are held.
    creep_terms : int
        Number of creep terms.
    """
    return Coordinates(hysteretic, held, creep_terms)
