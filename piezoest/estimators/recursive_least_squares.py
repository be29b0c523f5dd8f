"""The paper's recursive least squares (App. A) for any regression z = theta . phi."""

from typing import Any, Literal

import numpy as np

from piezoest._checks import FloatArray, array_1d, as_floats, finite, integer, moderate, number_or_nan
from piezoest.estimators import recursive_least_squares_kernel as kernel
from piezoest.layout import Copied, new, record
from piezoest.policies import Normalisation, Policy, check_policies
from piezoest.policies.base import Conditions, layouts

TimeBase = Literal["discrete", "continuous"]

# A covariance beyond 1e60 counts as one that has wound up: no start is near it.
LARGEST_START = 1e50


class RecursiveLeastSquares(Copied):
    """Recursive least squares with forgetting for any regression z = theta^T phi (appendix A).

    Parameters
    ----------
    n : int
        Number of parameters.
    theta : array_like, shape (n,), optional
        Parameters to start from (default zeros).
    P : array_like, shape (n, n) or (n,), or float, optional
        Initial covariance Q0^-1: matrix, diagonal, or one variance for all (default 1e6).
    noise_variance : float
        Variance R of the noise in z, in its unit squared (discrete law only; the paper's law has 1).
    time_base : {"discrete", "continuous"}
        ``"discrete"``: time in samples; one exact update a sample, the ordinary recursive least squares.
        ``"continuous"``: the differential equations (A5)-(A7) integrated by Bogacki-Shampine with `step`;
        with the step in seconds its normalised gain works per second, as in the paper.
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
        If a shape, a value or a combination of policies is wrong, or P is not symmetric positive definite.

    Notes
    -----
    Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), App. A.

    Examples
    --------
    >>> import piezoest as pz
    >>> law = pz.RecursiveLeastSquares(2)
    >>> for z, phi in ((1.0, [1.0, 0.0]), (3.0, [1.0, 1.0])):
    ...     law.update(z, phi)
    >>> law.theta.round(3)
    array([1., 2.])
    """

    __slots__ = ("_layouts", "_settings", "_state")

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
        n = integer("n", n, 1)
        start = np.zeros(n) if theta is None else array_1d("theta", theta)
        if start.size != n:
            raise ValueError(f"theta must have shape ({n},), got {start.shape}")
        P_0 = covariance_matrix("P", P, n)
        noise_variance = moderate("noise_variance", noise_variance)
        discrete = is_discrete(time_base)
        if not discrete and noise_variance != 1.0:
            raise ValueError("noise_variance must be 1 in the continuous law: scale z and phi instead")
        at = Conditions(moderate("step", step), P_0, discrete=discrete)
        policies = check_policies(policies, at)
        kept, given, values = layouts(policies, at)
        layout = kernel.layout(n, kept, discrete=discrete)
        settings_layout = record(law=kernel.law_settings_layout(n), policies=given)
        self._settings = new(
            settings_layout, law=kernel.law_settings(policies, at, noise_variance), policies=values
        )
        self._state = new(layout, law={"theta": start, "P": P_0})
        self._layouts = (layout, settings_layout)

    def __repr__(self) -> str:
        """Class and parameters."""
        theta = np.array2string(self.theta, precision=4, separator=", ", threshold=6, edgeitems=2)
        return f"<{type(self).__name__}: theta {theta}>"

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
        own = self._state["phi"]
        if phi.size != own.size:
            raise ValueError(f"phi must have shape {own.shape}, got {phi.shape}")
        if type(z) is not float:
            z = number_or_nan(z)
        own[:] = phi
        kernel.update.of(*self._layouts)(self._state, self._settings, z)

    @property
    def theta(self) -> FloatArray:
        """Parameters, shape (n,)."""
        return np.array(self._state["law"]["theta"])

    @property
    def P(self) -> FloatArray:
        """Covariance, shape (n, n)."""
        return np.array(self._state["law"]["P"])

    @property
    def y(self) -> float:
        """Last innovation z - theta . phi, before the update."""
        return float(self._state["law"]["innovation"])

    @property
    def S(self) -> float:
        """Variance of the last innovation as the law saw it."""
        return float(self._state["law"]["innovation_variance"])

    @property
    def resets(self) -> int:
        """How often the covariance was reset."""
        return int(self._state["law"]["resets"])


def is_discrete(time_base: TimeBase) -> bool:
    """Whether a time base is the discrete one."""
    if time_base not in ("discrete", "continuous"):
        raise ValueError(f"time_base must be 'discrete' or 'continuous', got {time_base!r}")
    return time_base == "discrete"


def covariance_matrix(name: str, value: Any, n: int) -> FloatArray:
    """Return a matrix, its diagonal or one variance as a symmetric positive definite (n, n) array."""
    matrix = as_floats(name, value)
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
