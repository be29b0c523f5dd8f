"""The compiled loops of `HysteresisRLS`: one sample, and whole records."""

from __future__ import annotations

from typing import Any

from numba import njit

from piezoest._jit import RUN_TYPES, STEP_TYPES, UNCOUNTED, Family, local, unrolled
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_kernel as kernel

CONFIG = kernel.CONFIG + law.CONFIG_SIZE
HEAD = kernel.FRONT + law.HEAD

# What a loop is compiled for: the bare law; what the default asks for; all. Its samples come out the same.
# For all, the compiler is not told the number of parameters (0): few need it, and it takes long.
BARE, USUAL, ALL = range(3)


def size(n: int) -> int:
    """Numbers of the state that are there whatever the estimator was told."""
    return kernel.FRONT + law.state_size(n)


@unrolled
def _take(state: Any, config: Any, line: Any, u: Any, x: Any, n: int, paced: Any) -> None:
    """One sample with none of the policies that are off by default; `paced` is None for the bare law."""
    if paced is None:
        kernel._take(state, config, None, line, None, u, x, n)
    else:
        kernel._take(state, config, state[kernel.SWING : kernel.EXCITATION], line, None, u, x, n)


@unrolled
def _keep(state: Any, n: int, row: int, scale: Any, theta: Any, y: Any, S: Any, P: Any) -> None:
    """Write a sample's outcome into the histories that have room."""
    for i in range(n):
        theta[row, i] = state[HEAD + i] * scale[i]
    if y.size > 0:
        y[row] = state[kernel.FRONT + law.INNOVATION]
    if S.size > 0:
        S[row] = state[kernel.FRONT + law.INNOVATION_VARIANCE]
    if P.size > 0:
        for i in range(n * n):
            P[row, i] = state[HEAD + n + i]


@Family
def step(n: int, duties: int, delayed: bool) -> Any:
    """``step[n, duties, delayed](state, config, u, x)`` takes one sample."""
    paced = None if duties == BARE else True
    length = size(n)

    @njit(STEP_TYPES, cache=True, nogil=True, **UNCOUNTED)
    def step(state: Any, config: Any, u: float, x: float) -> None:
        if n == 0:
            kernel._sample(state, config, u, x)
        elif delayed:
            _take(state, config, state[length:], u, x, n, paced)
        else:
            _take(state, config, None, u, x, n, paced)

    return step


@Family
def run(n: int, duties: int, delayed: bool) -> Any:
    """``run[n, duties, delayed]`` takes records, see `piezoest._jit.RUN_TYPES`."""
    return _run_any() if n == 0 else _run_of(n, None if duties == BARE else True, delayed)


def _run_any() -> Any:
    @njit(RUN_TYPES, cache=True, nogil=True, **UNCOUNTED)
    def run(
        state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
        theta: Any, s: Any, y: Any, S: Any, P: Any,
    ) -> None:  # fmt: skip
        n = int(config[kernel.N])
        row, due = 0, every
        for k in range(u.size):
            kernel._sample(state, config, u[k], x[k])
            due -= 1
            if due == 0:
                _keep(state, n, row, scale, theta, y, S, P)
                row, due = row + 1, every

    return run


def _run_of(n: int, paced: bool | None, delayed: bool) -> Any:
    length = size(n)

    @njit(RUN_TYPES, cache=True, nogil=True, **UNCOUNTED)
    def run(
        state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
        theta: Any, s: Any, y: Any, S: Any, P: Any,
    ) -> None:  # fmt: skip
        # In arrays of the loop's own, its state stays in registers.
        now, settings = local(length), local(CONFIG)
        for i in range(length):
            now[i] = state[i]
        for i in range(CONFIG):
            settings[i] = config[i]
        row, due = 0, every
        for k in range(u.size):
            if delayed:
                _take(now, settings, state[length:], u[k], x[k], n, paced)
            else:
                _take(now, settings, None, u[k], x[k], n, paced)
            due -= 1
            if due == 0:
                _keep(now, n, row, scale, theta, y, S, P)
                row, due = row + 1, every
        for i in range(length):
            state[i] = now[i]

    return run
