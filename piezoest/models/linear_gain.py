"""The ideal linear stage, x = K u (8)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d
from piezoest.equations import admissible, loop_inverse
from piezoest.models._base import finite_voltage
from piezoest.models.free_running import FreeRunning

# Least gain of a fit, relative to its start.
_LEAST = 1e-6


@dataclass(frozen=True, slots=True)
class LinearGain(FreeRunning):
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

    Examples
    --------
    >>> import numpy as np
    >>> import piezoest as pz
    >>> model = pz.LinearGain(0.15, offset=1.0)
    >>> model.simulate(np.array([0.0, 10.0]))
    array([1. , 2.5])
    """

    gain: float
    offset: float = 0.0

    parameter_names: ClassVar[tuple[str, ...]] = ("gain",)
    parameter_units: ClassVar[tuple[str, ...]] = ("µm/V",)
    inverse: ClassVar[Any] = loop_inverse
    remedy: ClassVar[str] = "its gain must not be zero, nor next to it"

    def __post_init__(self) -> None:
        self._check_finite()

    @property
    def is_admissible(self) -> bool:
        """Whether the gain can be inverted: it is neither zero nor so small that the voltage overflows."""
        return abs(self.gain) > admissible.SMALLEST

    def inverse_settings(self, sample_rate: float | None) -> dict[str, Any]:
        """A loop without width, whatever the sample rate."""
        return {"a": 1.0, "b": 0.0, "c": self.gain, "offset": self.offset}

    @property
    def slope(self) -> float:
        """The gain [µm/V]."""
        return self.gain

    def stage_settings(self) -> dict[str, Any]:
        """How the model sits in a `SimulatedStage`: see `piezoest.stage.kernel.hysteresis_layouts`."""
        return {"gain": self.gain}

    def simulate(self, u: FloatArray) -> FloatArray:
        """Displacement for a voltage record: x = K u + offset (8)."""
        return self.gain * array_1d("u", u) + self.offset

    def invert(self, r: FloatArray) -> FloatArray:
        """Voltage that gives a displacement: u = (r - offset)/K (11)."""
        if not self.is_admissible:
            raise ValueError(f"gain is {self.gain:g} µm/V, which has no inverse: identify the gain first")
        with np.errstate(over="ignore", invalid="ignore"):
            return finite_voltage(self, (array_1d("r", r) - self.offset) / self.gain)

    # ------------------------------------------------------------ what a fit varies

    @classmethod
    def guess(cls, u: FloatArray, x: FloatArray) -> Self:
        """Return the least-squares line."""
        counts = np.isfinite(x)
        middle = 0.5 * float(u.max() + u.min())
        columns = np.column_stack([u[counts] - middle, np.ones(int(counts.sum()))])
        gain, centre = (float(value) for value in np.linalg.lstsq(columns, x[counts], rcond=None)[0])
        return cls(gain, centre - gain * middle)

    @classmethod
    def free_step(cls, state: Any, u_0: Any, u_1: Any, constants: Any) -> tuple[tuple[Any, ...], Any]:
        """Return K u, and no state."""
        return (), constants[0] * u_1

    def coordinate_values(self) -> dict[str, float]:
        """Gain and offset."""
        if not self.is_admissible:
            raise ValueError("the model has a gain of zero, whose sign is not known: pass a rough value")
        return super(LinearGain, self).coordinate_values()

    @classmethod
    def bounds(cls, start: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """Keep the start's sign and a part of it."""
        if "gain" not in start:
            return {}
        least = _LEAST * start["gain"]
        return {"gain": (least, np.inf) if least > 0.0 else (-np.inf, least)}

    @classmethod
    def sizes(cls, value: Mapping[str, float]) -> dict[str, float]:
        """Of the offset what 10 V make."""
        return {**super(LinearGain, cls).sizes(value), "offset": 10.0 * abs(value["gain"])}

    def lifted(self, start: Self, least: float) -> Self:
        """Lift the gain, which keeps the start's sign."""
        gain = float(admissible.kept_gain(self.gain, start.gain, least))
        return self if gain == self.gain else type(self)(gain, self.offset)

    @property
    def loop(self) -> tuple[float, float, float]:
        """No hysteresis: (0, 0, K)."""
        return 0.0, 0.0, self.gain
