"""The baselines: filterpy's own EKF and UKF on the model of `HysteresisEKF`.

Unaltered filterpy, used as its interface needs it: 1-D x and z, `predict_x` overridden, F
set before every prediction, `predict` and `update` called apart (`predict_update` would
evaluate the measurement before predicting).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, ClassVar

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

from piezoest._checks import WILDEST, FloatArray
from piezoest.equations import coleman_hodgdon as equations
from piezoest.equations import kalman
from piezoest.estimators import ekf_kernel as kernel
from piezoest.estimators.base import EstimatorBase
from piezoest.estimators.delay_line import delayed
from piezoest.estimators.ekf import HysteresisEKF, is_hysteretic
from piezoest.estimators.samples import HELD, MISSING, UPDATED
from piezoest.estimators.saved_state import Rule
from piezoest.layout import Named
from piezoest.models import ColemanHodgdon, LinearGain


def _shown(name: str) -> Any:
    """Property of the held `HysteresisEKF`, of the filterpy object's present numbers."""

    def shown(estimator: _FilterPyBaseline) -> Any:
        return getattr(estimator._in_step(), name)

    return property(shown, doc=getattr(HysteresisEKF, name).__doc__)


class _HysteresisFilter(ExtendedKalmanFilter):  # type: ignore[misc]
    """filterpy's EKF with the exact step of w_h as its prediction of x."""

    def predict_x(self, u: float = 0.0) -> None:
        """Predict x for a change of voltage u [V]."""
        if is_hysteretic(self.x):
            self.x[0] = equations.hysteresis_step(self.x[0], u, self.x[1], self.x[2])


class _FilterPyBaseline(EstimatorBase):
    """What the two baselines share: bookkeeping around a filterpy object."""

    __slots__ = ("_ekf", "_filter")

    _ekf: HysteresisEKF
    _filter: Any

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
        self._ekf = HysteresisEKF(
            sample_rate, initial_model=initial_model, uncertainty=uncertainty, noise=noise, drift=drift,
            mismatch=mismatch, offset=offset, delay=delay, project=False,
        )  # fmt: skip
        self._arguments = {name: value for name, value in self._ekf._arguments.items() if name != "project"}
        self._filter = self._make_filter(self._ekf.s.size)
        self._filter.Q = np.diag(self._ekf.settings["walk"])
        self._filter.R = self._ekf.settings["noise"].reshape(1, 1).copy()
        self._layout, self._pending = self._ekf.layout, None
        self._state, self._start = self._ekf.state, self._ekf.state.copy()
        self._load(self._start)

    # Of its class: the filterpy object for n states, and how that predicts and updates.
    _make_filter: Callable[[int], Any]
    _predict: Callable[[float], None]
    _update: Callable[[float, FloatArray], None]

    theta, P, standard_errors = _shown("theta"), _shown("P"), _shown("standard_errors")
    s, state_covariance, K = _shown("s"), _shown("state_covariance"), _shown("K")
    y, S, status = _shown("y"), _shown("S"), _shown("status")
    model, parameter_names = _shown("model"), _shown("parameter_names")
    state = _shown("state")

    @property
    def filter(self) -> Any:
        """The filterpy object itself, for filterpy's own tools such as `filterpy.common.Saver`."""
        return self._filter

    def _in_step(self) -> HysteresisEKF:
        """Return the held estimator, with the filterpy object's numbers in its state."""
        numbers = self._ekf.state["filter"]
        numbers["s"], numbers["P"], numbers["K"] = self._filter.x, self._filter.P, np.ravel(self._filter.K)
        return self._ekf

    def to_dict(self) -> dict[str, Any]:
        """Return arguments and state as a JSON-safe dictionary, from which `from_dict` continues exactly."""
        self._in_step()
        return super().to_dict()

    def _load(self, state: Any) -> None:
        super()._load(state)
        numbers = state["filter"]
        self._filter.x, self._filter.P = numbers["s"].copy(), numbers["P"].copy()
        self._filter.K = numbers["K"].reshape(-1, 1).copy()

    def _rules(self, state: Any) -> Iterable[Rule]:
        return self._ekf._rules(state)

    def _process_noise(self, du: float) -> FloatArray:
        """Covariance that the process adds over du, the second-order variance of a w_h with it."""
        Q: FloatArray = np.diag(self._ekf.settings["walk"])
        if is_hysteretic(self._filter.x):
            Q[0, 0] += kalman.bilinear_variance(self._filter.P, du, self._filter.x[1])
        return Q

    def _sample(self, u: float, x: float) -> None:
        state = Named(self._state, self._layout)
        settings = Named(self._ekf.settings, self._ekf.layouts[1])
        state.samples += 1.0
        if abs(u) < WILDEST:
            u = kernel.from_first_voltage(state, delayed(state.line, u))
            if state.primed == 0.0:
                state.primed, state.u_last = 1.0, u
            if not self._guarded(self._predict, u - state.u_last):
                state.resets += 1.0
            state.u_last = u
        else:
            x = np.nan
        if not abs(x) < WILDEST:
            state.missing += 1.0
            state.last = MISSING
            return
        h = np.zeros(self._filter.x.size)
        x = kernel.from_first_displacement(state, x)
        kernel.measurement_row(state, settings, u, h)
        if not self._guarded(self._update, x, h):
            state.resets, state.held, state.last = state.resets + 1.0, state.held + 1.0, HELD
            return
        state.y, state.S = np.ravel(self._filter.y)[0], np.ravel(self._filter.S)[0]
        state.updates += 1.0
        state.last = UPDATED

    def _guarded(self, function: Any, *arguments: Any) -> bool:
        """Let the filter predict or update; where it breaks, the parameters stay and P starts again.

        A stream must not stop, and what is not a number would stay in the filter for good.
        """
        x = self._filter.x.copy()
        try:
            with np.errstate(all="ignore"):
                function(*arguments)
            if self._is_sound():
                return True
        except (np.linalg.LinAlgError, ValueError):  # scipy refuses what is not finite
            pass
        if is_hysteretic(self._filter.x):
            x[0] = 0.0
        self._filter.x, self._filter.P = x, np.diag(self._ekf.settings["variances"])
        self._filter.K = np.zeros((x.size, 1))
        self._filter.y, self._filter.S = np.zeros(1), np.ones((1, 1))
        return False

    def _is_sound(self) -> bool:
        """Whether state, covariance and gain are numbers, far from overflow, and no variance is lost."""
        P = self._filter.P
        numbers = np.concatenate([np.ravel(a) for a in (self._filter.x, P, self._filter.K, self._filter.S)])
        return bool(np.all(np.abs(numbers) < kalman.LARGEST_TRACE) and np.all(np.diag(P) >= 0.0))


class FilterPyEKF(_FilterPyBaseline):
    """filterpy's `ExtendedKalmanFilter` on the model of `HysteresisEKF`: a baseline.

    Parameters
    ----------
    sample_rate, initial_model, uncertainty, noise, drift, mismatch, offset, delay
        As in `HysteresisEKF`.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Equal to ``HysteresisEKF(..., project=False)`` at the cost of filterpy. The filterpy
    object is the attribute `filter`. Source: R. Labbe, filterpy.

    Examples
    --------
    >>> import piezoest as pz
    >>> estimator = pz.FilterPyEKF(1000.0)
    >>> estimator.step(1.0, 0.15)
    >>> type(estimator.filter).__mro__[1].__name__
    'ExtendedKalmanFilter'
    """

    __slots__ = ()

    def _make_filter(self, n: int) -> Any:
        return _HysteresisFilter(dim_x=n, dim_z=1)

    def _predict(self, du: float) -> None:
        F = np.eye(self._filter.x.size)
        if is_hysteretic(self._filter.x):
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
    sample_rate, initial_model, uncertainty, noise, drift, mismatch, offset, delay
        As in `HysteresisEKF`.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Merwe's scaled sigma points with alpha = 0.1, beta = 2, kappa = 3 - n. The filterpy object
    is the attribute `filter`. Source: R. Labbe, filterpy; R. van der Merwe, thesis (2004).

    Examples
    --------
    >>> import piezoest as pz
    >>> estimator = pz.FilterPyUKF(1000.0)
    >>> estimator.step(1.0, 0.15)
    >>> type(estimator.filter).__name__
    'UnscentedKalmanFilter'
    """

    __slots__ = ()

    conformance_exceptions: ClassVar[dict[str, str]] = {
        "model_is_admissible_after_anything": (
            "The UKF of filterpy subtracts K S K' from P, which loses definiteness on absurd measurements "
            "(1e8 µm); as a baseline it is used unaltered."
        )
    }

    def _make_filter(self, n: int) -> Any:
        points = MerweScaledSigmaPoints(n, alpha=0.1, beta=2.0, kappa=3.0 - n)
        dt = 1.0 / self._ekf.sample_rate
        return UnscentedKalmanFilter(dim_x=n, dim_z=1, dt=dt, hx=_read, fx=_advance, points=points)

    def _predict(self, du: float) -> None:
        # Sigma points see the product of errors within a sample only, not that it keeps its sign
        # over many: without its variance the errors reported are far too small.
        self._filter.Q = self._process_noise(du)
        self._filter.predict(du=du)

    def _update(self, x: float, h: FloatArray) -> None:
        self._filter.update(np.array([x]), h=h)


def _advance(s: FloatArray, dt: float, du: float) -> FloatArray:
    s = s.copy()
    if is_hysteretic(s):
        s[0] = equations.hysteresis_step(s[0], du, s[1], s[2])
    return s


def _read(s: FloatArray, h: FloatArray) -> FloatArray:
    return np.array([h @ s])
