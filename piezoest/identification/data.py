"""A log as identification sees it: where it counts, how it moves, and whether that is enough."""

from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import bridged, late
from piezoest.models import ColemanHodgdon, LinearGain
from piezoest.signals.turns import TURN, turns

FEWEST_TURNS = 2
SMALLEST_SIGNAL_TO_NOISE = 10.0


class Data(NamedTuple):
    """A voltage without gaps, a displacement, and the samples at which that counts."""

    u: FloatArray
    x: FloatArray
    counts: Any

    @property
    def middle(self) -> float:
        """Middle of the voltage's range [V]."""
        return 0.5 * float(self.u.max() + self.u.min())

    @property
    def extent(self) -> float:
        """Range of the voltage [V]."""
        return float(np.ptp(self.u))

    def measured(self, from_sample: int = 0) -> FloatArray:
        """Displacement, NaN where it does not count [µm]."""
        x = np.where(self.counts, self.x, np.nan)
        x[:from_sample] = np.nan
        return x

    def line(self, delay: float = 0.0, from_sample: int = 0) -> LinearGain:
        """Least-squares line through the displacement, which lags by `delay` samples."""
        return LinearGain.guess(late(self.u, delay), self.measured(from_sample))

    def loop_about_line(self, delay: float = 0.0) -> ColemanHodgdon:
        """A plain guess: a loop about that line, bent within the range of the voltage."""
        line = self.line(delay)
        return ColemanHodgdon.from_loop(2.0 / self.extent, 0.4 * line.gain, 1.3 * line.gain, line.offset)


def prepare(voltage: FloatArray, displacement: FloatArray) -> Data:
    """Bridge gaps of the voltage by straight lines; nothing within a gap counts."""
    return Data(bridged(voltage), displacement, np.isfinite(voltage) & np.isfinite(displacement))


def noise_of(data: Data) -> float:
    """Standard deviation of the displacement's noise [µm], from its third differences, robustly."""
    x = data.x[data.counts]
    third = np.diff(x, 3)
    return max(float(1.4826 * np.median(np.abs(third)) / np.sqrt(20.0)), 1e-9 * float(np.ptp(x)), 1e-12)


def check_excitation(data: Data, noise: float) -> FloatArray:
    """Refuse a voltage that cannot show a hysteresis; return the voltages at its turns."""
    if data.extent == 0.0:
        raise ValueError(
            f"too little excitation: the voltage stays at {data.middle:.6g} V over the fitted part, "
            "it must move the stage up and down"
        )
    turned = turning_voltages(data)
    if turned.size < FEWEST_TURNS:
        raise ValueError(
            f"too little excitation: over the fitted part the voltage moves by {data.extent:.4g} V but "
            f"turns {turned.size} times, at least {FEWEST_TURNS} are needed: hysteresis shows only at turns"
        )
    extent = float(np.ptp(data.x[data.counts]))
    if extent < SMALLEST_SIGNAL_TO_NOISE * noise:
        raise ValueError(
            f"too little excitation: the displacement moves by {extent:.3g} µm in noise of {noise:.3g} µm "
            f"rms, {extent / noise:.1f} times that, at least {SMALLEST_SIGNAL_TO_NOISE:g} are needed: "
            "raise the voltage"
        )
    gain = data.line().gain
    if gain < 0.0:
        raise ValueError(
            f"the displacement falls as the voltage rises ({gain:.4g} µm/V): change the sign of one of the "
            "two columns"
        )
    return turned


def turning_voltages(data: Data) -> FloatArray:
    """Voltages at which it turns and then runs back by more than a twentieth of its range [V]."""
    return data.u[turns(data.u, TURN * data.extent)]
