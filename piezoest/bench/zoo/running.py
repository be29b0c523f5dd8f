"""One controller on one rig: what went in and what came out, sample by sample."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo.rig import Rig

Factory = Callable[..., Any]  # factory(sample_rate, limits=limits) is a controller


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


@np.errstate(all="ignore")
def run_controller(rig: Rig, controller: Any) -> tuple[Traces, float]:
    """Let a controller drive a rig, by samples or by blocks; with the time that it took [s]."""
    r, stage, clock, seconds = rig.reference, rig.stage(), time.perf_counter, 0.0
    u, x, true = np.empty_like(r), np.empty_like(r), np.empty_like(r)
    single = rig.block == 1
    answer, move = (controller.step, stage.step) if single else (controller.run, stage.run)
    for start in range(0, r.size, rig.block):
        part = slice(start, min(start + rig.block, r.size))
        wanted = r.item(start) if single else r[part]
        began = clock()
        voltage = answer(wanted)
        seconds += clock() - began
        u[part] = voltage
        given = u.item(start) if single else u[part]
        reading = move(given)
        x[part], true[part] = reading, stage.displacement
        began = clock()
        controller.learn(given, reading)
        seconds += clock() - began
    return Traces(r, u, x, rig.seen(true)), seconds
