"""Keep the estimate itself admissible."""

from dataclasses import dataclass
from typing import Any

from numba.extending import register_jitable

from piezoest._checks import fraction, positive
from piezoest.compile import inlined, like
from piezoest.equations import admissible
from piezoest.policies.base import Policy

# Least alpha and beta, relative to their initial values.
LEAST = 1e-2


@dataclass(frozen=True, slots=True)
class Projection(Policy):
    """Keep theta itself in the admissible set: after each update the nearest point in the metric of P.

    Without it theta is not restricted, and only `model` is projected.

    P. Ioannou, J. Sun, Robust Adaptive Control (1996), sec. 4.4; G. Goodwin, K. Sin, Adaptive Filtering,
    Prediction and Control (1984), sec. 3.7; D. Simon, IET Control Theory Appl. 4 (2010) 1303-1318.

    Parameters
    ----------
    margin : float
        Distance from the limits of alpha beta < gamma <= 2 alpha beta, relative to alpha beta.

    Raises
    ------
    ValueError
        If margin is not within (0, 0.4].
    """

    needs_swings = needs_discrete = needs_loop = True

    margin: float = 0.01

    def __post_init__(self) -> None:
        positive("margin", fraction("margin", self.margin, 0.0, 0.4))


@register_jitable
def _project(theta: Any, P: Any, scale: Any, unit: Any, margin: Any) -> None:
    """Move the scaled theta to the nearest admissible point in the metric of P."""
    n = len(theta)
    alpha_least = LEAST * scale[0] / unit
    beta_least = LEAST * scale[1] / unit
    values, covariance = like(theta), like(P)
    for i in range(n):
        values[i] = theta[i] * scale[i] / unit
    if admissible.is_admissible(values[0], values[1], values[2], alpha_least, beta_least, margin) != 0.0:
        return
    for i in range(n):
        for j in range(n):
            covariance[i, j] = P[i, j] * (scale[i] / unit) * (scale[j] / unit)
    if admissible.project_admissible(values, covariance, alpha_least, beta_least, margin):
        for i in range(n):
            theta[i] = values[i] * unit / scale[i]


@inlined
def after_update(own: Any, fixed: Any, state: Any, settings: Any) -> None:
    """Project theta."""
    _project(state.law.theta, state.law.P, settings.scale, settings.output_scale, fixed.margin)
