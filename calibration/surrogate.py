"""The paper's experiment in its stationary state, without noise: what the ring settles to.

One period of the reference, sampled coarsely, through the inverse of the model that least
squares finds from that same period: the fixed point of estimator and compensator. It takes
milliseconds where the ring takes seconds, and differs from it by a per cent or so; the
calibration measures that difference with the ring and corrects for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

import piezoest as pz
from piezoest.equations import coleman_hodgdon as equations
from piezoest.equations.creep import creep_step
from piezoest.equations.play import prandtl_ishlinskii_step

SAMPLE_RATE = 10_000.0  # Hz
SETTLING = 20  # periods until the loop of the inverse has closed


@dataclass(frozen=True)
class Plant:
    """Prandtl-Ishlinskii operator with creep."""

    gain: float
    thresholds: Any
    weights: Any
    creep_gains: Any
    time_constants: Any


@dataclass(frozen=True)
class Row:
    """A row of Tables I and II: its reference, one period from its minimum on."""

    amplitude: float
    frequency: float
    reference: Any


def row(amplitude: float, frequency: float) -> Row:
    """The row's reference is that of `piezoest.signals.triangle` with its defaults."""
    period = np.asarray(pz.signals.triangle(amplitude, frequency, 1, SAMPLE_RATE))
    return Row(amplitude, frequency, np.roll(period, -int(np.argmin(period))))


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
    true = np.asarray(linear.displacement)
    return float(np.mean((ramp - true)[-1000:])), float(np.mean((ramp - measured)[-1000:]))


@njit
def _inverse(r: Any, a: float, b: float, c: float, settling: int) -> Any:
    """Stationary voltage for one period of the reference, which starts at its minimum."""
    low, high = r[0], r.max()
    w_h = 0.0
    du = equations.inverse_increment(w_h, low, a, b, c)
    u = du
    w_h = equations.hysteresis_step(w_h, du, a, b)
    for _ in range(settling):
        # Exact over any monotone travel, so one step a branch will do.
        for dr in (high - low, low - high):
            du = equations.inverse_increment(w_h, dr, a, b, c)
            u = u + du
            w_h = equations.hysteresis_step(w_h, du, a, b)
    voltage = np.empty_like(r)
    for k in range(r.size):
        dr = r[k] - (r[k - 1] if k > 0 else r[0])
        du = equations.inverse_increment(w_h, dr, a, b, c)
        u = u + du
        w_h = equations.hysteresis_step(w_h, du, a, b)
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


@njit
def _least_squares(u: Any, x: Any) -> Any:
    """Parameters of the derivative form over one period."""
    A = np.zeros((3, 3))
    B = np.zeros(3)
    phi = np.zeros(3)
    for k in range(u.size):
        rise, moment, travel = equations.sample_regressor(u[k - 1], u[k])
        phi[0] = -0.5 * (x[k] + x[k - 1]) * travel
        phi[1] = rise
        phi[2] = moment
        for i in range(3):
            B[i] += phi[i] * (x[k] - x[k - 1])
            for j in range(3):
                A[i, j] += phi[i] * phi[j]
    scale = np.sqrt(np.diag(A))
    return np.linalg.solve(A / np.outer(scale, scale), B / scale) / scale


def _delayed(x: Any, lag: float) -> Any:
    return x - 0.5 * lag * SAMPLE_RATE * (np.roll(x, -1) - np.roll(x, 1))


def response(plant: Plant, u: Any, lag: tuple[float, float]) -> tuple[Any, Any]:
    """True and measured displacement for one stationary period of voltage."""
    decays = np.exp(-1.0 / (SAMPLE_RATE * plant.time_constants))
    x = _respond(
        u,
        plant.gain,
        plant.thresholds,
        plant.weights,
        plant.creep_gains,
        decays,
    )
    return _delayed(x, lag[0]), _delayed(x, lag[1])


def stationary(plant: Plant, row: Row, lag: tuple[float, float], start: Any, rounds: int = 4) -> Any:
    """(alpha, beta, gamma, K, linear error, compensated error) of a row, from `start` (4,) on."""
    r = row.reference
    K = start[3]
    for _ in range(max(2, rounds - 1)):
        u = r / K
        true, measured = response(plant, u, lag)
        linear = np.max(np.abs(r - true))
        K = (measured @ u) / (u @ u)
    theta = np.array(start[:3], dtype=float)
    for _ in range(rounds):
        a, b, c = equations.loop_parameters(*theta)
        u = _inverse(r, a, b, c, SETTLING)
        true, measured = response(plant, u, lag)
        used, theta = theta, _least_squares(u, measured)
        if not (theta[0] > 1e-3 and theta[2] / theta[0] > theta[1]):
            raise ArithmeticError(f"no admissible model: {theta}")
        if np.max(np.abs(theta / used - 1.0)) < 1e-7:
            break
    return np.array([*theta, K, linear, np.max(np.abs(r - true))])
