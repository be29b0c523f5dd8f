"""The guard in the ring: a model has to explain what has just happened better than a straight line."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from piezoest._checks import FloatArray, positive
from piezoest.estimators.believing import STANDS_STILL
from piezoest.models import ColemanHodgdon, LinearGain, Model

# An interval whose voltage moves by no more than this part of its size is one at rest.
AT_REST = 1e-4
# Points that are kept of an interval, at most of a window, and windows that are kept.
POINTS, MOST, WINDOWS = 4, 800, 4
# What happened this part of a window ago counts for half.
HALF_LIFE = 0.5
# A model that is right to this part of the displacement's range is good enough anyway.
NEGLIGIBLE = 0.005
# A model in use that is about as good, to this part, makes room for the next one.
ABOUT = 1.1
# After a fall a model must be better than the line by this, or the two would take turns.
CLEARLY = 0.7
# It is not tried again for this part of a window, and the line fallen back to stays until it misses
# so many times what is allowed.
AGAIN, STALE = 0.25, 1.05
# While a period is not over, the line goes through the mean of so many points: the first alone is noisy.
FIRST = 16
# The line's gain must be known this well before anything is judged by it.
GAIN_KNOWN = 0.05
# b in parts of c in a Coleman-Hodgdon model that stands for a line.
NO_LOOP = 1e-9
# An error's largest value, but for this part of all, counts like a root mean square so many times smaller.
SPIKES, PEAK = 0.02, 2.0
# Rows of what is kept of the past.
TIME, VOLTAGE, MEASURED, ROWS = range(4)


@dataclass(frozen=True, slots=True)
class Event:
    """Something a supervisor did.

    Parameters
    ----------
    time : float
        Seconds since its start.
    action : str
        ``"kept"`` (a proposed model that misses more than is allowed was not taken, the present one
        stays), ``"fell back"`` (to the last good model or to a line) or ``"resumed"``.
    reason : str
        Why, with the figures.
    """

    time: float
    action: str
    reason: str


class Supervisor:
    """Lets only those models through to the compensator that are better than linear feed-forward.

    Every proposed model is run over the voltages of the last window, and its error against the
    measured displacement compared with that of the straight line x = K u + offset that fits
    the window best. A model whose error is above `limit` times the line's, or above that of the present
    model, is not handed on: the compensator keeps its present model if that one passes, else gets the
    last one that had passed if it still does, else the line itself. What linear feed-forward would
    miss of a reference is what a line misses of the displacement, so that adaptation is never worse
    than that for longer than it takes to see it. Errors are root mean squares, or half the largest
    value where that is more; the recent past weighs more. At the start, until the line's gain is
    known, a model must be clearly better than the one in use.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    window : float
        Seconds over which errors are compared: about one period of the reference.
    limit : float
        Error that is allowed, in parts of the line's.

    Raises
    ------
    ValueError
        If a value is not above zero.

    Notes
    -----
    A `ColemanHodgdon` is run from a few windows before, by when it has forgotten where it started; of
    any other model with a memory the mean error is left out instead. Source: a rule of this library.
    """

    __slots__ = (
        "_count", "_elapsed", "_events", "_first", "_good", "_held", "_kept",
        "_limit", "_line_at", "_moved", "_past", "_read_at", "_reading", "_sample_rate", "_still", "_until",
        "_window",
    )  # fmt: skip

    def __init__(self, sample_rate: float, *, window: float = 0.2, limit: float = 1.0) -> None:
        self._sample_rate = positive("sample_rate", sample_rate)
        self._window = positive("window", window)
        self._limit = positive("limit", limit)
        self.reset()

    def reset(self) -> None:
        """Return to the state after construction."""
        self._elapsed = self._moved = 0.0  # s, the second without what was at rest
        self._until, self._line_at = 0.0, 0.0
        self._past = np.empty((ROWS, 2 * WINDOWS * MOST))
        self._count = 0
        self._reading, self._read_at, self._still = math.nan, 0.0, False
        self._first: Model | None = None
        self._good: Model | None = None
        self._held: Model | None = None
        self._kept = False
        self._events: list[Event] = []

    @property
    def events(self) -> tuple[Event, ...]:
        """What it did, oldest first."""
        return tuple(self._events)

    @property
    def holding(self) -> bool:
        """Whether the compensator is on a model to fall back to."""
        return self._held is not None

    def review(self, r: FloatArray, u: FloatArray, x: FloatArray, present: Model, proposed: Model) -> Model:
        """Choose the model for the next interval.

        Parameters
        ----------
        r, u, x : ndarray, shape (N,)
            Reference [µm], voltage [V] and measured displacement [µm] of the interval that
            has just passed.
        present : Model
            The model the compensator had.
        proposed : Model
            The model the estimator has now.

        Returns
        -------
        Model
            `proposed`, `present` or one to fall back to.
        """
        self._elapsed += u.size / self._sample_rate
        if self._is_at_rest(u):
            # Creep alone moves the stage: nothing to judge a model by. Full voltage is such a rest, too.
            return present if self._held is None else self._held
        if not self._take(u, x):
            # Nothing was measured: nothing to judge a model by, and nothing new for it to go by.
            return present
        past = self._recent()
        ages = self._moved - past[TIME]
        weights = 0.5 ** (ages / (HALF_LIFE * self._window)) * (ages <= self._window)
        line = _line(past[:, weights > 0.0], weights[weights > 0.0], whole=self._moved >= self._window)
        if line is None:
            return self._while_there_is_no_line(past, weights, present, proposed)
        gain, offset, unexplained = line
        span = float(np.ptp(past[MEASURED, weights > 0.0]))
        limit = allowed = max(self._limit * unexplained, NEGLIGIBLE * span)
        error = _error(proposed, past, weights)
        if self._held is not None:
            allowed = max(CLEARLY * allowed, NEGLIGIBLE * span)
            if self._moved < self._until:
                allowed = 0.0
        if error <= allowed:
            good_enough = self._held is not None or error <= NEGLIGIBLE * span
            if not good_enough and error > ABOUT * _error(present, past, weights):
                # One lucky model after another is worse than any of them: the better one stays.
                return present
            self._pass(proposed, error, unexplained)
            return proposed
        reason = f"{proposed} misses {error:.3g} µm, a line {unexplained:.3g} µm"
        if self._held is None and _error(present, past, weights) <= limit:
            if not self._kept:
                self._note("kept", reason)
            self._kept = True
            return present
        return self._fall_back(past, weights, limit, gain, offset, present, reason)

    def _while_there_is_no_line(
        self, past: FloatArray, weights: FloatArray, present: Model, proposed: Model
    ) -> Model:
        """The proposed model or the first one, if that is clearly better than the one in use."""
        if self._first is None:
            self._first = present
        error = _error(present, past, weights)
        for other in (proposed, self._first):
            if _error(other, past, weights) <= CLEARLY * error:
                return other
        return present

    def _is_at_rest(self, u: FloatArray) -> bool:
        largest = max(
            float(np.max(np.abs(u))), float(np.max(np.abs(self._past[VOLTAGE, : self._count]), initial=0.0))
        )
        return float(np.ptp(u)) <= AT_REST * largest

    def _take(self, u: FloatArray, x: FloatArray) -> bool:
        """Keep some points of an interval; False if there was none to keep."""
        picked = np.arange(u.size)
        if u.size > POINTS:
            picked = np.unique(np.linspace(0, u.size - 1, POINTS).astype(int))
        picked = picked[np.isfinite(x[picked])]
        known = np.concatenate([u, self._past[VOLTAGE, : self._count]])
        size = float(np.ptp(known)) if known.size else 0.0
        picked = picked[[self._is_alive(float(u[k]), float(x[k]), size) for k in picked]]
        if picked.size == 0:
            return False
        if self._count + picked.size > self._past.shape[1]:
            half = self._count // 2
            self._past[:, : self._count - half] = self._past[:, half : self._count]
            self._count -= half
        new = slice(self._count, self._count + picked.size)
        self._past[TIME, new] = self._moved + (picked + 1) / self._sample_rate
        self._past[VOLTAGE, new] = u[picked]
        self._past[MEASURED, new] = x[picked]
        self._count += picked.size
        self._moved += u.size / self._sample_rate
        return True

    def _is_alive(self, u: float, x: float, size: float) -> bool:
        """Whether a reading is no repetition of the last: a saturated or dead sensor tells nothing."""
        if x != self._reading:
            self._reading, self._read_at, self._still = x, u, False
        elif abs(u - self._read_at) > STANDS_STILL * size:
            self._still = True
        return not self._still

    def _recent(self) -> FloatArray:
        """Points of the last windows, thinned where there are many."""
        past = self._past[:, : self._count]
        past = past[:, np.searchsorted(past[TIME], self._moved - WINDOWS * self._window) :]
        return past[:, :: 1 + past.shape[1] // (WINDOWS * MOST)]

    def _pass(self, model: Model, error: float, unexplained: float) -> None:
        if self._held is not None:
            self._note("resumed", f"{model} misses {error:.3g} µm, a line {unexplained:.3g} µm")
        self._good, self._held, self._kept = model, None, False

    def _fall_back(
        self,
        past: FloatArray,
        weights: FloatArray,
        allowed: float,
        gain: float,
        offset: float,
        present: Model,
        reason: str,
    ) -> Model:
        # A line of less than a whole window becomes better with every point.
        settled = self._line_at >= self._window
        if self._held is not None and settled and _error(self._held, past, weights) <= STALE * allowed:
            return self._held
        self._line_at = self._moved
        fallen = self._held is not None
        good = self._good
        if good is not None and _error(good, past, weights) <= allowed:
            self._held = good
        else:
            self._held = _as_model(gain, offset, present)
        if not fallen:
            self._until = self._moved + AGAIN * self._window
            self._note("fell back", f"{reason}; now {self._held}")
        return self._held

    def _note(self, action: str, reason: str) -> None:
        self._events.append(Event(self._elapsed, action, reason))


def _line(past: FloatArray, weights: FloatArray, *, whole: bool) -> tuple[float, float, float] | None:
    """Gain and offset of the best line, and its weighted error; None while the gain is not known.

    Over less than a whole window the line goes through the first points: a part of a loop has
    another centre than the loop.
    """
    size = past.shape[1]
    if size < 3:
        return None
    u, x = past[VOLTAGE], past[MEASURED]
    centre = slice(None) if whole else slice(FIRST)
    u_mean, x_mean = float(np.mean(u[centre])), float(np.mean(x[centre]))
    u, x = u - u_mean, x - x_mean
    spread = float(u @ u)
    if spread <= 0.0:
        return None
    gain = float(u @ x) / spread
    missed = x - gain * u
    if not math.sqrt(float(missed @ missed) / size) < GAIN_KNOWN * abs(gain) * math.sqrt(spread):
        return None
    return gain, x_mean - gain * u_mean, _size(missed, weights)


def _error(model: Model, past: FloatArray, weights: FloatArray) -> float:
    """How much a model misses of the past [µm], by the weights of its points."""
    u = np.ascontiguousarray(past[VOLTAGE])
    with np.errstate(all="ignore"):
        if isinstance(model, ColemanHodgdon):
            # Somewhere within the loop, which is soon forgotten: the middle between its branches.
            off_centre = float(u[0]) - 0.5 * (float(np.min(u)) + float(np.max(u)))
            start = -model.b * math.tanh(model.a * off_centre) / model.a
            missed = past[MEASURED] - model.simulate(u, initial_state=start, allow_jumps=True)
        elif isinstance(model, LinearGain):
            missed = past[MEASURED] - model.simulate(u)
        else:
            missed = past[MEASURED] - model.simulate(u)  # type: ignore[attr-defined]
            missed = missed - float(weights @ missed) / float(weights.sum())
        error = _size(missed, weights)
    return error if math.isfinite(error) else math.inf


def _size(missed: FloatArray, weights: FloatArray) -> float:
    """Root mean square of an error by weights [µm], or a part of the largest if that is more.

    The very largest do not count: a spike of the sensor would excuse any model.
    """
    mean = math.sqrt(float(weights @ missed**2) / float(weights.sum()))
    recent = np.abs(missed[weights > 0.0])
    place = recent.size - 1 - int(SPIKES * recent.size)
    return max(mean, float(np.partition(recent, place)[place]) / PEAK)


def _as_model(gain: float, offset: float, present: Model) -> Model:
    """Linear feed-forward as a model; of the kind in use, so that `theta` keeps its shape."""
    if isinstance(present, ColemanHodgdon) and gain > 0.0:
        return ColemanHodgdon.from_loop(present.a, NO_LOOP * gain, gain, offset)
    return LinearGain(gain, offset)
