"""Outcome of `BatchFit`."""

from dataclasses import dataclass

from piezoest.fitting.outcome import Outcome
from piezoest.models import Creep, FreeRunning


@dataclass(frozen=True, slots=True, eq=False)
class BatchFitResult(Outcome):
    """Outcome of an output-error fit.

    Parameters
    ----------
    parameter_names : tuple of str
        Names of the entries of `theta`: alpha, beta, gamma (or gain), offset, initial_state,
        creep_gains[0], …
    theta : ndarray, shape (n,)
        All parameters, held ones too: alpha [1/V], beta [µm/V], gamma [µm/V²], offset and state [µm], gains
        of creep [1], as far as they are fitted.
    P : ndarray, shape (n, n)
        Covariance of `theta` from the information matrix; zero for parameters that were held or
        ended at a bound, very large if the record does not tell the parameters apart.
    at_bound : tuple of str
        Coordinates that ended at the edge of the admissible set; ``"ratio"`` is gamma/(alpha beta),
        between 1 and 2.
    noise : float
        Standard deviation of the residual [µm], corrected for the number of parameters.
    residual : ndarray, shape (N,)
        Measured less simulated displacement [µm]; NaN where a sample is missing.
    last_covariance : ndarray, shape (n,)
        Covariance of `theta` with the model's displacement at the last measured sample.
    last_variance : float
        Variance of that displacement [µm²].
    model : FreeRunning
        The admissible model that misses the record least.
    creep : Creep or None
        Creep with the fitted gains.
    success : bool
        Whether the solver converged. If not, the parameters are the best that it found.
    message : str
        The solver's own words.
    evaluations : int
        Passes over the record that the solver took.
    seconds : float
        Time that the fit took [s].
    method : str
        ``"single-shooting"`` or ``"multiple-shooting"``.
    """

    model: FreeRunning
    creep: Creep | None
    success: bool
    message: str
    evaluations: int
    seconds: float
    method: str

    @property
    def initial_state(self) -> float:
        """w_h at the first sample [µm]; 0 for a linear gain."""
        name = "initial_state"
        return float(self.theta[self.parameter_names.index(name)]) if name in self.parameter_names else 0.0
