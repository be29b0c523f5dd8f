"""Forgetting by a random walk of the parameters, counted in swings of the voltage."""

from dataclasses import dataclass
from typing import Any

from piezoest._checks import moderate
from piezoest.compile import inlined
from piezoest.equations import admissible, least_squares, sensor_noise
from piezoest.equations.swing import half_period
from piezoest.policies.base import Conditions, Policy
from piezoest.policies.forgetting import check_memory

# Slower than so many swings a sample the voltage is at rest; slower than this fraction of its usual pace it
# counts as going at that.
SLOWEST, SLOW = 1e-12, 0.2
# Positions in theta; the offset may be off by this fraction of a swing, a parameter walks at least so much
# (squared), and no variance grows beyond so many times its start.
ALPHA, BETA, GAMMA, OFFSET_SLOPE = 0, 1, 2, 3
OFF_CENTRE, LEAST_STEP, CEILING = 0.3, 1e-6, 1e4
# ... and so much (squared) where the estimate is no stage's: a fault that took it there may have taken it
# near zero, from where it would not come back by fractions of itself.
LOST_STEP = 0.1


@dataclass(frozen=True, slots=True)
class RandomWalk(Policy):
    """Forgetting by a random walk of the parameters: P grows by a constant and not by a factor.

    A direction without excitation is forgotten linearly and not exponentially, and each direction is
    forgotten as fast as new data arrive for it. Everything depends on the travel of the voltage and not on
    time, as hysteresis does. So nothing is forgotten at rest, and one setting works for every amplitude,
    frequency and unit. A swing, from one turning point of the voltage to the next, is half a period.

    L. Ljung, System Identification, 2nd ed. (1999), sec. 11.2; L. Guo, L. Ljung, IEEE Trans.
    Autom. Control 40 (1995) 1353-1385.

    Parameters
    ----------
    memory : float
        Memory of the best excited direction, in periods.
    drift : float
        Random walk of each parameter over a period, relative to its value. It sets how fast the
        initial model is forgotten; later only `memory` matters.

    Raises
    ------
    ValueError
        If memory is less than 0.001, or drift not above zero.
    """

    forgets = needs_swings = needs_period = True
    follows = frozenset({"noise"})

    memory: float = 0.15
    drift: float = 0.4

    def __post_init__(self) -> None:
        check_memory(self.memory)
        moderate("drift", self.drift)

    def numbers(self, at: Conditions) -> dict[str, float]:
        """Square of a step and memory, over swings: halves of a period."""
        return {"walk": 0.5 * self.drift**2, "memory": 2.0 * self.memory}


@inlined
def noise_memory(state: Any, settings: Any) -> Any:
    """Square of the memory in swings that keeps the sensor's noise out of the gain."""
    if state.noise is None:
        return 0.0
    slope = state.law.theta[BETA]
    return sensor_noise.memory_squared(state.noise, state.swing, slope, settings.slope, settings.noise_factor)


@inlined
def _least_step(state: Any, settings: Any) -> Any:
    """Square of what a parameter of the loop walks at least."""
    if settings.loop is None:
        return LEAST_STEP
    theta, scale = state.law.theta, settings.parameter_scale
    alpha, beta, gamma = theta[ALPHA] * scale[ALPHA], theta[BETA] * scale[BETA], theta[GAMMA] * scale[GAMMA]
    return LEAST_STEP if admissible.is_admissible(alpha, beta, gamma, 0.0, 0.0, 0.0) != 0.0 else LOST_STEP


@inlined
def _square_step(state: Any, settings: Any, walk: Any, i: int, least: Any) -> Any:
    """Square of what a parameter walks in a swing: a fraction of itself; the offset, one of the swing."""
    theta = state.law.theta
    if i == OFFSET_SLOPE:
        swing_in_offset = state.swing.size * settings.scale[GAMMA] / settings.scale[OFFSET_SLOPE]
        step = OFF_CENTRE * theta[GAMMA] * swing_in_offset
        return walk * max(step * step, LEAST_STEP)
    return walk * max(theta[i] * theta[i], least)


@inlined
def prepare(own: Any, fixed: Any, state: Any, settings: Any) -> None:
    """Let P grow, and set the noise variance of a sample that gives the memory wanted.

    Everything is counted in swings of the voltage. With P growing by q a swing, the best excited direction
    forgets within sqrt(rho/(q phi²)) swings, where phi is the regressor and rho the noise variance of a whole
    swing: rho follows from the memory wanted and the mean of phi².
    """
    law, excitation = state.law, state.excitation
    if excitation.swings < SLOWEST:
        return
    fraction = excitation.motion
    rho, least = 0.0, _least_step(state, settings)
    for i in range(len(law.theta)):
        q = _square_step(state, settings, fixed.walk, i, least)
        rho += q * excitation.squares[i]
        if state.policies.excitation_gate is not None:
            q *= 1.0 - state.policies.excitation_gate.shut
        ceiling = CEILING * max(q, settings.law.P_0[i, i])
        law.P[i, i] = least_squares.random_walk(law.P[i, i], q * fraction, ceiling)
    # Near a standstill the mechanics still move, which says nothing of the hysteresis.
    memory_squared = fixed.memory * fixed.memory + noise_memory(state, settings)
    to_turn = half_period(state.swing, settings.first_half_period)
    law.noise = 1.0 + memory_squared * rho * max(fraction, SLOW / to_turn)
