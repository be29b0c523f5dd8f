"""How far a value is off what its neighbours, before and after, say of it: spikes and steps stand out.

How the neighbours are weighed is learnt from the log itself, so that noise, ringing and a coarsely sampled
wave are nothing unusual.
"""

import numpy as np

from piezoest._checks import FloatArray
from piezoest.compile import Vector, compiled
from piezoest.fitting.rows import gram, onto, times
from piezoest.fitting.runs import BoolArray, IntArray

# A scale that holds for so many samples, in which it is this quantile.
BLOCK, QUANTILE = 32, 0.7
NORMAL_QUANTILE = 1.0364  # of |e| of a normal deviate at that quantile
# Bends of the input on either side of a sample that help to foresee it, and samples to learn that from.
BENDS, TRAINED_ON = 2, 10_000


def surprise(y: FloatArray, inputs: FloatArray, each_side: int) -> FloatArray:
    """What the neighbours of each value, and an input about it, do not foresee of it, shape (N,).

    `inputs` are the bends of what drives the values, in the same unit. So many neighbours are asked on either
    side; as many values at both ends are not judged: zero.
    """
    # Single samples all over the log: a stretch of it might be a rest.
    rows = np.arange(each_side, y.size - each_side, max(1, y.size // TRAINED_ON))
    near = 0.5 * (y[rows - 1] + y[rows + 1])
    columns = [0.5 * (y[rows - j] + y[rows + j]) - near for j in range(2, each_side + 1)]
    columns += [inputs[rows + j] for j in range(-BENDS, BENDS + 1)]
    weights = _robust(np.stack(columns, axis=1), y[rows] - near)
    out = np.zeros(y.size)
    _unforeseen(y, inputs, weights, each_side, out)
    return out


@compiled
def _unforeseen(y: Vector, inputs: Vector, weights: Vector, each_side: int, out: Vector) -> None:
    """The same with weights that are known."""
    for k in range(each_side, len(y) - each_side):
        near = 0.5 * (y[k - 1] + y[k + 1])
        left = y[k] - near
        for j in range(2, each_side + 1):
            left -= weights[j - 2] * (0.5 * (y[k - j] + y[k + j]) - near)
        for j in range(-BENDS, BENDS + 1):
            left -= weights[each_side - 1 + BENDS + j] * inputs[k + j]
        out[k] = left


def _shifted(y: FloatArray, by: int) -> FloatArray:
    """Values `by` samples later, the ends repeated."""
    return y[np.clip(np.arange(y.size) + by, 0, y.size - 1)]


def noise_in(third: FloatArray) -> float:
    """Standard deviation of white noise by the third differences of what has it, robustly; 0 of none."""
    return 1.4826 * float(np.median(np.abs(third))) / np.sqrt(20.0) if third.size else 0.0


def is_peak(size: FloatArray, reach: int, found: IntArray) -> BoolArray:
    """For each place `found`, whether no value within `reach` samples on either side is greater."""
    about = np.clip(found[:, None] + np.arange(-reach, reach + 1), 0, size.size - 1)
    return np.asarray(size[found] >= np.max(size[about], axis=1))


def _robust(A: FloatArray, b: FloatArray) -> FloatArray:
    """Weights of least squares, about 1 in size at most, with what is far off left out, again and again."""
    used = np.ones(b.size, dtype=np.bool_)
    weights: FloatArray = np.zeros(A.shape[1])
    for _ in range(5):
        off = np.abs(b - times(A, weights))
        scale = float(np.quantile(off, QUANTILE)) / NORMAL_QUANTILE
        used = off <= 4.0 * scale
        if not np.any(b) or np.sum(used) < 2 * weights.size:
            break
        # A column that hardly moves above the noise would else get any weight.
        likely = max(scale, 1e-6 * float(np.max(np.abs(b)))) ** 2 * np.eye(weights.size)
        near = A[used]
        G = gram(near) + likely
        # Of a log without noise no two columns may differ.
        G += (1e-12 * np.max(np.diag(G)) + 1e-300) * np.eye(weights.size)
        solved = np.linalg.solve(G, onto(near, b[used]))
        weights = np.asarray(solved, dtype=np.float64)
    return weights


def scale_of(e: FloatArray, block: int = BLOCK) -> FloatArray:
    """Standard deviation about each sample, shape (N,): of the log, or of where it is greater.

    `e` is what is not foreseen, of at least `block` samples: so long a scale holds. What stands out in a
    quarter of them does not make it greater.
    """
    size: FloatArray = np.abs(e)
    whole = float(np.quantile(size[:: max(1, size.size // 100_000)], QUANTILE)) / NORMAL_QUANTILE
    blocks, place = size.size // block, int(QUANTILE * block)
    own = size[: blocks * block].reshape(blocks, block)  # a copy, for `size` is one
    own.partition(place, axis=1)
    quantile = own[:, place] / NORMAL_QUANTILE
    about = np.max([quantile, _shifted(quantile, 1), _shifted(quantile, -1)], axis=0)
    # In so few samples it scatters: what is not clearly greater is the log's.
    scale: FloatArray = np.maximum(whole, about / 1.5)
    return scale[np.minimum(np.arange(e.size) // block, blocks - 1)]
