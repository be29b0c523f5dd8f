"""The paper's estimator: recursive least squares on the derivative form, from raw (u, x)."""

from typing import Any, ClassVar, Literal

import numpy as np

from piezoest._checks import FloatArray, moderate, non_negative
from piezoest.equations import admissible
from piezoest.estimators import derivative_form as form
from piezoest.estimators import recursive_least_squares_kernel as law
from piezoest.estimators import rls_kernel
from piezoest.estimators.compiled import IN_LAW, Freezable
from piezoest.estimators.delay_line import delay_line
from piezoest.estimators.recursive_least_squares import TimeBase, is_discrete
from piezoest.models import AmplitudeProfile, ColemanHodgdon, LinearGain
from piezoest.policies import Forgetting, amplitude_memory, check_policies, default_policies, policy_to_dict
from piezoest.policies.base import Conditions, Policy, layouts

# Seconds of memory where the paper's law is asked for without one.
PAPER_MEMORY = 0.4
# Relative to the sample rate: below it nothing comes through the low-pass.
LEAST_CUTOFF = 1e-9
# The offset's scale: a centre that is off by so many volts.
OFFSET_VOLTS = 10.0


class HysteresisRLS(Freezable):
    """The paper's estimator: recursive least squares on the derivative form of a model.

    It takes voltage and displacement. For the Coleman-Hodgdon model it regresses z = dx/dt on the
    regressor (20); for the linear gain it regresses z = x on u (12). Both sides pass the same
    low-pass filter W_p. The adaptation law is that of App. A.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : ColemanHodgdon or LinearGain, optional
        Initial model; a model of the same kind is estimated. Default
        ``ColemanHodgdon(0.02, 0.12, 0.0036)``, a common stack actuator.
    memory : float, None or "period"
        ``"period"`` (default): the memory is counted in periods of the reference, see
        `policies.RandomWalk` and, for a `LinearGain`, `policies.PeriodicForgetting`. A number:
        time constant of exponential forgetting [s], as in the paper. None: no forgetting. With
        the continuous time base ``"period"`` means 0.4 s.
    uncertainty : float
        Standard deviation of each initial parameter, relative to its value.
    noise : float
        Standard deviation of the displacement's noise [µm]; it weighs the initial model against the data.
    cutoff : float
        Cut-off frequency of W_p [Hz], at least 1e-9 of the sample rate; more than half of it counts as half.
    high_pass : float, optional
        Cut-off frequency of a first-order high-pass filter on both sides [Hz], for a biased sensor (last
        remark of App. A); below the reference's lowest frequency. It removes constants only. A bias enters as
        |du/dt|, so `offset` is better unless the reference is a sharp triangle.
    offset : bool, optional
        Also estimate the centre of the loop, with |du/dt| as an additional regressor. A biased
        sensor or a unipolar voltage then needs no high-pass, and the offset that a larger loop has left is
        removed. Default: true with ``memory="period"``, except for a `LinearGain`; else false.
    delay : float
        Samples by which the measured displacement lags the voltage, up to a million; may be fractional.
    time_base : {"discrete", "continuous"}
        Time base of the law, see `RecursiveLeastSquares`; ``"continuous"`` is the paper's, in seconds.
    errors : bool
        Compute the covariance of the estimate's error, for `standard_errors`, and the mean square of the
        regressor, for `excitation`. This costs about as much as the law itself: :doc:`/performance`.
    policies : tuple of policies, optional
        They replace the defaults: to add one, write all. Default with ``memory="period"``: ``(RandomWalk(),
        DeadZone(), OutlierRejection())``, of which the first is the memory itself, or
        ``(PeriodicForgetting(), DeadZone())`` for a `LinearGain`. Else ``(NormBound(), DeadZone(),
        Normalisation())``, which is the paper's law with a dead zone; a number for `memory` always forgets.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Inside, parameters are relative to their initial value and the output relative to its
    noise, so that the covariance is well scaled. The regressor is integrated over each
    sample, which keeps the form exact to third order in the change of voltage.

    If a step of the voltage's converter is larger than what the voltage moves in a sample, a resonance
    answers it over several samples, which this form takes for a wrong loop. Then pass every tenth sample,
    with a tenth of the sample rate, or use `OutputErrorRLS` or `PrandtlIshlinskiiRLS`.

    Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), sec. III B and App. A.

    Examples
    --------
    >>> import piezoest as pz
    >>> fs = 10_000.0
    >>> u = pz.signals.triangle(amplitude=33.0, frequency=5.0, periods=5, sample_rate=fs).values
    >>> x = pz.PaperStage(fs, seed=0).run(u)
    >>> estimator = pz.HysteresisRLS(fs)
    >>> for u_k, x_k in zip(u, x, strict=True):
    ...     estimator.step(u_k, x_k)
    >>> compensator = pz.InverseCompensator(estimator.model)
    >>> estimator.status.last
    'updated'
    """

    __slots__ = ("_followed", "_scale")

    kernel: ClassVar[Any] = rls_kernel
    _places = IN_LAW
    unneeded: ClassVar[tuple[Any, ...]] = (rls_kernel.propagate_error,)

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
        time_base: TimeBase = "discrete",
        errors: bool = True,
        policies: tuple[Policy, ...] | None = None,
    ) -> None:
        sample_rate = moderate("sample_rate", sample_rate)
        initial = self._start_from(initial_model, ColemanHodgdon, LinearGain, admissible=False)
        if np.any(initial.theta == 0.0):
            raise ValueError(f"initial_model must have no parameter at zero, got {initial}")
        if isinstance(memory, str) and memory != "period":
            raise ValueError(f'memory must be "period", a number of seconds or None, got {memory!r}')
        if memory is not None and memory != "period":
            memory = moderate("memory", memory)
        if not isinstance(offset, bool | None):
            raise ValueError(f"offset must be True, False or None, got {offset!r}")
        discrete = is_discrete(time_base)
        if not discrete and memory == "period":
            memory = PAPER_MEMORY
        has_loop = isinstance(initial, ColemanHodgdon)
        if policies is None:
            policies = default_policies(memory, has_loop)
        if offset is None:
            offset = memory == "period" and has_loop
        cutoff = min(moderate("cutoff", cutoff), 0.5 * sample_rate)
        if cutoff < LEAST_CUTOFF * sample_rate:
            raise ValueError(
                f"cutoff must be at least {LEAST_CUTOFF:g} of the sample rate, got {cutoff:g} Hz"
            )
        self._arguments = {
            "sample_rate": sample_rate,
            "initial_model": initial.to_dict(),
            "memory": memory,
            "uncertainty": float(moderate("uncertainty", uncertainty)),
            "noise": float(moderate("noise", noise)),
            "cutoff": cutoff,
            "high_pass": None if high_pass is None else float(moderate("high_pass", high_pass)),
            "offset": bool(offset),
            "delay": non_negative("delay", delay),
            "time_base": time_base,
            "errors": bool(errors),
        }
        scale = np.abs(initial.theta)
        self._scale = np.append(scale, OFFSET_VOLTS * scale[-1]) if offset else scale
        P_0 = np.diag(np.full(self._scale.size, uncertainty**2))
        at = Conditions(
            1.0 / sample_rate,
            P_0,
            discrete,
            discrete and memory == "period",
            has_swings=True,
            has_loop=has_loop,
        )
        stated = (Forgetting(memory),) if isinstance(memory, float) else ()
        policies = check_policies((*stated, *check_policies(policies, at)), at)
        self._arguments["policies"] = [policy_to_dict(policy) for policy in policies[len(stated) :]]
        self._lay_out(policies, at)

    def _lay_out(self, policies: tuple[Policy, ...], at: Conditions) -> None:
        """Lay out state and settings for what the arguments ask for."""
        n, options = self._scale.size, self._arguments
        self._followed = form.followed(options, policies, at)
        kept, given, values = layouts(policies, at)
        high_pass = options["high_pass"] is not None
        self._configure(
            rls_kernel.settings_layout(n, has_loop=at.has_loop, high_pass=high_pass, policies=given),
            {
                **form.settings(self._initial, self._scale, options, at),
                "law": law.law_settings(policies, at, 1.0),
                "policies": values,
            },
        )
        line, empty = delay_line(options["delay"])
        start = np.append(np.sign(self._initial.theta), np.zeros(int(options["offset"])))
        law_layout = law.law_layout(n, discrete=at.discrete)
        self._begin(
            options,
            rls_kernel.layout(n, self._followed, law_layout, kept, line),
            {"law": {"theta": start, "P": at.P_0}, "line": empty},
        )

    def _shown(self, name: str, values: FloatArray, rows: FloatArray) -> Any:
        if name == "P":
            return values * np.outer(self._scale, self._scale)
        unit = float(self._settings["output_scale"])
        return values / (unit if name == "y" else unit**2)

    @property
    def profile(self) -> AmplitudeProfile:
        """What was learnt at each swing of the voltage, with `policies.AmplitudeMemory`; it can be set.

        The parameters depend on the amplitude. With a saved profile the next start need not learn them again.
        """
        return amplitude_memory.profile_of(self._state["policies"]["amplitude_memory"], self._scale)

    @profile.setter
    def profile(self, profile: AmplitudeProfile) -> None:
        own = self._state["policies"]["amplitude_memory"]
        amplitude_memory.store_profile(own, self._scale, profile)

    @property
    def excitation(self) -> float:
        """Smallest eigenvalue of the regressor's mean square over a swing, relative to the mean eigenvalue.

        This is alpha_0 of (A8) for the scaled regressor, normalised: 1 if all directions are equally excited,
        0 if one is not excited. NaN with ``errors=False``, unless `policies.ExcitationGate` is on.
        """
        if "products" not in self._followed:
            return np.nan
        mean = self._state["excitation"]["products"]
        total = float(np.trace(mean))
        return max(0.0, float(np.linalg.eigvalsh(mean)[0]) * len(mean) / total) if total > 0.0 else 0.0

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`; a fourth, ``offset_slope``, is alpha x_c - gamma u_c."""
        last = ("offset_slope",) if isinstance(self._initial, ColemanHodgdon) else ("offset",)
        names = self._initial.parameter_names
        return (*names, *last) if self._scale.size > len(names) else names

    @property
    def _row(self) -> FloatArray:
        return np.asarray(self._state["law"]["theta"] * self._scale)

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviations of `theta`, shape (n,), for white noise in the displacement.

        Differentiation and W_p colour that noise, so P is not the covariance of `theta`. The standard
        errors follow the noise through the filters and the law (see `least_squares.propagate_error`). They
        hold for constant parameters and do not contain errors of the model. With the continuous time
        base, or ``errors=False``, they are those of `P`.
        """
        if "errors" not in self._followed or self._state["law"]["updates"] == 0.0:
            return super().standard_errors
        C = self._state["error_covariance"]
        pole = float(self._settings["low_pole"])
        if self._settings["differenced"]:
            # The newest noise has not yet been taken back by its difference; its energy
            # behind W_p is (1 - pole)/(1 + pole).
            gain = self._state["error_gain"]
            energy = (1.0 - pole) / (1.0 + pole) * float(self._settings["noise_ratio"]) ** 2
            C = C + np.outer(gain, gain) * energy
        return np.sqrt(np.fmax(np.diag(C), 0.0)) * self._scale

    @property
    def K(self) -> FloatArray:
        """Gain that the present covariance gives the last regressor, shape (n,)."""
        unit = 1.0 / float(self._settings["output_scale"])
        phi = self._state["phi"] / self._scale * unit
        with np.errstate(all="ignore"):
            product = self.P @ phi
            gain = product / (phi @ product + unit**2)
        # Where it overflows, the sample moved nothing.
        return gain if np.all(np.isfinite(gain)) else np.zeros(phi.size)

    def _is_projected(self) -> bool:
        theta = self.theta
        if isinstance(self._initial, LinearGain):
            gain = float(theta[0])
            return gain != admissible.kept_gain(gain, self._initial.gain, rls_kernel.LEAST)
        return not rls_kernel.is_admissible(theta, self._scale)
