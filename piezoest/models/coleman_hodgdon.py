"""The Coleman-Hodgdon model of a stage, (1)-(4)."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d, finite
from piezoest.compile import Vector, compiled
from piezoest.equations import admissible, loop_inverse
from piezoest.equations import coleman_hodgdon as equations
from piezoest.models._base import finite_voltage
from piezoest.models.free_running import FreeRunning
from piezoest.signals import check_continuity

# Distance a fit keeps from gamma = alpha beta and gamma = 2 alpha beta, relative to alpha beta.
_FIT_MARGIN = 1e-6
# Least alpha and beta of a fit, relative to their start.
_LEAST = 1e-6


@dataclass(frozen=True, slots=True)
class ColemanHodgdon(FreeRunning):
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
        Displacement at zero voltage and w_h = 0 [µm]: a sensor bias, or the centre of a unipolar loop.

    Raises
    ------
    ValueError
        If a parameter is not a finite number, or alpha is zero.

    Notes
    -----
    The parameters are admissible if x rises with u, so that the inverse exists: alpha > 0, beta > 0,
    alpha beta < gamma <= 2 alpha beta, which means a > 0, b > 0, c >= 2b.
    Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012).

    Examples
    --------
    >>> import numpy as np
    >>> import piezoest as pz
    >>> model = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
    >>> x = model.simulate(np.array([0.0, 10.0, 20.0, 10.0]))  # V to µm
    >>> x.round(3)
    array([0.   , 1.526, 3.15 , 1.801])
    >>> model.invert(x).round(6)  # µm to V
    array([ 0., 10., 20., 10.])
    """

    alpha: float
    beta: float
    gamma: float
    offset: float = 0.0

    parameter_names: ClassVar[tuple[str, ...]] = ("alpha", "beta", "gamma")
    parameter_units: ClassVar[tuple[str, ...]] = ("1/V", "µm/V", "µm/V²")
    inverse: ClassVar[Any] = loop_inverse
    remedy: ClassVar[str] = (
        "alpha and beta must be above zero, and gamma between alpha·beta and 2·alpha·beta; "
        "nearest_admissible() moves it there"
    )

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

    def inverse_settings(self, sample_rate: float | None) -> dict[str, Any]:
        """Second form (4) and offset, whatever the sample rate."""
        return {"a": self.a, "b": self.b, "c": self.c, "offset": self.offset}

    @property
    def line(self) -> tuple[float, float]:
        """Slope from rest [µm/V] and offset [µm]."""
        return self.beta, self.offset

    def nearest_admissible(self, margin: float = admissible.NEAREST_MARGIN) -> Self:
        """Nearest admissible model, each parameter measured relative to its own value; itself if it is one.

        Parameters
        ----------
        margin : float
            Distance kept from the faces of the set, relative to gamma (default 1e-6).

        Raises
        ------
        ValueError
            If the parameters are so small or large that there is none.
        """
        if self.is_admissible:
            return self
        theta = self.theta
        with np.errstate(all="ignore"):
            known = admissible.nearest_admissible(theta, margin)
        alpha, beta, gamma = (float(value) for value in theta)
        if not (known and admissible.has_inverse(alpha, beta, gamma)):
            raise ValueError(f"{self} has no admissible model near it: check the units of its parameters")
        return type(self)(alpha, beta, gamma, self.offset)

    # ------------------------------------------------------------ what a fit varies

    state_names: ClassVar[tuple[str, ...]] = ("initial_state",)
    is_loop: ClassVar[bool] = True

    @classmethod
    def coordinates(cls, held: Collection[str], within_reach: bool) -> tuple[str, ...]:
        """Put gamma/(alpha beta) in place of the last of alpha, beta, gamma that is not held.

        Admissible is then a box: a > 0, b > 0 and c >= 2b are bounds. Within reach are start states of at
        most b/a: ``place``, the part of it, is then varied.
        """
        names = super(ColemanHodgdon, cls).coordinates(held, within_reach)
        replaced = [name for name in cls.parameter_names if name in names][-1:]
        place = ["initial_state"] if within_reach else []
        return tuple("ratio" if name in replaced else "place" if name in place else name for name in names)

    @classmethod
    def complete(cls, value: dict[str, Any]) -> None:
        """Add the parameter that the ratio stands for, and the start state."""
        if "gamma" not in value:
            value["gamma"] = value["ratio"] * value["alpha"] * value["beta"]
        elif "beta" not in value:
            value["beta"] = value["gamma"] / (value["alpha"] * value["ratio"])
        elif "alpha" not in value:
            value["alpha"] = value["gamma"] / (value["beta"] * value["ratio"])
        if "place" in value:
            a, b, _ = cls.constants(value)
            value["initial_state"] = value["place"] * b / a

    @classmethod
    def constants(cls, value: Mapping[str, Any]) -> tuple[Any, ...]:
        """Return (a, b, c)."""
        return equations.loop_parameters(value["alpha"], value["beta"], value["gamma"])

    @classmethod
    def free_step(cls, state: Any, u_0: Any, u_1: Any, constants: Any) -> tuple[tuple[Any, ...], Any]:
        """Return w_h and c u + w_h: (2), (3), exact for a monotone voltage."""
        w_h = equations.hysteresis_step(state[0], u_1 - u_0, constants[0], constants[1])
        return (w_h,), constants[2] * u_1 + w_h

    def coordinate_values(self) -> dict[str, float]:
        """Values of all coordinates, of the nearest admissible model, at rest."""
        near = self.nearest_admissible()
        ratio = near.gamma / (near.alpha * near.beta)
        value = super(ColemanHodgdon, near).coordinate_values() | {"place": 0.0}
        return value | {"ratio": float(np.clip(ratio, 1.0 + 2.0 * _FIT_MARGIN, 2.0 - 2.0 * _FIT_MARGIN))}

    @classmethod
    def bounds(cls, start: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """1 < ratio < 2; alpha and beta keep a part of their start."""
        positive = {name: (_LEAST * start[name], np.inf) for name in ("alpha", "beta") if name in start}
        return positive | {"ratio": (1.0 + _FIT_MARGIN, 2.0 - _FIT_MARGIN), "place": (-1.0, 1.0)}

    @classmethod
    def sizes(cls, value: Mapping[str, float]) -> dict[str, float]:
        """Of the ratio what is above one; of displacements b/a, the largest w_h."""
        curved = value["ratio"] - 1.0
        largest = curved * value["beta"] / value["alpha"]
        return {**value, "ratio": curved, "offset": largest, "initial_state": largest}

    @classmethod
    def check_fixed(cls, fixed: Mapping[str, float]) -> None:
        """Refuse alpha, beta and gamma that are not above zero or not admissible together."""
        if any(fixed.get(name, 1.0) <= 0.0 for name in cls.parameter_names):
            raise ValueError(f"fixed alpha, beta and gamma must be above zero, got {dict(fixed)}")
        super(ColemanHodgdon, cls).check_fixed(fixed)

    def lifted(self, start: Self, least: float) -> Self:
        """Lift a and c; b keeps its part of c."""
        a, c = least * start.a, least * start.c
        if self.a >= a and self.c >= c:
            return self
        a, c = max(self.a, a), max(self.c, c)
        return type(self).from_loop(a, c * (self.b / self.c), c, self.offset)

    @property
    def loop(self) -> tuple[float, float, float]:
        """(a, b, c) (4)."""
        return self.a, self.b, self.c

    def stage_settings(self) -> dict[str, Any]:
        """How the model sits in a `SimulatedStage`: see `piezoest.stage.kernel.hysteresis_layouts`."""
        return {"gain": self.c, "a": self.a, "b": self.b}

    def simulate(self, u: FloatArray, *, initial_state: float = 0.0, allow_jumps: bool = False) -> FloatArray:
        """Displacement [µm], shape (N,), for a voltage record; exact if u is monotone between samples.

        Parameters
        ----------
        u : array_like, shape (N,)
            Voltage [V].
        initial_state : float
            w_h [µm] at the first sample.
        allow_jumps : bool
            Take jumps between samples as fast monotone changes instead of refusing them.

        Raises
        ------
        ValueError
            If u is not a finite 1-D array, or jumps: the model is defined for connected inputs only.
        """
        u = array_1d("u", u)
        if not allow_jumps:
            check_continuity(u, name="u")
        x = np.empty_like(u)
        _simulate(u, finite("initial_state", initial_state), self.a, self.b, self.c, self.offset, x)
        return x

    def invert(self, r: FloatArray, *, initial_state: float = 0.0, allow_jumps: bool = False) -> FloatArray:
        """Voltage [V], shape (N,), under which the model follows a reference exactly (14), (C7), (C10).

        Parameters
        ----------
        r : array_like, shape (N,)
            Reference displacement [µm].
        initial_state, allow_jumps
            As in `simulate`.

        Raises
        ------
        ValueError
            If the model is not admissible, r is not a finite, connected 1-D array, or the voltage is too
            large for a number.
        """
        if not self.is_admissible:
            raise ValueError(f"{self} is not admissible and has no inverse: {self.remedy}")
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


@compiled
def _simulate(u: Vector, w_h: float, a: float, b: float, c: float, offset: float, x: Vector) -> None:
    for k in range(u.size):
        if k > 0:
            w_h = equations.hysteresis_step(w_h, u[k] - u[k - 1], a, b)
        x[k] = c * u[k] + w_h + offset


@compiled
def _invert(r: Vector, w_h: float, a: float, b: float, c: float, offset: float, u: Vector) -> None:
    for k in range(r.size):
        if k == 0:
            u[k] = (r[k] - offset - w_h) / c
        else:
            dr = r[k] - (c * u[k - 1] + w_h + offset)
            du = equations.inverse_increment(w_h, dr, a, b, c)
            w_h = equations.hysteresis_step(w_h, du, a, b)
            u[k] = u[k - 1] + du
