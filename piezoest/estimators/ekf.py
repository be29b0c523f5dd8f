"""Extended Kalman filter: the loop's state and its parameters estimated jointly."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from piezoest._checks import FloatArray, check_start, moderate
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators import ekf_kernel as kernel
from piezoest.estimators import ekf_loops, state_tables
from piezoest.estimators.base import NO_ROWS, NONE, Compiled, EstimatorBase, Status, Trace
from piezoest.estimators.delay_line import delay_line
from piezoest.estimators.saved_state import Table
from piezoest.models import ColemanHodgdon, LinearGain, Model


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
        Samples by which the measured displacement lags the voltage, up to a million; may be fractional.
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

    __slots__ = ("_config", "_initial", "_kind", "_n", "_terms")

    _compiled = Compiled(kernel._sample, kernel.proposed, None)

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
        sample_rate = moderate("sample_rate", sample_rate)
        initial = ColemanHodgdon(0.02, 0.12, 0.0036) if initial_model is None else initial_model
        if not isinstance(initial, ColemanHodgdon | LinearGain):
            raise ValueError(f"initial_model must be a ColemanHodgdon or a LinearGain, got {initial!r}")
        if not initial.is_admissible:
            raise ValueError(f"initial_model {initial} is not admissible: use nearest_admissible()")
        check_start(initial)
        uncertainty = moderate("uncertainty", uncertainty)
        drift = moderate("drift", drift, or_zero=True)
        mismatch = moderate("mismatch", mismatch, or_zero=True)
        fraction, line = delay_line(delay)
        start, spread, walk = starting_point(initial, uncertainty, drift, mismatch, offset)
        n = start.size
        self._initial, self._n = initial, n
        hysteretic = isinstance(initial, ColemanHodgdon)
        self._terms = np.array([initial.gain if isinstance(initial, LinearGain) else 0.0, initial.offset])
        self._config = np.zeros(kernel.CONFIG + n)
        self._config[kernel.N] = n
        self._config[kernel.HYSTERETIC] = hysteretic
        # The linear gain has no state that could stray: there the mismatch is noise.
        stray = 0.0 if hysteretic else mismatch**2 * sample_rate
        self._config[kernel.NOISE] = moderate("noise", noise) ** 2 + stray
        self._config[kernel.FRACTION] = fraction
        self._config[kernel.OFFSET] = bool(offset)
        self._config[kernel.PROJECT] = project and hysteretic
        if hysteretic:
            self._config[kernel.LEAST_A : kernel.LEAST_A + 3] = (
                kernel.LEAST * start[1],
                kernel.LEAST * start[2],
                kernel.LEAST_MARGIN * start[3],
            )
        self._config[kernel.START : kernel.START + n] = spread**2
        self._config[kernel.CONFIG :] = walk**2 / sample_rate
        self._kind = (n, bool(delay > 0.0)) if hysteretic else (0, True)
        state = np.zeros(kernel.state_size(n))
        state[kernel.HEAD : kernel.HEAD + n] = start
        state[kernel.HEAD + n : kernel.HEAD + n + n * n] = np.diag(spread**2).ravel()
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

    def _table(self) -> Table:
        return state_tables.ekf(self._config, self._state.size)

    def _sample(self, u: float, x: float) -> None:
        ekf_loops.steps[self._kind](self._state, self._config, u, x)

    def _absorb(self, u: FloatArray, x: FloatArray) -> None:
        u, x = self._records(u, x)
        run = ekf_loops.runs[self._kind]
        run(self._state, self._config, u, x, u.size + 1, NONE, NO_ROWS, NO_ROWS, NONE, NONE, NO_ROWS)

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, n = u.size // every, self._n
        theta = np.empty((rows, len(self.parameter_names)))
        s = np.empty((rows if "P" in want else 0, n))
        y = np.empty(rows if "y" in want else 0)
        S = np.empty(rows if "S" in want else 0)
        P = np.empty((rows if "P" in want else 0, n * n))
        run = ekf_loops.runs[self._kind]
        run(self._state, self._config, u, x, every, NONE, theta, s, y, S, P)
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
            index=np.arange(every - 1, len(theta) * every, every),
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
        return self._state[kernel.HEAD : kernel.HEAD + self._n].copy()

    @property
    def state_covariance(self) -> FloatArray:
        """Covariance of `state`, shape (n, n)."""
        n = self._n
        return self._state[kernel.HEAD + n : kernel.HEAD + n + n * n].reshape(n, n).copy()

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`."""
        names = self._initial.parameter_names
        return (*names, "offset") if self._config[kernel.OFFSET] else names

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
        return np.sqrt(np.fmax(np.diag(self.P), 0.0))

    @property
    def y(self) -> float:
        """Last innovation [µm]."""
        return float(self._state[kernel.INNOVATION])

    @property
    def S(self) -> float:
        """Variance of the last innovation [µm²]."""
        return float(self._state[kernel.INNOVATION_VARIANCE])

    @property
    def K(self) -> FloatArray:
        """Last gain, of `state`."""
        n = self._n
        return self._state[kernel.HEAD + n + n * n : kernel.HEAD + 2 * n + n * n].copy()

    @property
    def status(self) -> Status:
        """What happened to the samples so far."""
        head = self._state
        return Status(
            samples=int(head[kernel.SAMPLES]),
            updates=int(head[kernel.UPDATES]),
            missing=int(head[kernel.MISSED]),
            held=int(head[kernel.HELD]),
            resets=int(head[kernel.RESETS]),
            projected=bool(head[kernel.MOVED]),
            last=("waiting", "updated", "missing", "held")[int(head[kernel.LAST])],
        )

    @property
    def model(self) -> Model:
        """Admissible model as known now."""
        values = np.zeros(4)
        kernel.propose(self._state, self._config, self._terms, values)
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
