"""The compiled loops of `HysteresisEKF`: one sample, and whole records."""

from __future__ import annotations

from typing import Any

from piezoest._jit import Family, unrolled
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators import ekf_kernel as kernel
from piezoest.estimators.record_loops import by_itself, in_place, in_registers, keep_outcome, one_by_one


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
    covariance = state[kernel.HEAD + n : kernel.HEAD + n + n * n]
    keep_outcome(row, state[kernel.INNOVATION], state[kernel.INNOVATION_VARIANCE], covariance, n, y, S, P)


def taken(n: int) -> Any:
    """``take(state, config, line, u, x)``: one sample; `line` is None where nothing is delayed."""

    @unrolled
    def take(state: Any, config: Any, line: Any, u: Any, x: Any) -> None:
        kernel._take(state, config, line, u, x, n)

    return take


@Family
def step(n: int, delayed: bool) -> Any:
    """``step[n, delayed](state, config, u, x)`` takes a sample; n is 0 if only `config` knows it."""
    return one_by_one(kernel._sample if n == 0 else by_itself(taken(n), kernel.state_size(n), delayed))


@Family
def run(n: int, delayed: bool) -> Any:
    """``run[n, delayed]`` takes records, see `piezoest.estimators.record_loops`; n as in `step`."""

    @unrolled
    def keep(
        state: Any, config: Any, row: int, scale: Any, theta: Any, s: Any, y: Any, S: Any, P: Any
    ) -> None:
        if n == 0:
            _keep(state, config[kernel.HYSTERETIC], int(config[kernel.N]), row, theta, s, y, S, P)
        else:
            _keep(state, config[kernel.HYSTERETIC], n, row, theta, s, y, S, P)

    if n == 0:
        return in_place(kernel._sample, keep)
    return in_registers(taken(n), keep, kernel.state_size(n), kernel.CONFIG + n, delayed)
