"""The Coleman-Hodgdon model of a stage, (1)-(4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d, finite
from piezoest._jit import compiled
from piezoest.equations import admissible
from piezoest.equations import coleman_hodgdon as equations
from piezoest.models._base import Model, finite_voltage
from piezoest.signals import check_continuity


@dataclass(frozen=True, slots=True)
class ColemanHodgdon(Model):
    """Coleman-Hodgdon hysteresis: dw/dt = beta u' - alpha w|u'| + gamma |u'| u (1).

    The same map in its second form is x = c u + w_h + offset with
    dw_h/dt = -b u' - a w_h |u'| (2)-(4), and a, b, c as attributes.

    Parameters
    ----------
    alpha : float
        Rate at which a branch approaches its asymptote [1/V].
    beta : float
        Slope at u = w = 0 on an initial branch [µm/V].
    gamma : float
        alpha times the slope of the asymptote [µm/V²].
    offset : float
        Displacement at zero voltage and w_h = 0 [µm]; holds a sensor bias or the
        centre of a unipolar loop.

    Raises
    ------
    ValueError
        If a parameter is not a finite number, or alpha is zero.

    Notes
    -----
    Admissible, so that the slope dx/du keeps the sign of u' and the inverse exists, are
    alpha > 0, beta > 0, alpha beta < gamma <= 2 alpha beta; that is a > 0, b > 0, c >= 2b.
    Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012).
    """

    alpha: float
    beta: float
    gamma: float
    offset: float = 0.0

    parameter_names: ClassVar[tuple[str, ...]] = ("alpha", "beta", "gamma")
    parameter_units: ClassVar[tuple[str, ...]] = ("1/V", "µm/V", "µm/V²")

    def __post_init__(self) -> None:
        self._check_finite()
        if self.alpha == 0.0:
            raise ValueError("alpha is 0, which is no hysteresis: use LinearGain(gain) instead")

    @classmethod
    def from_loop(cls, a: float, b: float, c: float, offset: float = 0.0) -> Self:
        """Make the model from (a, b, c) of its second form (4).

        Parameters
        ----------
        a, b, c : float
            [1/V], [µm/V], [µm/V].
        offset : float
            Displacement at zero voltage and w_h = 0 [µm].
        """
        alpha, beta, gamma = equations.rate_parameters(finite("a", a), finite("b", b), finite("c", c))
        return cls(alpha, beta, gamma, offset)

    @property
    def a(self) -> float:
        """alpha [1/V] (4)."""
        return self.alpha

    @property
    def b(self) -> float:
        """gamma/alpha - beta [µm/V] (4)."""
        return self.gamma / self.alpha - self.beta

    @property
    def c(self) -> float:
        """gamma/alpha [µm/V], the slope of the asymptotes (4)."""
        return self.gamma / self.alpha

    @property
    def is_admissible(self) -> bool:
        """Whether the parameters are thermodynamically admissible and invertible."""
        return bool(admissible.has_inverse(self.alpha, self.beta, self.gamma))

    def nearest_admissible(self, margin: float = admissible.NEAREST_MARGIN) -> Self:
        """Nearest admissible model, each parameter measured in parts of its own value.

        Parameters
        ----------
        margin : float
            Distance kept from the faces of the set, in parts of gamma (default 1e-6).

        Returns
        -------
        ColemanHodgdon
            This model itself if it is admissible.

        Raises
        ------
        ValueError
            If the parameters are so small or large that there is none.
        """
        if self.is_admissible:
            return self
        theta = self.theta
        with np.errstate(all="ignore"):
            known = admissible.nearest_admissible(theta, np.empty(9), margin)
        alpha, beta, gamma = (float(value) for value in theta)
        if not (known and admissible.has_inverse(alpha, beta, gamma)):
            raise ValueError(f"{self} has no admissible model near it: check the units of its parameters")
        return type(self)(alpha, beta, gamma, self.offset)

    def simulate(self, u: FloatArray, *, initial_state: float = 0.0, allow_jumps: bool = False) -> FloatArray:
        """Displacement for a voltage record, exact between samples (u taken monotone there).

        Parameters
        ----------
        u : array_like, shape (N,)
            Voltage [V].
        initial_state : float
            w_h [µm] at the first sample.
        allow_jumps : bool
            Take jumps between samples as fast monotone changes instead of refusing them.

        Returns
        -------
        ndarray, shape (N,)
            Displacement [µm].

        Raises
        ------
        ValueError
            If u is not a finite 1-D array, or jumps: the model is defined for connected
            inputs only.
        """
        u = array_1d("u", u)
        if not allow_jumps:
            check_continuity(u, name="u")
        x = np.empty_like(u)
        _simulate(u, finite("initial_state", initial_state), self.a, self.b, self.c, self.offset, x)
        return x

    def invert(self, r: FloatArray, *, initial_state: float = 0.0, allow_jumps: bool = False) -> FloatArray:
        """Voltage under which the model follows a reference exactly (14), (C7), (C10).

        Parameters
        ----------
        r : array_like, shape (N,)
            Reference displacement [µm].
        initial_state : float
            w_h [µm] at the first sample.
        allow_jumps : bool
            Take jumps between samples as fast monotone changes instead of refusing them.

        Returns
        -------
        ndarray, shape (N,)
            Voltage [V]; ``simulate(invert(r))`` is r.

        Raises
        ------
        ValueError
            If the model is not admissible, r is not a finite, connected 1-D array, or the voltage is too
            large for a number.
        """
        if not self.is_admissible:
            raise ValueError(f"{self} is not admissible and has no inverse: use nearest_admissible()")
        if abs(initial_state) * self.a > self.b * (1.0 + 1e-9):
            raise ValueError(
                f"initial_state must lie within ±b/a = ±{self.b / self.a:.6g} µm, got {initial_state:g} µm"
            )
        r = array_1d("r", r)
        if not allow_jumps:
            check_continuity(r, name="r")
        u = np.empty_like(r)
        _invert(r, finite("initial_state", initial_state), self.a, self.b, self.c, self.offset, u)
        return finite_voltage(self, u)


@compiled()
def _simulate(u: Any, w_h: float, a: float, b: float, c: float, offset: float, x: Any) -> None:
    for k in range(u.size):
        if k > 0:
            w_h = equations.hysteresis_step(w_h, u[k] - u[k - 1], a, b)
        x[k] = c * u[k] + w_h + offset


@compiled()
def _invert(r: Any, w_h: float, a: float, b: float, c: float, offset: float, u: Any) -> None:
    for k in range(r.size):
        if k == 0:
            u[k] = (r[k] - offset - w_h) / c
        else:
            dr = r[k] - (c * u[k - 1] + w_h + offset)
            du = equations.inverse_increment(w_h, dr, a, b, c)
            w_h = equations.hysteresis_step(w_h, du, a, b)
            u[k] = u[k - 1] + du
