"""Creep: slow first-order terms that add up to the logarithmic drift after a step.

Source: K. Kuhnen, P. Krejci, Compensation of complex hysteresis and creep effects in
piezoelectrically actuated systems, IEEE Trans. Autom. Control 54 (2009) 537-550; time
constants a decade apart give x proportional to log t between the shortest and the longest.
"""

from numba.extending import register_jitable

from piezoest.compile import inlined


@register_jitable
def creep_step(z, w, gains, decays):
    """x_creep = sum_i z[i] after one sample of tau_i z_i' = gains[i] w - z_i.

    Exact for w held over the sample, decays[i] = exp(-dt/tau_i); `z` (n,) [µm] is updated
    in place.
    """
    x = 0.0
    for i in range(len(z)):
        z[i] = z[i] + (1.0 - decays[i]) * (gains[i] * w - z[i])
        x = x + z[i]
    return x


@inlined
def unit_creep_step(z, w, decays):
    """`creep_step` with all gains equal to one: the states `z` (n,) [µm] follow w, in place.

    x_creep = sum_i gains[i] z[i]; these states remain valid when the gains change.
    """
    for i in range(len(z)):
        z[i] = z[i] + (1.0 - decays[i]) * (w - z[i])


@inlined
def creep_to_come(z, gains, decays):
    """(held, share) of the next sample: x_creep = held + share w, for the w held over it.

    The contribution of the past is known before the sample, and that of the sample itself is linear
    in w. So creep is inverted without iteration. `z` are the states of `unit_creep_step`.
    """
    held = 0.0
    share = 0.0
    for i in range(len(z)):
        held = held + gains[i] * decays[i] * z[i]
        share = share + gains[i] * (1.0 - decays[i])
    return held, share
