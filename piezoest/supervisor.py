"""The guard in the ring: a model has to explain what has just happened better than a straight line."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from piezoest import supervisor_kernel as kernel
from piezoest._checks import FloatArray, positive
from piezoest.models import ColemanHodgdon, LinearGain, Model, PrandtlIshlinskii

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
# b in parts of c in a Coleman-Hodgdon model that stands for a line.
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
        Error that is allowed, in parts of the line's.

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
        "_again", "_elapsed", "_events", "_first", "_good", "_held", "_kept", "_limit", "_memory", "_points",
        "_sample_rate", "_trusts", "_until",
    )  # fmt: skip

    def __init__(self, sample_rate: float, *, limit: float = 1.0) -> None:
        self._sample_rate = positive("sample_rate", sample_rate)
        self._limit = positive("limit", limit)
        self.reset()

    def reset(self) -> None:
        """Return to the state after construction."""
        self._elapsed = 0
        self._memory, self._points = kernel.begin(1.0, 0.0)
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
            self._memory, self._points = kernel.begin(*_line_of(present))
        self._elapsed += u.size
        found = kernel.look(self._memory, self._points, r, u, x)
        if found != kernel.NOT_YET:
            chosen = self._judge(found, present, proposed)
            self._trusts = chosen is proposed and self._held is None
            return chosen
        if self._held is not None:
            return self._held
        if self._trusts and self._is_another(proposed):
            return self._judge(int(self._memory[kernel.FOUND]), present, proposed)
        return proposed if self._trusts else present

    def _is_another(self, proposed: Model) -> bool:
        """Whether a model is so far from the one last judged that no verdict holds for it."""
        good = self._good
        if not (isinstance(proposed, ColemanHodgdon) and isinstance(good, ColemanHodgdon)):
            return False
        return (
            abs(proposed.beta - good.beta) > ANOTHER * good.beta
            or abs(proposed.gamma / proposed.alpha - good.gamma / good.alpha)
            > ANOTHER * good.gamma / good.alpha
            or abs(proposed.offset - good.offset) > ANOTHER * self._memory[kernel.SPAN]
        )

    def _judge(self, found: int, present: Model, proposed: Model) -> Model:
        """The model for the time until the next verdict."""
        memory = self._memory
        if found == kernel.NOTHING_READ:
            return self._held or self._good or present
        if (
            isinstance(proposed, LinearGain)
            and 1.0 / kernel.FAR < proposed.gain / memory[kernel.BASE] < kernel.FAR
        ):
            return proposed  # a line itself
        if found == kernel.AT_REST:
            return self._at_rest(present)
        if found == kernel.NO_LINE:
            return self._without_a_line(present, proposed)
        unexplained = float(memory[kernel.UNEXPLAINED])
        negligible = (NEGLIGIBLE if memory[kernel.TURNS] > 0.0 else EARLY) * float(memory[kernel.SPAN])
        limit = allowed = max(self._limit * unexplained, negligible)
        error = self._error(proposed)
        if self._held is not None:
            allowed = max(CLEARLY * allowed, negligible) if memory[kernel.KEPT] >= self._until else 0.0
        elif memory[kernel.KEPT] >= self._until and memory[kernel.LEAST_MISS] > ASTRAY * limit:
            missed = f"the stage misses the reference by {memory[kernel.LEAST_MISS]:.3g} µm"
            return self._fall(self._line(present), f"{missed}, a line {unexplained:.3g} µm")
        tracks = self._held is None and memory[kernel.WORST_MISS] <= CLEARLY * limit
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
                self._note("resumed", _reason(proposed, error, unexplained))
                self._until = memory[kernel.KEPT] + kernel.A_SWING
            self._good, self._held, self._kept = proposed, None, False
            return proposed
        if self._held is not None:
            return self._stay(present, limit)
        if memory[kernel.WORST_MISS] <= limit or self._error(present) <= limit:
            if not self._kept:
                self._note("kept", _reason(proposed, error, unexplained))
            self._kept = True
            return present
        good = self._good
        if good is None or self._error(good) > limit:
            good = self._line(present)
        return self._fall(good, _reason(proposed, error, unexplained))

    def _without_a_line(self, present: Model, proposed: Model) -> Model:
        """The proposed model or the first one, if that is clearly better than the one in use."""
        if self._held is not None:
            return self._held
        error = self._error(present)
        for other in (proposed, self._first):
            if other is not None and self._error(other) <= CLEARLY * error:
                return other
        return present

    def _at_rest(self, present: Model) -> Model:
        """The line where the voltage rests though the reference moves within its reach."""
        line = self._line(present)
        if self._held is not None:
            self._held = line
            return line
        voltage = float(self._memory[kernel.LAST_U])
        return self._fall(line, f"the voltage rests at {voltage:.3g} V while the reference moves")

    def _stay(self, present: Model, limit: float) -> Model:
        """What was fallen back to; the line of now where that has become worse."""
        held, good = self._held, self._good
        if good is not None and held is not good and self._error(good) <= CLEARLY * limit:
            held = self._held = good
        if held is None or self._memory[kernel.KNOWN] == 0.0 or self._error(held) > STALE * limit:
            held = self._held = self._line(present)
        return held

    def _fall(self, model: Model, reason: str) -> Model:
        self._held, self._until = model, float(self._memory[kernel.KEPT]) + self._again
        self._again = min(2.0 * self._again, AT_MOST)
        self._note("fell back", f"{reason}; now {model}")
        return model

    def _line(self, present: Model) -> Model:
        """Linear feed-forward as a model; of the kind in use, so that `theta` keeps its shape."""
        gain, offset = float(self._memory[kernel.GAIN]), float(self._memory[kernel.OFFSET])
        if isinstance(present, ColemanHodgdon) and gain > 0.0:
            return ColemanHodgdon.from_loop(present.a, NO_LOOP * gain, gain, offset)
        return LinearGain(gain, offset)

    def _error(self, model: Model) -> float:
        """How much a model misses of the last swings [µm]."""
        memory, points = self._memory, self._points
        if isinstance(model, ColemanHodgdon):
            a = model.alpha
            c = model.gamma / a
            if not 1.0 / kernel.FAR < c / memory[kernel.BASE] < kernel.FAR:
                return math.inf
            error = kernel.missed_by_loop(memory, points, a, c - model.beta, c, model.offset)
        elif isinstance(model, LinearGain):
            error = kernel.missed_by_loop(memory, points, 1.0, 0.0, model.gain, model.offset)
        else:
            error = kernel.missed_but_for_mean(memory, points, self._displacements(model))
        return error if math.isfinite(error) else math.inf

    def _displacements(self, model: Model) -> FloatArray:
        """Displacements of a model of any kind at the points, which creep takes to come at an even rate."""
        memory, points = self._memory, self._points
        count, options = int(memory[kernel.COUNT]), {}
        if isinstance(model, PrandtlIshlinskii) and model.creep is not None:
            samples = points[kernel.SAMPLE, :count:8].tolist()
            between = sorted(later - sooner for sooner, later in itertools.pairwise(samples))
            options = {
                "sample_rate": 8.0 * self._sample_rate / between[len(between) // 2] if between else None
            }
        with np.errstate(all="ignore"):
            y = model.simulate(kernel.voltages(memory, points), **options)  # type: ignore[attr-defined]
        return np.ascontiguousarray(y[-count:], dtype=float)

    def _note(self, action: str, reason: str) -> None:
        self._events.append(Event(self._elapsed / self._sample_rate, action, reason))


def _reason(model: Model, error: float, unexplained: float) -> str:
    return f"{model} misses {error:.3g} µm, a line {unexplained:.3g} µm"


def _line_of(model: Model) -> tuple[float, float]:
    """Gain and offset of a model, as far as they can be told before anything is measured."""
    if isinstance(model, ColemanHodgdon):
        return model.beta, model.offset
    y = model.simulate(np.array([0.0, 1e-3, 0.0, 1.0]))  # type: ignore[attr-defined]
    return float(y[-1] - y[0]), float(y[0])
