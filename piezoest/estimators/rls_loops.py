"""The compiled loops of `HysteresisRLS`: one sample, and whole records."""

from __future__ import annotations

from typing import Any

from piezoest._jit import (
    RUN_TYPES,
    STEP_TYPES,
    UNCOUNTED,
    OnDemand,
    compiled,
    local,
    specialised,
    unrolled,
)
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_kernel as kernel
from piezoest.estimators.record_loops import keep_outcome

CONFIG = kernel.CONFIG + law.CONFIG_SIZE
HEAD = kernel.FRONT + law.HEAD

# What a loop is compiled for: the bare law; what the default asks for; all. Its samples come out the same.
# For all, the compiler is not told the number of parameters (0): few need it, and it takes long.
BARE, USUAL, ALL = range(3)


def size(n: int) -> int:
    """Numbers of the state that are there whatever the estimator was told."""
    return kernel.FRONT + law.state_size(n)


@unrolled
def take(n: int, paced: Any, state: Any, config: Any, line: Any, u: Any, x: Any) -> None:
    """One sample of n parameters: of the bare law where `paced` is None, without delay where `line` is."""
    if paced is None:
        kernel._take(state, config, None, line, None, u, x, n, None)
    else:
        kernel._take(state, config, state[kernel.SWING : kernel.EXCITATION], line, None, u, x, n, None)


@unrolled
def _keep(n: int, state: Any, row: int, scale: Any, theta: Any, y: Any, S: Any, P: Any) -> None:
    """Write a sample's outcome into the histories that have room."""
    for i in range(n):
        theta[row, i] = state[HEAD + i] * scale[i]
    head = kernel.FRONT
    covariance = state[HEAD + n : HEAD + n + n * n]
    keep_outcome(
        row, state[head + law.INNOVATION], state[head + law.INNOVATION_VARIANCE], covariance, n, y, S, P
    )


@compiled(nogil=True, **UNCOUNTED)
def step_with_all(state: Any, config: Any, u: float, x: float) -> None:
    """Take one sample, with whatever the configuration asks for."""
    kernel._sample(state, config, u, x)


@compiled(nogil=True, **UNCOUNTED)
def run_with_all(
    state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
    theta: Any, s: Any, y: Any, S: Any, P: Any,
) -> None:  # fmt: skip
    """Take records, with whatever the configuration asks for."""
    row, due = 0, every
    for k in range(u.size):
        kernel._sample(state, config, u[k], x[k])
        due -= 1
        if due == 0:
            _keep(int(config[kernel.N]), state, row, scale, theta, y, S, P)
            row, due = row + 1, every


@compiled(nogil=True, **UNCOUNTED)
def step(n: int, paced: Any, delayed: Any, length: int, state: Any, config: Any, u: float, x: float) -> None:
    """Take one sample; `length` numbers of the state stand before the delay line."""
    if delayed is None:
        take(n, paced, state, config, None, u, x)
    else:
        take(n, paced, state, config, state[length:], u, x)


@compiled(nogil=True, **UNCOUNTED)
def run(
    n: int, paced: Any, delayed: Any, length: int,
    state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
    theta: Any, s: Any, y: Any, S: Any, P: Any,
) -> None:  # fmt: skip
    """Take records, on copies that nobody else can see: what is indexed by constants stays in registers."""
    now, settings = local(length), local(CONFIG)
    for i in range(length):
        now[i] = state[i]
    for i in range(CONFIG):
        settings[i] = config[i]
    row, due = 0, every
    for k in range(u.size):
        if delayed is None:
            take(n, paced, now, settings, None, u[k], x[k])
        else:
            take(n, paced, now, settings, state[length:], u[k], x[k])
        due -= 1
        if due == 0:
            _keep(n, now, row, scale, theta, y, S, P)
            row, due = row + 1, every
    for i in range(length):
        state[i] = now[i]


def constants(n: int, duties: int, delayed: bool) -> tuple[Any, ...]:
    """What a loop is specialised for: n, whether the clock is followed and voltages are delayed, a length."""
    return n, None if duties == BARE else 1, 1 if delayed else None, size(n)


@OnDemand
def steps(n: int, duties: int, delayed: bool) -> Any:
    """``steps[n, duties, delayed](state, config, u, x)``: `step` for these."""
    if n == 0:
        return specialised(step_with_all, STEP_TYPES)
    return specialised(step, STEP_TYPES, *constants(n, duties, delayed))


@OnDemand
def runs(n: int, duties: int, delayed: bool) -> Any:
    """``runs[n, duties, delayed]``: `run` for these, of `piezoest._jit.RUN_TYPES`."""
    if n == 0:
        return specialised(run_with_all, RUN_TYPES)
    return specialised(run, RUN_TYPES, *constants(n, duties, delayed))
