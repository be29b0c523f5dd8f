"""The Prandtl-Ishlinskii model of a stage: a gain and a weighted sum of plays."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from piezoest._checks import FloatArray, array_1d, as_floats, finite, positive
from piezoest._jit import compiled
from piezoest.equations import admissible
from piezoest.equations.bent_plays import bent_plays_step, prandtl_ishlinskii_voltage
from piezoest.equations.creep import creep_to_come, unit_creep_step
from piezoest.models._base import Model, finite_voltage
from piezoest.models.creep import Creep

# Rounding allowed for in a given initial state, in parts of the largest threshold.
_STATE_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True, eq=False, init=False)
class PrandtlIshlinskii(Model):
    """Prandtl-Ishlinskii hysteresis with optional creep and asymmetry.

    w = gain u + sum_i weights[i] play_i[u], x = w + creep of w + offset. For asymmetric loops
    the slope of the voltage's part and of each play's may change at given voltages.

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
    creep : Creep, optional
        First-order terms driven by w; `simulate` and `invert` then need the sample rate.
    bends : array_like, shape (k,), optional
        Voltages at which slopes change [V], rising.
    bend_weights : array_like, shape (k, 1 + n), optional
        Change of slope above each bend [µm/V]: of the gain, where the voltage is above it, then
        of each weight, where that play is.
    sample_rate : float, optional
        Rate at which creep proceeds where no other is given [Hz].

    Raises
    ------
    ValueError
        If a value is not finite, the thresholds are not above zero and rising, the bends not
        rising, the shapes do not fit, or the creep is no `Creep`.

    Notes
    -----
    Admissible, so that x rises with u and the inverse exists, are gain > 0 and
    gain + weights[0] + … + weights[i] > 0 for every i, with bends for the least that each
    of them becomes, and negative creep gains that do not sum to -1 or less. `theta` holds the
    gain, the thresholds, the weights, then the creep gains and the bend weights row by row.

    Sources: P. Krejci, K. Kuhnen, IEE Proc. Control Theory Appl. 148 (2001) 185-192; K.
    Kuhnen, European Journal of Control 9 (2003) 407-418 (one-sided dead zones, here on
    each play, see `piezoest.equations.bent_plays`); K. Kuhnen, P. Krejci,
    IEEE Trans. Autom. Control 54 (2009) 537-550 (creep).
    """

    gain: float
    thresholds: FloatArray
    weights: FloatArray
    offset: float = 0.0
    creep: Creep | None = None
    bends: FloatArray = dataclasses.field(default_factory=lambda: np.empty(0))
    bend_weights: FloatArray = dataclasses.field(default_factory=lambda: np.empty((0, 1)))
    sample_rate: float | None = None

    def __init__(
        self,
        gain: float,
        thresholds: ArrayLike,
        weights: ArrayLike,
        offset: float = 0.0,
        creep: Creep | None = None,
        bends: ArrayLike = (),
        bend_weights: ArrayLike = (),
        sample_rate: float | None = None,
    ) -> None:
        thresholds, weights = rising_pair("thresholds", thresholds, "weights", weights)
        if thresholds.size and thresholds[0] <= 0.0:
            raise ValueError(
                f"thresholds must be above zero, got {thresholds[0]:g} first: "
                "add the weight of a threshold of zero to the gain"
            )
        if creep is not None and not isinstance(creep, Creep):
            raise ValueError(f"creep must be a Creep or None, got {type(creep).__name__}")
        bends, changes = _bends(bends, bend_weights, weights.size)
        object.__setattr__(self, "gain", finite("gain", gain))
        object.__setattr__(self, "thresholds", thresholds)
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "offset", finite("offset", offset))
        object.__setattr__(self, "creep", creep)
        object.__setattr__(self, "bends", bends)
        object.__setattr__(self, "bend_weights", changes)
        rate = None if sample_rate is None else positive("sample_rate", sample_rate)
        object.__setattr__(self, "sample_rate", rate)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PrandtlIshlinskii):
            return NotImplemented
        return self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash((*self.theta.tolist(), self.offset))

    @property
    def is_plain(self) -> bool:
        """Whether it has neither creep nor bends."""
        return self.creep is None and self.bends.size == 0

    @property
    def parameter_names(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the entries of `theta`."""
        indices, terms = range(self.thresholds.size), range(self._creep_gains.size)
        return (
            "gain",
            *(f"thresholds[{i}]" for i in indices),
            *(f"weights[{i}]" for i in indices),
            *(f"creep.gains[{i}]" for i in terms),
            *(f"bend_weights[{j},{i}]" for j, i in np.ndindex(self.bend_weights.shape)),
        )

    @property
    def parameter_units(self) -> tuple[str, ...]:  # type: ignore[override]
        """Units of the entries of `theta`."""
        n = self.thresholds.size
        creep, bends = ("1",) * self._creep_gains.size, ("µm/V",) * self.bend_weights.size
        return ("µm/V",) + ("V",) * n + ("µm/V",) * n + creep + bends

    @property
    def theta(self) -> FloatArray:
        """Gain, thresholds, weights, creep gains and bend weights in one vector, shape (1 + 2n + …,)."""
        parts = ([self.gain], self.thresholds, self.weights, self._creep_gains, self.bend_weights.ravel())
        return np.concatenate(parts)

    @property
    def _creep_gains(self) -> FloatArray:
        return np.empty(0) if self.creep is None else self.creep.gains

    @classmethod
    def from_theta(cls, theta: Any, offset: float = 0.0) -> Self:
        """Make the model without creep and bends from its parameter vector.

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
        data: dict[str, Any] = {
            "model": type(self).__name__,
            "gain": self.gain,
            "thresholds": self.thresholds.tolist(),
            "weights": self.weights.tolist(),
            "offset": self.offset,
        }
        if self.creep is not None:
            data["creep"] = self.creep.to_dict()
        if self.bends.size:
            data["bends"] = self.bends.tolist()
            data["bend_weights"] = self.bend_weights.tolist()
        if self.sample_rate is not None:
            data["sample_rate"] = self.sample_rate
        return data

    @classmethod
    def from_dict(cls, data: Any) -> Self:
        """Make the model from what `to_dict` gave.

        Parameters
        ----------
        data : dict
            The dictionary; ``"model"``, if there, must name this class.

        Raises
        ------
        ValueError
            If a field is missing or unknown, or the dictionary is of another model.
        """
        if isinstance(data, dict) and data.get("creep") is not None:
            data = {**data, "creep": Creep.from_dict(data["creep"])}
        # Named, for a class with slots is made twice and `super()` then finds the first.
        return super(PrandtlIshlinskii, cls).from_dict(data)

    @property
    def is_admissible(self) -> bool:
        """Whether x rises with u from every state, so that the inverse exists."""
        negative_creep = float(np.minimum(self._creep_gains, 0.0).sum())
        lowest = np.vstack([np.zeros(self.weights.size + 1), np.cumsum(self.bend_weights, axis=0)])
        slopes = np.append(self.gain, self.weights) + lowest.min(axis=0)
        with np.errstate(over="ignore", invalid="ignore"):
            rising = np.cumsum(slopes)
        within = np.all(rising > admissible.SMALLEST) and np.all(rising < admissible.LARGEST)
        return bool(within and negative_creep > -1.0)

    def simulate(
        self,
        u: FloatArray,
        *,
        initial_state: FloatArray | None = None,
        sample_rate: float | None = None,
    ) -> FloatArray:
        """Displacement for a voltage record; exact for a voltage held over each sample.

        Parameters
        ----------
        u : array_like, shape (N,)
            Voltage [V].
        initial_state : array_like, shape (n,) or (n + m,), optional
            Play states [V] before the first sample, and after them those of the creep terms
            in parts of their gains [µm]; zeros if not given.
        sample_rate : float, optional
            [Hz]; needed with creep only, and there the model's own if not given.

        Returns
        -------
        ndarray, shape (N,)
            Displacement [µm].

        Raises
        ------
        ValueError
            If u is not a finite 1-D array, no input can leave `initial_state` behind, or the
            sample rate is missing.
        """
        x = array_1d("u", u).copy()
        y, z = self._start(initial_state)
        _simulate(x, y, z, self.gain, self.offset, *self._arrays(sample_rate))
        return x

    def invert(
        self,
        r: FloatArray,
        *,
        initial_state: FloatArray | None = None,
        sample_rate: float | None = None,
    ) -> FloatArray:
        """Voltage under which the model follows a reference exactly.

        Parameters
        ----------
        r : array_like, shape (N,)
            Reference displacement [µm].
        initial_state : array_like, shape (n,) or (n + m,), optional
            Play states [V] before the first sample, and after them those of the creep terms
            in parts of their gains [µm]; zeros if not given.
        sample_rate : float, optional
            [Hz]; needed with creep only, and there the model's own if not given.

        Returns
        -------
        ndarray, shape (N,)
            Voltage [V]; ``simulate(invert(r))`` is r.

        Raises
        ------
        ValueError
            If the model is not admissible, r is not a finite 1-D array, no input can leave
            `initial_state` behind, the sample rate is missing, or the voltage is too large for a number.
        """
        if not self.is_admissible:
            slopes = self.gain + np.concatenate(([0.0], np.cumsum(self.weights)))
            raise ValueError(
                f"the model has no inverse, its lowest slope is {slopes.min():g} µm/V: gain and "
                "gain + weights[0] + … + weights[i] must be above zero, with every bend"
            )
        u = array_1d("r", r).copy()
        y, z = self._start(initial_state)
        _invert(u, y, z, self.gain, self.offset, *self._arrays(sample_rate))
        return finite_voltage(self, u)

    def _arrays(self, sample_rate: float | None) -> tuple[FloatArray, ...]:
        """Thresholds, weights, creep gains and decays, bends and their weights, all flat."""
        if self.creep is None:
            gains = decays = np.empty(0)
        else:
            sample_rate = self.sample_rate if sample_rate is None else sample_rate
            if sample_rate is None:
                raise ValueError("sample_rate is needed for a model with creep: pass it in Hz")
            gains, decays = self.creep.gains, self.creep.decays(sample_rate)
        return self.thresholds, self.weights, gains, decays, self.bends, self.bend_weights.ravel()

    def _start(self, initial_state: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """Play states (n,) and creep states (m,) to start from, as own arrays."""
        n, m = self.thresholds.size, self._creep_gains.size
        if initial_state is None:
            return np.zeros(n), np.zeros(m)
        state = array_1d("initial_state", initial_state).copy()
        if state.size not in (n, n + m):
            and_creep = f" and {m} of creep" if m else ""
            raise ValueError(f"initial_state must hold {n} play states{and_creep}, got {state.size} values")
        y, z = state[:n], state[n:] if state.size > n else np.zeros(m)
        # The inverse's walk relies on it: neighbouring plays drift apart no further than this.
        slack = _STATE_TOLERANCE * self.thresholds[-1:].sum()
        if np.any(np.abs(np.diff(y)) > np.diff(self.thresholds) + slack):
            raise ValueError(
                "initial_state cannot be reached by any voltage: neighbouring play states may differ "
                "by no more than their thresholds do; take it from a simulation"
            )
        return y, z


def rising_pair(name: str, thresholds: Any, other: str, weights: Any) -> tuple[FloatArray, FloatArray]:
    """Rising thresholds and as many weights, as arrays that nobody else can write to."""
    thresholds = array_1d(name, thresholds).copy()
    weights = array_1d(other, weights).copy()
    if thresholds.size != weights.size:
        raise ValueError(
            f"{other} must have one value per threshold, got {weights.size} weights for "
            f"{thresholds.size} thresholds"
        )
    if np.any(np.diff(thresholds) <= 0.0):
        raise ValueError(
            f"{name} must rise from entry to entry, got {thresholds}: "
            "sort them together with the weights and merge equal ones"
        )
    thresholds.flags.writeable = False
    weights.flags.writeable = False
    return thresholds, weights


def _bends(bends: Any, weights: Any, plays: int) -> tuple[FloatArray, FloatArray]:
    """Rising voltages and a row of changes for each, as arrays that nobody else can write to."""
    bends = array_1d("bends", bends).copy()
    shape = (bends.size, 1 + plays)
    changes = as_floats("bend_weights", weights).copy()
    if changes.size == 0:
        changes = changes.reshape(0, 1 + plays)
    if changes.shape != shape:
        raise ValueError(
            f"bend_weights must have shape {shape}, a row for each of bends and a column for the gain "
            f"and each weight, got {changes.shape}"
        )
    array_1d("bend_weights", changes.ravel())
    if np.any(np.diff(bends) <= 0.0):
        raise ValueError(f"bends must rise from entry to entry, got {bends}: sort them with their weights")
    bends.flags.writeable = False
    changes.flags.writeable = False
    return bends, changes


@compiled()
def _simulate(
    x: Any, y: Any, z: Any, gain: float, offset: float, thresholds: Any, weights: Any, gains: Any,
    decays: Any, bends: Any, changes: Any,
) -> None:  # fmt: skip
    """`x` comes as voltage and goes as displacement; `y` and `z` are updated."""
    for k in range(x.size):
        w = bent_plays_step(y, x[k], gain, thresholds, weights, bends, changes)
        unit_creep_step(z, w, decays)
        for i in range(z.size):
            w = w + gains[i] * z[i]
        x[k] = w + offset


@compiled()
def _invert(
    u: Any, y: Any, z: Any, gain: float, offset: float, thresholds: Any, weights: Any, gains: Any,
    decays: Any, bends: Any, changes: Any,
) -> None:  # fmt: skip
    """`u` comes as displacement and goes as voltage; `y` and `z` are updated."""
    last = 0.0
    for k in range(u.size):
        held, share = creep_to_come(z, gains, decays)
        w = (u[k] - offset - held) / (1.0 + share)
        last = prandtl_ishlinskii_voltage(y, last, w, gain, thresholds, weights, bends, changes)
        bent_plays_step(y, last, gain, thresholds, weights, bends, changes)
        unit_creep_step(z, w, decays)
        u[k] = last
