"""The compiled loops of `EstimatorBank`: in a module of their own, for few need to load them.

All take samples (K, N) of channels `start` to `stop`, each with a row of `states`, and write what stands in
the estimator's vector at every `every`-th sample into `rows`. `rls` and `kalman` are compiled for the same
as the loops of a single estimator without a delay, and are worth it for whole records.
"""

from __future__ import annotations

from typing import Any

from numba import njit
from numba.extending import register_jitable

from piezoest._jit import (
    STEP_TYPES,
    UNCOUNTED,
    Family,
    in_lanes,
    local,
    local_rows,
    read_ahead,
    taking,
    unrolled,
    version,
)
from piezoest.estimators import ekf_kernel, ekf_loops, rls_kernel, rls_loops

# Channels side by side in vector instructions; channels that share cache lines; samples taken by a channel
# before it is the next one's turn; rows of samples asked for ahead.
LANES, BLOCK, CHUNK, AHEAD = 32, 8, 64, 16

_SIGNATURE = "void(f8[:, ::1], f8[::1], f8[:, ::1], f8[:, ::1], i8, i8, i8, f8[:, :, ::1])"


@Family
def rls(n: int, duties: int, _: bool) -> Any:
    """``rls[n, duties, False]``: the loop over records of many `HysteresisRLS`."""
    if duties == rls_loops.BARE:
        return _in_lanes(n)
    take, size = rls_loops.taken(n, duties), rls_loops.size(n)
    return _channel_by_channel(take, size, rls_loops.CONFIG, rls_loops.HEAD, n)


@Family
def kalman(n: int, _: bool) -> Any:
    """``kalman[n, False]``: the loop over records of many `HysteresisEKF`."""
    take, size = ekf_loops.taken(n), ekf_kernel.state_size(n)
    return _channel_by_channel(take, size, ekf_kernel.CONFIG + n, ekf_kernel.HEAD, n)


@register_jitable
def _keep(state: Any, head: int, n: int, row: Any) -> None:
    for i in range(n):
        row[i] = state[head + i]


@njit(taking((STEP_TYPES,), _SIGNATURE.replace("void(", "void(i8, i8, ")), cache=True, nogil=True)
def in_turn(
    step: Any, head: int, n: int, states: Any, config: Any, u: Any, x: Any,
    start: int, stop: int, every: int, rows: Any,
) -> None:  # fmt: skip
    """Channels take samples by the function for a single one, some channels at a time.

    References to arrays are counted here: a function that is handed over is called with its own.
    """
    for first in range(start, stop, BLOCK):
        row, due = 0, every
        for k in range(u.shape[0]):
            due -= 1
            for c in range(first, min(first + BLOCK, stop)):
                step(states[c], config, u[k, c], x[k, c])
                if due == 0:
                    _keep(states[c], head, n, rows[row, c])
            if due == 0:
                row, due = row + 1, every


def _channel_by_channel(take: Any, size: int, settings_size: int, head: int, n: int) -> Any:
    """A channel takes many samples with its state in registers before it is the next one's turn."""
    source = version()

    @njit(_SIGNATURE, cache=True, nogil=True, **UNCOUNTED)
    def bank(states: Any, config: Any, u: Any, x: Any, start: int, stop: int, every: int, rows: Any) -> None:
        _ = source  # part of the cache's key
        now, settings = local(size), local(settings_size)
        for i in range(settings_size):
            settings[i] = config[i]
        for block in range(start, stop, BLOCK):
            for first in range(0, u.shape[0], CHUNK):
                last = min(first + CHUNK, u.shape[0])
                for c in range(block, min(block + BLOCK, stop)):
                    for i in range(size):
                        now[i] = states[c, i]
                    row, due = first // every, every - first % every
                    for k in range(first, last):
                        take(now, settings, None, u[k, c], x[k, c])
                        due -= 1
                        if due == 0:
                            _keep(now, head, n, rows[row, c])
                            row, due = row + 1, every
                    for i in range(size):
                        states[c, i] = now[i]

    return bank


@register_jitable
def _fill(source: Any, target: Any) -> None:
    """Fill all lanes, those that are left over with the last channel's."""
    for lane in range(LANES):
        target[lane] = source[min(lane, source.size - 1)]


def _in_lanes(n: int) -> Any:
    """The bare law for many channels in the same vector instructions; its branches become masks."""
    size, settings_size, head, source = rls_loops.size(n), rls_loops.CONFIG, rls_loops.HEAD, version()
    lasting = head + n + 2 * n * n + n  # up to P phi; what follows is work space of other laws
    single = rls_loops.taken(n, rls_loops.BARE)

    @unrolled
    def take(lane: int, states: Any, config: Any, u: Any, x: Any) -> None:
        single(states[:, lane], config, None, u[lane], x[lane])

    @njit(_SIGNATURE, cache=True, nogil=True, **UNCOUNTED)
    def bank(states: Any, config: Any, u: Any, x: Any, start: int, stop: int, every: int, rows: Any) -> None:
        _ = source  # part of the cache's key
        settings = local(settings_size)
        for i in range(settings_size):
            settings[i] = config[i]
        now, u_filled, x_filled = local_rows(size, LANES), local(LANES), local(LANES)
        for first in range(start, stop, LANES):
            used = min(LANES, stop - first)
            # The lanes that are left over repeat the last channel, and are forgotten.
            for lane in range(LANES):
                c = first + min(lane, used - 1)
                for i in range(rls_kernel.SWING):
                    now[i, lane] = states[c, i]
                for i in range(rls_kernel.FRONT, lasting):
                    now[i, lane] = states[c, i]
            row, due = 0, every
            for k in range(min(AHEAD, u.shape[0])):
                read_ahead(u[k, first : first + used])
                read_ahead(x[k, first : first + used])
            for k in range(u.shape[0]):
                if k + AHEAD < u.shape[0]:
                    read_ahead(u[k + AHEAD, first : first + used])
                    read_ahead(x[k + AHEAD, first : first + used])
                u_now, x_now = u[k, first : first + used], x[k, first : first + used]
                if used < LANES:
                    _fill(u_now, u_filled)
                    _fill(x_now, x_filled)
                    u_now, x_now = u_filled, x_filled
                in_lanes(take, LANES, (now, settings, u_now, x_now))
                due -= 1
                if due == 0:
                    for lane in range(used):
                        _keep(now[:, lane], head, n, rows[row, first + lane])
                    row, due = row + 1, every
            for lane in range(used):
                for i in range(rls_kernel.SWING):
                    states[first + lane, i] = now[i, lane]
                for i in range(rls_kernel.FRONT, lasting):
                    states[first + lane, i] = now[i, lane]

    return bank
