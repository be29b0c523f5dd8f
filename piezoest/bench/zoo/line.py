"""What a controller has to be better than: the best straight line for the healthy stage, held throughout.

It is drawn in hindsight; see `learnt_line` for the one that somebody could have had.

u = (r - centre)/gain, where displacement = gain u + centre is the least-squares line of a healthy twin
that is driven over the same reference; in the coordinates of the gauge.
"""

from dataclasses import dataclass

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo.rig import Rig

# The line decides how the twin is driven: it is sought over a few cycles first, and then over all of them.
ROUNDS, CYCLES, LAST_ROUNDS = 6, 5, 3
CLOSE = 1e-3  # of the reference's range: by how much the twin's mean may miss the reference's
SLOWEST, FASTEST = 0.2, 3.0  # slope of the means, relative to that over the reach


@dataclass(frozen=True, slots=True)
class FittedLine:
    """displacement = gain u + centre."""

    gain: float  # [µm/V]
    centre: float  # [µm]

    def voltage(self, r: FloatArray) -> FloatArray:
        """Voltage for a reference, without limits, shape (N,) [V]."""
        return (r - self.centre) / self.gain


def fit_line(rig: Rig) -> FittedLine:
    """Line of a rig's healthy twin."""
    plain, (factor, zero) = rig.plain, rig.coordinates
    # What is wrong from the start is what the controller knows as well; the rest comes later.
    zero_0 = float(zero[0])
    r = plain.values + (zero_0 if rig.fault.kind == "zero-off-shifted" else 0.0)
    slope = factor * rig.gain
    x_0 = float(np.ravel(rig.model.simulate(np.array([rig.reach.middle])))[0])
    line = FittedLine(slope, factor * (x_0 - rig.gain * rig.reach.middle) + zero_0)
    twin = _Twin(rig, factor, zero_0)
    for cycles, rounds in ((CYCLES, ROUNDS), (r.size // plain.cycle + 1, LAST_ROUNDS)):
        line = _improved(line, twin, r[: plain.begins + cycles * plain.cycle], rounds)
    return line


def slope_of(u: FloatArray, x: FloatArray) -> float:
    """Slope of the least-squares line through points. `u`, `x` (N,): [V] and [µm]."""
    du = u - u.mean()
    # Sums, for products of long arrays start threads, which wait for one another where all cores are at work.
    return float(np.sum(du * x) / np.sum(du * du))


class _Twin:
    """The stage without its faults, in the gauge's coordinates."""

    def __init__(self, rig: Rig, factor: float, zero: float) -> None:
        self._rig, self._factor, self._zero = rig, factor, zero
        self._stage = rig.stage(healthy=True)
        self.slope = factor * rig.gain
        self.judged = slice(rig.plain.begins + rig.plain.cycle // 4, None)
        self.close = CLOSE * rig.plain.amplitude

    def clip(self, u: FloatArray | float) -> FloatArray:
        """Voltage within the limits."""
        return np.clip(u, self._rig.reach.low, self._rig.reach.high)

    def run(self, u: FloatArray) -> FloatArray:
        """Displacement from rest."""
        self._stage.reset()
        self._stage.run(u)
        return self._factor * np.asarray(self._stage.displacement) + self._zero


def _improved(line: FittedLine, twin: _Twin, r: FloatArray, rounds: int) -> FittedLine:
    """The line under which the twin misses a reference least, of those that so many rounds find."""
    middle = float(np.mean(r[twin.judged]))
    before: tuple[float, float] | None = None
    best, least = line, np.inf
    for _ in range(rounds):
        u = twin.clip(line.voltage(r))
        x = twin.run(u)
        missed = float(np.sqrt(np.mean((r - x)[twin.judged] ** 2)))
        if missed < least:
            best, least = line, missed
        u, x = u[twin.judged], x[twin.judged]
        mean_u, mean_x = float(u.mean()), float(x.mean())
        gain = slope_of(u, x) if np.any(u != mean_u) else line.gain
        near = abs(middle - mean_x) < twin.close and abs(gain / line.gain - 1.0) < CLOSE
        if near or gain * twin.slope <= 0.0:
            break
        # Where the mean comes to depends on the way there: a secant finds the voltage that brings it home.
        steep = twin.slope
        if before is not None and mean_u != before[0]:
            steep = (mean_x - before[1]) / (mean_u - before[0])
            steep = twin.slope * float(np.clip(steep / twin.slope, SLOWEST, FASTEST))
        before = mean_u, mean_x
        line = FittedLine(gain, middle - gain * float(twin.clip(mean_u + (middle - mean_x) / steep)))
    return best
