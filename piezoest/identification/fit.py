"""Output-error fit of the Coleman-Hodgdon model: what the free-running model misses, minimised."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import ColemanHodgdon

# The fit's own parameters, of order one or of the data's units, with bounds that keep the model
# admissible: log of a times the voltage's range; b/c; c; displacement at the voltage's centre
# with w_h = 0; w_h at the first sample in parts of its limit b/a; delay in samples.
LOG_A, RATIO, C, CENTRE, PLACE, DELAY = range(6)
LEAST_RATIO, LARGEST_RATIO = 1e-3, 0.4995
LONGEST_DELAY = 10.0
LARGEST_LOG_A = 4.0
A_STARTS = (0.5, 2.0, 6.0)
# Blocks over which the coloured residual is summed for the standard errors.
BLOCKS = 25


class Data(NamedTuple):
    """What the fit sees: a voltage without gaps, and where the displacement counts."""

    u: FloatArray
    x: FloatArray
    counts: Any
    middle: float
    extent: float


class Fit(NamedTuple):
    """Where the fit ended."""

    p: FloatArray
    jacobian: FloatArray
    residual: FloatArray
    free: Any
    evaluations: int


def prepare(voltage: FloatArray, displacement: FloatArray) -> Data:
    """Bridge gaps of the voltage by straight lines; nothing within a gap counts."""
    known = np.isfinite(voltage)
    index = np.arange(voltage.size)
    u = voltage if known.all() else np.interp(index, index[known], voltage[known])
    middle = 0.5 * float(u.max() + u.min())
    return Data(u, displacement, known & np.isfinite(displacement), middle, float(np.ptp(u)))


def delayed(u: FloatArray, delay: float) -> FloatArray:
    """Voltage `delay` samples ago, linear between samples, the first one before the record."""
    if delay == 0.0:
        return u
    index = np.arange(u.size)
    return np.interp(index - delay, index, u)


def model_of(p: FloatArray, data: Data) -> ColemanHodgdon:
    """Model that the fit's parameters stand for."""
    a = float(np.exp(p[LOG_A])) / data.extent
    return ColemanHodgdon.from_loop(
        a, float(p[RATIO] * p[C]), float(p[C]), float(p[CENTRE] - p[C] * data.middle)
    )


def initial_state_of(p: FloatArray, model: ColemanHodgdon) -> float:
    """w_h at the first sample [µm]."""
    return float(p[PLACE]) * model.b / model.a


def simulate(p: FloatArray, data: Data, u: FloatArray) -> FloatArray:
    """Free-running displacement for a whole voltage, from the fitted state at its first sample."""
    model = model_of(p, data)
    return model.simulate(
        delayed(u, float(p[DELAY])), initial_state=initial_state_of(p, model), allow_jumps=True
    )


def straight_line(data: Data, delay: float, from_sample: int = 0) -> tuple[float, float]:
    """Least-squares gain [µm/V] and offset [µm]."""
    counts = data.counts.copy()
    counts[:from_sample] = False
    u, x = delayed(data.u, delay)[counts] - data.middle, data.x[counts]
    columns = np.column_stack([u, np.ones_like(u)])
    gain, centre = np.linalg.lstsq(columns, x, rcond=None)[0]
    return float(gain), float(centre - gain * data.middle)


def starts(data: Data, sample_rate: float, delay: float, noise: float) -> list[FloatArray]:
    """Points to start from: the recursive least squares of the derivative form, and plain guesses."""
    rls = recursion(data, sample_rate, delay, noise)
    rls.run(data.u, np.where(data.counts, data.x, np.nan), every=max(1, data.u.size - 1))
    learnt = rls.model
    first = [learnt.a * data.extent] if isinstance(learnt, ColemanHodgdon) else []
    return [_start(data, a, delay) for a in (*first, *A_STARTS)]


def recursion(data: Data, sample_rate: float, delay: float, noise: float) -> HysteresisRLS:
    """Recursive least squares without forgetting, from a guess at a loop about the straight line."""
    gain, offset = straight_line(data, delay)
    guess = ColemanHodgdon.from_loop(2.0 / data.extent, 0.4 * gain, 1.3 * gain, offset)
    return HysteresisRLS(
        sample_rate, initial_model=guess, memory=None, offset=True, delay=delay, uncertainty=1.0, noise=noise
    )


def _start(data: Data, a: float, delay: float) -> FloatArray:
    """Best b, c, offset and initial state for a given a: x is linear in them."""
    a = float(np.clip(a, 2e-2, 40.0))
    u = delayed(data.u, delay)
    loop = ColemanHodgdon.from_loop(a / data.extent, 1.0, 1.0)
    without_state = loop.simulate(u, allow_jumps=True) - u
    of_state = loop.simulate(u, initial_state=1.0, allow_jumps=True) - u - without_state
    columns = np.column_stack([without_state, u - data.middle, np.ones_like(u), of_state])
    b, c, centre, state = np.linalg.lstsq(columns[data.counts], data.x[data.counts], rcond=None)[0]
    if not c > 0.0:
        b, c, centre = 0.3, *_line_about_middle(data, delay)
        b *= c
    ratio = float(np.clip(b / c, 0.02, 0.48))
    place = float(np.clip(state * a / data.extent / (ratio * c), -0.9, 0.9))
    return np.array([np.log(a), ratio, c, centre, place, delay])


def _line_about_middle(data: Data, delay: float) -> tuple[float, float]:
    gain, offset = straight_line(data, delay)
    return gain, offset + gain * data.middle


def output_error(data: Data, begins: list[FloatArray], fit_delay: bool, from_sample: int) -> Fit:
    """Minimise the free-running error from the most promising of several beginnings."""
    from scipy.optimize import least_squares

    counts = data.counts.copy()
    counts[:from_sample] = False

    def residual(p: FloatArray) -> FloatArray:
        return np.asarray((data.x - simulate(p, data, data.u))[counts])

    best = min(begins, key=lambda p: float(np.sum(residual(p) ** 2)))
    varied = np.arange(6) if fit_delay else np.arange(5)
    low = np.array([-LARGEST_LOG_A, LEAST_RATIO, 0.0, -np.inf, -1.0, 0.0])
    high = np.array([LARGEST_LOG_A, LARGEST_RATIO, np.inf, np.inf, 1.0, LONGEST_DELAY])
    whole = best.copy()

    def of_varied(values: FloatArray) -> FloatArray:
        whole[varied] = values
        return residual(whole)

    # Steps that average over the corners of the linear interpolation and of the simulation.
    solution = least_squares(
        of_varied, best[varied], jac=_central(of_varied, low[varied], high[varied]),
        bounds=(low[varied], high[varied]), x_scale="jac", max_nfev=60,
    )  # fmt: skip
    whole[varied] = solution.x
    free = np.zeros(6, dtype=bool)
    free[varied] = solution.active_mask == 0
    jacobian = np.zeros((solution.fun.size, 6))
    jacobian[:, varied] = solution.jac
    full = np.full(data.u.size, np.nan)
    full[counts] = solution.fun
    return Fit(whole.copy(), jacobian, full, free, int(solution.nfev))


def _central(
    function: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    def jacobian(p: FloatArray) -> FloatArray:
        columns = []
        for i in range(p.size):
            step = 1e-4 * max(1.0, abs(p[i]))
            above, below = p.copy(), p.copy()
            above[i], below[i] = min(p[i] + step, high[i]), max(p[i] - step, low[i])
            columns.append((function(above) - function(below)) / (above[i] - below[i]))
        return np.column_stack(columns)

    return jacobian


def covariance(fit: Fit) -> FloatArray:
    """Covariance of the fit's parameters, shape (6, 6), zero for those held or at a bound.

    J^T J is inverted, and widened for a coloured residual e by the sandwich
    (J^T J)^-1 (sum over blocks of g g^T) (J^T J)^-1 with g = J^T e of one of `BLOCKS` blocks in
    time. White noise gives the usual formula in the mean; each variance is the larger of the two.
    """
    sizes = np.linalg.norm(fit.jacobian, axis=0)
    free = fit.free & (sizes > 0.0)
    J, e = fit.jacobian[:, free] / sizes[free], fit.residual[np.isfinite(fit.residual)]
    n = J.shape[1]
    # With columns of size one, directions that the data do not show have eigenvalues near zero; their
    # variance must come out large, so the floor is far below what rounding leaves.
    values, vectors = np.linalg.eigh(J.T @ J)
    inverse = (vectors / np.maximum(values, 1e-15)) @ vectors.T / np.outer(sizes[free], sizes[free])
    J = fit.jacobian[:, free]
    white = inverse * float(e @ e) / max(1, e.size - n)
    edges = np.linspace(0, e.size, BLOCKS + 1).astype(int)
    parts = np.array([J[i:j].T @ e[i:j] for i, j in itertools.pairwise(edges)])
    coloured = inverse @ (parts.T @ parts * BLOCKS / (BLOCKS - n)) @ inverse
    widening = np.sqrt(np.maximum(np.diag(coloured) / np.diag(white), 1.0))
    whole = np.zeros((6, 6))
    whole[np.ix_(free, free)] = white * np.outer(widening, widening)
    return whole


def standard_errors(fit: Fit, data: Data) -> FloatArray:
    """Of (alpha, beta, gamma, offset, delay), to first order, shape (5,)."""
    p, a = fit.p, float(np.exp(fit.p[LOG_A])) / data.extent
    c, ratio = p[C], p[RATIO]
    rows = np.zeros((5, 6))
    rows[0, LOG_A] = a
    rows[1, [RATIO, C]] = -c, 1.0 - ratio
    rows[2, [LOG_A, C]] = a * c, a
    rows[3, [C, CENTRE]] = -data.middle, 1.0
    rows[4, DELAY] = 1.0
    return np.sqrt(np.einsum("ij,jk,ik->i", rows, covariance(fit), rows))
