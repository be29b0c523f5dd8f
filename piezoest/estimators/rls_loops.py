"""The compiled loops of `HysteresisRLS`: one sample, and whole records."""

from __future__ import annotations

from typing import Any

from piezoest._jit import Family, unrolled
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_kernel as kernel
from piezoest.estimators.record_loops import by_itself, in_place, in_registers, keep_outcome, one_by_one

CONFIG = kernel.CONFIG + law.CONFIG_SIZE
HEAD = kernel.FRONT + law.HEAD

# What a loop is compiled for: the bare law; what the default asks for; all. Its samples come out the same.
# For all, the compiler is not told the number of parameters (0): few need it, and it takes long.
BARE, USUAL, ALL = range(3)


def size(n: int) -> int:
    """Numbers of the state that are there whatever the estimator was told."""
    return kernel.FRONT + law.state_size(n)


def taken(n: int, duties: int) -> Any:
    """``take(state, config, line, u, x)``: one sample; `line` is None where nothing is delayed."""

    @unrolled
    def take(state: Any, config: Any, line: Any, u: Any, x: Any) -> None:
        if duties == BARE:
            kernel._take(state, config, None, line, None, u, x, n)
        else:
            kernel._take(state, config, state[kernel.SWING : kernel.EXCITATION], line, None, u, x, n)

    return take


@unrolled
def _keep(state: Any, n: int, row: int, scale: Any, theta: Any, y: Any, S: Any, P: Any) -> None:
    for i in range(n):
        theta[row, i] = state[HEAD + i] * scale[i]
    head = kernel.FRONT
    covariance = state[HEAD + n : HEAD + n + n * n]
    keep_outcome(
        row, state[head + law.INNOVATION], state[head + law.INNOVATION_VARIANCE], covariance, n, y, S, P
    )


@Family
def step(n: int, duties: int, delayed: bool) -> Any:
    """``step[n, duties, delayed](state, config, u, x)`` takes one sample."""
    return one_by_one(kernel._sample if n == 0 else by_itself(taken(n, duties), size(n), delayed))


@Family
def run(n: int, duties: int, delayed: bool) -> Any:
    """``run[n, duties, delayed]`` takes records, see `piezoest.estimators.record_loops`."""

    @unrolled
    def keep(
        state: Any, config: Any, row: int, scale: Any, theta: Any, s: Any, y: Any, S: Any, P: Any
    ) -> None:
        if n == 0:
            _keep(state, int(config[kernel.N]), row, scale, theta, y, S, P)
        else:
            _keep(state, n, row, scale, theta, y, S, P)

    if n == 0:
        return in_place(kernel._sample, keep)
    return in_registers(taken(n, duties), keep, size(n), CONFIG, delayed)
