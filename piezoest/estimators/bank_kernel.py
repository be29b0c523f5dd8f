"""The compiled loops of `EstimatorBank`: in a module of their own, for few need to load them.

All take samples (K, N) of channels `start` to `stop`, each with a row of `states`, and write what stands in
the estimator's vector at every `every`-th sample into `rows`. They are specialised for the same constants as
the loops of a single estimator.
"""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from piezoest._jit import (
    UNCOUNTED,
    OnDemand,
    compiled,
    in_lanes,
    local,
    local_rows,
    read_ahead,
    specialised,
    unrolled,
)
from piezoest.estimators import ekf_kernel, ekf_loops, rls_kernel, rls_loops
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators.rls_loops import CONFIG, HEAD

# Channels side by side in vector instructions; channels that share cache lines; samples taken by a channel
# before it is the next one's turn; rows of samples asked for ahead.
LANES, BLOCK, CHUNK, AHEAD = 32, 8, 64, 16
# Samples that lanes take on trial.
TRIAL = 256
# Fewer samples than this of a channel are not worth to bring its state into registers for.
WORTH_MOVING = 8

_SIGNATURE = "void(f8[:, ::1], f8[::1], f8[:, ::1], f8[:, ::1], i8, i8, i8, f8[:, :, ::1])"


@register_jitable
def _keep(state: Any, head: int, n: int, row: Any) -> None:
    for i in range(n):
        row[i] = state[head + i]


@compiled(nogil=True, **UNCOUNTED)
def in_turn(
    kalman: Any, n: Any, paced: Any, delayed: Any, length: int, head: int,
    states: Any, config: Any, u: Any, x: Any, start: int, stop: int, every: int, rows: Any,
) -> None:  # fmt: skip
    """Channels take samples by the function for a single one, some channels at a time.

    That of `HysteresisEKF`, or of `HysteresisRLS` where `kalman` is None; n is None where `config` says it.
    """
    for first in range(start, stop, BLOCK):
        row, due = 0, every
        for k in range(u.shape[0]):
            due -= 1
            for c in range(first, min(first + BLOCK, stop)):
                if kalman is None:
                    if n is None:
                        rls_loops.step_with_all(states[c], config, u[k, c], x[k, c])
                    else:
                        rls_loops.step(n, paced, delayed, length, states[c], config, u[k, c], x[k, c])
                else:
                    if n is None:
                        ekf_loops.step_with_all(states[c], config, u[k, c], x[k, c])
                    else:
                        ekf_loops.step(n, delayed, length, states[c], config, u[k, c], x[k, c])
                if due == 0:
                    _keep(states[c], head, rows.shape[2], rows[row, c])
            if due == 0:
                row, due = row + 1, every


@compiled(nogil=True, **UNCOUNTED)
def channel_by_channel(
    kalman: Any, n: int, paced: Any, length: int, told: int, head: int,
    states: Any, config: Any, u: Any, x: Any, start: int, stop: int, every: int, rows: Any,
) -> None:  # fmt: skip
    """A channel takes many samples with its state in registers before it is the next one's turn."""
    now, settings = local(length), local(told)
    for i in range(told):
        settings[i] = config[i]
    for block in range(start, stop, BLOCK):
        for first in range(0, u.shape[0], CHUNK):
            last = min(first + CHUNK, u.shape[0])
            for c in range(block, min(block + BLOCK, stop)):
                for i in range(length):
                    now[i] = states[c, i]
                row, due = first // every, every - first % every
                for k in range(first, last):
                    if kalman is None:
                        rls_loops.take(n, paced, now, settings, None, u[k, c], x[k, c])
                    else:
                        ekf_kernel._take(now, settings, None, u[k, c], x[k, c], n)
                    due -= 1
                    if due == 0:
                        _keep(now, head, n, rows[row, c])
                        row, due = row + 1, every
                for i in range(length):
                    states[c, i] = now[i]


@register_jitable
def _fill(source: Any, target: Any) -> None:
    """Fill all lanes, those that are left over with the last channel's."""
    for lane in range(LANES):
        target[lane] = source[min(lane, source.size - 1)]


@unrolled
def _lane(lane: int, n: int, states: Any, config: Any, u: Any, x: Any) -> None:
    """One sample of the channel in this lane."""
    rls_kernel._take(states[:, lane], config, None, None, None, u[lane], x[lane], n, 1)


@register_jitable
def _again(
    n: int, state: Any, config: Any, u: Any, x: Any, start: int, stop: int, every: int, rows: Any
) -> None:  # fmt: skip
    """Take a channel's samples `start` to `stop` by themselves."""
    row, due = start // every, every - start % every
    for k in range(start, stop):
        rls_loops.take(n, None, state, config, None, u[k], x[k])
        due -= 1
        if due == 0:
            _keep(state, HEAD, n, rows[row])
            row, due = row + 1, every


@compiled(nogil=True, **UNCOUNTED)
def side_by_side(
    n: int, length: int,
    states: Any, config: Any, u: Any, x: Any, start: int, stop: int, every: int, rows: Any,
) -> None:  # fmt: skip
    """The bare law for many channels in the same vector instructions; its branches become masks.

    They take all samples on trial: a restart of P behind a mask would cost more than all that leads to it.
    A channel in which one was not safe goes back to where it was, and takes them again by itself.
    """
    lasting = HEAD + n + 2 * n * n + n  # up to P phi; what follows is work space of other laws
    restarts = rls_kernel.FRONT + law.RESETS
    settings = local(CONFIG)
    for i in range(CONFIG):
        settings[i] = config[i]
    now, before = local_rows(length, LANES), local_rows(length, LANES)
    u_filled, x_filled = local(LANES), local(LANES)
    for first in range(start, stop, LANES):
        used = min(LANES, stop - first)
        # The lanes that are left over repeat the last channel, and are forgotten.
        for lane in range(LANES):
            for i in range(lasting):
                now[i, lane] = states[first + min(lane, used - 1), i]
        row, due = 0, every
        for k in range(min(AHEAD, u.shape[0])):
            read_ahead(u[k, first : first + used])
            read_ahead(x[k, first : first + used])
        for begin in range(0, u.shape[0], TRIAL):
            end = min(begin + TRIAL, u.shape[0])
            for i in range(lasting):
                for lane in range(LANES):
                    before[i, lane] = now[i, lane]
            for k in range(begin, end):
                if k + AHEAD < u.shape[0]:
                    read_ahead(u[k + AHEAD, first : first + used])
                    read_ahead(x[k + AHEAD, first : first + used])
                u_now, x_now = u[k, first : first + used], x[k, first : first + used]
                if used < LANES:
                    _fill(u_now, u_filled)
                    _fill(x_now, x_filled)
                    u_now, x_now = u_filled, x_filled
                in_lanes(_lane, LANES, (n, now, settings, u_now, x_now))
                due -= 1
                if due == 0:
                    for lane in range(used):
                        _keep(now[:, lane], HEAD, n, rows[row, first + lane])
                    row, due = row + 1, every
            for lane in range(used):
                if now[restarts, lane] != before[restarts, lane]:
                    c = first + lane
                    _again(n, before[:, lane], settings, u[:, c], x[:, c], begin, end, every, rows[:, c])
                    for i in range(lasting):
                        now[i, lane] = before[i, lane]
        for lane in range(used):
            for i in range(lasting):
                states[first + lane, i] = now[i, lane]


@OnDemand
def rls(n: int, duties: int, delayed: bool, short: bool) -> Any:
    """``rls[n, duties, delayed, short]``: loop over (few) samples of many `HysteresisRLS`."""
    own = rls_loops.constants(n, duties, delayed)
    if n == 0:
        return specialised(in_turn, _SIGNATURE, None, None, None, None, 0, HEAD)
    if short or delayed:
        return specialised(in_turn, _SIGNATURE, None, *own, HEAD)
    if duties == rls_loops.BARE:
        return specialised(side_by_side, _SIGNATURE, n, rls_loops.size(n))
    return specialised(channel_by_channel, _SIGNATURE, None, n, 1, rls_loops.size(n), CONFIG, HEAD)


@OnDemand
def kalman(n: int, delayed: bool, short: bool) -> Any:
    """``kalman[n, delayed, short]``: loop over (few) samples of many `HysteresisEKF`."""
    length, head = ekf_kernel.state_size(n), ekf_kernel.HEAD
    if n == 0:
        return specialised(in_turn, _SIGNATURE, 1, None, None, None, 0, head)
    if short or delayed:
        return specialised(in_turn, _SIGNATURE, 1, n, None, 1 if delayed else None, length, head)
    return specialised(channel_by_channel, _SIGNATURE, 1, n, None, length, ekf_kernel.CONFIG + n, head)
