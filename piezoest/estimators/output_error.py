"""Recursive least squares of the Coleman-Hodgdon model in output-error form, from raw (u, x)."""

from typing import Any, ClassVar

import numpy as np

from piezoest._checks import FloatArray, integer, moderate, non_negative
from piezoest.equations import coleman_hodgdon, output_error, sensor_noise
from piezoest.estimators import output_error_kernel as kernel
from piezoest.estimators.compiled import IN_LAW, Freezable
from piezoest.estimators.delay_line import delay_line
from piezoest.estimators.derivative_form import FIRST_HALF_PERIOD, LONGEST_GAP
from piezoest.models import ColemanHodgdon
from piezoest.policies import OutlierRejection, Policy, RandomWalk, check_policies, policy_to_dict
from piezoest.policies.base import Conditions

# Seconds within which the disturbance may pass for noise of a single sample.
SLACK = 1e-4
# Swings that a disturbance lasts.
LASTING = 0.3
# Most decays in the bank: each sample moves them all.
MOST_MEMBERS = 1000

POLICIES = (RandomWalk(), OutlierRejection())


class OutputErrorRLS(Freezable):
    """Recursive least squares of a Coleman-Hodgdon model in output-error form.

    For a fixed decay a, the displacement x = c u + b h_a(u) + offset (2)-(3) is linear in
    (c, b, offset). The regressors depend on the voltage alone, so noise of the sensor causes no
    bias, and x is not differentiated. h_a is simulated for a bank of decays around the initial one.
    Least squares uses the nearest member of the bank, with the derivative by the decay as a fourth
    regressor, and changes the member when the estimated decay changes.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : ColemanHodgdon, optional
        Initial model. Default ``ColemanHodgdon(0.02, 0.12, 0.0036)``, a common stack actuator.
    uncertainty : float
        Standard deviation of each initial parameter (alpha, beta, gamma), relative to its value.
    noise : float
        Smallest standard deviation of the displacement's noise [µm]; the measured noise is added.
    span : float
        Factor: the bank covers the initial decay divided by `span` to the initial decay times `span`.
    members : int
        Number of decays in the bank, 3 to 1000.
    delay : float
        Samples by which the measured displacement lags the voltage, up to a million; may be fractional.
    policies : tuple of policies, optional
        `policies.RandomWalk`, which sets the memory, and optionally `policies.OutlierRejection`.
        Default: both.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    The law is a Kalman filter. As in `HysteresisRLS`, the parameters perform a random walk that is relative
    to alpha, beta and gamma and counted in swings of the reference. Creep and other errors of the model
    are described by a disturbance that lasts a fraction of a swing (a first-order Markov process), so a
    slow error is not counted once per sample. The model's offset is the centre of the loop plus this
    disturbance. At rest nothing changes.

    `theta` is (alpha, beta, gamma, offset), and `P` its covariance to first order. A decay may be at most
    one step beyond the end of the bank.

    Sources: L. Ljung, System Identification, 2nd ed. (1999), sec. 10.3, 11.2 and 11.4 (law); Eielsen,
    Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), (2)-(4) (model).

    Examples
    --------
    >>> import piezoest as pz
    >>> fs = 10_000.0
    >>> u = pz.signals.triangle(amplitude=33.0, frequency=5.0, periods=5, sample_rate=fs).values
    >>> x = pz.PaperStage(fs, seed=0).run(u)
    >>> estimator = pz.OutputErrorRLS(fs)
    >>> trace = estimator.run(u, x)
    >>> compensator = pz.InverseCompensator(estimator.model)
    """

    __slots__ = ()

    kernel: ClassVar[Any] = kernel
    _places = IN_LAW

    conformance_exceptions: ClassVar[dict[str, str]] = {
        "learns_a_linear_gain": "A linear gain has no loop, and nothing that an output-error form would add."
    }

    def __init__(
        self,
        sample_rate: float,
        *,
        initial_model: ColemanHodgdon | None = None,
        uncertainty: float = 0.5,
        noise: float = 1.5e-3,
        span: float = 5.0,
        members: int = 25,
        delay: float = 0.0,
        policies: tuple[Policy, ...] = POLICIES,
    ) -> None:
        sample_rate = moderate("sample_rate", sample_rate)
        initial = self._start_from(initial_model, ColemanHodgdon)
        if moderate("span", span) <= 1.0:
            raise ValueError(f"span must be above 1, got {span:g}")
        members = integer("members", members, 3, MOST_MEMBERS)
        # By name, so that a policy that this law does not carry out cannot be passed over.
        at = Conditions(
            1.0 / sample_rate, np.eye(kernel.SIZE), by_period=True, has_swings=True, has_loop=True
        )
        given = {type(policy): policy.numbers(at) for policy in check_policies(policies, at)}
        if RandomWalk not in given:
            raise ValueError("policies must hold a RandomWalk: it is what sets the memory here")
        if unknown := [p for p in policies if type(p) not in (RandomWalk, OutlierRejection)]:
            raise ValueError(f"policies: {unknown[0]!r} is none of RandomWalk and OutlierRejection")
        rejects = OutlierRejection in given
        line, empty = delay_line(delay)
        b, decays = initial.b / initial.c, initial.a * np.geomspace(1.0 / span, span, members)
        spread = moderate("uncertainty", uncertainty) ** 2
        self._configure(
            kernel.settings_layout(members, rejects=rejects),
            {
                "longest_gap": max(1, int(LONGEST_GAP * sample_rate)),
                "first_half_period": max(1.0, FIRST_HALF_PERIOD * sample_rate),
                "unit": initial.c,
                "noise_factor": 2.0 / sensor_noise.PRECISION**2,
                "slack": max(1.0, SLACK * sample_rate) ** 2,
                "lasting": LASTING,
                "step": np.log(decays[1] / decays[0]),
                "variance": moderate("noise", noise) ** 2,
                "start_b": b,
                "spread": spread,
                "start_offset": initial.offset,
                "decays": decays,
                "policies": {
                    "random_walk": given[RandomWalk],
                    "outlier_rejection": given.get(OutlierRejection, {}),
                },
            },
        )
        nearest = int(np.argmin(np.abs(np.log(decays / initial.a))))
        P = np.zeros((kernel.SIZE, kernel.SIZE))
        kernel.start_covariance(P, b, spread)
        s = [b, 1.0, b * np.log(initial.a / decays[nearest]), 0.0, 0.0]
        self._begin(
            {
                "sample_rate": sample_rate,
                "initial_model": initial.to_dict(),
                "uncertainty": float(uncertainty),
                "noise": float(noise),
                "span": float(span),
                "members": members,
                "delay": non_negative("delay", delay),
                "policies": [policy_to_dict(policy) for policy in policies],
            },
            kernel.layout(members, rejects=rejects, line=line),
            {"member": nearest, "member_before": nearest, "law": {"s": s, "P": P}, "line": empty},
        )

    def _shown(self, name: str, values: FloatArray, rows: FloatArray) -> Any:
        if name != "P":
            return values * self._initial.c ** (1 if name == "y" else 2)
        jacobian = self._jacobian(rows)
        covariance = jacobian @ values @ np.swapaxes(jacobian, -1, -2)
        return 0.5 * (covariance + np.swapaxes(covariance, -1, -2))

    def _decay_of(self, s: FloatArray) -> FloatArray:
        """Decay a of rows (…, 6) of the filter's state and the member in use, shape (…)."""
        correction = output_error.log_ratio(s[..., 0], s[..., 2], float(self._settings["step"]))
        return self._settings["decays"][s[..., -1].astype(int)] * np.exp(correction)

    def theta_of(self, s: FloatArray) -> FloatArray:
        """Parameters (…, 4) of rows (…, 6)."""
        unit = self._initial.c
        a, b, c = self._decay_of(s), s[..., 0] * unit, s[..., 1] * unit
        level = (s[..., 3] + s[..., 4]) * unit
        centre = self._state["centre"]
        offset = level + centre["x"] - c * centre["u"]
        if not self._state["primed"]:
            offset = offset + self._initial.offset
        return np.stack([*coleman_hodgdon.rate_parameters(a, b, c), offset], axis=-1)

    def _jacobian(self, s: FloatArray) -> FloatArray:
        """Derivative (…, 4, 5) of `theta` by the filter's state."""
        unit = self._initial.c
        a, b, c, d = self._decay_of(s), s[..., 0], s[..., 1], s[..., 2]
        b = np.fmax(b, kernel.LEAST_B * np.fmax(c, kernel.LEAST_C))
        jacobian = np.zeros((*s.shape[:-1], 4, kernel.SIZE))
        jacobian[..., 0, 0] = -a * d / b**2
        jacobian[..., 0, 2] = a / b
        jacobian[..., 1, 0] = -unit
        jacobian[..., 1, 1] = unit
        jacobian[..., 2, :] = jacobian[..., 0, :] * (c * unit)[..., None]
        jacobian[..., 2, 1] += a * unit
        jacobian[..., 3, 1] = -self._state["centre"]["u"] * unit
        jacobian[..., 3, 3:] = unit
        return jacobian

    @property
    def _row(self) -> FloatArray:
        """The filter's state and the member in use, shape (6,)."""
        return np.append(self._state["law"]["s"], self._state["member"])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`."""
        return (*self._initial.parameter_names, "offset")

    @property
    def decays(self) -> FloatArray:
        """Decays of the bank [1/V], shape (members,)."""
        return np.array(self._settings["decays"])

    @property
    def K(self) -> FloatArray:
        """Last gain, in `theta` per innovation, shape (4,)."""
        return np.asarray(self._jacobian(self._row) @ self._state["law"]["gain"] / self._initial.c)

    def _is_projected(self) -> bool:
        b, c = self._state["law"]["s"][:2].tolist()
        return not (c >= kernel.LEAST_C and kernel.LEAST_B * c <= b <= 0.5 * (1.0 - kernel.MARGIN) * c)
