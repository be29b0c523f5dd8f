"""The mass-spring-damper of the stage, (5)-(6): x'' + 2 zeta omega x' + omega² x = omega² f.

f is the displacement that the stage would take if it had no inertia [µm], so the static
gain is one. Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012).
"""

import cmath
import math

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray


def mechanics_coefficients(natural_frequency: float, damping_ratio: float, dt: float) -> NDArray[np.float64]:
    """Exact discretisation over `dt` [s] of (5) for f held: (a11, a12, a21, a22, b1, b2).

    `natural_frequency` is omega/(2 pi) [Hz], `damping_ratio` zeta, zero or more. The step is
    x <- a11 x + a12 v + b1 f, v <- a21 x + a22 v + b2 f, with v in µm/s.
    """
    omega = 2.0 * math.pi * natural_frequency
    # exp(A dt) = e^(-zeta omega dt) (cosh(q) I + sinh(q)/q (A + zeta omega I) dt), where q
    # is imaginary below critical damping: complex arithmetic covers both sides.
    q = cmath.sqrt(complex(damping_ratio**2 - 1.0)) * omega * dt
    envelope = cmath.exp(-damping_ratio * omega * dt)
    even = (envelope * cmath.cosh(q)).real
    odd = (envelope * (cmath.sinh(q) / q if abs(q) > 1e-6 else 1.0 + q * q / 6.0)).real * dt
    a11 = even + damping_ratio * omega * odd
    a12 = odd
    a21 = -(omega**2) * odd
    a22 = even - damping_ratio * omega * odd
    return np.array([a11, a12, a21, a22, 1.0 - a11, -a21])


@register_jitable
def mechanics_step(state, f, coefficients):
    """x after one sample with f held; `state` = (x [µm], v [µm/s]) is updated in place."""
    x = coefficients[0] * state[0] + coefficients[1] * state[1] + coefficients[4] * f
    v = coefficients[2] * state[0] + coefficients[3] * state[1] + coefficients[5] * f
    state[0] = x
    state[1] = v
    return x
