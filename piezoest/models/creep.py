"""Creep of a stage: what is added to the hysteresis, slowly."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from piezoest._checks import FloatArray, array_1d, finite, integer, positive
from piezoest.compile import Vector, compiled
from piezoest.equations.creep import creep_step
from piezoest.models._base import AsFields


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Creep(AsFields):
    """Logarithmic creep as first-order terms: x_creep = sum_i z_i, tau_i z_i' = gains[i] w - z_i.

    Parameters
    ----------
    gains : array_like, shape (n,)
        What each term adds in the end, relative to the displacement w [1].
    time_constants : array_like, shape (n,)
        tau_i [s], above zero.

    Raises
    ------
    ValueError
        If a value is not finite, a time constant is not above zero, or the lengths differ.

    Notes
    -----
    Source: K. Kuhnen, P. Krejci, IEEE Trans. Autom. Control 54 (2009) 537-550.

    Examples
    --------
    >>> import numpy as np
    >>> import piezoest as pz
    >>> creep = pz.Creep(gains=[0.01, 0.01], time_constants=[0.1, 1.0])
    >>> creep.simulate(np.ones(4), sample_rate=10.0).round(4)
    array([0.0073, 0.0105, 0.0121, 0.0131])
    """

    called = "creep"

    gains: FloatArray
    time_constants: FloatArray

    def __init__(self, gains: ArrayLike, time_constants: ArrayLike) -> None:
        gains = array_1d("gains", gains).copy()
        time_constants = array_1d("time_constants", time_constants).copy()
        if gains.size != time_constants.size:
            raise ValueError(
                f"time_constants must have one value per gain, got {time_constants.size} "
                f"for {gains.size} gains"
            )
        if np.any(time_constants <= 0.0):
            raise ValueError(f"time_constants must be above zero, got {time_constants.min():g}")
        self._keep(gains=gains, time_constants=time_constants)

    @classmethod
    def logarithmic(
        cls, gain_per_decade: float, *, shortest: float, longest: float, terms_per_decade: int = 1
    ) -> Self:
        """Make the creep that adds the same share of w in every decade of time.

        Parameters
        ----------
        gain_per_decade : float
            Share of the displacement added in each decade [1]; 0.01 to 0.02 is typical of piezos.
        shortest, longest : float
            First and last time constant [s].
        terms_per_decade : int
            Terms in each decade of time.

        Raises
        ------
        ValueError
            If `longest` is not above `shortest`, or a value is out of its range.
        """
        shortest, longest = positive("shortest", shortest), positive("longest", longest)
        if longest <= shortest:
            raise ValueError(f"longest must be above shortest = {shortest:g} s, got {longest:g} s")
        per_decade = integer("terms_per_decade", terms_per_decade, 1)
        decades = math.log10(longest / shortest)
        count = max(2, round(decades * per_decade) + 1)
        gain = finite("gain_per_decade", gain_per_decade) * decades / (count - 1)
        return cls(np.full(count, gain), np.geomspace(shortest, longest, count))

    def decays(self, sample_rate: float) -> FloatArray:
        """Factors exp(-dt/tau_i) of one sample, shape (n,).

        Parameters
        ----------
        sample_rate : float
            [Hz].
        """
        return np.exp(-1.0 / (positive("sample_rate", sample_rate) * self.time_constants))

    def simulate(
        self, w: FloatArray, *, sample_rate: float, initial_state: FloatArray | None = None
    ) -> FloatArray:
        """x_creep at the end of each sample, for w held over the sample.

        Parameters
        ----------
        w : array_like, shape (N,)
            Displacement without creep [µm].
        sample_rate : float
            [Hz].
        initial_state : array_like, shape (n,), optional
            z_i [µm] before the first sample; zeros if not given.

        Returns
        -------
        ndarray, shape (N,)
            What creep adds to the displacement [µm].

        Raises
        ------
        ValueError
            If w is not a finite 1-D array, or `initial_state` has another length than the gains.
        """
        x = array_1d("w", w, sample_rate=sample_rate).copy()
        z = (
            np.zeros(self.gains.size)
            if initial_state is None
            else array_1d("initial_state", initial_state).copy()
        )
        if z.size != self.gains.size:
            raise ValueError(f"initial_state must hold {self.gains.size} values, got {z.size}")
        _simulate(x, z, self.gains, self.decays(sample_rate))
        return x


@compiled
def _simulate(x: Vector, z: Vector, gains: Vector, decays: Vector) -> None:
    """`x` comes as w and goes as what creep adds to it; `z` is updated."""
    for k in range(x.size):
        x[k] = creep_step(z, x[k], gains, decays)
