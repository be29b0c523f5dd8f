"""The paper's estimator: recursive least squares on the derivative form, from raw (u, x)."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from piezoest._checks import FloatArray, check_start, moderate
from piezoest.equations import admissible
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_kernel as kernel
from piezoest.estimators import rls_loops, rls_model, rls_profile, state_tables
from piezoest.estimators import rls_settings as settings
from piezoest.estimators.base import NO_ROWS, NONE, Compiled, Freezable, Status, Trace
from piezoest.estimators.delay_line import delay_line
from piezoest.estimators.saved_state import Table
from piezoest.models import AmplitudeProfile, ColemanHodgdon, LinearGain, Model
from piezoest.policies import Forgetting, Policy, policy_to_dict

# Seconds of memory where the paper's law is asked for without one.
PAPER_MEMORY = 0.4
# In parts of the sample rate: below it nothing comes through the low-pass.
LEAST_CUTOFF = 1e-9


class HysteresisRLS(Freezable):
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
    memory : float, None or "period"
        ``"period"`` (default): random-walk forgetting with a memory in parts of the
        reference's own period, see `policies.RandomWalk` and, for a `LinearGain`,
        `policies.PeriodicForgetting`. A number: time constant of
        exponential forgetting [s], as in the paper. None: no forgetting. With the continuous
        time base ``"period"`` means 0.4 s.
    uncertainty : float
        Standard deviation of each initial parameter, in parts of its value.
    noise : float
        Standard deviation of the displacement's noise [µm]; weighs the start against the data.
    cutoff : float
        Cut-off frequency of W_p [Hz], at least 1e-9 of the sample rate.
    high_pass : float, optional
        Cut-off frequency of a first-order high-pass on both sides [Hz], against a biased
        sensor (last remark of App. A). Below the reference's lowest frequency. It can only
        remove what is constant: a bias enters as |du/dt|, so for anything but a sharp
        triangle `offset` is the better way.
    offset : bool, optional
        Estimate the loop's centre too, by one more regressor |du/dt|: a biased sensor or a
        unipolar voltage then needs no high-pass, and what a larger loop leaves behind is taken out.
        Default: with ``memory="period"``, except for a `LinearGain`; not with the paper's memory.
    delay : float
        Samples by which the measured displacement lags the voltage, up to a million; may be fractional.
    time_base : {"discrete", "continuous"}
        Time base of the law, see `RecursiveLeastSquares`; ``"continuous"`` is the paper's,
        in seconds.
    errors : bool
        Follow the covariance of the estimate's error, for `standard_errors`, and the mean square of the
        regressor, for `excitation`. They cost about as much as the law itself: :doc:`/performance`.
    policies : tuple of policies, optional
        Policies beside `memory`. Default with ``memory="period"``: ``(RandomWalk(), DeadZone(),
        OutlierRejection())``, for a `LinearGain` with `PeriodicForgetting` for
        `RandomWalk`; else ``(NormBound(), DeadZone(), Normalisation())``, the paper's with a dead
        zone.

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

    __slots__ = ("_config", "_initial", "_kind", "_n", "_scale", "_terms")

    _frozen_at = kernel.FROZEN

    _compiled = Compiled(
        kernel._sample,
        rls_model.proposed,
        kernel.FROZEN,
        unneeded=(kernel._propagate_error,),
    )

    conformance_exceptions: ClassVar[dict[str, str]] = {}

    def __init__(
        self,
        sample_rate: float,
        *,
        initial_model: ColemanHodgdon | LinearGain | None = None,
        memory: float | Literal["period"] | None = "period",
        uncertainty: float = 0.5,
        noise: float = 1.5e-3,
        cutoff: float = 2500.0,
        high_pass: float | None = None,
        offset: bool | None = None,
        delay: float = 0.0,
        time_base: law.TimeBase = "discrete",
        errors: bool = True,
        policies: tuple[Policy, ...] | None = None,
    ) -> None:
        sample_rate = moderate("sample_rate", sample_rate)
        initial = ColemanHodgdon(0.02, 0.12, 0.0036) if initial_model is None else initial_model
        if not isinstance(initial, ColemanHodgdon | LinearGain):
            raise ValueError(f"initial_model must be a ColemanHodgdon or a LinearGain, got {initial!r}")
        check_start(initial)
        if np.any(initial.theta == 0.0):
            raise ValueError(f"initial_model must have no parameter at zero, got {initial}")
        if memory is not None and memory != "period":
            memory = moderate("memory", memory)
        if not isinstance(offset, bool | None):
            raise ValueError(f"offset must be True, False or None, got {offset!r}")
        if time_base == "continuous" and memory == "period":
            memory = PAPER_MEMORY
        if policies is None:
            policies = settings.default_policies(memory, initial)
        settings.check_policies(policies, memory, time_base, initial)
        if offset is None:
            offset = memory == "period" and isinstance(initial, ColemanHodgdon)
        cutoff = min(moderate("cutoff", cutoff), 0.5 * sample_rate)
        if cutoff < LEAST_CUTOFF * sample_rate:
            raise ValueError(
                f"cutoff must be at least {LEAST_CUTOFF:g} of the sample rate, got {cutoff:g} Hz"
            )
        fraction, line = delay_line(delay)
        self._initial = initial
        self._scale = settings.parameter_scale(initial, offset)
        self._n = n = self._scale.size
        gain = initial.gain if isinstance(initial, LinearGain) else 0.0
        self._terms = rls_model.model_terms(self._scale, gain, initial.offset)

        config = settings.front_end(
            sample_rate,
            self._scale,
            hysteretic=isinstance(initial, ColemanHodgdon),
            offset=offset,
            cutoff=cutoff,
            high_pass=high_pass,
            fraction=fraction,
            noise=moderate("noise", noise),
            per_second=time_base == "continuous",
        )
        # The continuous law's P is the covariance already.
        config[kernel.ERRORS] = bool(errors) and time_base == "discrete"
        settings.policy_settings(config, policies, sample_rate)
        settings.note_duties(config, errors)
        P_0 = np.diag(np.full(n, moderate("uncertainty", uncertainty) ** 2))
        forgetting = Forgetting(memory if isinstance(memory, float) else np.inf)
        law_config = law.configure((forgetting, *policies), 1.0 / sample_rate, time_base, 1.0, P_0)
        self._config = np.concatenate([config, law_config])
        self._kind = settings.kind(self._config, delay)
        start = np.append(np.sign(initial.theta), np.zeros(int(offset)))
        extra = np.zeros(int(config[kernel.EXTRA]))
        state = np.concatenate([np.zeros(kernel.FRONT), law.new_state(start, P_0), extra, line])
        self._begin(
            {
                "sample_rate": sample_rate,
                "initial_model": initial.to_dict(),
                "memory": memory,
                "uncertainty": float(uncertainty),
                "noise": float(noise),
                "cutoff": cutoff,
                "high_pass": None if high_pass is None else float(high_pass),
                "offset": bool(offset),
                "delay": float(delay),
                "time_base": time_base,
                "errors": bool(errors),
                "policies": [policy_to_dict(policy) for policy in policies],
            },
            state,
        )

    def _table(self) -> Table:
        return state_tables.rls(self._config, self._state.size)

    def _sample(self, u: float, x: float) -> None:
        rls_loops.steps[self._kind](self._state, self._config, u, x)

    def _absorb(self, u: FloatArray, x: FloatArray) -> None:
        u, x = self._records(u, x)
        run = rls_loops.runs[self._kind]
        run(self._state, self._config, u, x, u.size + 1, self._scale, NO_ROWS, NO_ROWS, NONE, NONE, NO_ROWS)

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, n = u.size // every, self._n
        theta = np.empty((rows, n))
        y = np.empty(rows if "y" in want else 0)
        S = np.empty(rows if "S" in want else 0)
        P = np.empty((rows if "P" in want else 0, n * n))
        run = rls_loops.runs[self._kind]
        run(self._state, self._config, u, x, every, self._scale, theta, NO_ROWS, y, S, P)
        return Trace(
            index=np.arange(every - 1, rows * every, every),
            theta=theta,
            parameter_names=self.parameter_names,
            y=y / self._config[kernel.SCALE + 4] if "y" in want else None,
            S=S / self._config[kernel.SCALE + 4] ** 2 if "S" in want else None,
            P=P.reshape(-1, n, n) * np.outer(self._scale, self._scale) if "P" in want else None,
        )

    def _theta_of(self, rows: FloatArray) -> FloatArray:
        """Parameters of what the compiled loops write into their histories."""
        return rows * self._scale

    def reset_covariance(self) -> None:
        """Put P back to its initial value: covariance resetting on call."""
        n, head = self._n, kernel.FRONT + law.HEAD
        self._state[head + n : head + n + n * n] = self._state[head + n + n * n : head + n + 2 * n * n]
        self._state[kernel.FRONT + law.RESETS] += 1.0

    def announce_change(self, amplitude: float | None = None) -> None:
        """Say that the stage or the reference is about to change: adds the initial covariance to P.

        Parameters
        ----------
        amplitude : float, optional
            Of the reference from now on [µm]: if it is known to `profile`, the estimate goes to what was
            learnt there, and P only as far as that is uncertain. Needs `policies.AmplitudeMemory`.

        Raises
        ------
        ValueError
            If amplitude is not above zero, or given without `policies.AmplitudeMemory`.
        """
        if amplitude is not None and rls_profile.announce(self._state, self._config, self._scale, amplitude):
            return
        n, start = self._n, kernel.FRONT + law.HEAD + self._n
        self._state[start : start + n * n] += self._state[start + n * n : start + 2 * n * n]
        self._state[kernel.FRONT + law.RESETS] += 1.0

    @property
    def profile(self) -> AmplitudeProfile:
        """What was learnt at each swing of the voltage, with `policies.AmplitudeMemory`; settable.

        Parameters move with the stage's amplitude: a profile that was saved spares the next start
        what this one had to learn.
        """
        return rls_profile.read(self._state, self._config, self._scale)

    @profile.setter
    def profile(self, profile: AmplitudeProfile) -> None:
        rls_profile.write(self._state, self._config, self._scale, profile)

    @property
    def excitation(self) -> float:
        """Least eigenvalue of the regressor's mean square over a swing, in parts of the mean one.

        The alpha_0 of (A8) for the scaled regressor, normalised: 1 if every direction is
        excited alike, 0 if one is not excited at all. NaN with ``errors=False``, unless
        `policies.ExcitationGate` is on: nobody follows it then.
        """
        if self._config[kernel.WHOLE] == 0.0:
            return np.nan
        n = self._n
        mean = self._state[kernel.EXCITATION : kernel.EXCITATION + n * n].reshape(n, n)
        total = float(np.trace(mean))
        return max(0.0, float(np.linalg.eigvalsh(mean)[0]) * n / total) if total > 0.0 else 0.0

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`; a fourth, ``offset_slope``, is alpha x_c - gamma u_c."""
        extra = ("offset_slope",) if isinstance(self._initial, ColemanHodgdon) else ("offset",)
        names = self._initial.parameter_names
        return (*names, *extra) if self._n > len(names) else names

    @property
    def theta(self) -> FloatArray:
        """Parameters as estimated, shape (n,), possibly outside the admissible set."""
        head = kernel.FRONT + law.HEAD
        return self._state[head : head + self._n] * self._scale

    @property
    def P(self) -> FloatArray:
        """Covariance of `theta` as the law sees it, shape (n, n)."""
        n, head = self._n, kernel.FRONT + law.HEAD
        P = self._state[head + n : head + n + n * n].reshape(n, n)
        return P * np.outer(self._scale, self._scale)

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviations of `theta`, shape (n,), for white noise in the displacement.

        Differencing and W_p colour that noise, so that P is not the covariance of `theta`:
        these follow the noise through the filters and the law (see
        `least_squares.propagate_error`), for parameters that are constant: the model's own
        mismatch is not in them. With the continuous time base, or ``errors=False``, they are those of `P`.
        """
        if self._config[kernel.ERRORS] == 0.0 or self._state[kernel.FRONT + law.UPDATES] == 0.0:
            return np.sqrt(np.fmax(np.diag(self.P), 0.0))
        n = self._n
        C = self._state[kernel.ERROR : kernel.ERROR + n * n].reshape(n, n)
        pole = self._config[kernel.LOW_POLE]
        if self._config[kernel.HYSTERETIC]:
            # The newest noise has not yet been taken back by its difference; its energy
            # behind W_p is (1 - pole)/(1 + pole).
            gain = self._state[kernel.GAIN : kernel.GAIN + n]
            energy = (1.0 - pole) / (1.0 + pole) * self._config[kernel.NOISE_RATIO] ** 2
            C = C + np.outer(gain, gain) * energy
        return np.sqrt(np.fmax(np.diag(C), 0.0)) * self._scale

    @property
    def y(self) -> float:
        """Last innovation: filtered change of displacement a sample, or displacement [µm]."""
        return float(self._state[kernel.FRONT + law.INNOVATION] / self._config[kernel.SCALE + 4])

    @property
    def S(self) -> float:
        """Variance of the last innovation as the law saw it [µm²]."""
        return float(
            self._state[kernel.FRONT + law.INNOVATION_VARIANCE] / self._config[kernel.SCALE + 4] ** 2
        )

    @property
    def K(self) -> FloatArray:
        """Gain that the present covariance gives the last regressor, shape (n,)."""
        phi = (
            self._state[kernel.PHI : kernel.PHI + self._n]
            / self._scale
            * (1.0 / self._config[kernel.SCALE + 4])
        )
        with np.errstate(all="ignore"):
            product = self.P @ phi
            gain = product / (phi @ product + (1.0 / self._config[kernel.SCALE + 4]) ** 2)
        # Where it overflows, the sample was not taken.
        return gain if np.all(np.isfinite(gain)) else np.zeros(self._n)

    @property
    def status(self) -> Status:
        """What happened to the samples so far."""
        head = self._state[kernel.FRONT :]
        last = ("waiting", "updated", "missing", "held", "rejected")[int(head[law.LAST])]
        return Status(
            samples=int(self._state[kernel.SAMPLES]),
            updates=int(head[law.UPDATES]),
            missing=int(self._state[kernel.MISSED]),
            held=int(head[law.HELD]),
            outliers=int(self._state[kernel.OUTLIERS]),
            resets=int(head[law.RESETS]),
            projected=not self._as_estimated_is_admissible(),
            last=last,
        )

    def _as_estimated_is_admissible(self) -> bool:
        theta = self.theta
        if isinstance(self._initial, LinearGain):
            gain = float(theta[0])
            return gain == admissible.kept_gain(gain, self._initial.gain, kernel.LEAST)
        return bool(rls_model.is_admissible(theta, self._terms))

    @property
    def model(self) -> Model:
        """Admissible model as known now: `theta` itself, or its nearest point in the metric of P."""
        values = np.zeros(4)
        rls_model.propose(self._state, self._config, self._terms, values)
        alpha, beta, gamma, offset = values.tolist()
        if isinstance(self._initial, LinearGain):
            return LinearGain(alpha, offset)
        return ColemanHodgdon(alpha, beta, gamma, offset)
