"""Which loops a voltage goes through, and how far they are from those of a record.

A stage remembers the turns that no later swing has gone beyond. The last of them began the branch that it is
on; where the voltage comes to the one before, the loop is closed and both are forgotten (I. D. Mayergoyz,
Mathematical Models of Hysteresis, Springer 1991, ch. 1).
"""

import numpy as np

from piezoest._checks import FloatArray
from piezoest.compile import Matrix, Vector, compiled
from piezoest.fitting.runs import IntArray
from piezoest.signals.turns import TURN

# Loops whose turns are nearer than this fraction of the range are alike.
ALIKE = 0.02
# A stage is not as it was at once after a new loop: so many ranges of the voltage's way, and it has forgotten
# all but 1/e.
REMEMBERED = 1.0


def loops_of(u: FloatArray, visited: tuple[float, float]) -> FloatArray:
    """The last two remembered turns at each sample of a voltage without gaps, shape (N, 2) [V].

    Beyond the range `visited` the voltage is taken as at its end. Where only one turn is remembered, the
    other one is an end of it.
    """
    low, high = visited
    loops = np.empty((u.size, 2))
    _follow(np.clip(u, low, high), low, high, TURN * (high - low), np.empty(u.size + 1), loops)
    return loops


def seen_loops(u: FloatArray, visited: tuple[float, float]) -> FloatArray:
    """Those of a record, each once, shape (M, 2) [V]."""
    step = 0.5 * ALIKE * (visited[1] - visited[0])
    loops, _ = _one_by_one(u, visited)
    return np.asarray(step * np.unique(np.round(loops / step), axis=0))


def _one_by_one(u: FloatArray, visited: tuple[float, float]) -> tuple[FloatArray, IntArray]:
    """Loops in the order of their samples, shape (M, 2) [V], and which of them each sample is in, (N,)."""
    loops = loops_of(u, visited)
    begins = np.append(True, np.any(np.diff(loops, axis=0) != 0.0, axis=1))
    return loops[begins], np.cumsum(begins) - 1


def newness(u: FloatArray, visited: tuple[float, float], seen: FloatArray) -> FloatArray:
    """How far the turns of each loop are from those of the nearest one that was seen, shape (N,) [V].

    The largest so far is remembered for some way of the voltage.
    """
    from scipy.spatial import KDTree

    loops, number = _one_by_one(u, visited)
    extent = visited[1] - visited[0]
    apart, _ = KDTree(seen).query(loops, p=np.inf)
    new = (apart - ALIKE * extent).clip(0.0)[number]
    _remember(np.clip(u, *visited), REMEMBERED * extent, new)
    return np.asarray(new)


def running_mean(u: FloatArray, memory: float) -> FloatArray:
    """Mean of the voltage so far, shape (N,) [V], that forgets with a time constant of `memory` samples."""
    mean = np.array(u)
    _average(np.exp(-1.0 / memory), mean)
    return mean


@compiled
def _average(keep: float, values: Vector) -> None:
    """Each with what is kept of those before."""
    for k in range(1, len(values)):
        values[k] += keep * (values[k - 1] - values[k])


@compiled
def _follow(u: Vector, low: float, high: float, threshold: float, turns: Vector, loops: Matrix) -> None:
    """Write the last two of the `turns` that are remembered, at each voltage."""
    least, most, k = u[0], u[0], 0
    while k < len(u) and most - least <= threshold:
        least, most = min(least, u[k]), max(most, u[k])
        k += 1
    direction = 1.0 if u[k - 1] == most else -1.0
    turns[0], extreme = (least, least) if direction > 0.0 else (most, most)
    count = 1
    for k in range(len(u)):
        if direction * (u[k] - extreme) > 0.0:
            extreme = u[k]
        elif direction * (extreme - u[k]) > threshold:
            turns[count] = extreme
            count += 1
            direction, extreme = -direction, u[k]
        while count > 1 and direction * (extreme - turns[count - 2]) >= 0.0:
            if count == 2:
                turns[0], count = turns[1], 1
            else:
                count -= 2
        loops[k, 1] = turns[count - 1]
        loops[k, 0] = turns[count - 2] if count > 1 else high if direction > 0.0 else low


@compiled
def _remember(u: Vector, way: float, values: Vector) -> None:
    """The largest of `values` so far, forgotten along the voltage's way."""
    for k in range(1, len(u)):
        values[k] = max(values[k], values[k - 1] * np.exp(-abs(u[k] - u[k - 1]) / way))
