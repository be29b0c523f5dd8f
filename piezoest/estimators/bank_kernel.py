"""The compiled loops of `EstimatorBank`: in a module of their own, for few need to load them."""

from __future__ import annotations

from typing import Any

from numba import njit
from numba.extending import register_jitable

from piezoest._jit import UNCOUNTED
from piezoest.estimators import ekf_kernel, rls_kernel
from piezoest.estimators import recursive_least_squares as law

# Channels that share the first-level cache.
BLOCK = 16

_SIGNATURE = "void(f8[:, ::1], f8[::1], f8[:, ::1], f8[:, ::1], i8, i8, i8, f8[:, :, ::1])"


@register_jitable
def _bank(
    step: Any,
    head: int,
    n: int,
    states: Any,
    config: Any,
    u: Any,
    x: Any,
    start: int,
    stop: int,
    every: int,
    theta: Any,
) -> None:
    for first in range(start, stop, BLOCK):
        last = min(first + BLOCK, stop)
        row, due = 0, every
        for k in range(u.shape[0]):
            for c in range(first, last):
                step(states[c], config, u[k, c], x[k, c])
            due -= 1
            if due == 0:
                for c in range(first, last):
                    for i in range(n):
                        theta[row, c, i] = states[c, head + i]
                row, due = row + 1, every


@njit(_SIGNATURE, cache=True, nogil=True, **UNCOUNTED)
def rls(states: Any, config: Any, u: Any, x: Any, start: int, stop: int, every: int, theta: Any) -> None:
    """Take samples (K, N) of channels `start` to `stop`, each with a row of `states`."""
    head, n = rls_kernel.FRONT + law.HEAD, int(config[rls_kernel.N])
    _bank(rls_kernel.step, head, n, states, config, u, x, start, stop, every, theta)


@njit(_SIGNATURE, cache=True, nogil=True, **UNCOUNTED)
def kalman(states: Any, config: Any, u: Any, x: Any, start: int, stop: int, every: int, theta: Any) -> None:
    """The same for `HysteresisEKF`."""
    head, n = ekf_kernel.HEAD, int(config[ekf_kernel.N])
    _bank(ekf_kernel.step, head, n, states, config, u, x, start, stop, every, theta)
