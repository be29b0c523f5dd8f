"""The compiled loops of `HysteresisEKF`: one sample, and whole records."""

from __future__ import annotations

from typing import Any

from numba import njit

from piezoest._jit import RUN_TYPES, STEP_TYPES, UNCOUNTED, Family, local, unrolled
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators import ekf_kernel as kernel


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
def _keep(state: Any, hysteretic: Any, n: int, row: int, theta: Any, s: Any, y: Any, S: Any, P: Any) -> None:
    """Write a sample's outcome into the histories that have room."""
    _write_parameters(state[kernel.HEAD : kernel.HEAD + n], hysteretic, n, theta, row)
    if s.size > 0:
        for i in range(n):
            s[row, i] = state[kernel.HEAD + i]
    if y.size > 0:
        y[row] = state[kernel.INNOVATION]
    if S.size > 0:
        S[row] = state[kernel.INNOVATION_VARIANCE]
    if P.size > 0:
        for i in range(n * n):
            P[row, i] = state[kernel.HEAD + n + i]


@Family
def step(n: int, delayed: bool) -> Any:
    """``step[n, delayed](state, config, u, x)`` takes a sample; n is 0 if only `config` knows it."""
    length = kernel.state_size(n)

    @njit(STEP_TYPES, cache=True, nogil=True, **UNCOUNTED)
    def step(state: Any, config: Any, u: float, x: float) -> None:
        if n == 0:
            kernel._sample(state, config, u, x)
        elif delayed:
            kernel._take(state, config, state[length:], u, x, n)
        else:
            kernel._take(state, config, None, u, x, n)

    return step


@Family
def run(n: int, delayed: bool) -> Any:
    """``run[n, delayed]`` takes records, see `piezoest._jit.RUN_TYPES`; n as in `step`."""
    return _run_any() if n == 0 else _run_of(n, delayed)


def _run_any() -> Any:
    @njit(RUN_TYPES, cache=True, nogil=True, **UNCOUNTED)
    def run(
        state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
        theta: Any, s: Any, y: Any, S: Any, P: Any,
    ) -> None:  # fmt: skip
        n, hysteretic = int(config[kernel.N]), config[kernel.HYSTERETIC]
        row, due = 0, every
        for k in range(u.size):
            kernel._sample(state, config, u[k], x[k])
            due -= 1
            if due == 0:
                _keep(state, hysteretic, n, row, theta, s, y, S, P)
                row, due = row + 1, every

    return run


def _run_of(n: int, delayed: bool) -> Any:
    size, settings_size = kernel.state_size(n), kernel.CONFIG + n

    @njit(RUN_TYPES, cache=True, nogil=True, **UNCOUNTED)
    def run(
        state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
        theta: Any, s: Any, y: Any, S: Any, P: Any,
    ) -> None:  # fmt: skip
        # In arrays of the loop's own, its state stays in registers.
        now, settings = local(size), local(settings_size)
        for i in range(size):
            now[i] = state[i]
        for i in range(settings_size):
            settings[i] = config[i]
        row, due = 0, every
        for k in range(u.size):
            if delayed:
                kernel._take(now, settings, state[size:], u[k], x[k], n)
            else:
                kernel._take(now, settings, None, u[k], x[k], n)
            due -= 1
            if due == 0:
                _keep(now, settings[kernel.HYSTERETIC], n, row, theta, s, y, S, P)
                row, due = row + 1, every
        for i in range(size):
            state[i] = now[i]

    return run
