"""The derivative form as a regression: what becomes of raw samples before the law of `HysteresisRLS`.

z = dx/dt against the regressor (20) of the Coleman-Hodgdon model, or z = x against u for a line, integrated
from one good sample to the next, both sides through the low-pass W_p of App. A and an optional high-pass.
"""

from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.compile import inlined
from piezoest.equations import believing, filters, sensor_noise
from piezoest.models import Model
from piezoest.policies.base import Conditions, Policy
from piezoest.policies.random_walk import SLOWEST

# Seconds of half a period until the voltage has turned for the first time.
FIRST_HALF_PERIOD = 0.05
# Seconds without a measurement that are bridged.
LONGEST_GAP = 0.002


def settings(initial: Model, scale: FloatArray, options: dict[str, Any], at: Conditions) -> dict[str, Any]:
    """Numbers that compiled code is given, without the law's and the policies'."""
    rate = options["sample_rate"]
    pole = float(filters.first_order_pole(options["cutoff"], rate))
    if pole == 1.0:
        raise ValueError(
            f"cutoff must be nearer to the sample rate of {rate:g} Hz, got {options['cutoff']:g} Hz"
        )
    numbers: dict[str, Any] = {}
    if options["high_pass"] is not None:
        numbers["high_pole"] = filters.first_order_pole(options["high_pass"], rate)
    # Noise of x behind W_p, and of its difference behind W_p (white noise in x).
    white = (1.0 - pole) / (1.0 + pole)
    blue = 2.0 * (1.0 - pole) ** 2 / (1.0 + pole)
    gain = np.sqrt(blue if at.has_loop else white)
    unit = rate if at.has_loop and not at.discrete else 1.0
    noise = options["noise"]
    scaled, output_scale = scale / (noise * gain) * unit, unit / (noise * gain)
    if at.has_loop:
        numbers |= {"loop": {"decay_scale": scale[0]}, "slope": scaled[1] / output_scale}
    return {
        **numbers,
        "low_pole": pole,
        "longest_gap": max(1, int(LONGEST_GAP * rate)),
        "first_half_period": max(1.0, FIRST_HALF_PERIOD * rate),
        "noise_ratio": 1.0 / gain,
        "noise_factor": 2.0 * white / sensor_noise.PRECISION**2,
        "differenced": at.has_loop,
        "scale": scaled,
        "output_scale": output_scale,
        "parameter_scale": scale,
        "start": {"gain": initial.theta[0], "offset": initial.offset},
    }


def followed(options: dict[str, Any], policies: tuple[Policy, ...], at: Conditions) -> set[str]:
    """What is followed beside the regression: by policies, the offset, or a reader."""
    # The continuous law's P is the covariance already.
    errors = options["errors"] and at.discrete
    needed = {
        "centre": options["offset"],
        "high_pass": options["high_pass"] is not None,
        "level": options["offset"] and at.has_loop,
        "errors": errors,
        "products": options["errors"],
    }
    found = {name for name, is_needed in needed.items() if is_needed}.union(
        *(one.follows for one in policies)
    )
    if not at.has_loop:
        found.discard("noise")
    swings = {"level", "products", "noise", "belief", "energy"} & found
    if swings or any(policy.needs_swings for policy in policies):
        found.add("swings")
    return found


@inlined
def u_from_centre(state: Any, u: Any) -> Any:
    """Voltage from the first one on, where an offset is estimated."""
    return u if state.centre is None else u - state.centre.u


@inlined
def x_from_centre(state: Any, x: Any) -> Any:
    """Displacement from the first one on, where an offset is estimated."""
    return x if state.centre is None else x - state.centre.x


@inlined
def is_believable(state: Any, settings: Any, slope: Any, x: Any, jumped: Any) -> Any:
    """Whether x is a reading that the stage can have made, after the last good one, or may have `jumped`.

    What is usual then stays known: the way back from a wrong level must not pass for a usual reading.
    """
    if state.belief is None:
        return True
    dx, warm_up = x_from_centre(state, x) - state.x_last, settings.policies.outlier_rejection.warm_up
    if believing.stands_still(state.belief, dx, state.travel, state.swing.size):
        return False
    if believing.believable(state.belief, dx, slope, state.travel, warm_up):
        return True
    if jumped:
        believing.believe(state.belief, dx, state.travel, warm_up)
    return jumped


@inlined
def prime(state: Any, settings: Any, u: Any, x: Any) -> None:
    """Start from (u, x) as the last good sample."""
    if state.primed != 0.0:
        if state.belief is not None:  # x is a new level
            dx, warm_up = x_from_centre(state, x) - state.x_last, settings.policies.outlier_rejection.warm_up
            believing.believe(state.belief, dx, state.travel, warm_up)
    elif state.centre is not None:
        state.centre.u = u
        state.centre.x = x
    state.primed = 1.0
    state.u_last = u_from_centre(state, u)
    state.x_last = x_from_centre(state, x)
    state.travel = state.moment = state.rise = state.gap = 0.0


@inlined
def _regression(state: Any, settings: Any, x: Any) -> Any:
    """Regressor and output from the last good sample to this one, not yet filtered; returns the output."""
    phi = state.phi
    if settings.loop is None:
        phi[0] = state.u_last
        if len(phi) == 2:
            phi[1] = 1.0
        return x
    z = x - state.x_last
    if state.noise is not None:
        sensor_noise.measure(state.noise, z)
    phi[0] = -0.5 * (x + state.x_last) * state.travel
    phi[1] = state.rise
    phi[2] = state.moment
    if len(phi) == 4:
        phi[3] = state.travel
    return z


@inlined
def filtered_regression(state: Any, settings: Any, x: Any) -> Any:
    """Regressor behind W_p of App. A and the optional high-pass; returns the output, and starts the next."""
    z = _regression(state, settings, x)
    state.x_last = x
    state.travel = state.moment = state.rise = state.gap = 0.0
    phi, low, high = state.phi, state.low_pass, state.high_pass
    for i in range(len(phi)):
        phi[i] = low.phi[i] = filters.low_pass_step(low.phi[i], phi[i] * settings.scale[i], settings.low_pole)
        if high is not None:
            high.phi[i], phi[i] = filters.high_pass_step(high.phi[i], phi[i], settings.high_pole)
    z = low.z = filters.low_pass_step(low.z, z * settings.output_scale, settings.low_pole)
    if high is not None:
        high.z, z = filters.high_pass_step(high.z, z, settings.high_pole)
    return z


@inlined
def excite(state: Any, settings: Any) -> None:
    """Mean square of the regressor over a swing, in unit of motion."""
    phi, excitation = state.phi, state.excitation
    fraction = filters.low_pass_step(excitation.motion, state.fraction, settings.low_pole)
    excitation.motion = fraction
    swings = excitation.swings + fraction
    if swings < SLOWEST:
        return
    swings = min(swings, 1.0)
    excitation.swings = swings
    fresh, old = 1.0 / (max(fraction, SLOWEST) * swings), fraction / swings
    for i in range(len(phi)):
        mean = excitation.squares[i]
        excitation.squares[i] = mean + (fresh * phi[i] * phi[i] - old * mean)
    products = excitation.products
    if products is None:
        return
    for i in range(len(phi)):
        products[i, i] = excitation.squares[i]
        for j in range(i + 1, len(phi)):
            mean = products[i, j]
            mean += fresh * phi[i] * phi[j] - old * mean
            products[i, j] = mean
            products[j, i] = mean
