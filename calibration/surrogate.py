"""The stage that is fitted, and the paper's experiment on it in its stationary state, without noise.

The stage has a smooth density of thresholds, a linear part and creep. One period of the reference, sampled
coarsely, goes through the inverse of the model that least squares finds from that same period: the fixed
point of estimator and compensator. It takes milliseconds where the ring takes seconds, and differs from it by
a per cent or so; the calibration measures that difference with the ring and corrects for it.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

import piezoest as pz
from piezoest.equations import coleman_hodgdon as equations
from piezoest.equations.creep import creep_step
from piezoest.equations.play import prandtl_ishlinskii_step

SAMPLE_RATE = 10_000.0  # Hz
SETTLING = 20  # periods until the loop of the inverse has closed

KNOTS = 50.0 * np.linspace(0.0, 1.0, 13) ** 2  # V, close where the density is steep
TIME_CONSTANTS = np.array([0.011, 0.2])  # s, from an earlier fit to the same rows
THRESHOLD_EDGES = 60.0 * np.linspace(0.0, 1.0, 65) ** 2  # V
THRESHOLDS = 0.5 * (THRESHOLD_EDGES[1:] + THRESHOLD_EDGES[:-1])
CREEP_UNIT = 0.02  # creep of 2 % costs as much as half a unit of curvature
VOLTAGE_UNIT = 10.0  # V; curvature is that of the log density over r in tens of volts

_spline = CubicSpline(KNOTS / VOLTAGE_UNIT, np.eye(KNOTS.size), bc_type="natural", axis=0)
_density = _spline(np.minimum(THRESHOLDS, KNOTS[-1]) / VOLTAGE_UNIT)  # constant beyond the last knot
_fine = np.linspace(0.0, KNOTS[-1] / VOLTAGE_UNIT, 400)
_curvature = _spline(_fine, 2) * np.sqrt(_fine[1])

# A parameter vector, 16 numbers: log of the gain [µm/V], log of the density [µm/V²] at the knots, and the
# creep's gains in units of CREEP_UNIT.
DENSITY, CREEP = slice(1, 1 + KNOTS.size), slice(1 + KNOTS.size, None)
LOWEST = np.concatenate(([-4.0], np.full(KNOTS.size, -14.0), np.full(TIME_CONSTANTS.size, -1e-9)))
HIGHEST = np.concatenate(([-1.0], np.full(KNOTS.size, -1.0), np.full(TIME_CONSTANTS.size, 30.0)))


class Plant(NamedTuple):
    """Prandtl-Ishlinskii operator with creep."""

    gain: float
    thresholds: Any
    weights: Any
    creep_gains: Any
    time_constants: Any


def start() -> Any:
    """Where the search begins: a density that falls by half every few volts, then stays."""
    density = np.interp(KNOTS, [0.0, 4.0, 10.0, 50.0], np.log([6e-3, 3e-3, 2e-3, 1.2e-3]))
    return np.concatenate(([np.log(0.112)], density, np.full(TIME_CONSTANTS.size, 3.5)))


def plant(p: Any) -> Plant:
    """The stage's hysteresis and creep for a parameter vector."""
    weights = np.exp(_density @ p[DENSITY]) * np.diff(THRESHOLD_EDGES)
    creep_gains = CREEP_UNIT * np.maximum(p[CREEP], 0.0)
    return Plant(float(np.exp(p[0])), THRESHOLDS, weights, creep_gains, TIME_CONSTANTS)


def penalty(p: Any) -> Any:
    """What is to be small: curvature of the log density, and creep."""
    return np.concatenate((_curvature @ p[DENSITY], p[CREEP]))


def roughness(p: Any) -> float:
    """Integral of the squared curvature of the log density."""
    return float(np.sum((_curvature @ p[DENSITY]) ** 2))


def period(amplitude: float, frequency: float) -> Any:
    """One period of a row's reference, from its minimum on."""
    r = np.asarray(pz.signals.triangle(amplitude, frequency, 1, SAMPLE_RATE))
    return np.roll(r, -int(np.argmin(r)))


def lags(stage: pz.SimulatedStage) -> tuple[float, float]:
    """Delay of the true and of the measured displacement behind the voltage [s]."""
    linear = pz.SimulatedStage(
        stage.sample_rate,
        pz.LinearGain(1.0),
        mechanics=stage.mechanics,
        amplifier=type(stage.amplifier)(cutoff=stage.amplifier.cutoff),
        gauge=type(stage.gauge)(cutoff=stage.gauge.cutoff, delay=stage.gauge.delay),
    )
    ramp = np.arange(20_000) / stage.sample_rate
    measured = linear.run(ramp)
    true, late = (float(np.mean((ramp - x)[-1000:])) for x in (linear.displacement, measured))
    return true, late


@njit
def _inverse(path: Any, a: float, b: float, c: float) -> Any:
    """Voltage along a path from rest; a step of it may be any monotone travel."""
    voltage = np.empty_like(path)
    u = w_h = r = 0.0
    for k in range(path.size):
        du = equations.inverse_increment(w_h, path[k] - r, a, b, c)
        w_h = equations.hysteresis_step(w_h, du, a, b)
        u, r = u + du, path[k]
        voltage[k] = u
    return voltage


@njit
def _respond(u: Any, gain: float, thresholds: Any, weights: Any, gains: Any, decays: Any) -> Any:
    """Stationary displacement for one period of a voltage that starts at its minimum."""
    x = np.empty_like(u)
    y = np.zeros_like(thresholds)
    prandtl_ishlinskii_step(y, u.max(), gain, thresholds, weights)
    for k in range(u.size):
        x[k] = prandtl_ishlinskii_step(y, u[k], gain, thresholds, weights)
    z = np.zeros_like(gains)
    for k in range(u.size):
        creep_step(z, x[k], gains, decays)
    z = z / (1.0 - decays**u.size)  # periodic: of the start, a period leaves d^N
    for k in range(u.size):
        x[k] += creep_step(z, x[k], gains, decays)
    return x


def _least_squares(u: Any, x: Any) -> Any:
    """Parameters of the derivative form over one period."""
    u_0, x_0 = np.roll(u, 1), np.roll(x, 1)
    rise, moment, travel = equations.sample_regressor(u_0, u)
    A = np.column_stack([-0.5 * (x + x_0) * travel, rise, moment])
    scale = np.sqrt(np.sum(A * A, axis=0))
    return np.linalg.lstsq(A / scale, x - x_0, rcond=None)[0] / scale


def _response(plant: Plant, u: Any, lag: tuple[float, float]) -> list[Any]:
    """True and measured displacement for one stationary period of voltage."""
    decays = np.exp(-1.0 / (SAMPLE_RATE * plant.time_constants))
    x = _respond(u, plant.gain, plant.thresholds, plant.weights, plant.creep_gains, decays)
    slope = 0.5 * SAMPLE_RATE * (np.roll(x, -1) - np.roll(x, 1))
    return [x - each * slope for each in lag]


def stationary(plant: Plant, r: Any, lag: tuple[float, float], start: Any, rounds: int) -> Any:
    """(alpha, beta, gamma, K, linear error, compensated error) of a row, from `start` (4,) on."""
    K = start[3]
    for _ in range(max(2, rounds - 1)):
        u = r / K
        true, measured = _response(plant, u, lag)
        linear = np.max(np.abs(r - true))
        K = (measured @ u) / (u @ u)
    theta = np.array(start[:3], dtype=float)
    path = np.concatenate((r[:1], np.tile([r.max(), r[0]], SETTLING), r))
    for _ in range(rounds):
        u = _inverse(path, *equations.loop_parameters(*theta))[-r.size :]
        true, measured = _response(plant, u, lag)
        used, theta = theta, _least_squares(u, measured)
        if not (theta[0] > 1e-3 and theta[2] / theta[0] > theta[1]):
            raise ArithmeticError(f"no admissible model: {theta}")
        if np.max(np.abs(theta / used - 1.0)) < 1e-7:
            break
    return np.array([*theta, K, linear, np.max(np.abs(r - true))])
