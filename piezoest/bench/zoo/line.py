"""What a controller has to be better than: two straight lines.

One is the best line for the healthy stage, drawn in hindsight: u = (r - centre)/gain, where displacement =
gain u + centre is the least-squares line of a healthy twin that is driven over the same reference.

The other is learnt. Its gain is known, its zero is that of the first true reading; until then it rests. After
each leg it is drawn anew through the true readings of the last two. An oracle says which readings are true,
and how late they are: while there are none, the line is held. See docs/safety.rst.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo.faults import truthful
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Traces

# The line decides how the twin is driven: it is sought over a few cycles first, and then over all of them.
ROUNDS, CYCLES, LAST_ROUNDS = 6, 5, 3
CLOSE = 1e-3  # of the reference's range: by how much the twin's mean may miss the reference's
SLOWEST, FASTEST = 0.2, 3.0  # slope of the means, relative to that over the reach
LEGS = 2  # that the learnt line is drawn through
STEEPEST = 2.0  # slope relative to the mean slope and to that in hindsight, or its inverse
FEWEST, LEAST = 0.5, 0.25  # readings, relative to those of a leg; and their way, relative to the swing
NOISES = 6.0  # by which a reading may miss what is true


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
    x_0 = float(np.ravel(rig.model.simulate(np.array([rig.reach.middle])))[0])
    line = FittedLine(factor * rig.gain, factor * (x_0 - rig.gain * rig.reach.middle) + zero_0)
    stage = rig.stage(healthy=True)

    def twin(u: FloatArray) -> FloatArray:
        stage.reset()
        stage.run(u)
        return factor * np.asarray(stage.displacement) + zero_0

    for cycles, rounds in ((CYCLES, ROUNDS), (r.size // plain.cycle + 1, LAST_ROUNDS)):
        line = _improved(rig, line, twin, r[: plain.begins + cycles * plain.cycle], rounds)
    return line


def run_line(rig: Rig, line: FittedLine) -> Traces:
    """Let a straight line drive the same rig. `line`: from `fit_line`."""
    r, stage = rig.reference, rig.stage()
    u = np.clip(line.voltage(r), rig.reach.low, rig.reach.high)
    x = stage.run(u)
    return Traces(r, u, x, rig.seen(np.asarray(stage.displacement)))


def slope_of(u: FloatArray, x: FloatArray) -> float:
    """Slope of the least-squares line through points. `u`, `x` (N,): [V] and [µm]."""
    du = u - u.mean()
    # Sums, for products of long arrays start threads, which wait for one another where all cores are at work.
    return float(np.sum(du * x) / np.sum(du * du))


def _improved(
    rig: Rig, line: FittedLine, twin: Callable[[FloatArray], FloatArray], r: FloatArray, rounds: int
) -> FittedLine:
    """The line under which the twin misses a reference least, of those that so many rounds find.

    `twin`: displacement in the gauge's coordinates for voltages, from rest.
    """
    slope, low, high = rig.coordinates[0] * rig.gain, rig.reach.low, rig.reach.high
    judged = slice(rig.plain.begins + rig.plain.cycle // 4, None)
    middle = float(np.mean(r[judged]))
    before: tuple[float, float] | None = None
    best, least = line, np.inf
    for _ in range(rounds):
        u = np.clip(line.voltage(r), low, high)
        x = twin(u)
        missed = float(np.sqrt(np.mean((r - x)[judged] ** 2)))
        if missed < least:
            best, least = line, missed
        u, x = u[judged], x[judged]
        mean_u, mean_x = float(u.mean()), float(x.mean())
        gain = slope_of(u, x) if np.any(u != mean_u) else line.gain
        near = abs(middle - mean_x) < CLOSE * rig.plain.amplitude and abs(gain / line.gain - 1.0) < CLOSE
        if near or gain * slope <= 0.0:
            break
        # Where the mean comes to depends on the way there: a secant finds the voltage that brings it home.
        steep = slope
        if before is not None and mean_u != before[0]:
            steep = (mean_x - before[1]) / (mean_u - before[0])
            steep = slope * float(np.clip(steep / slope, SLOWEST, FASTEST))
        before = mean_u, mean_x
        line = FittedLine(gain, middle - gain * float(np.clip(mean_u + (middle - mean_x) / steep, low, high)))
    return best


def run_learnt_line(rig: Rig, hindsight: FittedLine) -> tuple[Traces, int]:
    """Let a line that learns leg by leg drive a rig; with the first sample that it drives."""
    r, stage, n = rig.reference, rig.stage(), rig.plain.values.size
    u, x, true = np.full(n, rig.limits.rest), np.empty(n), np.empty(n)
    told, line = _oracle(rig), None
    done, knows = 0, n
    for end in _ends(rig, n):
        part = slice(done, end)
        if line is not None:
            u[part] = np.clip(line.voltage(r[part]), rig.reach.low, rig.reach.high)
        x[part] = stage.run(u[part])
        true[part] = stage.displacement
        last, past = told(slice(max(0, end - LEGS * _leg(rig)), end), x, true)
        if line is None and last.size:
            # The known gain through the first reading.
            gain = rig.coordinates[0] * rig.gain
            line, knows = FittedLine(gain, float(x[last[0]] - gain * u[past[0]])), end
        elif line is not None:
            line = _redrawn(rig, line, u[past], x[last], hindsight.gain)
        done = end
    return Traces(r, u, x, rig.seen(true)), knows


def _leg(rig: Rig) -> int:
    """Samples of a leg: half a wave, or half a cycle of what repeats itself later."""
    return max(1, round(0.5 * rig.plain.cycle))


def _ends(rig: Rig, n: int) -> list[int]:
    """Samples after which a line is drawn: of the first block, and of those in which a leg ends."""
    legs = np.arange(rig.plain.begins, n, _leg(rig))
    blocks = -(-np.append(legs, 1) // rig.block) * rig.block
    return sorted({int(end) for end in blocks if 0 < end < n} | {n})


def _oracle(rig: Rig) -> Callable[[slice, FloatArray, FloatArray], tuple[Any, Any]]:
    """What says which readings of a part are true, and of which samples, given all that is known so far."""
    (factor, zero), late = rig.coordinates, rig.around.delay
    tolerance = NOISES * abs(factor) * rig.noise

    def told(part: slice, x: FloatArray, true: FloatArray) -> tuple[Any, Any]:
        k = np.arange(part.start, part.stop)
        past = np.maximum(k - late, 0)
        good = truthful(rig, part.start, x[part], factor * true[past] + zero[part], tolerance)
        return k[good], past[good]

    return told


def _redrawn(rig: Rig, line: FittedLine, u: FloatArray, x: FloatArray, hindsight: float) -> FittedLine:
    """The line through true readings: the same one if they are few, of the same slope if they are close."""
    if u.size < FEWEST * _leg(rig):
        return line
    mean_slope, gain = rig.coordinates[0] * rig.gain, line.gain
    if abs(mean_slope) * np.ptp(u) > LEAST * 2.0 * rig.plain.amplitude:
        least, most = sorted((1.0, hindsight / mean_slope))
        gain = mean_slope * min(max(slope_of(u, x) / mean_slope, least / STEEPEST), most * STEEPEST)
    return FittedLine(gain, float(x.mean() - gain * u.mean()))
