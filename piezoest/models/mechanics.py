"""Mechanics of a stage: one lightly damped resonance, (5)."""

from dataclasses import dataclass

import numpy as np

from piezoest._checks import FloatArray, array_1d, non_negative, positive
from piezoest.compile import Vector, compiled
from piezoest.equations.mechanics import mechanics_coefficients, mechanics_step
from piezoest.models._base import AsFields


@dataclass(frozen=True, slots=True)
class MassSpringDamper(AsFields):
    """Second-order mechanics of unit static gain: x'' + 2 zeta omega x' + omega² x = omega² f (5).

    Parameters
    ----------
    natural_frequency : float
        omega/(2 pi) [Hz].
    damping_ratio : float
        zeta [1], zero or more.

    Raises
    ------
    ValueError
        If the natural frequency is not above zero or the damping ratio is negative.

    Examples
    --------
    >>> import numpy as np
    >>> import piezoest as pz
    >>> mechanics = pz.MassSpringDamper(natural_frequency=780.0, damping_ratio=0.02)
    >>> mechanics.simulate(np.ones(3), sample_rate=10_000.0).round(3)
    array([0.117, 0.437, 0.883])
    """

    called = "mechanics"

    natural_frequency: float
    damping_ratio: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "natural_frequency", positive("natural_frequency", self.natural_frequency))
        object.__setattr__(self, "damping_ratio", non_negative("damping_ratio", self.damping_ratio))

    def coefficients(self, sample_rate: float) -> FloatArray:
        """Exact step of one sample with the input held, shape (6,): see `mechanics_coefficients`.

        Parameters
        ----------
        sample_rate : float
            [Hz].
        """
        dt = 1.0 / positive("sample_rate", sample_rate)
        return mechanics_coefficients(self.natural_frequency, self.damping_ratio, dt)

    def simulate(
        self, f: FloatArray, *, sample_rate: float, initial_state: FloatArray | None = None
    ) -> FloatArray:
        """Displacement at the end of each sample, for f held over the sample.

        Parameters
        ----------
        f : array_like, shape (N,)
            Displacement that the stage would take without inertia [µm].
        sample_rate : float
            [Hz].
        initial_state : array_like, shape (2,), optional
            Displacement [µm] and velocity [µm/s] before the first sample; zeros if not given.

        Returns
        -------
        ndarray, shape (N,)
            Displacement [µm].

        Raises
        ------
        ValueError
            If f is not a finite 1-D array, or `initial_state` has not two entries.
        """
        x = array_1d("f", f).copy()
        state = np.zeros(2) if initial_state is None else array_1d("initial_state", initial_state).copy()
        if state.size != 2:
            raise ValueError(f"initial_state must hold displacement and velocity, got {state.size} values")
        _simulate(x, state, self.coefficients(sample_rate))
        return x


@compiled
def _simulate(x: Vector, state: Vector, coefficients: Vector) -> None:
    """`x` comes as f and goes as displacement; `state` is updated."""
    for k in range(x.size):
        x[k] = mechanics_step(state, x[k], coefficients)
