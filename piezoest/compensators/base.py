"""What linear and inverse feed-forward share: the model's inverse, limits, bumpless change."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np

from piezoest._checks import WILDEST, FloatArray, array_1d, integer, number_or_nan, positive
from piezoest.compensators import corridor, loop_inverse
from piezoest.compensators.layout import (
    BY_PATH,
    CONFIG,
    CORRIDOR,
    DECAY,
    INTEGRATED,
    LARGEST_STEP,
    LIMITED_NOW,
    MAXIMUM,
    MEMORY,
    MINIMUM,
    MISSED,
    OFFSET,
    OWED,
    PATH,
    SAMPLES,
    SATURATED,
    SLEWED,
    STATE,
    VOLTAGE,
    W_H,
    A,
    B,
    C,
)
from piezoest.compensators.limits import VoltageLimits
from piezoest.equations import recent_path
from piezoest.equations.turning_points import recall, remember
from piezoest.models import ColemanHodgdon, LinearGain, Model, PrandtlIshlinskii

DUE = CORRIDOR + corridor.DUE

Method = Literal["closed-form", "bogacki-shampine"]
HandOver = Literal["path", "place"]


@dataclass(frozen=True, slots=True)
class CompensatorStatus:
    """What happened to the samples a compensator was given.

    Parameters
    ----------
    samples : int
        Reference samples seen.
    saturated, slewed : int
        Samples at which the voltage range or the slew rate was in the way.
    missing : int
        Samples without a usable reference: the voltage was held.
    projected : bool
        Whether the model set last was inadmissible and its nearest admissible one is used.
    """

    samples: int
    saturated: int
    slewed: int
    missing: int
    projected: bool


def _is_tame(model: Model) -> bool:
    """Whether no parameter is beyond what its inverse can take."""
    if isinstance(model, ColemanHodgdon):
        return all(abs(v) < WILDEST for v in (model.alpha, model.beta, model.gamma, model.offset))
    return bool(np.all(np.abs([*model.theta, getattr(model, "offset", 0.0)]) < WILDEST))


def _loop(model: Model) -> tuple[float, float, float, float]:
    """(a, b, c, offset) of a model."""
    if isinstance(model, ColemanHodgdon):
        return model.a, model.b, model.c, model.offset
    assert isinstance(model, LinearGain)
    # No hysteresis: b = 0, and any a.
    return 1.0, 0.0, model.gain, model.offset


def _slope(model: Model) -> float:
    """Slope of a model from rest [µm/V], about."""
    if isinstance(model, ColemanHodgdon):
        return model.beta
    assert isinstance(model, LinearGain | PrandtlIshlinskii)
    return model.gain


def _plays() -> Any:
    """Loops of a Prandtl-Ishlinskii model: loaded with the first one, for they take time to compile."""
    from piezoest.compensators import play_inverse

    return play_inverse


class Compensator:
    """Feed-forward through the inverse of a model.

    See `LinearCompensator` and `InverseCompensator`.
    """

    __slots__ = ("_config", "_limits", "_model", "_projected", "_sample_rate", "_start", "_state", "_waiting")

    def __init__(
        self,
        model: Model,
        limits: VoltageLimits | None,
        method: Method,
        transfer_samples: int,
        sample_rate: float | None = None,
        hand_over: HandOver = "path",
    ) -> None:
        if limits is None:
            limits = VoltageLimits()
        elif not isinstance(limits, VoltageLimits):
            raise ValueError(f"limits must be VoltageLimits(minimum, maximum), got {limits!r}")
        self._limits = limits
        self._sample_rate = (
            limits.sample_rate if sample_rate is None else positive("sample_rate", sample_rate)
        )
        self._config = np.zeros(CONFIG)
        self._config[MINIMUM] = self._limits.minimum
        self._config[MAXIMUM] = self._limits.maximum
        self._config[LARGEST_STEP] = self._limits.largest_step
        transfer_samples = integer("transfer_samples", transfer_samples)
        self._config[DECAY] = np.exp(-1.0 / transfer_samples) if transfer_samples else 0.0
        if method not in ("closed-form", "bogacki-shampine"):
            raise ValueError(f"method must be 'closed-form' or 'bogacki-shampine', got {method!r}")
        self._config[INTEGRATED] = method == "bogacki-shampine"
        if hand_over not in ("path", "place"):
            raise ValueError(f"hand_over must be 'path' or 'place', got {hand_over!r}")
        self._config[BY_PATH] = hand_over == "path"
        if not self._accepts(model).is_admissible:
            hint = "its gain must not be zero, nor next to it"
            if isinstance(model, ColemanHodgdon):
                hint = "use nearest_admissible()"
            elif isinstance(model, PrandtlIshlinskii):
                hint = "all its slopes must be above zero"
            raise ValueError(f"model {model} is not admissible and has no inverse: {hint}")
        self._projected = False
        self._start = model
        self._begin(model)

    @property
    def _compiled(self) -> tuple[Any, Any]:
        """Functions that a controller's code is generated from: voltage; change of model, or None."""
        if isinstance(self._model, PrandtlIshlinskii):
            return _plays().step, None
        return loop_inverse.voltage, loop_inverse.change_model

    @property
    def _fixed(self) -> tuple[int, ...]:
        """Positions in the configuration that no change of model or limits in that code touches."""
        if isinstance(self._model, PrandtlIshlinskii):
            return A, B, C, OFFSET, DECAY, INTEGRATED, BY_PATH, *range(CONFIG, self._config.size)
        return DECAY, INTEGRATED, BY_PATH

    def _begin(self, model: Model) -> None:
        """Start at rest, at the voltage nearest to zero."""
        self._configure(model)
        self._model = model
        self._state = np.zeros(STATE)
        self._state[VOLTAGE] = self._limits.rest
        recent_path.begin(self._state, PATH, self._limits.rest, self._config[A])
        remember(self._state, MEMORY, self._limits.rest)
        self._place(model, model)
        self._waiting: Model | None = None
        corridor.begin(self._state, CORRIDOR, self._limits.rest, self._expected(), _slope(model))

    def _accepts(self, model: Model) -> Model:
        """Return the model if it is of a kind this compensator can invert."""
        if not isinstance(model, ColemanHodgdon | LinearGain | PrandtlIshlinskii):
            raise ValueError(
                "model must be a ColemanHodgdon, a PrandtlIshlinskii or a LinearGain, "
                f"got {type(model).__name__}"
            )
        return model

    def _configure(self, model: Model) -> None:
        """Take over the model's numbers; states that only a Prandtl-Ishlinskii model has come and go."""
        head = self._config[:CONFIG]
        if not isinstance(model, PrandtlIshlinskii):
            head[[A, B, C, OFFSET]] = _loop(model)
            self._config = head.copy()
            return
        rate = model.sample_rate if self._sample_rate is None else self._sample_rate
        arrays = model._arrays(rate)
        counts = [float(values.size) for values in arrays[::2]]
        head[[A, B, C, OFFSET]] = 1.0, 0.0, model.gain, model.offset
        self._config = np.concatenate([head, counts, *arrays])

    def _expected(self) -> float:
        """Displacement that the model in use expects of the last sample [µm]."""
        config, state = self._config, self._state
        if isinstance(self._model, PrandtlIshlinskii):
            return float(_plays().expected(state, config))
        return float(config[C] * state[VOLTAGE] + state[W_H] + config[OFFSET])

    def _place(self, model: Model, before: Model) -> None:
        """Bring the model's memory to where the voltage is, as far as it is known."""
        state = self._state
        if not isinstance(model, PrandtlIshlinskii):
            self._state = state[:STATE].copy()
            return
        terms = 0 if model.creep is None else model.creep.gains.size
        z = np.zeros(terms)
        if isinstance(before, PrandtlIshlinskii):
            n = before.thresholds.size
            if np.array_equal(before.thresholds, model.thresholds) and state.size == STATE + n + terms:
                return
            if state.size - STATE - n == terms:
                z = state[STATE + n :]
        y = [recall(state, MEMORY, r) for r in model.thresholds.tolist()]
        self._state = np.concatenate([state[:STATE], y, z])

    @property
    def model(self) -> Model:
        """Model whose inverse is used. Setting it is bumpless.

        It takes effect by travel: when the reference has moved by 1/64 of its last leg since the last one
        did, at once if it has, or has not moved at all. Until then the model in use drives on, and of several
        that are set the last one waits. Where models follow one another soon, the voltage stays in a
        corridor around linear feed-forward (`piezoest.compensators.corridor`).

        The new model's w_h is found as `hand_over` says, and plays as the voltage's turning
        points have left them. What the new model makes of the present voltage differs
        from what the old one made of it; that difference is paid back exponentially over
        `transfer_samples`. An inadmissible model is replaced by its nearest admissible one, a
        `PrandtlIshlinskii` or `LinearGain`, or one with parameters beyond 1e9, not taken, and
        `status` says so: a stream must not stop.
        """
        return self._model

    @model.setter
    def model(self, model: Model) -> None:
        self._waiting = self._accepts(model)
        if self.hand_over_due:
            self._take_up_waiting()

    @property
    def hand_over_due(self) -> bool:
        """Whether a model that is set now takes effect at once."""
        return bool(self._state[DUE] != 0.0)

    def _take_up_waiting(self) -> None:
        """Use the model that was set last."""
        model, self._waiting = self._waiting, None
        assert model is not None
        if not _is_tame(model):
            # An estimator that ran away: what its model's inverse gives is no number.
            self._projected = True
            return
        self._projected = not model.is_admissible
        if self._projected:
            if not isinstance(model, ColemanHodgdon):
                return
            model = model.nearest_admissible()
        before, self._model = self._model, model
        if not isinstance(model, PrandtlIshlinskii) and not isinstance(before, PrandtlIshlinskii):
            loop_inverse.change(self._state, self._config, *_loop(model))
            return
        self._model = before
        expected = self._expected() + self._state[OWED]
        self._configure(model)
        self._place(model, before)
        self._model = model
        a, b = self._config[A], self._config[B]
        if b > 0.0:
            recent_path.take_up(self._state, PATH, a)
        self._state[W_H] = b * recent_path.hysteresis(self._state, PATH)
        self._state[OWED] = expected - self._expected()
        corridor.hand_over(self._state, CORRIDOR)

    @property
    def limits(self) -> VoltageLimits:
        """Limits that the voltage never leaves."""
        return self._limits

    @property
    def voltage(self) -> float:
        """Voltage given out last [V]."""
        return float(self._state[VOLTAGE])

    @property
    def limited(self) -> int:
        """Sign of what the limits withheld at the last sample: +1, -1, or 0 if nothing."""
        return int(self._state[LIMITED_NOW])

    @property
    def status(self) -> CompensatorStatus:
        """What happened to the samples so far."""
        state = self._state
        return CompensatorStatus(
            samples=int(state[SAMPLES]),
            saturated=int(state[SATURATED]),
            slewed=int(state[SLEWED]),
            missing=int(state[MISSED]),
            projected=self._projected,
        )

    def step(self, r: float | None) -> float:
        """Voltage for the next sample of the reference.

        Parameters
        ----------
        r : float
            Reference displacement [µm]; NaN, infinity and what is no number hold the last voltage.

        Returns
        -------
        float
            Voltage [V], within the limits.
        """
        if type(r) is not float:
            r = number_or_nan(r)
        if self._waiting is not None and self._state[DUE] != 0.0:
            self._take_up_waiting()
        if isinstance(self._model, PrandtlIshlinskii):
            return float(_plays().step(self._state, self._config, r))
        return loop_inverse.step(self._state, self._config, r)

    def run(self, r: Any) -> FloatArray:
        """Voltages for a whole reference; continues from the current state, as a loop of `step`.

        Parameters
        ----------
        r : array_like, shape (N,)
            Reference displacement [µm]; NaN holds the last voltage.

        Returns
        -------
        ndarray, shape (N,)
            Voltage [V], within the limits.

        Raises
        ------
        ValueError
            If r is not a 1-D array of numbers.
        """
        r = array_1d("r", r, allow_nan=True)
        u = np.empty_like(r)
        start = 0
        while self._waiting is not None and start < r.size:
            u[start] = self.step(float(r[start]))
            start += 1
        run = _plays().run if isinstance(self._model, PrandtlIshlinskii) else loop_inverse.run
        run(self._state, self._config, r[start:], u[start:])
        return u

    def reset(self) -> None:
        """Return to the state after construction, with the model given there."""
        self._projected = False
        self._begin(self._start)

    def copy(self) -> Self:
        """Return an independent compensator in the same state."""
        return copy.deepcopy(self)

    def __copy__(self) -> Self:
        return self.copy()
