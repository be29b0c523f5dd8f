"""The paper's estimator: recursive least squares on the derivative form, from raw (u, x)."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numba import njit
from numba.extending import register_jitable

from piezoest._checks import WILDEST, FloatArray, positive
from piezoest.equations import admissible, filters, least_squares
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators.base import EstimatorBase, Status, Trace
from piezoest.estimators.delay_line import delay_line, delayed
from piezoest.models import ColemanHodgdon, LinearGain, Model, model_from_dict
from piezoest.policies import (
    DeadZone,
    Forgetting,
    Normalisation,
    NormBound,
    Policy,
    policy_from_dict,
    policy_to_dict,
)

# The front end's part of the state: from (u, x) to a regression z = theta . phi.
PRIMED, U_LAST, X_LAST, TRAVEL, MOMENT, RISE, GAP, SAMPLES, MISSED = range(9)
U_CENTRE, X_CENTRE = 9, 10
LOW, HIGH, PHI = 11, 16, 21  # five filters each: four regressors and the output
# Regressors seen through the noise's filter, the regressors before them, and their scatter.
PSI, PHI_LAST, SCATTER = 26, 30, 34
FRONT = 50  # the law's state begins here, the delay line follows it

# The front end's configuration; the law's follows.
N, HYSTERETIC, LOW_POLE, HIGH_POLE, HIGH_PASS, FRACTION, OFFSET, LONGEST_GAP, NOISE_RATIO = range(9)
SCALE = 9  # four scales of the parameters, one of the output
CONFIG = 14


@register_jitable
def _filtered(state: Any, config: Any, i: int, value: Any) -> Any:
    """Low-pass (W_p of App. A), then the optional high-pass."""
    state[LOW + i] = filters.low_pass_step(state[LOW + i], value, config[LOW_POLE])
    value = state[LOW + i]
    if config[HIGH_PASS] != 0.0:
        state[HIGH + i], value = filters.high_pass_step(state[HIGH + i], value, config[HIGH_POLE])
    return value


@register_jitable
def _prime(state: Any, config: Any, u: Any, x: Any) -> None:
    """Start from (u, x) as the last good sample."""
    if state[PRIMED] == 0.0 and config[OFFSET] != 0.0:
        state[U_CENTRE] = u
        state[X_CENTRE] = x
    state[PRIMED] = 1.0
    state[U_LAST] = u - state[U_CENTRE]
    state[X_LAST] = x - state[X_CENTRE]
    state[TRAVEL] = state[MOMENT] = state[RISE] = state[GAP] = 0.0


@register_jitable
def _scatter(state: Any, config: Any, phi: Any, n: int, restart: bool) -> None:
    """The sandwich's middle: sensor noise reaches the output through W_p and, in z, a difference."""
    psi = state[PSI : PSI + n]
    for i in range(n):
        seen = (phi[i] - config[HYSTERETIC] * state[PHI_LAST + i]) * config[NOISE_RATIO]
        psi[i] = filters.low_pass_step(psi[i], seen, config[LOW_POLE])
        state[PHI_LAST + i] = phi[i]
    M = state[SCATTER : SCATTER + n * n]
    if restart:
        for i in range(n * n):
            M[i] = state[FRONT + law.HEAD + n + n * n + i]
            # Of a diagonal P_0, the information P_0^-1.
            if M[i] != 0.0:
                M[i] = 1.0 / M[i]
    least_squares.accumulate_scatter(M, psi, n, config[CONFIG + law.FORGETTING])


@register_jitable
def _sample(state: Any, config: Any, u: Any, x: Any) -> None:
    """One raw sample: a regression for the law, or a note of why there is none."""
    n = int(config[N])
    law_state = state[FRONT:]
    if np.abs(u) < WILDEST:
        u = delayed(state[FRONT + law.state_size(n) :], config[FRACTION], u)
    state[SAMPLES] += 1.0
    known = np.abs(u) < WILDEST
    measured = known and np.abs(x) < WILDEST
    if not measured:
        state[MISSED] += 1.0
        law_state[law.LAST] = law.MISSING
    if state[PRIMED] == 0.0 or state[GAP] > config[LONGEST_GAP]:
        if measured:
            _prime(state, config, u, x)
            law_state[law.LAST] = law.WAITING
        return
    if known:
        # A short gap is bridged: the voltage's integrals go on, the displacement's mean
        # is taken between the good samples on its two sides.
        u -= state[U_CENTRE]
        rise, moment, travel = equations.sample_regressor(state[U_LAST], u)
        state[RISE] += rise
        state[MOMENT] += moment
        state[TRAVEL] += travel
        state[U_LAST] = u
    if not measured:
        state[GAP] += 1.0
        return
    x -= state[X_CENTRE]
    phi = state[PHI : PHI + n]
    if config[HYSTERETIC] != 0.0:
        z = x - state[X_LAST]
        phi[0] = -0.5 * (x + state[X_LAST]) * state[TRAVEL]
        phi[1] = state[RISE]
        phi[2] = state[MOMENT]
        if n == 4:
            phi[3] = state[TRAVEL]
    else:
        z = x
        phi[0] = state[U_LAST]
        if n == 2:
            phi[1] = 1.0
    state[X_LAST] = x
    state[TRAVEL] = state[MOMENT] = state[RISE] = state[GAP] = 0.0
    for i in range(n):
        phi[i] = _filtered(state, config, i, phi[i] * config[SCALE + i])
    z = _filtered(state, config, 4, z * config[SCALE + 4])
    resets, updates = law_state[law.RESETS], law_state[law.UPDATES]
    law.adapt(law_state, config[CONFIG:], phi, z, n)
    if law_state[law.LAST] == law.UPDATED:
        _scatter(state, config, phi, n, updates == 0.0 or law_state[law.RESETS] != resets)


@njit("void(f8[::1], f8[::1], f8, f8)", cache=True)
def _step(state: Any, config: Any, u: float, x: float) -> None:
    _sample(state, config, u, x)


@njit("void(f8[::1], f8[::1], f8[::1], f8[::1], i8, f8[:, ::1], f8[::1], f8[::1], f8[:, ::1])", cache=True)
def _run(state: Any, config: Any, u: Any, x: Any, every: int, theta: Any, y: Any, S: Any, P: Any) -> None:
    n = int(config[N])
    head = FRONT + law.HEAD
    for k in range(u.size):
        _sample(state, config, u[k], x[k])
        if (k + 1) % every == 0:
            row = k // every
            for i in range(n):
                theta[row, i] = state[head + i]
            if y.size > 0:
                y[row] = state[FRONT + law.INNOVATION]
            if S.size > 0:
                S[row] = state[FRONT + law.INNOVATION_VARIANCE]
            if P.size > 0:
                for i in range(n * n):
                    P[row, i] = state[head + n + i]


class HysteresisRLS(EstimatorBase):
    """Recursive least squares on the derivative form of a model, from raw (u, x).

    The paper's estimator: z = dx/dt against the regressor (20) of the Coleman-Hodgdon model
    (18)-(20), or z = x against u for the linear gain (12), both sides through the same
    low-pass W_p, into the law of App. A.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : ColemanHodgdon or LinearGain, optional
        Model to start from; its kind is the kind that is estimated. Default
        ``ColemanHodgdon(0.02, 0.12, 0.0036)``, a common stack actuator.
    memory : float or None
        Time constant of exponential forgetting [s]; None for no forgetting.
    uncertainty : float
        Standard deviation of each initial parameter, in parts of its value.
    noise : float
        Standard deviation of the displacement's noise [µm]; weighs the start against the data.
    cutoff : float
        Cut-off frequency of W_p [Hz].
    high_pass : float, optional
        Cut-off frequency of a first-order high-pass on both sides [Hz], against a biased
        sensor (last remark of App. A). Below the reference's lowest frequency. It can only
        remove what is constant: a bias enters as |du/dt|, so for anything but a sharp
        triangle `offset` is the better way.
    offset : bool
        Estimate the loop's centre too, by one more regressor |du/dt|: a biased sensor or a
        unipolar voltage then needs no high-pass.
    delay : float
        Samples by which the measured displacement lags the voltage; may be fractional.
    time_base : {"discrete", "continuous"}
        Time base of the law, see `RecursiveLeastSquares`; ``"continuous"`` is the paper's,
        in seconds.
    policies : tuple of policies, optional
        Policies beside forgetting; default ``(NormBound(), DeadZone(), Normalisation())``.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Inside, parameters are in parts of their initial value and the output in parts of its
    noise, so that the covariance is well scaled. The regressor is integrated over each
    sample, which keeps the form exact to third order in the change of voltage.

    Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), sec. III B
    and App. A.
    """

    __slots__ = ("_config", "_initial", "_n", "_scale")

    conformance_exceptions: ClassVar[dict[str, str]] = {}

    def __init__(
        self,
        sample_rate: float,
        *,
        initial_model: ColemanHodgdon | LinearGain | None = None,
        memory: float | None = 0.4,
        uncertainty: float = 0.5,
        noise: float = 1.5e-3,
        cutoff: float = 2500.0,
        high_pass: float | None = None,
        offset: bool = False,
        delay: float = 0.0,
        time_base: law.TimeBase = "discrete",
        policies: tuple[Policy, ...] | None = None,
    ) -> None:
        sample_rate = positive("sample_rate", sample_rate)
        initial = ColemanHodgdon(0.02, 0.12, 0.0036) if initial_model is None else initial_model
        if not isinstance(initial, ColemanHodgdon | LinearGain):
            raise ValueError(f"initial_model must be a ColemanHodgdon or a LinearGain, got {initial!r}")
        if np.any(initial.theta == 0.0):
            raise ValueError(f"initial_model must have no parameter at zero, got {initial}")
        if policies is None:
            policies = (NormBound(), DeadZone(), Normalisation())
        cutoff = min(positive("cutoff", cutoff), 0.5 * sample_rate)
        fraction, line = delay_line(delay)
        self._initial = initial
        hysteretic = isinstance(initial, ColemanHodgdon)
        self._n = n = initial.theta.size + bool(offset)

        config = np.zeros(CONFIG)
        pole = float(filters.first_order_pole(cutoff, sample_rate))
        config[N] = n
        config[HYSTERETIC] = hysteretic
        config[LOW_POLE] = pole
        config[HIGH_PASS] = high_pass is not None
        if high_pass is not None:
            config[HIGH_POLE] = filters.first_order_pole(positive("high_pass", high_pass), sample_rate)
        config[FRACTION] = fraction
        config[OFFSET] = bool(offset)
        config[LONGEST_GAP] = max(1, int(0.002 * sample_rate))
        # Noise of x behind W_p, and of its difference behind W_p (white noise in x).
        white = (1.0 - pole) / (1.0 + pole)
        blue = 2.0 * (1.0 - pole) ** 2 / (1.0 + pole)
        gain = np.sqrt(blue if hysteretic else white)
        output_noise = positive("noise", noise) * gain
        config[NOISE_RATIO] = 1.0 / gain
        self._scale = np.append(np.abs(initial.theta), self._offset_scale(initial) if offset else [])
        config[SCALE : SCALE + n] = self._scale / output_noise
        config[SCALE + 4] = 1.0 / output_noise
        if time_base == "continuous":
            config[SCALE : SCALE + 5] *= sample_rate if hysteretic else 1.0

        start = np.append(np.sign(initial.theta), np.zeros(int(bool(offset))))
        P_0 = np.diag(np.full(n, positive("uncertainty", uncertainty) ** 2))
        law_config = law.configure(
            (Forgetting(np.inf if memory is None else memory), *policies),
            1.0 / sample_rate,
            time_base,
            1.0,
            P_0,
        )
        self._config = np.concatenate([config, law_config])
        state = np.concatenate([np.zeros(FRONT), law.new_state(start, P_0), line])
        self._begin(
            {
                "sample_rate": sample_rate,
                "initial_model": initial.to_dict(),
                "memory": None if memory is None or np.isinf(memory) else float(memory),
                "uncertainty": float(uncertainty),
                "noise": float(noise),
                "cutoff": cutoff,
                "high_pass": None if high_pass is None else float(high_pass),
                "offset": bool(offset),
                "delay": float(delay),
                "time_base": time_base,
                "policies": [policy_to_dict(policy) for policy in policies],
            },
            state,
        )

    @staticmethod
    def _offset_scale(initial: ColemanHodgdon | LinearGain) -> float:
        """Scale of the offset's parameter: a centre that is off by some ten volts."""
        return 10.0 * abs(initial.gamma) if isinstance(initial, ColemanHodgdon) else 10.0 * abs(initial.gain)

    @classmethod
    def _revive(cls, arguments: dict[str, Any]) -> dict[str, Any]:
        policies = tuple(policy_from_dict(item) for item in arguments["policies"])
        return {
            **arguments,
            "initial_model": model_from_dict(arguments["initial_model"]),
            "policies": policies,
        }

    def _sample(self, u: float, x: float) -> None:
        _step(self._state, self._config, u, x)

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, n = u.size // every, self._n
        theta = np.empty((rows, n))
        y = np.empty(rows if "y" in want else 0)
        S = np.empty(rows if "S" in want else 0)
        P = np.empty((rows if "P" in want else 0, n * n))
        _run(self._state, self._config, u, x, every, theta, y, S, P)
        theta *= self._scale
        scale = np.outer(self._scale, self._scale)
        return Trace(
            index=np.arange(1, rows + 1) * every - 1,
            theta=theta,
            parameter_names=self.parameter_names,
            y=y / self._config[SCALE + 4] if "y" in want else None,
            S=S / self._config[SCALE + 4] ** 2 if "S" in want else None,
            P=P.reshape(-1, n, n) * scale if "P" in want else None,
        )

    def reset_covariance(self) -> None:
        """Put P back to its initial value: covariance resetting on call."""
        n, head = self._n, FRONT + law.HEAD
        self._state[head + n : head + n + n * n] = self._state[head + n + n * n : head + n + 2 * n * n]
        self._state[FRONT + law.RESETS] += 1.0

    @property
    def sample_rate(self) -> float:
        """[Hz]."""
        return float(self._arguments["sample_rate"])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`; a fourth, ``offset_slope``, is alpha x_c - gamma u_c."""
        extra = ("offset_slope",) if isinstance(self._initial, ColemanHodgdon) else ("offset",)
        names = self._initial.parameter_names
        return (*names, *extra) if self._n > len(names) else names

    @property
    def theta(self) -> FloatArray:
        """Parameters as estimated, shape (n,), possibly outside the admissible set."""
        head = FRONT + law.HEAD
        return self._state[head : head + self._n] * self._scale

    @property
    def P(self) -> FloatArray:
        """Covariance of `theta` as the law sees it, shape (n, n)."""
        n, head = self._n, FRONT + law.HEAD
        P = self._state[head + n : head + n + n * n].reshape(n, n)
        return P * np.outer(self._scale, self._scale)

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviations of `theta`, shape (n,), for white noise in the displacement.

        Differencing and W_p colour that noise, so that P is not the covariance of `theta`:
        these are of the sandwich P M P (see `least_squares.accumulate_scatter`). The model's own
        mismatch is not in them. With the continuous time base they are those of `P`.
        """
        if self._config[CONFIG + law.CONTINUOUS] or self._state[FRONT + law.UPDATES] == 0.0:
            return np.sqrt(np.diag(self.P))
        n, head = self._n, FRONT + law.HEAD
        P = self._state[head + n : head + n + n * n].reshape(n, n)
        M = self._state[SCATTER : SCATTER + n * n].reshape(n, n)
        if self._config[HYSTERETIC]:
            # The newest noise has not yet been taken back by its difference; its energy
            # behind W_p is (1 - pole)/(1 + pole).
            phi, pole = self._state[PHI_LAST : PHI_LAST + n], self._config[LOW_POLE]
            energy = (1.0 - pole) / (1.0 + pole) * self._config[NOISE_RATIO] ** 2
            M = M + np.outer(phi, phi) * energy
        return np.sqrt(np.diag(P @ M @ P)) * self._scale

    @property
    def y(self) -> float:
        """Last innovation: filtered change of displacement a sample, or displacement [µm]."""
        return float(self._state[FRONT + law.INNOVATION] / self._config[SCALE + 4])

    @property
    def S(self) -> float:
        """Variance of the last innovation as the law saw it [µm²]."""
        return float(self._state[FRONT + law.INNOVATION_VARIANCE] / self._config[SCALE + 4] ** 2)

    @property
    def K(self) -> FloatArray:
        """Gain that the present covariance gives the last regressor, shape (n,)."""
        phi = self._state[PHI : PHI + self._n] / self._scale * (1.0 / self._config[SCALE + 4])
        product = self.P @ phi
        return product / (phi @ product + (1.0 / self._config[SCALE + 4]) ** 2)

    @property
    def status(self) -> Status:
        """What happened to the samples so far."""
        head = self._state[FRONT:]
        last = ("waiting", "updated", "missing", "held")[int(head[law.LAST])]
        return Status(
            samples=int(self._state[SAMPLES]),
            updates=int(head[law.UPDATES]),
            missing=int(self._state[MISSED]),
            held=int(head[law.HELD]),
            resets=int(head[law.RESETS]),
            projected=not self._as_estimated_is_admissible(),
            last=last,
        )

    def _as_estimated_is_admissible(self) -> bool:
        theta = self.theta
        if isinstance(self._initial, LinearGain):
            return bool(theta[0] * self._initial.gain > 0.0)
        return bool(admissible.is_admissible(theta[0], theta[1], theta[2], *self._least, MARGIN))

    @property
    def _least(self) -> tuple[float, float]:
        return LEAST * float(self._scale[0]), LEAST * float(self._scale[1])

    @property
    def model(self) -> Model:
        """Admissible model as known now: `theta` itself, or its nearest point in the metric of P."""
        theta = self.theta
        if isinstance(self._initial, LinearGain):
            least = LEAST * self._initial.gain
            gain = theta[0] if theta[0] * self._initial.gain > 0.0 else least
            offset = self._initial.offset
            if self._n == 2:
                offset = float(theta[1] + self._state[X_CENTRE] - gain * self._state[U_CENTRE])
            return LinearGain(float(gain), offset)
        if not self._as_estimated_is_admissible():
            admissible.project_admissible(theta, self.P.ravel(), self._n, *self._least, MARGIN)
        alpha, beta, gamma = (float(value) for value in theta[:3])
        offset = self._initial.offset
        if self._n == 4:
            c = gamma / alpha
            centre = self._state[X_CENTRE] - c * self._state[U_CENTRE]
            offset = float(equations.offset_from_rate_parameters(alpha, theta[3]) + centre)
        return ColemanHodgdon(alpha, beta, gamma, offset)


# The model handed out keeps this distance from the faces of the admissible set: parts of
# gamma, and least alpha and beta in parts of their initial values.
MARGIN = 1e-3
LEAST = 1e-2
