"""The shape that is fitted: a smooth threshold density, a linear part and creep."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from surrogate import Plant

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

DENSITY = slice(1, 1 + KNOTS.size)
CREEP = slice(1 + KNOTS.size, None)

# A parameter vector: log of the gain [µm/V], log of the density [µm/V²] at the knots, and the
# creep's gains in units of CREEP_UNIT.
LOWEST = np.concatenate(([-4.0], np.full(KNOTS.size, -14.0), np.full(TIME_CONSTANTS.size, -1e-9)))
HIGHEST = np.concatenate(([-1.0], np.full(KNOTS.size, -1.0), np.full(TIME_CONSTANTS.size, 30.0)))


def start() -> Any:
    """Where the search begins: a density that falls by half every few volts, then stays."""
    density = np.interp(KNOTS, [0.0, 4.0, 10.0, 50.0], np.log([6e-3, 3e-3, 2e-3, 1.2e-3]))
    return np.concatenate(([np.log(0.112)], density, np.full(TIME_CONSTANTS.size, 3.5)))


def plant(p: Any) -> Plant:
    """The stage's hysteresis and creep for a parameter vector."""
    weights = np.exp(_density @ p[DENSITY]) * np.diff(THRESHOLD_EDGES)
    return Plant(
        float(np.exp(p[0])), THRESHOLDS, weights, CREEP_UNIT * np.maximum(p[CREEP], 0.0), TIME_CONSTANTS
    )


def penalty(p: Any) -> Any:
    """What is to be small: curvature of the log density, and creep."""
    return np.concatenate((_curvature @ p[DENSITY], p[CREEP]))


def roughness(p: Any) -> float:
    """Integral of the squared curvature of the log density."""
    return float(np.sum((_curvature @ p[DENSITY]) ** 2))
