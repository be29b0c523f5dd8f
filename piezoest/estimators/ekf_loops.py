"""The compiled loops of `HysteresisEKF`: one sample, and whole records."""

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
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators import ekf_kernel as kernel
from piezoest.estimators.record_loops import keep_outcome


@unrolled
def _write_parameters(s: Any, hysteretic: Any, n: int, theta: Any, row: int) -> None:
    """Parameters of the state s into a row of theta."""
    if hysteretic == 0.0:
        for i in range(n):
            theta[row, i] = s[i]
        return
    theta[row, 0], theta[row, 1], theta[row, 2] = equations.rate_parameters(s[1], s[2], s[3])
    if n == 5:
        theta[row, 3] = s[4]


@unrolled
def _keep(n: int, state: Any, hysteretic: Any, row: int, theta: Any, s: Any, y: Any, S: Any, P: Any) -> None:
    """Write a sample's outcome into the histories that have room."""
    _write_parameters(state[kernel.HEAD : kernel.HEAD + n], hysteretic, n, theta, row)
    if s.size > 0:
        for i in range(n):
            s[row, i] = state[kernel.HEAD + i]
    covariance = state[kernel.HEAD + n : kernel.HEAD + n + n * n]
    keep_outcome(row, state[kernel.INNOVATION], state[kernel.INNOVATION_VARIANCE], covariance, n, y, S, P)


@compiled(nogil=True, **UNCOUNTED)
def step_with_all(state: Any, config: Any, u: float, x: float) -> None:
    """Take one sample of as many states as the configuration says."""
    kernel._sample(state, config, u, x)


@compiled(nogil=True, **UNCOUNTED)
def run_with_all(
    state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
    theta: Any, s: Any, y: Any, S: Any, P: Any,
) -> None:  # fmt: skip
    """Take records of as many states as the configuration says."""
    row, due = 0, every
    for k in range(u.size):
        kernel._sample(state, config, u[k], x[k])
        due -= 1
        if due == 0:
            _keep(int(config[kernel.N]), state, config[kernel.HYSTERETIC], row, theta, s, y, S, P)
            row, due = row + 1, every


@compiled(nogil=True, **UNCOUNTED)
def step(n: int, delayed: Any, length: int, state: Any, config: Any, u: float, x: float) -> None:
    """Take one sample of n states; `length` numbers of the state stand before the delay line."""
    if delayed is None:
        kernel._take(state, config, None, u, x, n)
    else:
        kernel._take(state, config, state[length:], u, x, n)


@compiled(nogil=True, **UNCOUNTED)
def run(
    n: int, delayed: Any, length: int, told: int,
    state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
    theta: Any, s: Any, y: Any, S: Any, P: Any,
) -> None:  # fmt: skip
    """Take records, on copies that nobody else can see: what is indexed by constants stays in registers.

    The settings are `told` numbers.
    """
    now, settings = local(length), local(told)
    for i in range(length):
        now[i] = state[i]
    for i in range(told):
        settings[i] = config[i]
    row, due = 0, every
    for k in range(u.size):
        if delayed is None:
            kernel._take(now, settings, None, u[k], x[k], n)
        else:
            kernel._take(now, settings, state[length:], u[k], x[k], n)
        due -= 1
        if due == 0:
            _keep(n, now, settings[kernel.HYSTERETIC], row, theta, s, y, S, P)
            row, due = row + 1, every
    for i in range(length):
        state[i] = now[i]


def constants(n: int, delayed: bool) -> tuple[Any, ...]:
    """What a loop is specialised for: n, whether voltages are delayed, and where their line begins."""
    return n, 1 if delayed else None, kernel.state_size(n)


@OnDemand
def steps(n: int, delayed: bool) -> Any:
    """``steps[n, delayed](state, config, u, x)``: `step` for these; n is 0 if only `config` knows it."""
    if n == 0:
        return specialised(step_with_all, STEP_TYPES)
    return specialised(step, STEP_TYPES, *constants(n, delayed))


@OnDemand
def runs(n: int, delayed: bool) -> Any:
    """``runs[n, delayed]``: `run` for these, of `piezoest._jit.RUN_TYPES`."""
    if n == 0:
        return specialised(run_with_all, RUN_TYPES)
    return specialised(run, RUN_TYPES, *constants(n, delayed), kernel.CONFIG + n)
