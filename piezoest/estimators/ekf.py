"""Extended Kalman filter: the loop's state and its parameters estimated jointly."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numba import njit
from numba.extending import register_jitable

from piezoest._checks import WILDEST, FloatArray, non_negative, positive
from piezoest._jit import UNCOUNTED, unrolled
from piezoest.equations import admissible, kalman
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators.base import NO_ROWS, NONE, Compiled, EstimatorBase, Status, Trace
from piezoest.estimators.delay_line import delay_line, delayed
from piezoest.models import ColemanHodgdon, LinearGain, Model

# State: bookkeeping, then vectors of n or n*n numbers, the delay line last.
U_LAST, PRIMED, SAMPLES, MISSED, UPDATES, MOVED, LAST, INNOVATION, INNOVATION_VARIANCE = range(9)
U_CENTRE, X_CENTRE, CENTRED, HEAD = 9, 10, 11, 12

# Configuration: scalars, then n process noises and the parameters' least values.
N, HYSTERETIC, NOISE, FRACTION, OFFSET, PROJECT, LEAST_A, LEAST_B, MARGIN, CONFIG = range(10)

WAITING, UPDATED, MISSING = 0.0, 1.0, 2.0


@unrolled
def _views(state: Any, n: int) -> Any:
    """State vector s, its covariance P, last gain K, workspace, delay line."""
    i = HEAD
    m = n * n
    return (
        state[i : i + n],
        state[i + n : i + n + m],
        state[i + n + m : i + 2 * n + m],
        state[i + 2 * n + m : i + 5 * n + 2 * m],
        state[i + 5 * n + 2 * m :],
    )


@unrolled
def _time_update(s: Any, P: Any, du: Any, config: Any, n: int, work: Any) -> None:
    """Exact sample map of the state, its Jacobian for the covariance, process noise."""
    row, q = work[:n], work[n : 2 * n]
    for i in range(n):
        row[i] = 0.0
        q[i] = config[CONFIG + i]
    if config[HYSTERETIC] != 0.0:
        w_h, kept, by_a, by_b = equations.hysteresis_linearised(s[0], du, s[1], s[2])
        q[0] += kalman.bilinear_variance(P, du, s[1], n)
        s[0] = w_h
        row[0], row[1], row[2] = kept, by_a, by_b
        kalman.predict_covariance(P, row, 3, q, n, work[2 * n :])
    else:
        row[0] = 1.0
        kalman.predict_covariance(P, row, 1, q, n, work[2 * n :])


@unrolled
def measurement_row(h: Any, u: Any, config: Any, n: int) -> None:
    """dx/ds: x = w_h + c u (+ offset), or x = K u (+ offset)."""
    for i in range(n):
        h[i] = 0.0
    if config[HYSTERETIC] != 0.0:
        h[0] = 1.0
        h[3] = u
    else:
        h[0] = u
    if config[OFFSET] != 0.0:
        h[n - 1] = 1.0


@unrolled
def _onto_admissible(s: Any, P: Any, config: Any, n: int, work: Any) -> Any:
    """Project onto a >= least, b >= least, c - 2b >= margin: flat faces in this form."""
    if s[1] >= config[LEAST_A] and s[2] >= config[LEAST_B] and s[3] - 2.0 * s[2] >= config[MARGIN]:
        return 0.0
    g = work[:n]
    rest = work[n:]
    moved = 0.0
    for face in range(3):
        for i in range(n):
            g[i] = 0.0
        least = config[LEAST_A + face]
        if face < 2:
            g[1 + face] = 1.0
        else:
            g[2], g[3] = -2.0, 1.0
        moved = max(moved, kalman.project(s, P, g, least, n, rest))
    # The faces meet at an angle: whatever is left over is clamped.
    s[1] = max(s[1], config[LEAST_A])
    s[2] = max(s[2], config[LEAST_B])
    s[3] = max(s[3], 2.0 * s[2] + config[MARGIN])
    return moved


@unrolled
def _take(state: Any, config: Any, u: Any, x: Any, n: int) -> None:
    """One sample of a filter of `n` states."""
    s, P, gain, work, line = _views(state, n)
    state[SAMPLES] += 1.0
    if np.abs(u) < WILDEST:
        u = delayed(line, config[FRACTION], u)
        if state[PRIMED] == 0.0:
            state[PRIMED] = 1.0
            state[U_CENTRE] = u * config[OFFSET]
            state[U_LAST] = u - state[U_CENTRE]
        u -= state[U_CENTRE]
        _time_update(s, P, u - state[U_LAST], config, n, work)
        state[U_LAST] = u
    else:
        x = np.nan
    if not np.abs(x) < WILDEST:
        state[MISSED] += 1.0
        state[LAST] = MISSING
        return
    if state[CENTRED] == 0.0:
        state[CENTRED] = 1.0
        state[X_CENTRE] = x * config[OFFSET]
    measurement_row(work[:n], u, config, n)
    y = x - state[X_CENTRE] - kalman.measure(s, work[:n], n)
    S = kalman.update(s, P, work[:n], y, config[NOISE], n, gain, work[n:])
    state[MOVED] = 0.0
    if config[PROJECT] != 0.0:
        state[MOVED] = _onto_admissible(s, P, config, n, work)
    state[INNOVATION] = y
    state[INNOVATION_VARIANCE] = S
    state[UPDATES] += 1.0
    state[LAST] = UPDATED


@register_jitable
def _sample(state: Any, config: Any, u: Any, x: Any) -> None:
    """One sample."""
    n = int(config[N])
    if n == 4:
        _take(state, config, u, x, 4)
    elif n == 5:
        _take(state, config, u, x, 5)
    else:
        _take(state, config, u, x, n)


@register_jitable
def proposed(state: Any, config: Any, terms: Any, model: Any) -> None:
    """(alpha, beta, gamma, offset) or (gain, -, -, offset) into `model`, admissible; `terms` = start's."""
    s = state[HEAD : HEAD + int(config[N])]
    offset = terms[1]
    if config[HYSTERETIC] == 0.0:
        gain = s[0] if s[0] * terms[0] > 0.0 else 1e-2 * terms[0]
        if config[OFFSET] != 0.0:
            offset = s[1] + state[X_CENTRE] - gain * state[U_CENTRE]
        model[0] = gain
        model[3] = offset
        return
    if config[OFFSET] != 0.0:
        offset = s[4] + state[X_CENTRE] - s[3] * state[U_CENTRE]
    a = s[1] if s[1] != 0.0 else config[LEAST_A]
    alpha, beta, gamma = equations.rate_parameters(a, s[2], s[3])
    model[0] = alpha
    model[1] = beta
    model[2] = gamma
    model[3] = offset
    if not admissible.has_inverse(alpha, beta, gamma):
        work = np.empty(9)
        admissible.nearest_admissible(model, work, admissible.NEAREST_MARGIN)


@njit("void(f8[::1], f8[::1], f8[::1], f8[::1])", cache=True)
def _propose(state: Any, config: Any, terms: Any, model: Any) -> None:
    proposed(state, config, terms, model)


@unrolled
def _checked(state: Any, config: Any, u: Any, x: Any, n: int) -> None:
    if len(state) < HEAD + 5 * n + 2 * n * n or len(config) < CONFIG + n:
        return  # never so; said here, it saves the compiler to ask at each slice
    _take(state, config, u, x, n)


@njit("void(f8[::1], f8[::1], f8, f8)", cache=True, nogil=True, **UNCOUNTED)
def _step(state: Any, config: Any, u: float, x: float) -> None:
    n = int(config[N])
    if n == 4:
        _checked(state, config, u, x, 4)
    elif n == 5:
        _checked(state, config, u, x, 5)
    else:
        _checked(state, config, u, x, n)


@unrolled
def _write_parameters(s: Any, config: Any, n: int, theta: Any, row: int) -> None:
    """Parameters of the state s into a row of theta."""
    if config[HYSTERETIC] == 0.0:
        for i in range(n):
            theta[row, i] = s[i]
        return
    theta[row, 0], theta[row, 1], theta[row, 2] = equations.rate_parameters(s[1], s[2], s[3])
    if n == 5:
        theta[row, 3] = s[4]


@unrolled
def _loop(
    state: Any, config: Any, u: Any, x: Any, every: int, theta: Any, s: Any, y: Any, S: Any, P: Any, n: int
) -> None:
    """Take a record; with `n` a constant the compiler unrolls the loops over states."""
    if len(state) < HEAD + 5 * n + 2 * n * n or len(config) < CONFIG + n:
        return  # never so; said here, it saves the compiler to ask at each slice
    row, due = 0, every
    for k in range(u.size):
        _take(state, config, u[k], x[k], n)
        due -= 1
        if due == 0:
            _write_parameters(state[HEAD : HEAD + n], config, n, theta, row)
            if s.size > 0:
                for i in range(n):
                    s[row, i] = state[HEAD + i]
            if y.size > 0:
                y[row] = state[INNOVATION]
            if S.size > 0:
                S[row] = state[INNOVATION_VARIANCE]
            if P.size > 0:
                for i in range(n * n):
                    P[row, i] = state[HEAD + n + i]
            row, due = row + 1, every


@njit(
    "void(f8[::1], f8[::1], f8[::1], f8[::1], i8, f8[:, ::1], f8[:, ::1], f8[::1], f8[::1], f8[:, ::1])",
    cache=True,
    **UNCOUNTED,
)
def _run(
    state: Any, config: Any, u: Any, x: Any, every: int, theta: Any, s: Any, y: Any, S: Any, P: Any
) -> None:
    n = int(config[N])
    if n == 4:
        _loop(state, config, u, x, every, theta, s, y, S, P, 4)
    elif n == 5:
        _loop(state, config, u, x, every, theta, s, y, S, P, 5)
    else:
        _loop(state, config, u, x, every, theta, s, y, S, P, n)


class HysteresisEKF(EstimatorBase):
    """Extended Kalman filter for the loop's state and the model's parameters together.

    The state is (w_h, a, b, c), with the offset as a fifth on request: in this second form
    of the Coleman-Hodgdon model (2)-(3) the measurement x = w_h + c u + offset is linear,
    w_h is linear in b, and the admissible set has flat faces. Between samples the exact
    step and its exact Jacobian are used, so that the filter is the same at any sample rate;
    the one product of unknowns, a w_h, adds its second-order variance.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : ColemanHodgdon or LinearGain, optional
        Model to start from; its kind is the kind that is estimated. Default
        ``ColemanHodgdon(0.02, 0.12, 0.0036)``, a common stack actuator.
    uncertainty : float
        Standard deviation of each initial parameter (a, b, c or the gain), in parts of its value.
    noise : float
        Standard deviation of the displacement's noise [µm].
    drift : float
        Random walk of each parameter, in parts of its initial value per root second. The
        filter's memory: 0 for constant parameters.
    mismatch : float
        Random walk of w_h [µm per root second]: how far the true stage strays from the model
        within a second; 0 if the model is true. For a `LinearGain`, which has no w_h: its error
        averaged over a second [µm].
    offset : bool
        Estimate an offset of the displacement too, which walks as `mismatch` says: what a larger
        loop leaves behind after a change of amplitude.
    delay : float
        Samples by which the measured displacement lags the voltage; may be fractional.
    project : bool
        Keep the estimate in the admissible set, by projection in the metric of P.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Joseph's form of the update; process noise is given per second, so that a tuning
    survives a change of sample rate. `theta` and `P` are (alpha, beta, gamma) by (4), the
    covariance to first order; `state` and `state_covariance` are the filter's own.

    Source: D. Simon, Optimal State Estimation (2006), sec. 13.2; the model: Eielsen, Gravdahl
    and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), (2)-(4).
    """

    __slots__ = ("_config", "_initial", "_n", "_terms")

    # Module with the compiled ring of `track`.
    _ring = "piezoest.tracking_ekf"
    _compiled = Compiled(_sample, proposed, None)

    conformance_exceptions: ClassVar[dict[str, str]] = {}

    def __init__(
        self,
        sample_rate: float,
        *,
        initial_model: ColemanHodgdon | LinearGain | None = None,
        uncertainty: float = 0.5,
        noise: float = 1.5e-3,
        drift: float = 0.3,
        mismatch: float = 0.3,
        offset: bool = False,
        delay: float = 0.0,
        project: bool = True,
    ) -> None:
        sample_rate = positive("sample_rate", sample_rate)
        initial = ColemanHodgdon(0.02, 0.12, 0.0036) if initial_model is None else initial_model
        if not isinstance(initial, ColemanHodgdon | LinearGain):
            raise ValueError(f"initial_model must be a ColemanHodgdon or a LinearGain, got {initial!r}")
        if not initial.is_admissible:
            raise ValueError(f"initial_model {initial} is not admissible: use nearest_admissible()")
        uncertainty = positive("uncertainty", uncertainty)
        drift = non_negative("drift", drift)
        mismatch = non_negative("mismatch", mismatch)
        fraction, line = delay_line(delay)
        start, spread, walk = starting_point(initial, uncertainty, drift, mismatch, offset)
        n = start.size
        self._initial, self._n = initial, n
        hysteretic = isinstance(initial, ColemanHodgdon)
        self._terms = np.array([initial.gain if isinstance(initial, LinearGain) else 0.0, initial.offset])
        self._config = np.zeros(CONFIG + n)
        self._config[N] = n
        self._config[HYSTERETIC] = hysteretic
        # The linear gain has no state that could stray: there the mismatch is noise.
        stray = 0.0 if hysteretic else mismatch**2 * sample_rate
        self._config[NOISE] = positive("noise", noise) ** 2 + stray
        self._config[FRACTION] = fraction
        self._config[OFFSET] = bool(offset)
        self._config[PROJECT] = project and hysteretic
        if hysteretic:
            self._config[LEAST_A : LEAST_A + 3] = 1e-2 * start[1], 1e-2 * start[2], 1e-3 * start[3]
        self._config[CONFIG:] = walk**2 / sample_rate
        state = np.zeros(HEAD + 5 * n + 2 * n * n)
        state[HEAD : HEAD + n] = start
        state[HEAD + n : HEAD + n + n * n] = np.diag(spread**2).ravel()
        self._begin(
            {
                "sample_rate": sample_rate,
                "initial_model": initial.to_dict(),
                "uncertainty": uncertainty,
                "noise": float(noise),
                "drift": drift,
                "mismatch": mismatch,
                "offset": bool(offset),
                "delay": float(delay),
                "project": bool(project),
            },
            np.concatenate([state, line]),
        )

    def _sample(self, u: float, x: float) -> None:
        _step(self._state, self._config, u, x)

    def _absorb(self, u: FloatArray, x: FloatArray) -> None:
        u, x = self._records(u, x)
        _run(self._state, self._config, u, x, u.size + 1, NO_ROWS, NO_ROWS, NONE, NONE, NO_ROWS)

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, n = u.size // every, self._n
        theta = np.empty((rows, len(self.parameter_names)))
        s = np.empty((rows if "P" in want else 0, n))
        y = np.empty(rows if "y" in want else 0)
        S = np.empty(rows if "S" in want else 0)
        P = np.empty((rows if "P" in want else 0, n * n))
        _run(self._state, self._config, u, x, every, theta, s, y, S, P)
        return self._trace(theta, s, y, S, P.reshape(-1, n, n), every, want)

    def _trace(
        self,
        theta: FloatArray,
        s: FloatArray,
        y: FloatArray,
        S: FloatArray,
        P: FloatArray,
        every: int,
        want: frozenset[str],
    ) -> Trace:
        return Trace(
            index=np.arange(1, len(theta) + 1) * every - 1,
            theta=theta,
            parameter_names=self.parameter_names,
            y=y if "y" in want else None,
            S=S if "S" in want else None,
            P=self._theta_covariance(s, P) if "P" in want else None,
        )

    def _theta_of(self, s: FloatArray) -> FloatArray:
        """Parameters (…, n_theta) of states (…, n)."""
        if isinstance(self._initial, LinearGain):
            return s.copy()
        alpha, beta, gamma = equations.rate_parameters(s[..., 1], s[..., 2], s[..., 3])
        return np.stack([alpha, beta, gamma, *np.moveaxis(s[..., 4:], -1, 0)], axis=-1)

    def _theta_covariance(self, s: FloatArray, P: FloatArray) -> FloatArray:
        """Covariances (…, n_theta, n_theta) of the parameters, to first order."""
        if isinstance(self._initial, LinearGain):
            return P.copy()
        n = self._n
        jacobian = np.zeros((*s.shape[:-1], n - 1, n))
        jacobian[..., 0, 1] = 1.0
        jacobian[..., 1, 2] = -1.0
        jacobian[..., 1, 3] = 1.0
        jacobian[..., 2, 1] = s[..., 3]
        jacobian[..., 2, 3] = s[..., 1]
        if n == 5:
            jacobian[..., 3, 4] = 1.0
        return jacobian @ P @ np.swapaxes(jacobian, -1, -2)

    @property
    def state(self) -> FloatArray:
        """The filter's own state: (w_h, a, b, c[, offset]) or (gain[, offset])."""
        return self._state[HEAD : HEAD + self._n].copy()

    @property
    def state_covariance(self) -> FloatArray:
        """Covariance of `state`, shape (n, n)."""
        n = self._n
        return self._state[HEAD + n : HEAD + n + n * n].reshape(n, n).copy()

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`."""
        names = self._initial.parameter_names
        return (*names, "offset") if self._config[OFFSET] else names

    @property
    def theta(self) -> FloatArray:
        """Parameters, shape (n,), in the order of `parameter_names`."""
        return self._theta_of(self.state)

    @property
    def P(self) -> FloatArray:
        """Covariance of `theta` to first order, shape (n, n)."""
        return self._theta_covariance(self.state, self.state_covariance)

    @property
    def standard_errors(self) -> FloatArray:
        """Square roots of the diagonal of `P`, shape (n,)."""
        return np.sqrt(np.diag(self.P))

    @property
    def y(self) -> float:
        """Last innovation [µm]."""
        return float(self._state[INNOVATION])

    @property
    def S(self) -> float:
        """Variance of the last innovation [µm²]."""
        return float(self._state[INNOVATION_VARIANCE])

    @property
    def K(self) -> FloatArray:
        """Last gain, of `state`."""
        n = self._n
        return self._state[HEAD + n + n * n : HEAD + 2 * n + n * n].copy()

    @property
    def status(self) -> Status:
        """What happened to the samples so far."""
        head = self._state
        return Status(
            samples=int(head[SAMPLES]),
            updates=int(head[UPDATES]),
            missing=int(head[MISSED]),
            held=0,
            resets=0,
            projected=bool(head[MOVED]),
            last=("waiting", "updated", "missing")[int(head[LAST])],
        )

    @property
    def model(self) -> Model:
        """Admissible model as known now."""
        values = np.zeros(4)
        _propose(self._state, self._config, self._terms, values)
        alpha, beta, gamma, offset = values.tolist()
        if isinstance(self._initial, LinearGain):
            return LinearGain(alpha, offset)
        return ColemanHodgdon(alpha, beta, gamma, offset)


def starting_point(
    initial: ColemanHodgdon | LinearGain, uncertainty: float, drift: float, mismatch: float, offset: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """State to start from, its standard deviations, and its random walk per root second.

    The loop may start anywhere within its limits ±b/a; the offset, within some ten volts.
    """
    if isinstance(initial, LinearGain):
        start, scale = [initial.gain], [abs(initial.gain)]
        spread, walk = [uncertainty * scale[0]], [drift * scale[0]]
    else:
        start = [0.0, initial.a, initial.b, initial.c]
        spread = [0.5 * initial.b / initial.a, *(uncertainty * value for value in start[1:])]
        walk = [mismatch, *(drift * value for value in start[1:])]
    if offset:
        start.append(0.0)
        spread.append(10.0 * abs(initial.gain if isinstance(initial, LinearGain) else initial.c))
        walk.append(mismatch)
    return np.array(start), np.array(spread), np.array(walk)
