"""What a controller has to be better than, too: the line that an honest user could have had at each moment.

Its gain is known, its zero is that of the first true reading; until then it rests. After each leg it is drawn
anew through the true readings of the last two. It drives a twin of the rig with the same noise and faults. An
oracle says which readings are true, and how late they are: while there are none, the line is held.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo.faults import truthful
from piezoest.bench.zoo.line import FittedLine, slope_of
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Traces

LEGS = 2  # that a line is drawn through
STEEPEST = 2.0  # slope relative to the mean slope and to that in hindsight, or its inverse
FEWEST, LEAST = 0.5, 0.25  # readings, relative to those of a leg; and their way, relative to the swing
NOISES = 6.0  # by which a reading may miss what is true


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
            line, knows = _first(rig, u[past[0]], x[last[0]]), end
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
        good = truthful(rig.fault, part.start, x[part], factor * true[past] + zero[part], tolerance)
        return k[good], past[good]

    return told


def _first(rig: Rig, u: float, x: float) -> FittedLine:
    """The known gain through a reading."""
    gain = rig.coordinates[0] * rig.gain
    return FittedLine(gain, float(x - gain * u))


def _redrawn(rig: Rig, line: FittedLine, u: FloatArray, x: FloatArray, hindsight: float) -> FittedLine:
    """The line through true readings: the same one if they are few, of the same slope if they are close."""
    if u.size < FEWEST * _leg(rig):
        return line
    mean_slope, gain = rig.coordinates[0] * rig.gain, line.gain
    if abs(mean_slope) * np.ptp(u) > LEAST * 2.0 * rig.plain.amplitude:
        least, most = sorted((1.0, hindsight / mean_slope))
        gain = mean_slope * min(max(slope_of(u, x) / mean_slope, least / STEEPEST), most * STEEPEST)
    return FittedLine(gain, float(x.mean() - gain * u.mean()))
