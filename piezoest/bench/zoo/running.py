"""One controller on one rig: what went in and what came out, sample by sample."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo.line import FittedLine
from piezoest.bench.zoo.rig import Rig

Factory = Callable[..., Any]  # factory(sample_rate, limits) is a controller


@dataclass(frozen=True, slots=True, eq=False)
class Traces:
    """A run, each of shape (N,)."""

    # r [µm], u [V], reading [µm], true displacement [µm]; r and it in the gauge's coordinates.
    reference: FloatArray
    voltage: FloatArray
    measured: FloatArray
    displacement: FloatArray

    @property
    def error(self) -> FloatArray:
        """r - x [µm], shape (N,)."""
        return self.reference - self.displacement


def run_controller(rig: Rig, controller: Any) -> tuple[Traces, float]:
    """Let a controller drive a rig; with the time that it took [s]."""
    r, stage = rig.reference, rig.stage()
    u, x, true = np.empty_like(r), np.empty_like(r), np.empty_like(r)
    drive = _by_sample if rig.block == 1 else _by_block
    seconds = drive(controller, stage, r, u, x, true, rig.block)
    return Traces(r, u, x, rig.seen(true)), seconds


def run_line(rig: Rig, line: FittedLine) -> Traces:
    """Let a straight line drive the same rig. `line`: from `fit_line`."""
    r, stage = rig.reference, rig.stage()
    u = np.clip(line.voltage(r), rig.reach.low, rig.reach.high)
    x = stage.run(u)
    return Traces(r, u, x, rig.seen(np.asarray(stage.displacement)))


def _by_sample(
    controller: Any, stage: Any, r: FloatArray, u: FloatArray, x: FloatArray, true: FloatArray, block: int
) -> float:
    seconds, clock = 0.0, time.perf_counter
    for k, wanted in enumerate(r.tolist()):
        began = clock()
        voltage = float(controller.step(wanted))
        seconds += clock() - began
        reading = stage.step(voltage)
        u[k], x[k] = voltage, reading
        true[k : k + 1] = stage.displacement  # a number, or an array of one
        began = clock()
        controller.learn(voltage, reading)
        seconds += clock() - began
    return seconds


def _by_block(
    controller: Any, stage: Any, r: FloatArray, u: FloatArray, x: FloatArray, true: FloatArray, block: int
) -> float:
    seconds, clock = 0.0, time.perf_counter
    for start in range(0, r.size, block):
        part = slice(start, min(start + block, r.size))
        began = clock()
        u[part] = controller.run(r[part])
        seconds += clock() - began
        x[part] = stage.run(u[part])
        true[part] = stage.displacement
        began = clock()
        controller.learn(u[part], x[part])
        seconds += clock() - began
    return seconds
