"""Signs of a feedback loop in a log: the voltage answers the noise of the displacement."""

from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.runs import BoolArray

LAGS, MOST_SAMPLES, PASSES = 8, 60_000, 4
FEWEST_SAMPLES = 200
# The voltage is foreseen by the displacement's noise beyond doubt, and for this part of what it does itself.
BEYOND_DOUBT, EXPLAINED = 20.0, 0.3
# Or both are off at one time, in opposite directions.
OPPOSITE = -0.4
# Noise of the voltage, relative to that of the displacement, below which there is nothing to be explained.
QUIET = 1e-3
# A voltage that stands still in this part of the samples goes in steps that were set, and has no noise.
STANDS = 0.5
# Noise of the displacement, relative to its range, that is but the rounding of numbers.
NOISELESS = 1e-9


class Answer(NamedTuple):
    """How a voltage answers the noise of the displacement."""

    lag: int = 0  # samples after which it does, if at all
    explained: float = 0.0  # part of the variance of the voltage's own noise that earlier x explains
    together: float = 0.0  # correlation of what nothing earlier explains of both
    closed: bool = False  # whether this is feedback beyond doubt


def goes_in_steps(u: FloatArray) -> bool:
    """Whether a voltage stands still in most samples, as a staircase does."""
    return bool(np.mean(np.diff(u) == 0.0) > STANDS)


def answer(u: FloatArray, x: FloatArray, gain: float) -> Answer:
    """Look for feedback; open-loop voltages, and smooth or noiseless closed loops, show none.

    Second differences take away what moves slowly. Each is foreseen from its own past, and from that of the
    other: in open loop the past displacement says nothing about the voltage, but what makes up for noise of
    the voltage's own reading, with the sign of the gain. Negative feedback has the other sign. Source: C. W.
    J. Granger, Econometrica 37 (1969) 424-438; L. Ljung, System Identification, 2nd ed., 1999, sec. 13.4.
    """
    if goes_in_steps(u):
        return Answer()
    du, dx = gain * np.diff(u, 2), np.diff(x, 2)
    rows = np.arange(LAGS, min(du.size, LAGS + MOST_SAMPLES))
    if rows.size < FEWEST_SAMPLES:
        return Answer()
    past = [signal[rows - j] for signal in (du, dx) for j in range(1, LAGS + 1)]
    both, target = np.stack(past, axis=1), du[rows]
    size = np.sqrt(np.mean(both**2, axis=0))
    if np.any(size == 0.0):
        return Answer()
    both = both / size
    own = both[:, :LAGS]
    # Corners of the voltage are no noise: what is far off alone, or with the displacement, is left out.
    used = _usual(own, target) & _usual(both, target) & _usual(both, dx[rows])
    if np.sum(used) < FEWEST_SAMPLES:
        return Answer()
    weights, left_u, scatter = _least_squares(both[used], target[used])
    _, left_alone, _ = _least_squares(own[used], target[used])
    _, left_x, _ = _least_squares(both[used], dx[rows][used])
    noise_u, noise_x = float(np.std(left_alone)), float(np.std(left_x))
    if noise_u < QUIET * noise_x or noise_x < NOISELESS * float(np.ptp(x)):
        return Answer()
    explained = 1.0 - float(np.var(left_u)) / noise_u**2
    together = 0.0
    if float(np.std(left_u)) > QUIET * noise_x:
        together = float(np.corrcoef(left_u, left_x)[0, 1])
    certain = np.abs(weights) > BEYOND_DOUBT * scatter
    lag = int(np.argmax(certain[LAGS:]))
    opposes = bool(certain[LAGS + lag] and weights[LAGS + lag] < 0.0)
    closed = (opposes and explained > EXPLAINED) or together < OPPOSITE
    return Answer(lag + 1 if opposes and explained > EXPLAINED else 0, explained, together, closed)


def _usual(A: FloatArray, b: FloatArray) -> BoolArray:
    """Rows that least squares does not miss by far more than others."""
    used: BoolArray = np.ones(b.size, dtype=np.bool_)
    for _ in range(PASSES):
        off = np.abs(b - A @ _solved(A[used], b[used])[0])
        used = np.asarray(off <= 5.0 * 1.4826 * np.median(off) + 1e-12 * np.max(np.abs(b)))
        if np.sum(used) < FEWEST_SAMPLES:
            break
    return used


def _solved(A: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weights by least squares, and A^T A, which is never singular."""
    G = A.T @ A
    G = np.asarray(G + (1e-9 * np.max(np.diag(G)) + 1e-300) * np.eye(len(G)))
    return np.asarray(np.linalg.solve(G, A.T @ b), dtype=np.float64), G


def _least_squares(A: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weights, what they leave, and their standard errors."""
    weights, G = _solved(A, b)
    left = b - A @ weights
    return weights, left, np.sqrt(np.diag(np.linalg.inv(G))) * float(np.std(left))
