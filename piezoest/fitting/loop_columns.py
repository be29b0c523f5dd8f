"""The Coleman-Hodgdon model of a given alpha as columns of a regression.

x = c u + w_h + offset, and w_h is linear in b and in where it begins: with b = 1 and w_h = 0 at the start
it is f(u), so x = (c - 2b) u + b (2u + f) + w_h(0) exp(-a travel) + offset. Models are admissible whose
first two coefficients are above zero. Equations (2)-(4) of Eielsen et al. (2012).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from piezoest._checks import FloatArray
from piezoest.compile import Matrix, Vector, compiled
from piezoest.equations.coleman_hodgdon import hysteresis_step
from piezoest.models import ColemanHodgdon, Creep

# c - 2b, and b, are at least this fraction of the straight line's gain.
LEAST = 1e-6
# What is left of the start, relative to it, that counts for nothing.
FORGOTTEN = 1e-26


@dataclass(frozen=True, slots=True)
class LoopColumns:
    """Columns of c - 2b, b and w_h(0), for one `alpha` [1/V].

    With `rested` the stage comes from a rest at 0 V, and nothing of w_h(0) is left.
    """

    alpha: float
    rested: bool = False

    size: ClassVar[int] = 3
    free: ClassVar[int] = 1
    foretells: ClassVar[bool] = True
    bent: ClassVar[bool] = False

    def begin(self) -> FloatArray:
        """Voltage, f, and what is left of the start; the first sample says the voltage."""
        return np.zeros(3) if self.rested else np.array([np.nan, 0.0, 1.0])

    def afresh(self, u: float) -> LoopColumns:
        """The same for a stage that rests at 0 V until a record begins at voltage u [V]."""
        return replace(self, rested=True)

    def rows(self, u: FloatArray, state: FloatArray) -> FloatArray:
        """Columns along a voltage."""
        if np.isnan(state[0]):
            state[0] = u[0]
        rows = np.empty((u.size, 3))
        _loop(u, self.alpha, state, rows)
        return rows

    def lower(self, gain: float) -> FloatArray:
        """What is admissible."""
        return np.array([LEAST * gain, LEAST * gain, -np.inf])

    def line(self) -> FloatArray:
        """The voltage alone."""
        return np.array([1.0, 0.0, 0.0])

    def unevenness(self) -> FloatArray:
        """Nothing is to be smooth."""
        return np.zeros((3, 3))

    def prior(self) -> FloatArray:
        """The record shows all there is."""
        return np.zeros((3, 3))

    def beyond(self, w: FloatArray) -> tuple[LoopColumns, FloatArray, float]:
        """The model as it is: it goes on by itself."""
        return self, w, 0.0

    def model(self, w: FloatArray, offset: float, creep: Creep | None, rate: float) -> ColemanHodgdon:
        """Model of these coefficients; it has no creep."""
        return ColemanHodgdon.from_loop(self.alpha, float(w[1]), float(w[0] + 2.0 * w[1]), offset)

    def names(self, w: FloatArray) -> dict[str, FloatArray]:
        """beta; gamma = alpha c is not linear in them."""
        return {"beta": np.array([1.0, 1.0, 0.0])}

    def initial_state(self, w: FloatArray, model: ColemanHodgdon) -> float:
        """w_h at the first sample [µm]."""
        return float(w[2])


@compiled
def _loop(u: Vector, alpha: float, state: Vector, rows: Matrix) -> None:
    """Voltage, loop and start along a voltage; `state` goes on."""
    for k in range(u.size):
        du = u[k] - state[0]
        state[1] = hysteresis_step(state[1], du, alpha, 1.0)
        left = hysteresis_step(state[2], du, alpha, 0.0)
        # Numbers below the normal range would make all that follows a hundred times slower.
        state[2] = left if left > FORGOTTEN else 0.0
        state[0] = u[k]
        rows[k, 0] = u[k]
        rows[k, 1] = 2.0 * u[k] + state[1]
        rows[k, 2] = state[2]
