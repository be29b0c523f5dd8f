"""The Prandtl-Ishlinskii model of a stage: a gain and a weighted sum of plays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from piezoest._checks import FloatArray, array_1d, finite
from piezoest.equations import play as equations
from piezoest.models._base import Model

# Rounding allowed for in a given initial state, in parts of the largest threshold.
_STATE_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True, eq=False, init=False)
class PrandtlIshlinskii(Model):
    """Prandtl-Ishlinskii hysteresis: x = gain u + sum_i weights[i] play_i[u] + offset.

    Parameters
    ----------
    gain : float
        Slope where no play moves, that is just after a reversal [µm/V].
    thresholds : array_like, shape (n,)
        Thresholds of the plays [V], above zero and rising. The weight of a threshold of
        zero belongs to the gain.
    weights : array_like, shape (n,)
        Slope that each play adds once it moves [µm/V].
    offset : float
        Displacement at zero voltage and plays at zero [µm].

    Raises
    ------
    ValueError
        If a value is not finite, the thresholds are not above zero and rising, or the
        lengths differ.

    Notes
    -----
    Admissible, so that x rises with u and the inverse exists, are gain > 0 and
    gain + weights[0] + … + weights[i] > 0 for every i. `theta` holds the gain, the
    thresholds, then the weights. Source: P. Krejci, K. Kuhnen, IEE Proc. Control Theory
    Appl. 148 (2001) 185-192.
    """

    gain: float
    thresholds: FloatArray
    weights: FloatArray
    offset: float = 0.0

    def __init__(self, gain: float, thresholds: ArrayLike, weights: ArrayLike, offset: float = 0.0) -> None:
        thresholds = array_1d("thresholds", thresholds).copy()
        weights = array_1d("weights", weights).copy()
        if thresholds.size != weights.size:
            raise ValueError(
                f"weights must have one value per threshold, got {weights.size} weights for "
                f"{thresholds.size} thresholds"
            )
        if thresholds.size and thresholds[0] <= 0.0:
            raise ValueError(
                f"thresholds must be above zero, got {thresholds[0]:g} first: "
                "add the weight of a threshold of zero to the gain"
            )
        if np.any(np.diff(thresholds) <= 0.0):
            raise ValueError(
                f"thresholds must rise from entry to entry, got {thresholds}: "
                "sort them together with the weights and merge equal ones"
            )
        thresholds.flags.writeable = False
        weights.flags.writeable = False
        object.__setattr__(self, "gain", finite("gain", gain))
        object.__setattr__(self, "thresholds", thresholds)
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "offset", finite("offset", offset))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PrandtlIshlinskii):
            return NotImplemented
        return bool(np.array_equal(self.theta, other.theta) and self.offset == other.offset)

    def __hash__(self) -> int:
        return hash((*self.theta.tolist(), self.offset))

    @property
    def parameter_names(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the entries of `theta`: the gain, the thresholds, the weights."""
        indices = range(self.thresholds.size)
        return ("gain", *(f"thresholds[{i}]" for i in indices), *(f"weights[{i}]" for i in indices))

    @property
    def parameter_units(self) -> tuple[str, ...]:  # type: ignore[override]
        """Units of the entries of `theta`."""
        n = self.thresholds.size
        return ("µm/V",) + ("V",) * n + ("µm/V",) * n

    @property
    def theta(self) -> FloatArray:
        """Gain, thresholds, weights in one vector, shape (1 + 2n,)."""
        return np.concatenate(([self.gain], self.thresholds, self.weights))

    @classmethod
    def from_theta(cls, theta: Any, offset: float = 0.0) -> Self:
        """Make the model from its parameter vector.

        Parameters
        ----------
        theta : array_like, shape (1 + 2n,)
            Gain, n thresholds, n weights.
        offset : float
            Displacement at zero voltage and plays at zero [µm].

        Raises
        ------
        ValueError
            If the length is even, or a parameter is refused.
        """
        values = array_1d("theta", theta, minimum_length=1)
        n, odd = divmod(values.size - 1, 2)
        if odd:
            raise ValueError(
                f"theta must hold a gain, n thresholds and n weights (1 + 2n values), got {values.size}"
            )
        return cls(float(values[0]), values[1 : 1 + n], values[1 + n :], offset)

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary with the class name under ``"model"``."""
        return {
            "model": type(self).__name__,
            "gain": self.gain,
            "thresholds": self.thresholds.tolist(),
            "weights": self.weights.tolist(),
            "offset": self.offset,
        }

    @property
    def is_admissible(self) -> bool:
        """Whether x rises with u from every state, so that the inverse exists."""
        return bool(self.gain > 0.0 and np.all(self.gain + np.cumsum(self.weights) > 0.0))

    def simulate(self, u: FloatArray, *, initial_state: FloatArray | None = None) -> FloatArray:
        """Displacement for a voltage record; exact, whatever the sample rate.

        Parameters
        ----------
        u : array_like, shape (N,)
            Voltage [V].
        initial_state : array_like, shape (n,), optional
            Play states [V] before the first sample; zeros if not given.

        Returns
        -------
        ndarray, shape (N,)
            Displacement [µm].

        Raises
        ------
        ValueError
            If u is not a finite 1-D array, or no input can leave `initial_state` behind.
        """
        x = array_1d("u", u).copy()
        _simulate(x, self._start(initial_state), self.gain, self.thresholds, self.weights, self.offset)
        return x

    def invert(self, r: FloatArray, *, initial_state: FloatArray | None = None) -> FloatArray:
        """Voltage under which the model follows a reference exactly.

        Parameters
        ----------
        r : array_like, shape (N,)
            Reference displacement [µm].
        initial_state : array_like, shape (n,), optional
            Play states [V] before the first sample; zeros if not given.

        Returns
        -------
        ndarray, shape (N,)
            Voltage [V]; ``simulate(invert(r))`` is r.

        Raises
        ------
        ValueError
            If the model is not admissible, r is not a finite 1-D array, or no input can
            leave `initial_state` behind.
        """
        if not self.is_admissible:
            slopes = self.gain + np.concatenate(([0.0], np.cumsum(self.weights)))
            raise ValueError(
                f"the model has no inverse, its lowest slope is {slopes.min():g} µm/V: "
                "gain and gain + weights[0] + … + weights[i] must be above zero"
            )
        u = array_1d("r", r).copy()
        _invert(u, self._start(initial_state), self.gain, self.thresholds, self.weights, self.offset)
        return u

    def _start(self, initial_state: FloatArray | None) -> FloatArray:
        """Play states to start from, as an own array (n,)."""
        if initial_state is None:
            return np.zeros(self.thresholds.size)
        y = array_1d("initial_state", initial_state).copy()
        if y.size != self.thresholds.size:
            raise ValueError(f"initial_state must hold {self.thresholds.size} play states, got {y.size}")
        # The inverse's walk relies on it: neighbouring plays drift apart no further than this.
        slack = _STATE_TOLERANCE * self.thresholds[-1:].sum()
        if np.any(np.abs(np.diff(y)) > np.diff(self.thresholds) + slack):
            raise ValueError(
                "initial_state cannot be reached by any voltage: neighbouring play states may differ "
                "by no more than their thresholds do; take it from a simulation"
            )
        return y


@njit(cache=True)
def _simulate(x: Any, y: Any, gain: float, thresholds: Any, weights: Any, offset: float) -> None:
    """`x` comes as voltage and goes as displacement; `y` is updated."""
    for k in range(x.size):
        x[k] = equations.prandtl_ishlinskii_step(y, x[k], gain, thresholds, weights) + offset


@njit(cache=True)
def _invert(u: Any, y: Any, gain: float, thresholds: Any, weights: Any, offset: float) -> None:
    """`u` comes as displacement and goes as voltage; `y` is updated."""
    for k in range(u.size):
        u[k] = equations.prandtl_ishlinskii_inverse_step(y, u[k] - offset, gain, thresholds, weights)
