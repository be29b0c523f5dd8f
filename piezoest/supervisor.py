"""The guard in the ring: adaptation may never be worse than linear feed-forward for long."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from piezoest._checks import FloatArray, positive
from piezoest.equations.coleman_hodgdon import stationary_gain
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import ColemanHodgdon, LinearGain, Model

# Below this the reference is at rest, and nothing is judged [µm].
AT_REST = 1e-3
# A proposed model's gain may differ by so much from the gain that is measured.
GAIN_TOLERANCE = 0.35
# A model is good enough to fall back to if its error was below this part of the linear one.
GOOD = 0.7
# b in parts of c in a Coleman-Hodgdon model that stands for a line.
NO_LOOP = 1e-9
# Fraction of the window over which the error is taken at its worst.
RECENT = 0.25


@dataclass(frozen=True, slots=True)
class Event:
    """Something a supervisor did.

    Parameters
    ----------
    time : float
        Seconds since its start.
    action : str
        ``"kept"`` (a proposed model was not taken), ``"fell back"`` or ``"resumed"``.
    reason : str
        Why, with the figures.
    """

    time: float
    action: str
    reason: str


class Supervisor:
    """Compares the tracking error with that of linear feed-forward, and falls back when it is worse.

    The gain K is estimated beside the ring (12). What linear feed-forward would miss is the
    opening of the loop, max|x - K u|, over the last window, scaled to the reference. Where
    the error passes `limit` times that, the compensator gets back the last model that was
    good, or linear feed-forward itself if there is none, for one window; then adaptation
    is tried again. A proposed model whose gain (at the present amplitude) is not the
    measured one is not taken in the first place.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    window : float
        Seconds over which errors are compared: about one period of the reference.
    limit : float
        Error that is allowed, in parts of linear feed-forward's.

    Raises
    ------
    ValueError
        If a value is not above zero.
    """

    __slots__ = ("_elapsed", "_events", "_gain", "_good", "_held", "_limit", "_recent", "_until", "_window")

    def __init__(self, sample_rate: float, *, window: float = 0.2, limit: float = 1.2) -> None:
        self._window = positive("window", window)
        self._limit = positive("limit", limit)
        self._gain = HysteresisRLS(
            positive("sample_rate", sample_rate), initial_model=LinearGain(0.15), memory=window, offset=True
        )
        self.reset()

    def reset(self) -> None:
        """Return to the state after construction."""
        self._gain.reset()
        self._elapsed = 0.0
        self._until = -math.inf
        self._good: Model | None = None
        self._held: Model | None = None
        self._events: list[Event] = []
        # Per interval: its end, largest |r - x|, |x - K u|, |x|, |r|, |u|.
        self._recent: deque[tuple[float, ...]] = deque()

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
        self._take(r, u, x)
        if self._elapsed < RECENT * self._window:
            return proposed
        error, linear = self._compare()
        if self._held is not None:
            if self._elapsed < self._until:
                return self._held
            self._held = None
            self._note("resumed", f"error {error:.3g} µm, linear feed-forward {linear:.3g} µm")
        if self._elapsed > self._window and error > self._limit * linear > 0.0:
            return self._fall_back(error, linear, present)
        if error < GOOD * linear:
            self._good = present
        return self._plausible(present, proposed)

    def _take(self, r: FloatArray, u: FloatArray, x: FloatArray) -> None:
        self._gain.run(u, x, every=max(1, u.size))
        self._elapsed += r.size / self._gain.sample_rate
        good = np.isfinite(x)
        if np.any(good):
            model = self._gain.model
            line = model.simulate(u[good]) if isinstance(model, LinearGain) else x[good]
            largest = (np.max(np.abs(part)) for part in (r[good] - x[good], x[good] - line, x[good], r, u))
            self._recent.append((self._elapsed, *(float(value) for value in largest)))
        while self._recent and self._recent[0][0] < self._elapsed - self._window:
            self._recent.popleft()

    def _compare(self) -> tuple[float, float]:
        """Recent largest error, and what linear feed-forward's would have been; zeros at rest."""
        if not self._recent:
            return 0.0, 0.0
        values = np.array(self._recent)
        late = values[:, 0] > self._elapsed - RECENT * self._window
        _, _, opening, size, reference, _ = values.max(axis=0)
        if reference < AT_REST or size < AT_REST or not np.any(late):
            return 0.0, 0.0
        return float(values[late, 1].max()), float(opening / size * reference)

    def _fall_back(self, error: float, linear: float, present: Model) -> Model:
        good = self._good
        self._held = good if good is not None and self._fits(good) else self._line(present)
        self._until = self._elapsed + self._window
        self._note(
            "fell back", f"error {error:.3g} µm, linear feed-forward {linear:.3g} µm; now {self._held}"
        )
        return self._held

    def _plausible(self, present: Model, proposed: Model) -> Model:
        if self._fits(proposed):
            return proposed
        if not self._events or self._events[-1].action != "kept":
            self._note("kept", f"{proposed} does not have the measured gain {self._gain.model}")
        return present if self._fits(present) else self._line(present)

    def _line(self, present: Model) -> Model:
        """Linear feed-forward, as a model of the kind in use: without a loop to speak of."""
        line = self._gain.model
        if isinstance(present, ColemanHodgdon) and isinstance(line, LinearGain):
            return ColemanHodgdon.from_loop(present.a, NO_LOOP * line.gain, line.gain, line.offset)
        return line

    def _fits(self, model: Model) -> bool:
        """Whether the model's gain at the present amplitude is about the measured one."""
        line = self._gain.model
        if not self._recent or not isinstance(line, LinearGain):
            return True
        amplitude = max(row[5] for row in self._recent)
        if isinstance(model, ColemanHodgdon):
            gain = float(stationary_gain(amplitude, model.a, model.b, model.c))
        elif isinstance(model, LinearGain):
            gain = model.gain
        else:
            return True
        return abs(gain / line.gain - 1.0) < GAIN_TOLERANCE

    def _note(self, action: str, reason: str) -> None:
        self._events.append(Event(self._elapsed, action, reason))
