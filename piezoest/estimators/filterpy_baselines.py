"""The baselines: filterpy's own EKF and UKF on the model of `HysteresisEKF`.

Unaltered filterpy, used as its interface needs it: 1-D x and z, `predict_x` overridden, F
set before every prediction, `predict` and `update` called apart (`predict_update` would
evaluate the measurement before predicting).
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

from piezoest._checks import WILDEST, FloatArray
from piezoest.equations import coleman_hodgdon as equations
from piezoest.equations import kalman
from piezoest.estimators import ekf_kernel as kernel
from piezoest.estimators.base import EstimatorBase, Trace
from piezoest.estimators.delay_line import delayed
from piezoest.estimators.ekf import HysteresisEKF
from piezoest.models import ColemanHodgdon, LinearGain


class _HysteresisFilter(ExtendedKalmanFilter):  # type: ignore[misc]
    """filterpy's EKF with the exact step of w_h as its prediction of x."""

    hysteretic = True

    def predict_x(self, u: float = 0.0) -> None:
        """Predict x for a change of voltage u [V]."""
        if self.hysteretic:
            self.x[0] = equations.hysteresis_step(self.x[0], u, self.x[1], self.x[2])


class _FilterPyBaseline(HysteresisEKF):
    """What the two baselines share: bookkeeping around a filterpy object."""

    __slots__ = ("_filter", "_flat")

    _filter: Any
    _flat: FloatArray

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
    ) -> None:
        self._filter = None
        super().__init__(
            sample_rate,
            initial_model=initial_model,
            uncertainty=uncertainty,
            noise=noise,
            drift=drift,
            mismatch=mismatch,
            offset=offset,
            delay=delay,
            project=False,
        )
        del self._arguments["project"]
        self._filter = self._make_filter()
        self._filter.Q = np.diag(self._config[kernel.CONFIG :])
        self._filter.R = np.array([[self._config[kernel.NOISE]]])
        self._load(self._start)

    def _make_filter(self) -> Any:
        raise NotImplementedError

    def _predict(self, du: float) -> None:
        raise NotImplementedError

    def _update(self, x: float, h: FloatArray) -> None:
        raise NotImplementedError

    def _process_noise(self, du: float) -> FloatArray:
        """Covariance that the process adds over du, the second-order variance of a w_h with it."""
        Q = np.diag(self._config[kernel.CONFIG :])
        if self._config[kernel.HYSTERETIC]:
            s, P = self._filter.x, self._filter.P
            Q[0, 0] += kalman.bilinear_variance(P.ravel(), du, s[1], self._n)
        return Q

    @property
    def filter(self) -> Any:
        """The filterpy object itself, for filterpy's own tools such as `filterpy.common.Saver`."""
        return self._filter

    @property
    def _state(self) -> FloatArray:
        """The flat state, brought up to date from the filterpy object."""
        if self._filter is not None:
            n, head = self._n, kernel.HEAD
            self._flat[head : head + n] = self._filter.x
            self._flat[head + n : head + n + n * n] = self._filter.P.ravel()
            self._flat[head + n + n * n : head + 2 * n + n * n] = np.ravel(self._filter.K)
        return self._flat

    @_state.setter
    def _state(self, state: FloatArray) -> None:
        self._flat = state

    def _load(self, state: FloatArray) -> None:
        n, head = self._n, kernel.HEAD
        self._flat[:] = state
        self._filter.x = state[head : head + n].copy()
        self._filter.P = state[head + n : head + n + n * n].reshape(n, n).copy()
        self._filter.K = state[head + n + n * n : head + 2 * n + n * n].reshape(n, 1).copy()

    def _sample(self, u: float, x: float) -> None:
        state, config, n = self._flat, self._config, self._n
        state[kernel.SAMPLES] += 1.0
        if abs(u) < WILDEST:
            u = delayed(state[kernel.state_size(n) :], config[kernel.FRACTION], u)
            if state[kernel.PRIMED] == 0.0:
                state[kernel.PRIMED] = 1.0
                state[kernel.U_CENTRE] = u * config[kernel.OFFSET]
                state[kernel.U_LAST] = u - state[kernel.U_CENTRE]
            u -= state[kernel.U_CENTRE]
            if not self._guarded(self._predict, u - state[kernel.U_LAST]):
                state[kernel.RESETS] += 1.0
            state[kernel.U_LAST] = u
        else:
            x = np.nan
        if not abs(x) < WILDEST:
            state[kernel.MISSED] += 1.0
            state[kernel.LAST] = kernel.MISSING
            return
        if state[kernel.CENTRED] == 0.0:
            state[kernel.CENTRED] = 1.0
            state[kernel.X_CENTRE] = x * config[kernel.OFFSET]
        h = np.zeros(n)
        kernel.measurement_row(h, u, config, n)
        if not self._guarded(self._update, x - state[kernel.X_CENTRE], h):
            state[kernel.RESETS] += 1.0
            state[kernel.HELD] += 1.0
            state[kernel.LAST] = kernel.HOLDING
            return
        state[kernel.INNOVATION] = np.ravel(self._filter.y)[0]
        state[kernel.INNOVATION_VARIANCE] = np.ravel(self._filter.S)[0]
        state[kernel.UPDATES] += 1.0
        state[kernel.LAST] = kernel.UPDATED

    def _guarded(self, part: Any, *arguments: Any) -> bool:
        """Run a part of the filter; where it breaks, the parameters stay and P starts anew.

        A stream must not stop, and what is not a number would stay in the filter for good.
        """
        x = self._filter.x.copy()
        try:
            with np.errstate(all="ignore"):
                part(*arguments)
            if self._is_sound():
                return True
        except (np.linalg.LinAlgError, ValueError):  # scipy refuses what is not finite
            pass
        if self._config[kernel.HYSTERETIC]:
            x[0] = 0.0
        variances = self._config[kernel.START : kernel.START + self._n]
        self._filter.x, self._filter.P = x, np.diag(variances)
        self._filter.K = np.zeros((self._n, 1))
        self._filter.y, self._filter.S = np.zeros(1), np.ones((1, 1))
        return False

    def _is_sound(self) -> bool:
        """Whether state, covariance and gain are numbers, far from overflow, and no variance is lost."""
        P = self._filter.P
        parts = self._filter.x, P, self._filter.K, self._filter.S
        numbers = np.concatenate([np.ravel(part) for part in parts])
        return bool(np.all(np.abs(numbers) < kalman.LARGEST_TRACE) and np.all(np.diag(P) >= 0.0))

    def _absorb(self, u: FloatArray, x: FloatArray) -> None:
        EstimatorBase._absorb(self, u, x)  # not the compiled loop of `HysteresisEKF`

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, n = u.size // every, self._n
        s, y, S, P = np.empty((rows, n)), np.empty(rows), np.empty(rows), np.empty((rows, n, n))
        for k in range(u.size):
            self._sample(float(u[k]), float(x[k]))
            if (k + 1) % every == 0:
                row = k // every
                s[row], P[row] = self._filter.x, self._filter.P
                y[row], S[row] = self._flat[kernel.INNOVATION], self._flat[kernel.INNOVATION_VARIANCE]
        return self._trace(self._theta_of(s), s, y, S, P, every, want)


class FilterPyEKF(_FilterPyBaseline):
    """filterpy's `ExtendedKalmanFilter` on the model of `HysteresisEKF`: a baseline.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : ColemanHodgdon or LinearGain, optional
        Model to start from; its kind is the kind that is estimated.
    uncertainty : float
        Standard deviation of each initial parameter, in parts of its value.
    noise : float
        Standard deviation of the displacement's noise [µm].
    drift : float
        Random walk of each parameter, in parts of its initial value per root second.
    mismatch : float
        Random walk of w_h [µm per root second].
    offset : bool
        Estimate a constant offset of the displacement too.
    delay : float
        Samples by which the measured displacement lags the voltage.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Equal to ``HysteresisEKF(..., project=False)`` at the cost of filterpy. The filterpy
    object is at hand as `filter`. Source: R. Labbe, filterpy.
    """

    __slots__ = ()

    def _make_filter(self) -> Any:
        made = _HysteresisFilter(dim_x=self._n, dim_z=1)
        made.hysteretic = bool(self._config[kernel.HYSTERETIC])
        return made

    def _predict(self, du: float) -> None:
        F = np.eye(self._n)
        if self._config[kernel.HYSTERETIC]:
            s = self._filter.x
            F[0, :3] = equations.hysteresis_jacobian(s[0], du, s[1], s[2])
        self._filter.F, self._filter.Q = F, self._process_noise(du)
        self._filter.predict(du)

    def _update(self, x: float, h: FloatArray) -> None:
        row = h[None, :]
        self._filter.update(np.array([x]), lambda s: row, lambda s: row @ s)


class FilterPyUKF(_FilterPyBaseline):
    """filterpy's `UnscentedKalmanFilter` on the model of `HysteresisEKF`: a baseline.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : ColemanHodgdon or LinearGain, optional
        Model to start from; its kind is the kind that is estimated.
    uncertainty : float
        Standard deviation of each initial parameter, in parts of its value.
    noise : float
        Standard deviation of the displacement's noise [µm].
    drift : float
        Random walk of each parameter, in parts of its initial value per root second.
    mismatch : float
        Random walk of w_h [µm per root second].
    offset : bool
        Estimate a constant offset of the displacement too.
    delay : float
        Samples by which the measured displacement lags the voltage.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Merwe's scaled sigma points with alpha = 0.1, beta = 2, kappa = 3 - n. The filterpy object
    is at hand as `filter`. Source: R. Labbe, filterpy; R. van der Merwe, thesis (2004).
    """

    __slots__ = ()

    conformance_exceptions: ClassVar[dict[str, str]] = {
        "model_is_admissible_after_anything": (
            "The UKF of filterpy subtracts K S K' from P, which loses definiteness on absurd measurements "
            "(1e8 µm); as a baseline it is used unaltered."
        ),
    }

    def _make_filter(self) -> Any:
        n = self._n
        points = MerweScaledSigmaPoints(n, alpha=0.1, beta=2.0, kappa=3.0 - n)
        step = _advance if self._config[kernel.HYSTERETIC] else _stay
        return UnscentedKalmanFilter(
            dim_x=n, dim_z=1, dt=1.0 / self.sample_rate, hx=_read, fx=step, points=points
        )

    def _predict(self, du: float) -> None:
        # Sigma points see the product of errors within a sample only, not that it keeps its sign
        # over many: without its variance the errors reported are far too small.
        self._filter.Q = self._process_noise(du)
        self._filter.predict(du=du)

    def _update(self, x: float, h: FloatArray) -> None:
        self._filter.update(np.array([x]), h=h)


def _advance(s: FloatArray, dt: float, du: float) -> FloatArray:
    s = s.copy()
    s[0] = equations.hysteresis_step(s[0], du, s[1], s[2])
    return s


def _stay(s: FloatArray, dt: float, du: float) -> FloatArray:
    return s


def _read(s: FloatArray, h: FloatArray) -> FloatArray:
    return np.array([h @ s])
