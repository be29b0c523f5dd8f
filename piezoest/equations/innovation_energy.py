"""The usual energy of an estimator's innovation, learnt over the travel of the voltage.

Of T. Fortescue, L. Kershenbaum, B. Ydstie, Automatica 17 (1981) 831-835, where it is not known before.
"""

from piezoest.compile import inlined
from piezoest.layout import AMOUNT, Kind, record

# Swings over which the usual energy is learnt.
ENOUGH = 2.0

# The usual energy, and the swings (up to two) that it is known from.
ENERGY = record(usual=AMOUNT, swings=Kind(0.0, ENOUGH))


@inlined
def relative(energy, y, S):
    """Energy of an innovation y of variance S, relative to its usual one."""
    return y * y / S / max(energy.usual, 1e-30)


@inlined
def learn(energy, y, S, fraction):
    """Learn from an innovation over a fraction of a swing; the first one after `forget` is left out."""
    if energy.swings < 0.0:
        energy.swings = 0.0
        return
    energy.swings = min(energy.swings + fraction, ENOUGH)
    energy.usual += (y * y / S - energy.usual) * fraction / max(energy.swings, 1e-12)


@inlined
def forget(energy):
    """Start learning again with the next innovation."""
    energy.swings = -1.0


@inlined
def nominal(energy, forgetting):
    """Forgetting factor that gives the desired memory at the usual energy; close to 1 until that is known."""
    if energy.swings < ENOUGH:
        return 1.0 - (1.0 - forgetting) / 1e30
    return 1.0 - (1.0 - forgetting) / max(energy.usual, 1e-30)
