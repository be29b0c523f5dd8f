"""A Preisach model of a stage, to be simulated: neither Coleman-Hodgdon nor Prandtl-Ishlinskii."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from piezoest._checks import FloatArray, array_1d, finite, positive
from piezoest.compile import Vector, compiled
from piezoest.equations.preisach import preisach_step
from piezoest.models._base import Model, rising_pair


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Preisach(Model):
    """Preisach hysteresis: x = gain u + sum_i weights[i] relays(play_i[u]) + offset.

    The relays of half-width thresholds[i] are spread over the voltage with the density sech²((s -
    centre)/width): their share of the slope is weights[i] at the centre and falls off on both sides of it,
    which makes the loop asymmetric, and minor loops differ with their place.

    Parameters
    ----------
    gain : float
        Slope of the part without hysteresis [µm/V], above zero.
    thresholds : array_like, shape (n,)
        Half-widths of the relays [V], above zero and rising.
    weights : array_like, shape (n,)
        Slope that the relays of each half-width add at the centre [µm/V], zero or more.
    centre, width : float
        Of the density over the voltage [V]; the width is above zero.
    offset : float
        Displacement at zero voltage, after rest at zero [µm].

    Raises
    ------
    ValueError
        If a value is out of its range or the lengths differ.

    Notes
    -----
    Made for simulation: it has no `invert`. `theta` holds gain, thresholds, weights, centre and
    width. Sources: I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991; M.
    Brokate, J. Sprekels, Hysteresis and Phase Transitions, Springer 1996, sec. 2.4.

    Examples
    --------
    >>> import numpy as np
    >>> import piezoest as pz
    >>> model = pz.PreisachStage(1000.0).hysteresis
    >>> model.simulate(np.array([0.0, 10.0, 20.0, 10.0])).round(3)
    array([0.   , 1.199, 2.731, 1.614])
    """

    gain: float
    thresholds: FloatArray
    weights: FloatArray
    centre: float
    width: float
    offset: float = 0.0

    def __init__(
        self,
        gain: float,
        thresholds: ArrayLike,
        weights: ArrayLike,
        centre: float,
        width: float,
        offset: float = 0.0,
    ) -> None:
        thresholds, weights = rising_pair(thresholds, weights)
        if np.any(weights < 0.0):
            raise ValueError(f"weights must be zero or more, got {weights.min():g}")
        self._keep(
            gain=positive("gain", gain), thresholds=thresholds, weights=weights,
            centre=finite("centre", centre), width=positive("width", width), offset=finite("offset", offset),
        )  # fmt: skip

    def __repr__(self) -> str:
        return (
            f"Preisach(gain={self.gain:.4g}, {self.thresholds.size} thresholds, centre={self.centre:.4g}, "
            f"width={self.width:.4g}, offset={self.offset:.4g})"
        )

    @property
    def parameter_names(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the entries of `theta`."""
        indices = range(self.thresholds.size)
        plays = (*(f"thresholds[{i}]" for i in indices), *(f"weights[{i}]" for i in indices))
        return ("gain", *plays, "centre", "width")

    @property
    def parameter_units(self) -> tuple[str, ...]:  # type: ignore[override]
        """Units of the entries of `theta`."""
        n = self.thresholds.size
        return ("µm/V",) + ("V",) * n + ("µm/V",) * n + ("V", "V")

    @property
    def theta(self) -> FloatArray:
        """Gain, thresholds, weights, centre and width in one vector, shape (3 + 2n,)."""
        return np.concatenate(([self.gain], self.thresholds, self.weights, [self.centre, self.width]))

    @property
    def is_admissible(self) -> bool:
        """Whether x rises with u: always, for these parameters."""
        return True

    def stage_settings(self) -> dict[str, Any]:
        """How the model sits in a `SimulatedStage`: see `piezoest.stage.kernel.hysteresis_layouts`."""
        return {name: getattr(self, name) for name in ("gain", "thresholds", "weights", "centre", "width")}

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
            If u is not a finite 1-D array or `initial_state` has another length.
        """
        x = array_1d("u", u).copy()
        n = self.thresholds.size
        y = np.zeros(n) if initial_state is None else array_1d("initial_state", initial_state).copy()
        if y.size != n:
            raise ValueError(f"initial_state must hold {n} play states, got {y.size}")
        _simulate(x, y, self.gain, self.thresholds, self.weights, self.centre, self.width, self.offset)
        return x


@compiled
def _simulate(
    x: Vector, y: Vector, gain: float, thresholds: Vector, weights: Vector, centre: float, width: float,
    offset: float,
) -> None:  # fmt: skip
    """`x` comes as voltage and goes as displacement; `y` is updated."""
    for k in range(x.size):
        x[k] = preisach_step(y, x[k], gain, thresholds, weights, centre, width) + offset
