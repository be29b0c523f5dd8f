"""Limits of the voltage that a compensator may ask for."""

import math
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from piezoest._checks import finite, positive


@dataclass(frozen=True, slots=True)
class VoltageLimits:
    """Limits that a compensator's voltage never leaves.

    Parameters
    ----------
    minimum, maximum : float
        Voltage range [V]; infinite for none.
    slew_rate : float, optional
        Largest |du/dt| [V/s]; needs `sample_rate`.
    sample_rate : float, optional
        [Hz].

    Raises
    ------
    ValueError
        If a limit is no number, the range is empty, or the slew rate comes without a sample rate.

    Examples
    --------
    >>> import piezoest as pz
    >>> limits = pz.VoltageLimits(minimum=0.0, maximum=100.0)
    >>> compensator = pz.LinearCompensator(pz.LinearGain(0.15), limits)
    >>> compensator.step(30.0)  # would need 200 V
    100.0
    """

    minimum: float = -math.inf
    maximum: float = math.inf
    slew_rate: float | None = None
    sample_rate: float | None = None

    def __post_init__(self) -> None:
        for name in ("minimum", "maximum"):
            object.__setattr__(self, name, _bound(name, getattr(self, name)))
        # Not >=: a limit that is NaN must be refused too.
        if not self.minimum < self.maximum:
            raise ValueError(f"minimum must be below maximum, got {self.minimum:g} V and {self.maximum:g} V")
        for name in ("slew_rate", "sample_rate"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, positive(name, getattr(self, name)))
        if self.slew_rate is not None and self.sample_rate is None:
            raise ValueError("slew_rate needs sample_rate: pass the rate of the loop in Hz")

    @property
    def largest_step(self) -> float:
        """Largest change of voltage between two samples [V]; infinite without a slew rate."""
        if self.slew_rate is None or self.sample_rate is None:
            return math.inf
        return self.slew_rate / self.sample_rate

    @property
    def rest(self) -> float:
        """The voltage within the range that is nearest to 0 V."""
        return finite("rest", min(max(0.0, self.minimum), self.maximum))


def check_rate(part: Any, sample_rate: float, called: str = "limits are") -> None:
    """Refuse limits or a compensator for another sample rate: slew rate and creep would be others."""
    if part.sample_rate is not None and part.sample_rate != sample_rate:
        raise ValueError(
            f"{called} for {part.sample_rate:g} Hz, sample_rate is {sample_rate:g} Hz: give both the same"
        )


def resting(limits: VoltageLimits, voltage: Any) -> float:
    """Return a voltage at which a stage rests [V]; None for the one nearest to 0 V."""
    u = limits.rest if voltage is None else finite("voltage", voltage)
    if not limits.minimum <= u <= limits.maximum:
        raise ValueError(
            f"voltage must lie within the limits, {limits.minimum:g} V to {limits.maximum:g} V, got {u:g} V"
        )
    return u


def _bound(name: str, value: Any) -> float:
    """One number, infinite or not."""
    try:
        if isinstance(value, Real) or (np.ndim(value) == 0 and isinstance(value, np.ndarray)):
            return float(value)
    except (OverflowError, TypeError, ValueError):
        pass
    raise ValueError(f"{name} must be a number of volts, got {value!r}: leave it out for no limit")
