"""How compiled loops are made: of what an estimator does with a sample, and what it keeps of it.

A loop over records has the signature `piezoest._jit.RUN_TYPES`.
"""

from __future__ import annotations

from typing import Any

from numba import njit

from piezoest._jit import RUN_TYPES, STEP_TYPES, UNCOUNTED, local, unrolled, version


@unrolled
def keep_outcome(
    row: int, innovation: Any, variance: Any, covariance: Any, n: int, y: Any, S: Any, P: Any
) -> None:
    """Write what an update says into the histories that have room; `covariance` is flat, of n by n."""
    if y.size > 0:
        y[row] = innovation
    if S.size > 0:
        S[row] = variance
    if P.size > 0:
        for i in range(n * n):
            P[row, i] = covariance[i]


def by_itself(take: Any, length: int, delayed: bool) -> Any:
    """``sample(state, config, u, x)`` of a ``take(state, config, line, u, x)``.

    The delay line begins behind `length` numbers of the state; it is None if not `delayed`.
    """

    @unrolled
    def sample(state: Any, config: Any, u: Any, x: Any) -> None:
        if delayed:
            take(state, config, state[length:], u, x)
        else:
            take(state, config, None, u, x)

    return sample


def one_by_one(sample: Any) -> Any:
    """Compiled ``sample(state, config, u, x)``, of `piezoest._jit.STEP_TYPES`."""
    source = version()

    @njit(STEP_TYPES, cache=True, nogil=True, **UNCOUNTED)
    def step(state: Any, config: Any, u: float, x: float) -> None:
        _ = source  # part of the cache's key
        sample(state, config, u, x)

    return step


def in_place(sample: Any, keep: Any) -> Any:
    """Loop of ``sample(state, config, u, x)`` on the state where it is, whatever its size.

    ``keep(state, config, row, scale, theta, s, y, S, P)`` writes into the histories that have room.
    """
    source = version()

    @njit(RUN_TYPES, cache=True, nogil=True, **UNCOUNTED)
    def run(
        state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
        theta: Any, s: Any, y: Any, S: Any, P: Any,
    ) -> None:  # fmt: skip
        _ = source  # part of the cache's key
        row, due = 0, every
        for k in range(u.size):
            sample(state, config, u[k], x[k])
            due -= 1
            if due == 0:
                keep(state, config, row, scale, theta, s, y, S, P)
                row, due = row + 1, every

    return run


def in_registers(take: Any, keep: Any, length: int, settings: int, delayed: bool) -> Any:
    """Loop of ``take(state, config, line, u, x)`` on copies of `length` and `settings` numbers.

    Nobody else can see these arrays, so that the compiler keeps in registers what is indexed by
    constants. The delay line, behind the state, stays where it is; it is None if not `delayed`.
    """
    source = version()

    @njit(RUN_TYPES, cache=True, nogil=True, **UNCOUNTED)
    def run(
        state: Any, config: Any, u: Any, x: Any, every: int, scale: Any,
        theta: Any, s: Any, y: Any, S: Any, P: Any,
    ) -> None:  # fmt: skip
        now, told = local(length), local(settings)
        for i in range(length):
            now[i] = state[i]
        for i in range(settings):
            told[i] = config[i]
        _ = source  # part of the cache's key
        row, due = 0, every
        for k in range(u.size):
            if delayed:
                take(now, told, state[length:], u[k], x[k])
            else:
                take(now, told, None, u[k], x[k])
            due -= 1
            if due == 0:
                keep(now, told, row, scale, theta, s, y, S, P)
                row, due = row + 1, every
        for i in range(length):
            state[i] = now[i]

    return run
