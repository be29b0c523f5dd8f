"""The guard in the ring: a model has to explain what has just happened better than a straight line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest import supervisor_kernel as kernel
from piezoest._checks import FloatArray, positive
from piezoest.equations import loop_inverse
from piezoest.models import ColemanHodgdon, LinearGain, Model

# A model that is right to this part of the displacement's range is good enough anyway; the second number
# before the first turn, for a line knows no loop then.
NEGLIGIBLE, EARLY = 0.005, 0.1
# A model in use that is about as good, to this part, makes room for the next one.
ABOUT = 1.1
# After a fall a model must be better than the line by this, or the two would take turns.
CLEARLY = 0.7
# The stage misses the reference if each quarter of the last swing does, by so many times what is allowed.
ASTRAY = 1.5
# After a fall no model is tried for so many points, twice as many after each, up to the second number.
AGAIN, AT_MOST = 16.0, 512.0
# The line fallen back to stays until it misses so many times what is allowed.
STALE = 1.05
# A model whose slopes or offset are this much from those of the last one is judged at once.
ANOTHER = 0.1
# b relative to c in a Coleman-Hodgdon model that stands for a line.
NO_LOOP = 1e-9


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

    About sixteen times a swing the proposed model is run over the last swings of the voltage, and its
    error against the measured displacement compared with that of the straight line x = K u + offset that
    fits them best. A model whose error is above `limit` times the line's, or above that of the present
    model, is not handed on: the compensator keeps its present model if that one passes, else gets the
    last one that had passed if it still does, else the line itself. The line takes over, too, where the
    stage misses the reference by more than a line would all the time, or the voltage rests at a limit
    while the reference moves within reach. Between two verdicts the last one holds, but for a model far
    from the one last judged, which is judged at once. While the stage tracks clearly better than a line
    would, a model near the last good one is taken without more ado. Errors are root mean
    squares, or half the largest value where that is more; the recent past weighs more. At the start,
    until the line's gain is known, a model must be clearly better than the one in use.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    limit : float
        Error that is allowed, relative to the line's.

    Raises
    ------
    ValueError
        If a value is not above zero.

    Notes
    -----
    What counts is the travel of voltage and reference, 64 points a swing, whatever the time and the
    interval: a rest adds nothing. Readings that stand still while the voltage moves teach nothing: while
    there are no others the model in use stays. The line's gain keeps the sign of the first model's, and
    lies within a factor of twenty of it, or of the first line's that was found over two swings.

    A `ColemanHodgdon` is run from where the voltage's recent path puts it; of any other model with a
    memory the mean error is left out. Source: a rule of this library.
    """

    __slots__ = (
        "_again", "_elapsed", "_events", "_first", "_good", "_held", "_kept", "_limit", "_memory",
        "_sample_rate", "_seen", "_trusts", "_until",
    )  # fmt: skip

    def __init__(self, sample_rate: float, *, limit: float = 1.0) -> None:
        self._sample_rate = positive("sample_rate", sample_rate)
        self._limit = positive("limit", limit)
        self.reset()

    def reset(self) -> None:
        """Return to the state after construction."""
        self._elapsed = 0
        self._memory = kernel.begin(1.0, 0.0)
        self._seen = kernel.seen_in(self._memory)
        self._until, self._again = 0.0, AGAIN
        self._first: Model | None = None
        self._good: Model | None = None
        self._held: Model | None = None
        self._trusts = self._kept = False
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
        if self._first is None:
            self._first = present
            self._memory = kernel.begin(*present.line)
        self._elapsed += u.size
        r, u = np.ascontiguousarray(r, float), np.ascontiguousarray(u, float)
        found = kernel.look.of(kernel.MEMORY)(self._memory, r, u, np.ascontiguousarray(x, float))
        if found != kernel.NOT_YET:
            chosen = self._judge(found, present, proposed)
            self._trusts = chosen is proposed and self._held is None
            return chosen
        if self._held is not None:
            return self._held
        if self._trusts and self._is_another(proposed):
            return self._judge(int(self._seen.found), present, proposed)
        return proposed if self._trusts else present

    def _is_another(self, proposed: Model) -> bool:
        """Whether a model is so far from the one last judged that no verdict holds for it."""
        good = self._good
        if not (isinstance(proposed, ColemanHodgdon) and isinstance(good, ColemanHodgdon)):
            return False
        return (
            abs(proposed.beta - good.beta) > ANOTHER * good.beta
            or abs(proposed.c - good.c) > ANOTHER * good.gamma / good.alpha
            or abs(proposed.offset - good.offset) > ANOTHER * self._seen.span
        )

    def _judge(self, found: int, present: Model, proposed: Model) -> Model:
        """The model for the time until the next verdict."""
        seen = self._seen = kernel.seen_in(self._memory)
        if found == kernel.NOTHING_READ:
            return self._held or self._good or present
        if isinstance(proposed, LinearGain) and self._is_near(proposed.gain):
            return proposed  # a line itself
        if found == kernel.AT_REST:
            return self._at_rest(present)
        if found == kernel.NO_LINE:
            return self._without_a_line(present, proposed)
        unexplained = seen.unexplained
        negligible = (NEGLIGIBLE if seen.turns > 0.0 else EARLY) * seen.span
        limit = allowed = max(self._limit * unexplained, negligible)
        error = self._error(proposed)
        if self._held is not None:
            allowed = max(CLEARLY * allowed, negligible) if seen.kept >= self._until else 0.0
        elif seen.kept >= self._until and seen.least_miss > ASTRAY * limit:
            missed = f"the stage misses the reference by {seen.least_miss:.3g} µm"
            return self._fall(self._line(present), f"{missed}, a line {unexplained:.3g} µm")
        tracks = self._held is None and seen.worst_miss <= CLEARLY * limit
        near = isinstance(proposed, ColemanHodgdon) and not self._is_another(proposed)
        if tracks and near and self._good is not None:
            # What the past cannot tell, as creep in a rest, does not speak against what tracks well.
            self._good, self._kept = proposed, False
            return proposed
        if error <= allowed:
            if self._held is None and error > negligible and error > ABOUT * self._error(present):
                # One lucky model after another is worse than any of them: the better one stays.
                return present
            if self._held is not None:
                self._note("resumed", self._reason(proposed, error))
                self._until = seen.kept + kernel.A_SWING
            self._good, self._held, self._kept = proposed, None, False
            return proposed
        if self._held is not None:
            return self._stay(self._held, present, limit)
        if seen.worst_miss <= limit or self._error(present) <= limit:
            if not self._kept:
                self._note("kept", self._reason(proposed, error))
            self._kept = True
            return present
        good = self._good
        if good is None or self._error(good) > limit:
            good = self._line(present)
        return self._fall(good, self._reason(proposed, error))

    def _without_a_line(self, present: Model, proposed: Model) -> Model:
        """The proposed model or the first one, if that is clearly better than the one in use."""
        if self._held is not None:
            return self._held
        error = self._error(present)
        others = (other for other in (proposed, self._first) if other is not None)
        return next((other for other in others if self._error(other) <= CLEARLY * error), present)

    def _at_rest(self, present: Model) -> Model:
        """The line where the voltage rests though the reference moves within its reach."""
        line = self._line(present)
        if self._held is not None:
            self._held = line
            return line
        voltage = self._seen.last_u
        return self._fall(line, f"the voltage rests at {voltage:.3g} V while the reference moves")

    def _stay(self, held: Model, present: Model, limit: float) -> Model:
        """What was fallen back to; the line of now where that has become worse."""
        good = self._good
        if good is not None and held is not good and self._error(good) <= CLEARLY * limit:
            held = good
        if self._seen.known == 0.0 or self._error(held) > STALE * limit:
            held = self._line(present)
        self._held = held
        return held

    def _fall(self, model: Model, reason: str) -> Model:
        self._held, self._until = model, self._seen.kept + self._again
        self._again = min(2.0 * self._again, AT_MOST)
        self._note("fell back", f"{reason}; now {model}")
        return model

    def _line(self, present: Model) -> Model:
        """Linear feed-forward as a model; of the kind in use, so that `theta` keeps its shape."""
        gain, offset = self._seen.gain, self._seen.offset
        if isinstance(present, ColemanHodgdon) and gain > 0.0:
            return ColemanHodgdon.from_loop(present.a, NO_LOOP * gain, gain, offset)
        return LinearGain(gain, offset)

    def _is_near(self, gain: float) -> bool:
        """Whether a gain is anything like that of the stage."""
        return 1.0 / kernel.FAR < gain / self._seen.base < kernel.FAR

    def _error(self, model: Model) -> float:
        """How much a model misses of the last swings [µm]."""
        memory: Any = self._memory
        if model.inverse is loop_inverse:
            loop = model.inverse_settings(None)
            if loop["b"] > 0.0 and not self._is_near(loop["c"]):
                return math.inf
            error = kernel.missed_by_loop.of(kernel.MEMORY)(memory, *loop.values())
        else:
            error = kernel.missed_but_for_mean.of(kernel.MEMORY)(memory, self._displacements(model))
        return error if math.isfinite(error) else math.inf

    def _displacements(self, model: Model) -> FloatArray:
        """Displacements of any model at the points, which creep takes to come at an even rate."""
        count, options = int(self._memory["count"]), {}
        if getattr(model, "creep", None) is not None:
            between = np.sort(np.diff(self._memory["points"]["sample"][:count:8]))
            rate = 8.0 * self._sample_rate / between[between.size // 2] if between.size else None
            options = {"sample_rate": rate}
        with np.errstate(all="ignore"):
            y = model.simulate(kernel.voltages(self._memory), **options)  # type: ignore[attr-defined]
        return np.ascontiguousarray(y[-count:], dtype=float)

    def _reason(self, model: Model, error: float) -> str:
        return f"{model} misses {error:.3g} µm, a line {self._seen.unexplained:.3g} µm"

    def _note(self, action: str, reason: str) -> None:
        self._events.append(Event(self._elapsed / self._sample_rate, action, reason))
