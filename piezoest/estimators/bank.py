"""Many stages at once: one estimator's law on many channels, over all cores."""

from __future__ import annotations

import copy
import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Self

import numpy as np

from piezoest._checks import FloatArray, as_floats, integer, number_or_nan
from piezoest.estimators import bank_kernel
from piezoest.estimators.base import Status
from piezoest.estimators.ekf import HysteresisEKF
from piezoest.estimators.rls import HysteresisRLS
from piezoest.models import Model

_LOOPS: dict[type, Any] = {HysteresisRLS: bank_kernel.rls, HysteresisEKF: bank_kernel.kalman}

# Samples (of all channels) below which a second core costs more than it brings.
WORTH_A_CORE = 4096
# Most channels: each has a state of its own.
MOST_CHANNELS = 1_000_000


class EstimatorBank:
    """Many copies of an estimator, one for each channel, stepped together.

    Each channel is an estimator of its own and gives what a single one gives, to the last
    bit; only the loop over the channels is compiled, and spread over the cores.

    Parameters
    ----------
    estimator : HysteresisRLS or HysteresisEKF
        Every channel starts as a copy of it, in its present state; it is not changed itself.
    channels : int
        Number of stages, N, up to a million.
    threads : int, optional
        Cores to use; default all.

    Raises
    ------
    ValueError
        If the estimator has no compiled loop over channels, or a number is below one.

    Examples
    --------
    >>> import numpy as np
    >>> import piezoest as pz
    >>> bank = pz.EstimatorBank(pz.HysteresisRLS(50_000.0), channels=64)
    >>> bank.step(np.zeros(64), np.zeros(64))
    >>> bank.theta.shape
    (64, 4)
    """

    __slots__ = ("_kind", "_none", "_reader", "_start", "_states", "_threads")

    _reader: Any

    def __init__(self, estimator: Any, channels: int, *, threads: int | None = None) -> None:
        if type(estimator) not in _LOOPS:
            raise ValueError(
                f"estimator must be a HysteresisRLS or a HysteresisEKF, got {type(estimator).__name__}: "
                "keep a list of estimators instead"
            )
        channels = integer("channels", channels, 1, MOST_CHANNELS)
        self._threads = integer("threads", os.cpu_count() or 1 if threads is None else threads, 1)
        self._kind = estimator._kind
        reader: Any = estimator.copy()
        self._reader = reader
        self._start = estimator._state.copy()
        self._states = np.tile(self._start, (channels, 1))
        self._none = np.empty((0, channels, self._reader._n))

    def __copy__(self) -> Self:
        return copy.deepcopy(self)

    def __len__(self) -> int:
        """Return the number of channels."""
        return len(self._states)

    def _channels_of(self, name: str, values: Any, dimensions: int) -> FloatArray:
        if dimensions == 1 and not (isinstance(values, np.ndarray) and values.dtype.kind in "biuf"):
            # One channel's driver must not stop the others.
            values = [number_or_nan(value) for value in values] if np.iterable(values) else values
        array = np.require(as_floats(name, values), requirements=["C", "W"])
        if array.ndim != dimensions or array.shape[-1] != len(self):
            shape = f"(K, {len(self)})" if dimensions == 2 else f"({len(self)},)"
            raise ValueError(f"{name} must have shape {shape}, got {array.shape}")
        return array

    def _take(self, u: FloatArray, x: FloatArray, every: int, theta: FloatArray) -> None:
        channels = len(self)
        parts = min(self._threads, max(1, u.size // WORTH_A_CORE), channels)
        reader = self._reader
        loop = _LOOPS[type(reader)][*self._kind, len(u) < bank_kernel.WORTH_MOVING]
        if parts == 1:
            loop(self._states, reader._config, u, x, 0, channels, every, theta)
            return
        edges = [channels * part // parts for part in range(parts + 1)]
        with ThreadPoolExecutor(parts) as pool:
            tasks = [
                pool.submit(loop, self._states, reader._config, u, x, start, stop, every, theta)
                for start, stop in itertools.pairwise(edges)
            ]
        for task in tasks:
            task.result()

    def step(self, u: Any, x: Any) -> None:
        """Take one sample of every channel.

        Parameters
        ----------
        u, x : array_like, shape (N,)
            Voltages [V] and measured displacements [µm]; NaN, None or a masked value where there is none.
            In a list whatever is no number counts as missing, as in `HysteresisRLS.step`.

        Raises
        ------
        ValueError
            If a shape is another one.
        """
        u, x = self._channels_of("u", u, 1), self._channels_of("x", x, 1)
        self._take(u[np.newaxis], x[np.newaxis], 2, self._none)

    def run(self, u: Any, x: Any, *, every: int = 1) -> FloatArray:
        """Take whole records; continues from the present state.

        Parameters
        ----------
        u, x : array_like, shape (K, N)
            Voltages [V] and measured displacements [µm], a row for each sample.
        every : int
            Keep every k-th sample's parameters.

        Returns
        -------
        ndarray, shape (K // every, N, n)
            Parameters after those samples.

        Raises
        ------
        ValueError
            If a shape is another one.
        """
        u, x = self._channels_of("u", u, 2), self._channels_of("x", x, 2)
        if u.shape != x.shape:
            raise ValueError(f"u and x must have the same shape, got {u.shape} and {x.shape}")
        every = integer("every", every, 1)
        rows = np.empty((u.shape[0] // every, len(self), self._reader._n))
        self._take(u, x, every, rows)
        theta: FloatArray = self._reader._theta_of(rows)
        return theta

    def _channel(self, c: int) -> Any:
        self._reader._state = self._states[c]
        return self._reader

    def channel(self, c: int) -> Any:
        """Return an independent estimator in the state of channel c.

        Parameters
        ----------
        c : int
            Number of the channel, from 0.
        """
        single = self._channel(c).copy()
        single._state = self._states[c].copy()
        return single

    @property
    def theta(self) -> FloatArray:
        """Parameters of every channel, shape (N, n)."""
        return np.array([self._channel(c).theta for c in range(len(self))])

    @property
    def models(self) -> list[Model]:
        """Admissible models as known now, one for each channel."""
        return [self._channel(c).model for c in range(len(self))]

    @property
    def status(self) -> list[Status]:
        """What happened to the samples so far, for each channel."""
        return [self._channel(c).status for c in range(len(self))]

    def reset(self) -> None:
        """Return every channel to the state of the estimator given."""
        self._states[:] = self._start
