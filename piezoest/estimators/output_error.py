"""Recursive least squares of the Coleman-Hodgdon model in output-error form, from raw (u, x)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from piezoest._checks import FloatArray, check_start, integer, moderate, non_negative
from piezoest.equations import coleman_hodgdon, output_error
from piezoest.estimators import output_error_kernel as kernel
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_kernel as front
from piezoest.estimators import state_tables
from piezoest.estimators.base import NO_ROWS, NONE, Compiled, Freezable, Status, Trace
from piezoest.estimators.delay_line import delay_line
from piezoest.estimators.rls_settings import FIRST_HALF, LONGEST_GAP
from piezoest.estimators.saved_state import Table
from piezoest.models import ColemanHodgdon
from piezoest.policies import OutlierRejection, Policy, RandomWalk, policy_to_dict, select

# Seconds within which the disturbance may pass for noise of a single sample.
SLACK = 1e-4
# Swings that a disturbance lasts.
LASTING = 0.3
# Most decays in the bank: each sample moves them all.
MOST_MEMBERS = 1000

POLICIES = (RandomWalk(), OutlierRejection())


class OutputErrorRLS(Freezable):
    """Recursive least squares of a Coleman-Hodgdon model in output-error form.

    For a fixed decay a the displacement x = c u + b h_a(u) + offset (2)-(3) is linear in
    (c, b, offset), with regressors from the voltage alone: free of the sensor's noise, which then
    makes no bias, and x is never differentiated. A bank of decays around the start runs along with the
    voltage; least squares works around the member of the bank that is nearest, with the derivative by the
    decay as a fourth regressor, and goes on to the next member as the estimate does.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : ColemanHodgdon, optional
        Model to start from. Default ``ColemanHodgdon(0.02, 0.12, 0.0036)``, a common stack
        actuator.
    uncertainty : float
        Standard deviation of each initial parameter (alpha, beta, gamma), in parts of its value.
    noise : float
        Least standard deviation of the displacement's noise [µm]; what is measured comes on top.
    span : float
        Factor: the bank reaches from the initial decay divided by it to the decay times it.
    members : int
        Decays in the bank, 3 to 1000.
    delay : float
        Samples by which the measured displacement lags the voltage, up to a million; may be fractional.
    policies : tuple of policies, optional
        `policies.RandomWalk`, which sets the memory, and `policies.OutlierRejection`, which
        may be left out. Default both.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    The law is a Kalman filter. Parameters walk by parts of alpha, beta and gamma as in
    `HysteresisRLS`, on the reference's own clock. What no parameter explains (creep, the shape that the
    model does not have) is a disturbance of its own that lasts a part of a swing, a Markov
    process of first order; so a slow error of the level does not weigh as often as it is sampled. The
    model's offset is the loop's centre and that disturbance together. At rest nothing moves.

    `theta` is (alpha, beta, gamma, offset), `P` its covariance to first order as the law sees it.
    A decay beyond the bank is taken for its end.

    Sources: L. Ljung, System Identification, 2nd ed. (1999), sec. 10.3, 11.2 and 11.4 (law); Eielsen,
    Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), (2)-(4) (model).
    """

    __slots__ = ("_config", "_initial", "_terms")

    _frozen_at = front.FROZEN

    _compiled = Compiled(kernel._sample, kernel.proposed, front.FROZEN)

    conformance_exceptions: ClassVar[dict[str, str]] = {
        "learns_a_linear_gain": "A linear gain has no loop, and nothing that an output-error form would add.",
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
        initial = ColemanHodgdon(0.02, 0.12, 0.0036) if initial_model is None else initial_model
        if not isinstance(initial, ColemanHodgdon):
            raise ValueError(f"initial_model must be a ColemanHodgdon, got {initial!r}")
        if not initial.is_admissible:
            raise ValueError(f"initial_model {initial} is not admissible: use nearest_admissible()")
        check_start(initial)
        if moderate("span", span) <= 1.0:
            raise ValueError(f"span must be above 1, got {span:g}")
        members = integer("members", members, 3, MOST_MEMBERS)
        walk = select(policies, RandomWalk)
        rejection = select(policies, OutlierRejection)
        if not isinstance(walk, RandomWalk):
            raise ValueError("policies must hold a RandomWalk: it is what sets the memory here")
        if unknown := [p for p in policies if not isinstance(p, RandomWalk | OutlierRejection)]:
            raise ValueError(f"policies: {unknown[0]!r} is none of RandomWalk and OutlierRejection")
        fraction, line = delay_line(delay)
        self._initial = initial
        self._terms = np.array([initial.offset])

        config = np.zeros(kernel.DECAYS)
        config[front.N] = 4
        config[front.HYSTERETIC] = config[front.OFFSET] = 1.0
        slack = max(1.0, SLACK * sample_rate)
        config[front.FRACTION] = fraction
        config[front.LONGEST_GAP] = max(1, int(LONGEST_GAP * sample_rate))
        config[front.FIRST_HALF] = max(1.0, FIRST_HALF * sample_rate)
        config[front.WALK] = 0.5 * walk.drift**2
        config[front.WALK_MEMORY] = 2.0 * walk.memory
        if isinstance(rejection, OutlierRejection):
            config[front.OUTLIER] = 1.0
            config[front.WARM_UP] = rejection.warm_up
        config[front.SCALE : front.SCALE + 4] = initial.c
        config[front.SCALE + 4] = 1.0
        config[front.SLOPE] = initial.c
        config[front.NOISE_FACTOR] = 2.0 / front.PRECISION**2
        config[kernel.SLACK] = slack**2
        config[kernel.LASTING] = LASTING
        config[kernel.VARIANCE] = moderate("noise", noise) ** 2
        config[kernel.MEMBERS] = members
        b = initial.b / initial.c
        config[kernel.START_B] = b
        config[kernel.SPREAD] = moderate("uncertainty", uncertainty) ** 2
        decays = initial.a * np.geomspace(1.0 / span, span, members)
        config[kernel.STEP] = np.log(decays[1] / decays[0])
        self._config = np.concatenate([config, decays])

        state = np.zeros(kernel.bank_end(self._config))
        nearest = int(np.argmin(np.abs(np.log(decays / initial.a))))
        state[kernel.MEMBER] = state[kernel.MEMBER_BEFORE] = nearest
        state[kernel.S : kernel.S + 3] = b, 1.0, b * np.log(initial.a / decays[nearest])
        kernel.start_covariance(state, config)
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
            np.concatenate([state, line]),
        )

    def _table(self) -> Table:
        return state_tables.output_error(self._config, self._state.size)

    def _sample(self, u: float, x: float) -> None:
        kernel.step(self._state, self._config, u, x)

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, n = u.size // every, kernel.SIZE
        s = np.empty((rows, n + 1))
        y = np.empty(rows if "y" in want else 0)
        S = np.empty(rows if "S" in want else 0)
        P = np.empty((rows if "P" in want else 0, n * n))
        kernel.run(self._state, self._config, u, x, every, NONE, NO_ROWS, s, y, S, P)
        unit = self._initial.c
        return Trace(
            index=np.arange(every - 1, rows * every, every),
            theta=self._theta_of(s),
            parameter_names=self.parameter_names,
            y=y * unit if "y" in want else None,
            S=S * unit**2 if "S" in want else None,
            P=self._theta_covariance(s, P.reshape(-1, n, n)) if "P" in want else None,
        )

    def _decay_of(self, s: FloatArray) -> FloatArray:
        """Decay a of rows (…, 6) of the filter's state and the member in use, shape (…)."""
        decays = self._config[kernel.DECAYS :]
        correction = output_error.log_ratio(s[..., kernel.B], s[..., kernel.D], self._config[kernel.STEP])
        return decays[s[..., kernel.SIZE].astype(int)] * np.exp(correction)

    def _theta_of(self, s: FloatArray) -> FloatArray:
        """Parameters (…, 4) of rows (…, 6)."""
        unit = self._initial.c
        a, b, c = self._decay_of(s), s[..., kernel.B] * unit, s[..., kernel.C] * unit
        level = (s[..., kernel.CENTRE] + s[..., kernel.DISTURBANCE]) * unit
        offset = level + self._state[front.X_CENTRE] - c * self._state[front.U_CENTRE]
        if self._state[front.PRIMED] == 0.0:
            offset = offset + self._initial.offset
        return np.stack([*coleman_hodgdon.rate_parameters(a, b, c), offset], axis=-1)

    def _jacobian(self, s: FloatArray) -> FloatArray:
        """Derivative (…, 4, 5) of `theta` by the filter's state."""
        unit = self._initial.c
        a, b, c = self._decay_of(s), s[..., kernel.B], s[..., kernel.C]
        b = np.fmax(b, kernel.LEAST_B * np.fmax(c, kernel.LEAST_C))
        jacobian = np.zeros((*s.shape[:-1], 4, kernel.SIZE))
        jacobian[..., 0, kernel.B] = -a * s[..., kernel.D] / b**2
        jacobian[..., 0, kernel.D] = a / b
        jacobian[..., 1, kernel.B] = -unit
        jacobian[..., 1, kernel.C] = unit
        jacobian[..., 2, :] = jacobian[..., 0, :] * (c * unit)[..., None]
        jacobian[..., 2, kernel.C] += a * unit
        jacobian[..., 3, kernel.C] = -self._state[front.U_CENTRE] * unit
        jacobian[..., 3, kernel.CENTRE :] = unit
        return jacobian

    def _theta_covariance(self, s: FloatArray, P: FloatArray) -> FloatArray:
        """Covariances (…, 4, 4) of the parameters, to first order."""
        jacobian = self._jacobian(s)
        covariance = jacobian @ P @ np.swapaxes(jacobian, -1, -2)
        return 0.5 * (covariance + np.swapaxes(covariance, -1, -2))

    @property
    def _row(self) -> FloatArray:
        """The filter's state and the member in use, shape (6,)."""
        return np.append(self._state[kernel.S : kernel.S + kernel.SIZE], self._state[kernel.MEMBER])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`."""
        return (*self._initial.parameter_names, "offset")

    @property
    def decays(self) -> FloatArray:
        """Decays of the bank [1/V], shape (members,)."""
        return self._config[kernel.DECAYS :].copy()

    @property
    def theta(self) -> FloatArray:
        """Parameters as estimated, shape (4,), possibly outside the admissible set."""
        return self._theta_of(self._row)

    @property
    def P(self) -> FloatArray:
        """Covariance of `theta` to first order as the law sees it, shape (4, 4)."""
        n = kernel.SIZE
        return self._theta_covariance(self._row, self._state[kernel.P : kernel.P + n * n].reshape(n, n))

    @property
    def standard_errors(self) -> FloatArray:
        """Square roots of the diagonal of `P`, shape (4,): for parameters that walk as the law expects."""
        return np.sqrt(np.fmax(np.diag(self.P), 0.0))

    @property
    def y(self) -> float:
        """Last innovation [µm]."""
        return float(self._state[front.FRONT + law.INNOVATION] * self._initial.c)

    @property
    def S(self) -> float:
        """Variance of the last innovation as the law saw it [µm²]."""
        return float(self._state[front.FRONT + law.INNOVATION_VARIANCE] * self._initial.c**2)

    @property
    def K(self) -> FloatArray:
        """Last gain, in `theta` per innovation, shape (4,)."""
        gain = self._state[kernel.GAIN : kernel.GAIN + kernel.SIZE]
        return self._jacobian(self._row) @ gain / self._initial.c

    @property
    def status(self) -> Status:
        """What happened to the samples so far."""
        head = self._state[front.FRONT :]
        b, c = self._state[kernel.S : kernel.S + 2].tolist()
        admissible = c >= kernel.LEAST_C and kernel.LEAST_B * c <= b <= 0.5 * (1.0 - kernel.MARGIN) * c
        return Status(
            samples=int(self._state[front.SAMPLES]),
            updates=int(head[law.UPDATES]),
            missing=int(self._state[front.MISSED]),
            held=int(head[law.HELD]),
            resets=int(head[law.RESETS]),
            projected=not admissible,
            last=("waiting", "updated", "missing", "held", "rejected")[int(head[law.LAST])],
            outliers=int(self._state[front.OUTLIERS]),
        )

    @property
    def model(self) -> ColemanHodgdon:
        """Admissible model as known now: `theta` itself, or its nearest point in the metric of P."""
        values = np.zeros(4)
        kernel.propose(self._state, self._config, self._terms, values)
        return ColemanHodgdon(*values.tolist())
