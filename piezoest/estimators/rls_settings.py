"""What `HysteresisRLS` is told, put into the flat numbers that its compiled inside reads."""

from __future__ import annotations

from typing import Any

import numpy as np

from piezoest._checks import FloatArray, moderate
from piezoest.equations import filters
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_kernel as kernel
from piezoest.estimators import rls_loops as loops
from piezoest.estimators import rls_policies as extra
from piezoest.models import ColemanHodgdon, LinearGain, Model
from piezoest.policies import (
    AmplitudeMemory,
    ChangeDetection,
    DeadZone,
    DirectionalForgetting,
    ExcitationGate,
    Forgetting,
    Normalisation,
    NormBound,
    OutlierRejection,
    PeriodicForgetting,
    Policy,
    Projection,
    RandomWalk,
    VariableForgetting,
    forgetting_of,
    select,
)

# Seconds of half a period until the voltage has turned for the first time.
FIRST_HALF = 0.05
# Seconds without a measurement that are bridged.
LONGEST_GAP = 0.002
# The offset's scale: a centre that is off by so many volts.
CENTRE = 10.0


def default_policies(memory: Any, initial: Model) -> tuple[Policy, ...]:
    """Policies that go with a memory: the paper's with a dead zone, or those of the reference's own clock."""
    if memory != "period":
        return NormBound(), DeadZone(), Normalisation()
    forgetting = PeriodicForgetting() if isinstance(initial, LinearGain) else RandomWalk()
    return forgetting, DeadZone(), OutlierRejection()


def check_policies(policies: tuple[Policy, ...], memory: Any, time_base: str, initial: Model) -> None:
    """Refuse the clock's policies without their memory, and what excludes each other.

    Raises
    ------
    ValueError
        If there is one of them with another memory or the continuous time base, two ways to forget, or one
        that the model does not go with.
    """
    clocked = select(policies, RandomWalk) or select(policies, PeriodicForgetting)
    if clocked and (time_base == "continuous" or memory != "period"):
        raise ValueError(
            "policies: RandomWalk and PeriodicForgetting go with memory='period' and the discrete time base"
        )
    stated = () if memory in (None, "period") else (Forgetting(memory),)
    forgetting_of((*policies, *stated))
    clocked_kinds = (ExcitationGate, ChangeDetection, AmplitudeMemory, Projection)
    for kind in clocked_kinds if time_base == "continuous" else ():
        if select(policies, kind):
            raise ValueError(f"policies: {kind.__name__} goes with the discrete time base")
    for kind in (Projection, AmplitudeMemory) if isinstance(initial, LinearGain) else ():
        if select(policies, kind):
            raise ValueError(f"policies: {kind.__name__} goes with a ColemanHodgdon, not with a LinearGain")


def parameter_scale(initial: ColemanHodgdon | LinearGain, offset: bool) -> FloatArray:
    """Scale of each parameter, shape (n,): the initial value, and for the offset ten volts' worth."""
    scale = np.abs(initial.theta)
    return np.append(scale, CENTRE * scale[-1]) if offset else scale


def policy_settings(config: FloatArray, policies: tuple[Policy, ...], sample_rate: float) -> None:
    """Write what the front end needs of the policies into its configuration."""
    walk = select(policies, RandomWalk)
    if isinstance(walk, RandomWalk):
        config[kernel.WALK] = 0.5 * walk.drift**2
        config[kernel.WALK_MEMORY] = 2.0 * walk.memory
    periodic = select(policies, PeriodicForgetting)
    if isinstance(periodic, PeriodicForgetting):
        config[kernel.PERIODS] = periodic.memory
    by_clock = select(policies, DirectionalForgetting) or select(policies, VariableForgetting)
    if isinstance(by_clock, DirectionalForgetting | VariableForgetting) and by_clock.unit == "period":
        config[kernel.PERIODS] = by_clock.memory
    _switched_settings(config, policies)
    rejection = select(policies, OutlierRejection)
    if isinstance(rejection, OutlierRejection) and config[kernel.HYSTERETIC]:
        config[kernel.OUTLIER] = 1.0
        config[kernel.WARM_UP] = rejection.warm_up


def _switched_settings(config: FloatArray, policies: tuple[Policy, ...]) -> None:
    """The part of what is off by default."""
    projection = select(policies, Projection)
    if isinstance(projection, Projection):
        config[kernel.MARGIN] = projection.margin
    detection = select(policies, ChangeDetection)
    if isinstance(detection, ChangeDetection):
        config[kernel.THRESHOLD], config[kernel.RISEN] = detection.threshold, detection.drift
    gate = select(policies, ExcitationGate)
    if isinstance(gate, ExcitationGate):
        config[kernel.EXCITED] = gate.least
    variable = select(policies, VariableForgetting)
    if isinstance(variable, VariableForgetting):
        config[kernel.SHORTEST] = variable.shortest
    amplitudes = select(policies, AmplitudeMemory)
    if isinstance(amplitudes, AmplitudeMemory):
        config[kernel.PLACES] = amplitudes.places
        config[kernel.TOLERANCE] = amplitudes.tolerance
        config[kernel.RECALLED] = amplitudes.uncertainty**2
    if detection or gate or variable or amplitudes:
        config[kernel.EXTRA] = extra.HEAD + extra.PLACE * config[kernel.PLACES]


def note_duties(config: FloatArray, errors: bool) -> None:
    """Write what is asked of the front end beside the regression: by policies, the offset, or a reader."""
    config[kernel.WHOLE] = errors or config[kernel.EXCITED] > 0.0
    asking = (kernel.WHOLE, kernel.WALK, kernel.OUTLIER, kernel.PERIODS, kernel.EXCITED, kernel.EXTRA)
    config[kernel.PACED] = config[kernel.N] == 4 or np.any(config[list(asking)])


def kind(config: FloatArray, delay: float) -> tuple[int, int, bool]:
    """Key of the compiled loop in `rls_loops` that does no more than it has to."""
    front = (kernel.HIGH_PASS, kernel.EXCITED, kernel.EXTRA, kernel.MARGIN)
    own = (law.CONTINUOUS, law.DIRECTIONAL, law.LEAST_FACTOR, law.FLOOR)
    rare = [*front, *(kernel.CONFIG + place for place in own)]
    if np.any(config[rare]):
        return 0, loops.ALL, True
    bare = config[kernel.HYSTERETIC] and not config[kernel.PACED]
    return int(config[kernel.N]), loops.BARE if bare else loops.USUAL, bool(delay > 0.0)


def front_end(
    sample_rate: float,
    scale: FloatArray,
    *,
    hysteretic: bool,
    offset: bool,
    cutoff: float,
    high_pass: float | None,
    fraction: float,
    noise: float,
    per_second: bool,
) -> FloatArray:
    """Configuration of the front end, without the policies'."""
    config = np.zeros(kernel.CONFIG)
    pole = float(filters.first_order_pole(cutoff, sample_rate))
    if pole == 1.0:
        raise ValueError(f"cutoff must be nearer to the sample rate of {sample_rate:g} Hz, got {cutoff:g} Hz")
    n = scale.size
    config[kernel.N] = n
    config[kernel.HYSTERETIC] = hysteretic
    config[kernel.LOW_POLE] = pole
    if high_pass is not None:
        config[kernel.HIGH_PASS] = 1.0
        config[kernel.HIGH_POLE] = filters.first_order_pole(moderate("high_pass", high_pass), sample_rate)
    config[kernel.FRACTION] = fraction
    config[kernel.OFFSET] = offset
    config[kernel.LONGEST_GAP] = max(1, int(LONGEST_GAP * sample_rate))
    config[kernel.FIRST_HALF] = max(1.0, FIRST_HALF * sample_rate)
    # Noise of x behind W_p, and of its difference behind W_p (white noise in x).
    white = (1.0 - pole) / (1.0 + pole)
    blue = 2.0 * (1.0 - pole) ** 2 / (1.0 + pole)
    gain = np.sqrt(blue if hysteretic else white)
    config[kernel.NOISE_RATIO] = 1.0 / gain
    unit = sample_rate if per_second and hysteretic else 1.0
    config[kernel.DECAY_SCALE] = scale[0]
    config[kernel.SCALE : kernel.SCALE + n] = scale / (noise * gain) * unit
    config[kernel.SCALE + 4] = unit / (noise * gain)
    config[kernel.SLOPE] = config[kernel.SCALE + 1] / config[kernel.SCALE + 4]
    config[kernel.NOISE_FACTOR] = 2.0 * white / kernel.PRECISION**2
    return config
