"""The ideal linear stage, x = K u (8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from piezoest._checks import FloatArray, array_1d
from piezoest.equations import admissible
from piezoest.models._base import Model, finite_voltage


@dataclass(frozen=True, slots=True)
class LinearGain(Model):
    """The ideal linear stage: x = K u + offset (8).

    Parameters
    ----------
    gain : float
        Voltage-to-displacement gain K [µm/V].
    offset : float
        Displacement at zero voltage [µm].

    Raises
    ------
    ValueError
        If a parameter is not a finite number.
    """

    gain: float
    offset: float = 0.0

    parameter_names: ClassVar[tuple[str, ...]] = ("gain",)
    parameter_units: ClassVar[tuple[str, ...]] = ("µm/V",)

    def __post_init__(self) -> None:
        self._check_finite()

    @property
    def is_admissible(self) -> bool:
        """Whether the gain can be inverted: it is neither zero nor so small that the voltage overflows."""
        return abs(self.gain) > admissible.SMALLEST

    def simulate(self, u: FloatArray) -> FloatArray:
        """Displacement for a voltage record.

        Parameters
        ----------
        u : array_like, shape (N,)
            Voltage [V].

        Returns
        -------
        ndarray, shape (N,)
            Displacement [µm].
        """
        return self.gain * array_1d("u", u) + self.offset

    def invert(self, r: FloatArray) -> FloatArray:
        """Voltage that gives a displacement: u = (r - offset)/K (11).

        Parameters
        ----------
        r : array_like, shape (N,)
            Reference displacement [µm].

        Returns
        -------
        ndarray, shape (N,)
            Voltage [V].

        Raises
        ------
        ValueError
            If the gain is zero or next to it, or the voltage is too large for a number.
        """
        if not self.is_admissible:
            raise ValueError(f"gain is {self.gain:g} µm/V, which has no inverse: identify the gain first")
        with np.errstate(over="ignore", invalid="ignore"):
            return finite_voltage(self, (array_1d("r", r) - self.offset) / self.gain)
