"""How `PrandtlIshlinskiiRLS` starts: grid, prior and tuning, none of which has a unit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray, check_start, finite
from piezoest.estimators import play_rls_layout as layout
from piezoest.estimators.play_rls_grid import LEVEL_START
from piezoest.models import ColemanHodgdon, LinearGain, PrandtlIshlinskii

# Half-width of the first grid of a Coleman-Hodgdon model, in parts of 1/alpha.
FIRST_RANGE = 0.6
FIRST_HALF = 0.1  # s, half a period before the voltage has turned
LONGEST_GAP = 2e-3  # s, after which an outlier is a new level

# In parts of the stroke, of the start, or of the range travelled.
SLACK = 5e-3  # misfit of one window that is no parameter's
LEVEL_TRAVEL = 1e-3  # walk of the level per root of the range travelled
LEVEL_TIME = 1e-3  # ... and of half a period
COMMON_WALK = 0.02  # walk of all slopes together per root of the range travelled
SINGLE_WALK = 0.15  # ... and of each by itself, in parts of its prior deviation
WINDOWS = 32.0  # updates while the voltage travels half its range
LEAST_GAIN = 0.05  # least slope just after a turn, in parts of the start's

# Prior: deviations of the gain, of each weight in parts of the mean one, between segments.
GAIN_DEVIATION, WEIGHT_DEVIATION, SEGMENT_SHARE = 0.15, 1.0, 0.6
CORRELATION = 3.0  # thresholds over which the weights' deviations are alike
CREEP_START, CREEP_DEVIATION = 0.01, 0.03


class Plan(NamedTuple):
    """Grid and start."""

    relative: FloatArray  # thresholds in parts of half the range
    bends: FloatArray  # the same, from the middle
    times: FloatArray
    centre: float
    half: float
    fixed: bool
    unit: float  # µm/V
    slopes: FloatArray  # (1 + n, 1 + k) [µm/V]
    gains: FloatArray
    offset: float


def plan(initial: Any, voltage_range: Any, thresholds: int, bends: int, times: FloatArray) -> Plan:
    """Grid and start that the arguments ask for."""
    if not isinstance(initial, PrandtlIshlinskii | ColemanHodgdon | LinearGain):
        raise ValueError(
            f"initial_model must be a PrandtlIshlinskii, a ColemanHodgdon or a LinearGain, got {initial!r}"
        )
    if not initial.is_admissible:
        raise ValueError(f"initial_model must be admissible, got {initial}")
    check_start(initial)
    if np.any(times <= 0.0):
        raise ValueError(f"creep must hold time constants above zero, got {times.min():g} s")
    centre, half, fixed = 0.0, 0.0, voltage_range is not None
    if fixed:
        low, high = (finite("voltage_range", value) for value in array_1d_pair(voltage_range))
        centre, half = 0.5 * (low + high), 0.5 * (high - low)
    if isinstance(initial, LinearGain):
        if initial.gain <= 0.0:
            raise ValueError(f"initial_model must have a gain above zero, got {initial.gain:g} µm/V")
        slopes = np.array([[initial.gain]])
        none = np.empty(0)
        return Plan(none, none, none, centre, half or 1.0, True, initial.gain, slopes, none, initial.offset)
    if isinstance(initial, PrandtlIshlinskii):
        return _of_plays(initial)
    if not fixed:
        half = FIRST_RANGE / initial.alpha
    relative = np.arange(1, thresholds + 1) / max(1, thresholds)
    edges = np.linspace(-1.0, 1.0, bends + 2)[1:-1]
    loop = _with_the_loop_of(initial, half * relative, half)
    slopes = np.repeat(loop[:, None], bends + 1, axis=1)
    gains = np.full(times.size, CREEP_START)
    return Plan(relative, edges, times, centre, half, fixed, float(loop[0]), slopes, gains, initial.offset)


def array_1d_pair(voltage_range: Any) -> tuple[float, float]:
    """Two rising numbers."""
    values = np.asarray(voltage_range, dtype=np.float64)
    if values.shape != (2,) or not values[0] < values[1]:
        raise ValueError(f"voltage_range must be (least, largest) in V, got {voltage_range!r}")
    return float(values[0]), float(values[1])


def _of_plays(model: PrandtlIshlinskii) -> Plan:
    n, k = model.thresholds.size, model.bends.size
    half = float(model.thresholds[-1]) if n else 1.0
    centre = float(np.mean(model.bends)) if k else 0.0
    first = np.append(model.gain, model.weights)[:, None]
    slopes = np.hstack([first, first + np.cumsum(model.bend_weights, axis=0).T])
    times = np.empty(0) if model.creep is None else model.creep.time_constants
    gains = np.empty(0) if model.creep is None else model.creep.gains
    relative, bends = model.thresholds / half, (model.bends - centre) / half
    return Plan(relative, bends, times, centre, half, True, model.gain, slopes, gains, model.offset)


def _with_the_loop_of(model: ColemanHodgdon, thresholds: FloatArray, amplitude: float) -> FloatArray:
    """Gain and weights, not below zero, whose loop at an amplitude is nearest to the model's."""
    from scipy.optimize import nnls

    quarter = np.linspace(0.0, amplitude, 101)[1:]
    u = np.concatenate([quarter, *([quarter[-2::-1], -quarter[:1], -quarter, -quarter[-2::-1], quarter] * 2)])
    x = model.simulate(u, allow_jumps=True) - model.offset
    plain = [PrandtlIshlinskii(0.0, [r], [1.0]).simulate(u) for r in thresholds]
    columns = np.column_stack([u, *plain])
    late = slice(quarter.size, None)
    found = nnls(columns[late], x[late])[0]
    # None at zero: a weight there would have no scale.
    least = np.append(0.1, np.full(thresholds.size, 0.1 / max(1, thresholds.size))) * (found.sum() or 1.0)
    return np.asarray(np.maximum(found, 0.1 * least))


def tune(config: FloatArray) -> None:
    """Write the tuning into the configuration."""
    for place, value in (
        (layout.SLACK, SLACK),
        (layout.LEVEL_TRAVEL, LEVEL_TRAVEL),
        (layout.LEVEL_TIME, LEVEL_TIME),
        (layout.COMMON_WALK, COMMON_WALK),
        (layout.SINGLE_WALK, SINGLE_WALK),
        (layout.WINDOWS, WINDOWS),
        (layout.LEAST, LEAST_GAIN),
    ):
        config[place] = value


def prior(plan: Plan, uncertainty: float, config: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Start, deviations and covariance of all parameters in the law's units."""
    slopes = plan.slopes / plan.unit
    rows, columns = slopes.shape
    n, m = rows - 1, plan.times.size
    deviation = np.full(rows, GAIN_DEVIATION)
    if n:
        deviation[1:] = WEIGHT_DEVIATION * max(float(slopes[1:].sum()) / (n * columns), 0.3 / n)
    index = np.arange(rows)
    alike = np.exp(-np.abs(index[:, None] - index) / CORRELATION)
    alike[0, 1:] = alike[1:, 0] = 0.0
    between = np.full((columns, columns), 1.0) + SEGMENT_SHARE**2 * np.eye(columns)
    shape = np.kron(alike * np.outer(deviation, deviation), between)
    flat = slopes.ravel()
    size = flat.size + m + 1
    P = np.zeros((size, size))
    P[: flat.size, : flat.size] = shape + uncertainty**2 * np.outer(flat, flat)
    place = np.arange(flat.size, flat.size + m)
    P[place, place] = CREEP_DEVIATION**2
    P[-1, -1] = (LEVEL_START * plan.unit * plan.half) ** 2
    spread = np.concatenate([np.repeat(deviation, columns), np.full(m, CREEP_DEVIATION), [0.0]])
    return np.concatenate([flat, plan.gains, [plan.offset]]), spread, P
