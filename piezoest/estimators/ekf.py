"""Extended Kalman filter: the loop's state and its parameters estimated jointly."""

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from piezoest._checks import FloatArray, moderate, non_negative
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators import ekf_kernel
from piezoest.estimators.compiled import CompiledEstimator
from piezoest.estimators.delay_line import delay_line
from piezoest.estimators.derivative_form import LONGEST_GAP
from piezoest.estimators.saved_state import Rule
from piezoest.models import ColemanHodgdon, LinearGain

# How far the parameters of a filter that does not project may be outside of the admissible set: a relative to
# its least value, c relative to the least c - 2b. They are 1e-2 and 1e-3 of the start's.
GROWING, GREATEST = 1e5, 1e10


class HysteresisEKF(CompiledEstimator):
    """Extended Kalman filter for the state of the loop and the parameters together.

    The state `s` is (w_h, a, b, c), optionally with an offset. In this second form of the
    Coleman-Hodgdon model (2)-(3) the measurement x = w_h + c u + offset is linear. Between samples the
    filter uses the exact step and its exact Jacobian, so it works at any sample rate. The variance of
    the product a w_h is added to second order.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : ColemanHodgdon or LinearGain, optional
        Initial model; a model of the same kind is estimated. Default
        ``ColemanHodgdon(0.02, 0.12, 0.0036)``, a common stack actuator.
    uncertainty : float
        Standard deviation of each initial parameter (a, b, c or the gain), relative to its value.
    noise : float
        Standard deviation of the displacement's noise [µm].
    drift : float
        Random walk of each parameter, relative to its initial value, per root second. It sets the
        memory of the filter; 0 for constant parameters.
    mismatch : float
        Random walk of w_h [µm per root second]: how far the stage deviates from the model within a second; 0
        for an exact model. For a `LinearGain`, which has no w_h: its error averaged over a second [µm]. The
        default suits a stroke of some 10 µm: scale it with the stroke.
    offset : bool
        Also estimate an offset of the displacement, with the random walk `mismatch`. A larger loop
        leaves such an offset after a change of amplitude.
    delay : float
        Samples by which the measured displacement lags the voltage, up to a million; may be fractional.
    project : bool
        Keep the estimate in the admissible set by a projection in the metric of P.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Impossible readings are left out as by `policies.OutlierRejection`, but only where the filter too is
    surprised, by more than ten standard deviations, or where the voltage has travelled a tenth of a swing on
    a constant reading. A level that stays for 2 ms is accepted; the offset, or else w_h, follows it.
    With `project`, a is at most 40 divided by the swing of the voltage, or the initial a if that is larger.

    The update has Joseph's form. Process noise is given per second, so it need not be changed with the
    sample rate. `theta` is (alpha, beta, gamma) from (4), and `P` its covariance to first order. `s` and
    `state_covariance` belong to the filter itself.

    Coarse steps of the voltage's converter mislead it as they do `HysteresisRLS`: see the notes there.

    Source: D. Simon, Optimal State Estimation (2006), sec. 13.2; the model: Eielsen, Gravdahl
    and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), (2)-(4).

    Examples
    --------
    >>> import piezoest as pz
    >>> fs = 10_000.0
    >>> u = pz.signals.triangle(amplitude=33.0, frequency=5.0, periods=5, sample_rate=fs).values
    >>> x = pz.PaperStage(fs, seed=0).run(u)
    >>> estimator = pz.HysteresisEKF(fs)
    >>> trace = estimator.run(u, x)
    >>> compensator = pz.InverseCompensator(estimator.model)
    """

    __slots__ = ()

    kernel: ClassVar[Any] = ekf_kernel
    _places: ClassVar[dict[str, tuple[str, ...]]] = {"P": ("filter", "P"), "K": ("filter", "K")}

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
        initial = self._start_from(initial_model, ColemanHodgdon, LinearGain)
        uncertainty = moderate("uncertainty", uncertainty)
        drift = moderate("drift", drift, or_zero=True)
        mismatch = moderate("mismatch", mismatch, or_zero=True)
        line, line_start = delay_line(delay)
        start, spread, walk = starting_point(initial, uncertainty, drift, mismatch, offset)
        hysteretic = isinstance(initial, ColemanHodgdon)
        # The linear gain has no state that could stray: there the mismatch is noise.
        stray = 0.0 if hysteretic else mismatch**2 * sample_rate
        self._configure(
            ekf_kernel.settings_layout(start.size, hysteretic=hysteretic),
            {
                "longest_gap": max(1, int(LONGEST_GAP * sample_rate)),
                "noise": moderate("noise", noise) ** 2 + stray,
                "offset": initial.offset,
                "walk": walk**2 / sample_rate,
                "variances": spread**2,
                **_scale(initial),
            },
        )
        self._begin(
            {
                "sample_rate": sample_rate,
                "initial_model": initial.to_dict(),
                "uncertainty": uncertainty,
                "noise": float(noise),
                "drift": drift,
                "mismatch": mismatch,
                "offset": bool(offset),
                "delay": non_negative("delay", delay),
                "project": bool(project),
            },
            ekf_kernel.state_layout(
                start.size, line, offset=bool(offset), project=bool(project and hysteretic)
            ),
            {"filter": {"s": start, "P": np.diag(spread**2)}, "line": line_start},
        )

    def _rules(self, state: Any) -> Iterable[Rule]:
        yield from super()._rules(state)
        if isinstance(self._initial, ColemanHodgdon):
            words = "the filter's parameters must be admissible, or near it where it does not project"
            yield words, self._parameters_fit(state)

    def _parameters_fit(self, state: Any) -> bool:
        _, a, b, c = state["filter"]["s"][:4]
        least = self._settings["least"]
        if self._arguments["project"]:
            return bool(a >= least["a"] and b >= least["b"])
        # Without projection a decay below zero is an exponential that grows: not without end.
        return bool(-GROWING * least["a"] <= a and abs(c) <= GREATEST * least["margin"])

    def _shown(self, name: str, values: FloatArray, rows: FloatArray) -> Any:
        return parameter_covariance(rows, values) if name == "P" else values

    def theta_of(self, rows: FloatArray) -> FloatArray:
        """Parameters (…, n) of rows of the filter's state."""
        return parameters(rows)

    @property
    def s(self) -> FloatArray:
        """The filter's own state: (w_h, a, b, c[, offset]) or (gain[, offset])."""
        return np.array(self._state["filter"]["s"])

    _row = s

    @property
    def state_covariance(self) -> FloatArray:
        """Covariance of `s`, shape (n, n)."""
        return np.array(self._state["filter"]["P"])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`."""
        names = self._initial.parameter_names
        return (*names, "offset") if self._arguments["offset"] else names

    def _is_projected(self) -> bool:
        projection = self._state["projection"]
        return projection.dtype.names is not None and bool(projection["moved"])


def is_hysteretic(s: FloatArray) -> bool:
    """Whether states (…, n) are of a hysteresis: those of a linear gain are one, or two with an offset."""
    return s.shape[-1] > 2


def parameters(s: FloatArray) -> FloatArray:
    """Parameters (…, n_theta) of states (…, n)."""
    if not is_hysteretic(s):
        return s.copy()
    theta = np.empty((*s.shape[:-1], s.shape[-1] - 1))
    theta[..., 0], theta[..., 1], theta[..., 2] = equations.rate_parameters(s[..., 1], s[..., 2], s[..., 3])
    theta[..., 3:] = s[..., 4:]
    return theta


def parameter_covariance(s: FloatArray, P: FloatArray) -> FloatArray:
    """Covariances (…, n_theta, n_theta) of the parameters, to first order, from P of s (…, n)."""
    if not is_hysteretic(s):
        return P.copy()
    n = s.shape[-1]
    jacobian = np.zeros((*s.shape[:-1], n - 1, n))
    jacobian[..., 0, 1] = 1.0
    jacobian[..., 1, 2] = -1.0
    jacobian[..., 1, 3] = 1.0
    jacobian[..., 2, 1] = s[..., 3]
    jacobian[..., 2, 3] = s[..., 1]
    if n == 5:
        jacobian[..., 3, 4] = 1.0
    return jacobian @ P @ np.swapaxes(jacobian, -1, -2)


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


def _scale(initial: ColemanHodgdon | LinearGain) -> dict[str, Any]:
    """Settings that hold the estimate near the start's size: least parameters, or the start's gain."""
    if isinstance(initial, LinearGain):
        return {"gain": initial.gain}
    least, margin = ekf_kernel.LEAST, ekf_kernel.LEAST_MARGIN
    return {"least": {"a": least * initial.a, "b": least * initial.b, "margin": margin * initial.c}}
