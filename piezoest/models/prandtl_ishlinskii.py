"""The Prandtl-Ishlinskii model of a stage: a gain and a weighted sum of plays."""

import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from piezoest._checks import FloatArray, array_1d, as_floats, finite, instance, positive, rate_of
from piezoest.compile import Record, Vector, compiled
from piezoest.equations import admissible, play_inverse
from piezoest.equations.bent_plays import bent_plays_step, prandtl_ishlinskii_voltage
from piezoest.equations.creep import creep_to_come, unit_creep_step
from piezoest.layout import new
from piezoest.models._base import Model, finite_voltage, rising_pair
from piezoest.models.creep import Creep

# Rounding allowed for in a given initial state, relative to the largest threshold.
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
        Values of the voltage, or of a play's output, at which its slope changes [V], rising.
    bend_weights : array_like, shape (k, 1 + n), optional
        Change of slope above each bend [µm/V], of the gain and of each weight.
    sample_rate : float, optional
        Rate at which creep proceeds where no other is given [Hz].

    Raises
    ------
    ValueError
        If a value is out of its range, the bends or thresholds do not rise, or the shapes do not fit.

    Notes
    -----
    The inverse exists if x rises with u: gain > 0 and gain + weights[0] + … + weights[i] > 0 for every i,
    with bends for the smallest value of each, and negative creep gains that sum to more than -1. `theta`
    holds the gain, the thresholds, the weights, the creep gains, and the bend weights row by row.

    Sources: P. Krejci, K. Kuhnen, IEE Proc. Control Theory Appl. 148 (2001) 185-192; K. Kuhnen, European
    Journal of Control 9 (2003) 407-418 (one-sided dead zones, here on each play, see
    `piezoest.equations.bent_plays`); K. Kuhnen, P. Krejci, IEEE Trans. Autom. Control 54 (2009) 537-550
    (creep).

    Examples
    --------
    >>> import piezoest as pz
    >>> model = pz.PrandtlIshlinskii(gain=0.1, thresholds=[2.0, 5.0], weights=[0.03, 0.02])
    >>> model.simulate([0.0, 10.0, 20.0, 10.0]).round(3)  # V to µm
    array([0.  , 1.34, 2.84, 1.66])
    """

    gain: float
    thresholds: FloatArray
    weights: FloatArray
    offset: float = 0.0
    creep: Creep | None = None
    bends: FloatArray = dataclasses.field(default_factory=lambda: np.empty(0))
    bend_weights: FloatArray = dataclasses.field(default_factory=lambda: np.empty((0, 1)))
    sample_rate: float | None = None

    inverse: ClassVar[Any] = play_inverse
    remedy: ClassVar[str] = "gain and gain + weights[0] + … + weights[i] must be above zero with every bend"

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
        thresholds, weights = rising_pair(thresholds, weights)
        instance("creep", creep, Creep | None, "a Creep or None")
        bends, changes = _bends(bends, bend_weights, weights.size)
        self._keep(
            gain=finite("gain", gain), thresholds=thresholds, weights=weights,
            offset=finite("offset", offset), creep=creep, bends=bends, bend_weights=changes,
            sample_rate=None if sample_rate is None else positive("sample_rate", sample_rate),
        )  # fmt: skip

    def __repr__(self) -> str:
        reach = f" up to {self.thresholds[-1]:.3g} V" if self.thresholds.size else ""
        return (
            f"PrandtlIshlinskii(gain={self.gain:.4g}, {self.thresholds.size} plays{reach}, {self.bends.size} "
            f"bends, {self._creep_gains.size} creep terms, offset={self.offset:.4g})"
        )

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

        `theta` (1 + 2n,): gain, n thresholds, n weights. `offset`: displacement at zero voltage and plays at
        zero [µm].
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
        creep = None if self.creep is None else self.creep.to_dict()
        data = super(PrandtlIshlinskii, self).to_dict() | {"creep": creep}
        absent = ("bends", "bend_weights") * (not self.bends.size)
        return {name: value for name, value in data.items() if value is not None and name not in absent}

    @classmethod
    def _read(cls, values: dict[str, Any]) -> dict[str, Any]:
        creep = values.get("creep")
        return values if creep is None else {**values, "creep": Creep.from_dict(creep)}

    @property
    def is_admissible(self) -> bool:
        """Whether x rises with u from every state, so that the inverse exists."""
        negative_creep = float(np.minimum(self._creep_gains, 0.0).sum())
        rising = self._rising
        within = np.all(rising > admissible.SMALLEST) and np.all(rising < admissible.LARGEST)
        return bool(within and negative_creep > -1.0)

    @property
    def _rising(self) -> FloatArray:
        """Least slope while so many plays move, shape (n + 1,) [µm/V]."""
        lowest = np.vstack([np.zeros(self.weights.size + 1), np.cumsum(self.bend_weights, axis=0)])
        slopes = np.append(self.gain, self.weights) + lowest.min(axis=0)
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(np.cumsum(slopes))

    def stage_settings(self) -> dict[str, Any]:
        """How the model sits in a `SimulatedStage`: see `piezoest.stage.kernel.hysteresis_layouts`.

        Raises
        ------
        ValueError
            If it has bends, or creep of its own.
        """
        if self.creep is not None or self.bends.size:
            raise ValueError(
                "hysteresis must have neither bends nor creep of its own: pass creep=model.creep to the stage"
            )
        return {"gain": self.gain, "thresholds": self.thresholds, "weights": self.weights}

    def simulate(
        self, u: Any, *, initial_state: FloatArray | None = None, sample_rate: float | None = None
    ) -> FloatArray:
        """Displacement [µm], shape (N,), for a voltage record; exact for a voltage held over each sample.

        Parameters
        ----------
        u : array_like, shape (N,)
            Voltage [V].
        initial_state : array_like, shape (n,) or (n + m,), optional
            Play states [V] before the first sample, and after them those of the creep terms
            relative to their gains [µm]; zeros if not given.
        sample_rate : float, optional
            [Hz]; needed with creep only. Default: that of a `Signal`, else the model's own.

        Raises
        ------
        ValueError
            If u is not a finite 1-D array, no voltage can lead to `initial_state`, or the
            sample rate is missing or another one than that of a `Signal`.
        """
        sample_rate = rate_of(u, sample_rate)
        x = array_1d("u", u, sample_rate=sample_rate).copy()
        self._through(_simulate, x, initial_state, sample_rate)
        return x

    def invert(
        self, r: Any, *, initial_state: FloatArray | None = None, sample_rate: float | None = None
    ) -> FloatArray:
        """Voltage [V], shape (N,), under which the model follows a reference exactly.

        Parameters
        ----------
        r : array_like, shape (N,)
            Reference displacement [µm].
        initial_state, sample_rate
            As in `simulate`.

        Raises
        ------
        ValueError
            As in `simulate`, and if the model is not admissible or the voltage is too large for a number.
        """
        if not self.is_admissible:
            raise ValueError(
                f"the model has no inverse, its lowest slope is {self._rising.min():g} µm/V, its creep gains "
                f"sum to {self._creep_gains.sum():g}: {self.remedy}, and negative creep gains above -1 in sum"
            )
        sample_rate = rate_of(r, sample_rate)
        u = array_1d("r", r, sample_rate=sample_rate).copy()
        self._through(_invert, u, initial_state, sample_rate)
        return finite_voltage(self, u)

    @property
    def slope(self) -> float:
        """Slope from rest [µm/V], where no play moves."""
        return self.gain

    def _through(self, loop: Any, record: FloatArray, initial_state: Any, sample_rate: float | None) -> None:
        """Run a compiled loop over a record, which changes in place."""
        y, z = self._start(initial_state)
        settings = self.inverse_settings(sample_rate)
        layouts = self.inverse.layouts(settings)
        loop.of(*layouts)(new(layouts[0], y=y, z=z), new(layouts[1], **settings), record)

    def inverse_settings(self, sample_rate: float | None) -> dict[str, Any]:
        """Gain, offset, thresholds, weights, creep gains and decays, bends and their weights row by row."""
        if self.creep is None:
            gains = decays = np.empty(0)
        else:
            sample_rate = self.sample_rate if sample_rate is None else sample_rate
            if sample_rate is None:
                raise ValueError("sample_rate is needed for a model with creep: pass it in Hz")
            gains, decays = self.creep.gains, self.creep.decays(sample_rate)
        return {
            "gain": self.gain,
            "offset": self.offset,
            "thresholds": self.thresholds,
            "weights": self.weights,
            "creep_gains": gains,
            "decays": decays,
            "bends": self.bends,
            "bend_weights": self.bend_weights.ravel(),
        }

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


def _bends(bends: Any, weights: Any, plays: int) -> tuple[FloatArray, FloatArray]:
    """Rising voltages and a row of changes for each, as arrays of their own."""
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
    return bends, changes


@compiled
def _simulate(state: Record, model: Record, x: Vector) -> None:
    """`x` comes as voltage and goes as displacement."""
    for k in range(len(x)):
        w = bent_plays_step(
            state.y, x[k], model.gain, model.thresholds, model.weights, model.bends, model.bend_weights
        )
        unit_creep_step(state.z, w, model.decays)
        for i in range(len(state.z)):
            w = w + model.creep_gains[i] * state.z[i]
        x[k] = w + model.offset


@compiled
def _invert(state: Record, model: Record, u: Vector) -> None:
    """`u` comes as displacement and goes as voltage."""
    y, z, gain, thresholds, weights = state.y, state.z, model.gain, model.thresholds, model.weights
    last = 0.0
    for k in range(len(u)):
        held, share = creep_to_come(z, model.creep_gains, model.decays)
        w = (u[k] - model.offset - held) / (1.0 + share)
        last = prandtl_ishlinskii_voltage(
            y, last, w, gain, thresholds, weights, model.bends, model.bend_weights
        )
        bent_plays_step(y, last, gain, thresholds, weights, model.bends, model.bend_weights)
        unit_creep_step(z, w, model.decays)
        u[k] = last
