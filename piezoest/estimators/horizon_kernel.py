"""What `MovingHorizon` keeps by name, and the compiled way of samples into its window."""

from typing import Any

import numpy as np

from piezoest._checks import WILDEST
from piezoest.compile import Record, Vector, compiled, inlined
from piezoest.equations.coleman_hodgdon import hysteresis_step
from piezoest.estimators.samples import HELD, MISSING, WAITING
from piezoest.layout import (
    AMOUNT,
    COUNT,
    COVARIANCE,
    FLAG,
    MEASURED,
    NUMBER,
    PARAMETER,
    Kind,
    Length,
    numbers,
    record,
    whole,
)

# Stands for a missing sample in the window, where JSON could not have NaN.
NOTHING = 2.0 * WILDEST
# The model held between solves, of any class with such a loop, and its hysteresis now.
MODEL = record(a=PARAMETER, b=PARAMETER, c=PARAMETER, offset=PARAMETER, w_h=NUMBER)


def layout(n: int, m: int, window: int, noise: float) -> Any:
    """State of n coordinates and m parameters; `window` in samples, `noise` the least that is assumed [µm].

    `mean` and `root` are the arrival cost's, see `piezoest.fitting.problem.Prior`; u and x are rings.
    """
    ring = numbers(Length("window", window), kind=MEASURED)
    return record(
        samples=COUNT, missing=COUNT, updates=COUNT, solves=COUNT, failures=COUNT,
        last=whole(WAITING, HELD),
        known=FLAG, u_last=MEASURED,
        model=MODEL, y=NUMBER, S=AMOUNT, noise=Kind(noise),
        q=numbers(n, kind=PARAMETER), mean=numbers(n, kind=PARAMETER), root=numbers(n, n),
        theta=numbers(m, kind=PARAMETER), P=numbers(m, m, kind=COVARIANCE), K=numbers(m),
        u=ring, x=ring,
    )  # fmt: skip


@inlined
def sample(state: Any, u: float, x: float) -> None:
    """One raw sample into the window; the held model's hysteresis and innovation."""
    model = state.model
    k = int(state.samples) % len(state.u)
    known = np.abs(u) < WILDEST
    if known:
        if state.known != 0.0:
            model.w_h = hysteresis_step(model.w_h, u - state.u_last, model.a, model.b)
        state.known = 1.0
        state.u_last = u
    measured = known and np.abs(x) < WILDEST
    # An unknown voltage is held: the next known one then is one change, as exact if monotone.
    state.u[k] = state.u_last if state.known != 0.0 else NOTHING
    state.x[k] = x if measured else NOTHING
    state.samples += 1.0
    if measured:
        state.y = x - (model.c * u + model.w_h + model.offset)
        state.last = HELD
    else:
        state.missing += 1.0
        state.last = MISSING


@compiled
def step(state: Record, u: float, x: float) -> None:
    """One sample."""
    sample(state, u, x)


@compiled
def run(state: Record, u: Vector, x: Vector, y: Vector) -> None:
    """Samples; their innovations go into `y`."""
    for k in range(u.size):
        sample(state, u[k], x[k])
        y[k] = state.y
