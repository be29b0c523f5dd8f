"""Fewer points for a record, without losing the voltage's path or the displacement's information."""

from typing import Any

import numpy as np

from piezoest._checks import FloatArray

# A voltage that turns more often than in one of so many points is taken at full rate.
POINTS_PER_TURN = 3


def thinned(
    u: FloatArray, x: FloatArray, first: int, decimation: int, also: int
) -> tuple[Any, FloatArray, FloatArray, FloatArray]:
    """Points of a record that stand for all of it.

    The record (N,) is a voltage without gaps and a displacement with NaN where it is missing. `first` is its
    first sample's number in the stream: the points stay where they are as it slides. `decimation` samples
    make a point; the sample `also` has to be one too.

    Returns `points` (M,): samples that are points: the middle of each block, turning points, first and last;
    `shift` (M,): mean voltage of the samples averaged less that of the point; `x` (M,): mean displacement of
    the samples averaged; `root_weight` (M,): square root of the number of samples averaged; 0 where there is
    no measurement.
    """
    N, reach = u.size, (decimation - 1) // 2
    direction = np.sign(np.diff(u))
    moving = np.flatnonzero(direction)
    turns = moving[1:][direction[moving[1:]] != direction[moving[:-1]]]
    if turns.size * POINTS_PER_TURN * decimation > N:
        decimation, reach = 1, 0
    middles = np.arange((reach - first) % decimation, N, decimation)
    points = np.unique(np.concatenate([middles, turns, [0, min(also, N - 1), N - 1]]))
    weight = np.isin(points, middles) * 1.0
    shift, mean_x = np.zeros(points.size), x[points].copy()
    if reach > 0:
        turned = np.zeros(N + 1)
        turned[turns + 1] = 1.0
        sums = [np.concatenate([[0.0], np.cumsum(hindrance)]) for hindrance in (turned[1:], np.isnan(x))]
        whole = (points >= reach) & (points + reach < N) & (weight > 0.0)
        low, high = points - reach, points + reach + 1
        for count in sums:
            whole[whole] = count[high[whole]] == count[low[whole]]
        block = points[whole][:, None] + np.arange(-reach, reach + 1)
        shift[whole] = u[block].mean(axis=1) - u[points[whole]]
        mean_x[whole] = x[block].mean(axis=1)
        weight[whole] = np.sqrt(2.0 * reach + 1.0)
    return points, shift, mean_x, np.where(np.isfinite(mean_x), weight, 0.0)
