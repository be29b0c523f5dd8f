"""A second-order lead: the inverse of mechanics and delay, to second order in the frequency.

What follows the inverse of the hysteresis is G(s) = omega² e^(-s delay) / (s² + 2 zeta omega s +
omega²), the voltage being held over each sample. 1/G is improper; its series up to s² is

    1 + c1 s + c2 s²,  c1 = 2 zeta/omega + lag,  c2 = 1/omega² + 2 zeta/omega lag + lag²/2,

with lag = delay - dt/2: a reading at the end of a held sample is half a sample ahead of the hold's
middle. s becomes a difference smoothed by one pole, and c2 takes up what the smoothing itself
delays, so that the series stays right up to s²: the phase needs no preview.
Source: S. Devasia, E. Eleftheriou, S. O. R. Moheimani, A survey of control issues in nanopositioning,
IEEE Trans. Control Syst. Technol. 15 (2007) 802-823, sec. IV (model-based feed-forward).
"""

import math

from numba.extending import register_jitable

from piezoest.layout import FIXED, FLAG, NUMBER, record

# Last r, its two smoothed derivatives, whether there was a sample before.
STATE = record(r=NUMBER, first=NUMBER, second=NUMBER, started=FLAG)
# Pole and gain of a difference [1], [1/s]; of r' [s] and r'' [s²].
SETTINGS = record(pole=FIXED, gain=FIXED, c1=FIXED, c2=FIXED)


def lead_coefficients(
    natural_frequency: float, damping_ratio: float, delay: float, smoothing: float, dt: float
) -> dict[str, float]:
    """Settings of `lead_step`: pole, gain of a difference [1/s], c1 [s], c2 [s²].

    omega/(2 pi) [Hz], zeta, delay [s], time constant of the smoothed difference [s], length of a sample [s].
    """
    omega = 2.0 * math.pi * natural_frequency
    lag, damped = delay - 0.5 * dt, 2.0 * damping_ratio / omega
    pole = math.exp(-dt / smoothing)
    smoothed = dt * (0.5 + pole / (1.0 - pole))
    c1 = damped + lag
    c2 = 1.0 / omega**2 + damped * lag + 0.5 * lag**2
    return {"pole": pole, "gain": (1.0 - pole) / dt, "c1": c1, "c2": c2 + c1 * smoothed}


@register_jitable
def lead_step(state, r, settings):
    """r + c1 r' + c2 r'' of the next sample; `state` follows."""
    before = state.first
    state.first = settings.pole * before + settings.gain * (r - state.r)
    state.second = settings.pole * state.second + settings.gain * (state.first - before)
    state.r = r
    return r + settings.c1 * state.first + settings.c2 * state.second
