"""What a run of a scenario comes down to: settling, errors, excursions, and whether it diverged."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.cases import Case
from piezoest.tracking import TrackingRecord

SETTLED = 0.012  # of the amplitude: the level at which the paper's own method settles
NEAR_FINAL = 1.5  # times the settled error
LAST_PERIODS = 3
DIVERGED = 1.5  # times linear feed-forward's error
CAUGHT_UP = 0.05  # periods


@dataclass(frozen=True, slots=True)
class Metrics:
    """Numbers of one run.

    Parameters
    ----------
    settling_periods : int or None
        Periods after the change until the largest error of every further one is below 1.2 %
        of the amplitude: 0 if the first one is, None if the last one is not.
    periods_to_final : int or None
        The same for 1.5 times `settled_max`.
    worst_error : float
        Largest error after the change [µm].
    settled_max, settled_rms : float
        Largest and root mean square error of the last three periods [µm].
    excursion : float
        Largest deviation of a parameter from its final value after the change, relative to
        that.
    linear_settled_max : float
        `settled_max` of linear feed-forward in the same run [µm].
    ratio : float
        `settled_max` over that.
    run_ratio : float
        Largest error of the whole run but its first period, over linear feed-forward's.
    worst_ratio : float
        The same, compared period by period; a linear error below the settled level counts as
        that level.
    diverged : bool
        Whether `run_ratio` is above 1.5: the tracking error exceeds one and a half times
        that of linear feed-forward.
    diverged_in_a_period : bool
        Whether `worst_ratio` is.
    before_max : float or None
        Largest error of the last whole period before the change, or before the rest [µm].
    rest_excursion : float or None
        Largest deviation of a parameter during the rest from its value before it, in parts
        of that.
    rest_excursion_later : float or None
        The same, from a twentieth of a period into the rest, by when the stage has followed the last
        of the motion.
    errors : tuple of float
        Largest error of each period after the change [µm].
    """

    settling_periods: int | None
    periods_to_final: int | None
    worst_error: float
    settled_max: float
    settled_rms: float
    excursion: float
    linear_settled_max: float
    ratio: float
    run_ratio: float
    worst_ratio: float
    diverged: bool
    diverged_in_a_period: bool
    before_max: float | None
    rest_excursion: float | None
    rest_excursion_later: float | None
    errors: tuple[float, ...] = field(repr=False)


def measure(record: TrackingRecord, linear: TrackingRecord, case: Case) -> Metrics:
    """Take the numbers of a run.

    Parameters
    ----------
    record : TrackingRecord
        Of the estimator.
    linear : TrackingRecord
        Of linear feed-forward with an estimated gain, on an identical stage.
    case : Case
        What both were.

    Returns
    -------
    Metrics

    Raises
    ------
    ValueError
        If the record does not hold a whole period after the change.
    """
    error, linear_error = np.abs(record.error), np.abs(linear.error)
    after = edges_after(case.change, case.period, error.size)
    if after.size < 2:
        raise ValueError(f"the record of {error.size} samples ends within a period of {case.period:g}")
    errors = largest(error, after)
    periods = min(LAST_PERIODS, errors.size)
    tail = slice(int(after[-1 - periods]), int(after[-1]))
    settled = float(np.max(error[tail]))
    linear_settled = float(np.max(linear_error[tail]))
    # Windows of a period on both sides of the change; those within the run's first period do not count.
    edges = np.concatenate([edges_before(case.change, case.period)[:-1], after])
    edges = edges[edges >= round(case.period)]
    floor = SETTLED * case.amplitude
    run_ratio, worst_ratio = 0.0, 0.0
    if edges.size > 1:
        ours, theirs = largest(error, edges), largest(linear_error, edges)
        run_ratio = _over(float(np.max(ours)), float(np.max(theirs)))
        worst_ratio = float(np.max(ours / np.maximum(theirs, floor)))
    calm = edges_before(case.rest[0] if case.rest else case.change, case.period)
    return Metrics(
        settling_periods=settling(errors, floor),
        periods_to_final=settling(errors, NEAR_FINAL * settled),
        worst_error=float(np.max(error[case.change :])),
        settled_max=settled,
        settled_rms=float(np.sqrt(np.mean(error[tail] ** 2))),
        excursion=deviation(record.theta[case.change :], record.theta[-1]),
        linear_settled_max=linear_settled,
        ratio=_over(settled, linear_settled),
        run_ratio=run_ratio,
        worst_ratio=worst_ratio,
        # Written so that NaN diverges.
        diverged=not run_ratio <= DIVERGED,
        diverged_in_a_period=not worst_ratio <= DIVERGED,
        before_max=float(largest(error, calm)[-1]) if calm.size > 1 else None,
        rest_excursion=_rest_excursion(record.theta, case),
        rest_excursion_later=_rest_excursion(record.theta, case, round(CAUGHT_UP * case.period)),
        errors=tuple(errors.tolist()),
    )


def settling(errors: FloatArray, level: float) -> int | None:
    """Periods until every further error is below a level; None if the last one is not.

    Parameters
    ----------
    errors : ndarray, shape (M,)
        Largest error of each period.
    level : float
        In the same unit.
    """
    above = np.flatnonzero(~(errors < level))
    if above.size == 0:
        return 0
    periods = int(above[-1]) + 1
    return periods if periods < errors.size else None


def edges_after(change: int, period: float, size: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """First samples of the whole periods from the change on, and the end of the last.

    Parameters
    ----------
    change : int
        First sample of the first period.
    period : float
        In samples, not necessarily whole.
    size : int
        Samples of the record.
    """
    edges = np.rint(change + period * np.arange(int((size - change) / period) + 2)).astype(np.int64)
    return edges[edges <= size]


def edges_before(change: int, period: float) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """First samples of the whole periods before the change, and the change itself.

    Parameters
    ----------
    change : int
        End of the last period.
    period : float
        In samples, not necessarily whole.
    """
    edges = np.rint(change - period * np.arange(int(change / period) + 2)).astype(np.int64)
    return edges[edges >= 0][::-1]


def largest(error: FloatArray, edges: np.ndarray[tuple[int], np.dtype[np.int64]]) -> FloatArray:
    """Largest value between each two edges.

    Parameters
    ----------
    error : ndarray, shape (N,)
        Of either sign left out.
    edges : ndarray of int, shape (M + 1,)
        Rising.

    Returns
    -------
    ndarray, shape (M,)
    """
    return np.maximum.reduceat(error[: edges[-1]], edges[:-1])


def deviation(theta: FloatArray, level: FloatArray) -> float:
    """Largest deviation of a parameter from a level, relative to that; 0 without parameters.

    Parameters
    ----------
    theta : ndarray, shape (N, n)
        Parameters over time.
    level : ndarray, shape (n,)
        What they are compared with.
    """
    if theta.size == 0:
        return 0.0
    moved = np.abs(theta - level)
    # A weight of a model that ended at zero: it is off by nothing, or by more than any part.
    parts = np.divide(moved, np.abs(level), out=np.where(moved > 0.0, np.inf, 0.0), where=level != 0.0)
    return float(np.max(parts))


def _rest_excursion(theta: FloatArray, case: Case, skipped: int = 0) -> float | None:
    """Excursion during the rest without its first samples; None if there is no such rest."""
    if case.rest is None or theta.size == 0:
        return None
    first, end = case.rest[0] + skipped, case.rest[1]
    if first >= end:
        return None
    return deviation(theta[first:end], theta[first])


def _over(ours: float, theirs: float) -> float:
    return ours / theirs if theirs > 0.0 else float(np.inf if ours > 0.0 else 1.0)
