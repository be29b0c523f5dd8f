"""The paper's recursive least squares (App. A) for any regression z = theta . phi."""

from __future__ import annotations

import copy
from typing import Any, Literal, Self

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import FloatArray, array_1d, finite, integer, moderate, number_or_nan
from piezoest._jit import UNCOUNTED, OnDemand, compiled, specialised, unrolled
from piezoest.equations import least_squares as equations
from piezoest.policies import (
    CovarianceResetting,
    DeadZone,
    DirectionalForgetting,
    Forgetting,
    Normalisation,
    NormBound,
    Policy,
    VariableForgetting,
    forgetting_of,
    select,
)

TimeBase = Literal["discrete", "continuous"]

# Configuration of the law: positions in a flat array.
FORGETTING, NOISE, BOUND, CONTINUOUS, STEP, RATE, NORMALISED, FLOOR, DEAD_ZONE = range(9)
# Flag of directional forgetting; least factor of variable forgetting, 0 without it.
DIRECTIONAL, LEAST_FACTOR, CONFIG_SIZE = 9, 10, 11

# Head of the law's state; theta, P, P_0 and the work space follow.
INNOVATION, INNOVATION_VARIANCE, UPDATES, HELD, RESETS, LAST, HEAD = range(7)

# Values of LAST.
WAITING, UPDATED, MISSING, HOLDING, REJECTED = 0.0, 1.0, 2.0, 3.0, 4.0

# Positive: variable forgetting is on, and whoever knows the clock sets its least factor.
LEAST_BY_THE_CLOCK = 1e-300

# Least part of the past that a sample keeps: P is divided by it.
LEAST_KEPT = 1e-6

# Beyond this a number is no measurement, and its square could overflow.
LARGEST = 1e100
# A covariance beyond 1e60 counts as one that has wound up: no start is near it.
LARGEST_START = 1e50


@register_jitable
def state_size(n: int) -> int:
    """Numbers that the state of the law needs for n parameters."""
    return HEAD + n + 2 * n * n + n + 3 * (n + n * n)


def configure(
    policies: tuple[Policy, ...], step: float, time_base: str, noise: float, P_0: FloatArray
) -> FloatArray:
    """Flat configuration of the law from its policies."""
    if time_base not in ("discrete", "continuous"):
        raise ValueError(f"time_base must be 'discrete' or 'continuous', got {time_base!r}")
    chosen = forgetting_of(policies)
    forgetting, timed = Forgetting(), False
    if isinstance(chosen, Forgetting):
        forgetting = chosen
    elif isinstance(chosen, DirectionalForgetting | VariableForgetting) and chosen.unit == "second":
        forgetting, timed = Forgetting(chosen.memory), True
    bound = select(policies, NormBound)
    resetting = select(policies, CovarianceResetting)
    dead_zone = select(policies, DeadZone)
    if time_base == "continuous" and isinstance(chosen, DirectionalForgetting | VariableForgetting):
        raise ValueError(f"policies: {type(chosen).__name__} goes with the discrete time base")
    config = np.zeros(CONFIG_SIZE)
    config[FORGETTING] = max(forgetting.factor(step), LEAST_KEPT)
    config[NOISE] = noise
    config[BOUND] = bound.limit * np.trace(P_0) if isinstance(bound, NormBound) else np.inf
    config[CONTINUOUS] = time_base == "continuous"
    config[STEP] = step
    config[RATE] = 1.0 / forgetting.memory
    config[NORMALISED] = select(policies, Normalisation) is not None
    if isinstance(resetting, CovarianceResetting):
        config[FLOOR] = resetting.floor * np.linalg.eigvalsh(P_0)[0]
    config[DEAD_ZONE] = dead_zone.threshold if isinstance(dead_zone, DeadZone) else -1.0
    config[DIRECTIONAL] = isinstance(chosen, DirectionalForgetting)
    if isinstance(chosen, VariableForgetting):
        config[LEAST_FACTOR] = max(chosen.least_factor(step), LEAST_KEPT) if timed else LEAST_BY_THE_CLOCK
    return config


def new_state(theta: FloatArray, P_0: FloatArray) -> FloatArray:
    """State of the law at its start."""
    n = theta.size
    state = np.zeros(state_size(n))
    state[HEAD : HEAD + n] = theta
    state[HEAD + n : HEAD + n + n * n] = P_0.ravel()
    state[HEAD + n + n * n : HEAD + n + 2 * n * n] = P_0.ravel()
    return state


@unrolled
def varied(state: Any, phi: Any, z: Any, n: Any, R: Any, forgetting: Any, least: Any) -> Any:
    """Forgetting factor of this sample by variable forgetting."""
    y = z - equations.predicted_output(state[HEAD : HEAD + n], phi, n)
    work = state[HEAD + n + 2 * n * n :]
    quadratic = equations.covariance_times(state[HEAD + n : HEAD + n + n * n], phi, n, work)
    return equations.variable_forgetting(y, quadratic, R, forgetting, least)


@unrolled
def _informs(state: Any, config: Any, phi: Any, n: Any) -> Any:
    """Whether the regressor is outside the dead zone; counts where it is not."""
    P_0 = state[HEAD + n + n * n : HEAD + n + 2 * n * n]
    information = 0.0
    for i in range(n):
        information += phi[i] * phi[i] * P_0[i * n + i]
    if information > config[DEAD_ZONE] * config[NOISE]:
        return True
    state[LAST] = HOLDING
    state[HELD] += 1.0
    return False


@unrolled
def _note(state: Any, y: Any, S: Any) -> None:
    """Keep the innovation and its variance, and count the update."""
    state[INNOVATION] = y
    state[INNOVATION_VARIANCE] = S
    state[UPDATES] += 1.0
    state[LAST] = UPDATED


@unrolled
def _restart(state: Any, n: Any) -> None:
    """Let P start anew."""
    P = state[HEAD + n : HEAD + n + n * n]
    equations.restore_covariance(P, state[HEAD + n + n * n : HEAD + n + 2 * n * n], n)
    state[RESETS] += 1.0


@unrolled
def _settle(state: Any, n: Any, taken: Any, y: Any, S: Any) -> None:
    """Count a sample: an update, or one that was not safe; then theta stays and P starts anew."""
    if taken:
        _note(state, y, S)
    else:
        state[LAST] = HOLDING
        state[HELD] += 1.0
        _restart(state, n)


@unrolled
def _views(state: Any, n: Any) -> Any:
    """Theta, P, work space."""
    i = HEAD + n
    return state[HEAD:i], state[i : i + n * n], state[i + 2 * n * n :]


@unrolled
def _discretely(state: Any, config: Any, phi: Any, z: Any, n: Any, R: Any, forgetting: Any) -> None:
    theta, P, work = _views(state, n)
    y, quadratic = equations.innovation(theta, P, phi, z, n, work)
    taken = equations.is_safe(P, n, y, quadratic + forgetting * R, work)
    S = R
    if taken:
        S = equations.discrete_correction(theta, P, n, y, quadratic, forgetting, R, config[BOUND], 1.0, work)
    _settle(state, n, taken, y, S)


@unrolled
def _continuously(state: Any, config: Any, phi: Any, z: Any, n: Any) -> None:
    theta, P, work = _views(state, n)
    h = config[STEP]
    y, S = equations.continuous_step(theta, P, phi, z, n, h, config[RATE], config[NORMALISED], work)
    taken = equations.continuous_is_safe(P, phi, n, y, S, h, work)
    if taken:
        equations.continuous_correction(theta, P, n, h, config[BOUND], 1.0, work)
    _settle(state, n, taken, y, S)


@unrolled
def _by_direction(state: Any, config: Any, phi: Any, z: Any, n: Any, R: Any, forgetting: Any) -> None:
    theta, P, work = _views(state, n)
    y, q = equations.innovation(theta, P, phi, z, n, work)
    taken = equations.is_safe(P, n, y, q + R, work)
    if taken:
        equations.directional_correction(theta, P, n, y, q, forgetting, R, config[BOUND], 1.0, work)
    _settle(state, n, taken, y, q + R)


@unrolled
def adapt_on_trial(state: Any, config: Any, phi: Any, z: Any, n: Any, R: Any, forgetting: Any) -> None:
    """As `adapt_discretely`, but what is not safe is taken too, and counted by RESETS.

    Whoever calls this looks at that count later, and takes those samples again by the other one.
    """
    if _informs(state, config, phi, n):
        theta, P, work = _views(state, n)
        y, quadratic = equations.innovation(theta, P, phi, z, n, work)
        state[RESETS] += not equations.is_safe(P, n, y, quadratic + forgetting * R, work)
        S = equations.discrete_correction(theta, P, n, y, quadratic, forgetting, R, config[BOUND], 1.0, work)
        _note(state, y, S)


@unrolled
def adapt_discretely(state: Any, config: Any, phi: Any, z: Any, n: Any, R: Any, forgetting: Any) -> None:
    """One sample of the ordinary law: gate, update with noise variance R."""
    if _informs(state, config, phi, n):
        _discretely(state, config, phi, z, n, R, forgetting)


@unrolled
def adapt(state: Any, config: Any, phi: Any, z: Any, n: Any, R: Any, forgetting: Any) -> None:
    """One sample of the law as configured: gate, resetting, update with noise variance R."""
    if not _informs(state, config, phi, n):
        return
    _, P, work = _views(state, n)
    if config[FLOOR] > 0.0 and equations.above_floor(P, n, config[FLOOR], work) == 0.0:
        _restart(state, n)
    if config[CONTINUOUS] != 0.0:
        _continuously(state, config, phi, z, n)
    elif config[DIRECTIONAL] != 0.0:
        _by_direction(state, config, phi, z, n, R, forgetting)
    else:
        _discretely(state, config, phi, z, n, R, forgetting)


@compiled(**UNCOUNTED)
def _update(state: Any, config: Any, phi: Any, z: float, n: int) -> None:
    within = np.abs(z) < LARGEST
    for i in range(n):
        within = within and np.abs(phi[i]) < LARGEST
    if not within:
        state[LAST] = MISSING
        return
    forgetting = config[FORGETTING]
    if config[LEAST_FACTOR] > 0.0:
        forgetting = varied(state, phi, z, n, config[NOISE], forgetting, config[LEAST_FACTOR])
    adapt(state, config, phi, z, n, config[NOISE], forgetting)


@OnDemand
def _updates() -> Any:
    """``_updates[()]``: `_update`, compiled when it is first called, for few need it by itself."""
    return specialised(_update, "void(f8[::1], f8[::1], f8[::1], f8, i8)")


# What any regression can do.
_OWN = (
    Forgetting,
    DirectionalForgetting,
    VariableForgetting,
    NormBound,
    Normalisation,
    CovarianceResetting,
    DeadZone,
)


class RecursiveLeastSquares:
    """Recursive least squares with forgetting for any regression z = theta . phi (App. A).

    Parameters
    ----------
    n : int
        Number of parameters.
    theta : array_like, shape (n,), optional
        Parameters to start from (default zeros).
    P : array_like, shape (n, n) or (n,), or float, optional
        Initial covariance Q0^-1: matrix, diagonal, or one variance for all (default 1e6).
    noise_variance : float
        Variance R of the noise in z, in its unit squared (discrete law only; the paper's
        law has 1).
    time_base : {"discrete", "continuous"}
        ``"discrete"``: time in samples; one exact update a sample, the ordinary recursive
        least squares. ``"continuous"``: the differential equations (A5)-(A7) integrated by
        Bogacki-Shampine with `step`; with the step in seconds its normalised gain works
        per second, as in the paper.
    step : float
        Time between samples, in the unit of `Forgetting.memory`: 1 for samples (default),
        ``1 / sample_rate`` for seconds.
    policies : tuple of policies
        Any of `Forgetting`, `DirectionalForgetting` and `VariableForgetting` (at most one of
        the three; its "second" is the unit of `step`), `NormBound`, `Normalisation`, `CovarianceResetting`,
        `DeadZone`, at most one of each. Default: none of them but `Normalisation`.

    Raises
    ------
    ValueError
        If a shape, a value or a combination of policies is wrong, or P is not symmetric
        positive definite.

    Notes
    -----
    Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), App. A.
    """

    __slots__ = ("_config", "_n", "_state")

    def __init__(
        self,
        n: int,
        *,
        theta: Any = None,
        P: Any = 1e6,
        noise_variance: float = 1.0,
        time_base: TimeBase = "discrete",
        step: float = 1.0,
        policies: tuple[Policy, ...] = (Normalisation(),),
    ) -> None:
        self._n = integer("n", n, 1)
        start = np.zeros(self._n) if theta is None else array_1d("theta", theta)
        if start.size != self._n:
            raise ValueError(f"theta must have shape ({self._n},), got {start.shape}")
        P_0 = covariance_matrix("P", P, self._n)
        noise_variance = moderate("noise_variance", noise_variance)
        if time_base == "continuous" and noise_variance != 1.0:
            raise ValueError("noise_variance must be 1 in the continuous law: scale z and phi instead")
        self._config = configure(tuple(policies), moderate("step", step), time_base, noise_variance, P_0)
        for policy in policies:
            if not isinstance(policy, _OWN) or getattr(policy, "unit", "second") != "second":
                raise ValueError(f"policies: {policy!r} needs a voltage's clock: see HysteresisRLS")
        self._state = new_state(start, P_0)

    def update(self, z: float, phi: Any) -> None:
        """Take one sample.

        Parameters
        ----------
        z : float
            Output. A sample in which z or phi is NaN, infinite, beyond 1e100 or no number is skipped.
        phi : array_like, shape (n,)
            Regressor.

        Raises
        ------
        ValueError
            If phi has another shape.
        """
        phi = array_1d("phi", phi, allow_nan=True)
        if phi.size != self._n:
            raise ValueError(f"phi must have shape ({self._n},), got {phi.shape}")
        if type(z) is not float:
            z = number_or_nan(z)
        _updates[()](self._state, self._config, phi, z, self._n)

    def reset_covariance(self) -> None:
        """Put P back to its initial value (covariance resetting on call)."""
        n = self._n
        self._state[HEAD + n : HEAD + n + n * n] = self._state[HEAD + n + n * n : HEAD + n + 2 * n * n]
        self._state[RESETS] += 1.0

    def __copy__(self) -> Self:
        return copy.deepcopy(self)

    @property
    def theta(self) -> FloatArray:
        """Parameters, shape (n,)."""
        return self._state[HEAD : HEAD + self._n].copy()

    @property
    def P(self) -> FloatArray:
        """Covariance, shape (n, n)."""
        n = self._n
        return self._state[HEAD + n : HEAD + n + n * n].reshape(n, n).copy()

    @property
    def y(self) -> float:
        """Last innovation z - theta . phi, before the update."""
        return float(self._state[INNOVATION])

    @property
    def S(self) -> float:
        """Variance of the last innovation as the law saw it."""
        return float(self._state[INNOVATION_VARIANCE])

    @property
    def resets(self) -> int:
        """How often the covariance was reset."""
        return int(self._state[RESETS])


def covariance_matrix(name: str, value: Any, n: int) -> FloatArray:
    """Return a covariance as a symmetric positive definite (n, n) array.

    `value` may be the matrix, its diagonal or one variance for all.
    """
    matrix = np.asarray(value, dtype=np.float64)
    if matrix.ndim == 0:
        matrix = finite(name, value) * np.eye(n)
    elif matrix.ndim == 1:
        matrix = np.diag(array_1d(name, matrix))
    if matrix.shape != (n, n):
        raise ValueError(f"{name} must have shape ({n}, {n}), got {matrix.shape}")
    if not np.all(np.isfinite(matrix)) or not np.array_equal(matrix, matrix.T):
        raise ValueError(f"{name} must be finite and symmetric: pass (P + P.T) / 2")
    if np.trace(matrix) > LARGEST_START:
        raise ValueError(f"{name} must have a trace of at most {LARGEST_START:g}, got {np.trace(matrix):g}")
    if np.linalg.eigvalsh(matrix)[0] <= 0.0:
        raise ValueError(f"{name} must be positive definite: its smallest eigenvalue is not above zero")
    return np.ascontiguousarray(matrix)
