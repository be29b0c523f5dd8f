"""Many stages at once: one estimator's law on many channels, over all cores."""

import itertools
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from piezoest._checks import FloatArray, as_floats, integer, number_or_nan
from piezoest.estimators import loops
from piezoest.estimators.base import Status
from piezoest.estimators.compiled import CompiledEstimator
from piezoest.layout import Copied, write
from piezoest.models import Model

# Samples (of all channels) below which a second core costs more than it brings.
SAMPLES_PER_CORE = 4096
# Most channels: each has a state of its own.
MOST_CHANNELS = 1_000_000


class EstimatorBank(Copied):
    """Many copies of an estimator, one for each channel, stepped together.

    Each channel is an estimator of its own and gives what a single one gives, to the last
    bit; only the loop over the channels is compiled, and spread over the cores.

    Parameters
    ----------
    estimator : HysteresisRLS, HysteresisEKF, OutputErrorRLS or PrandtlIshlinskiiRLS
        Or another one whose samples go through compiled functions. Every channel starts as a copy of it, in
        its present state; it is not changed itself.
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

    __slots__ = ("_reader", "_start", "_states", "_threads")

    def __init__(self, estimator: CompiledEstimator, channels: int, *, threads: int | None = None) -> None:
        if not isinstance(estimator, CompiledEstimator):
            raise ValueError(
                f"estimator must be a compiled one, such as HysteresisRLS, got {type(estimator).__name__}: "
                "keep a list of estimators instead"
            )
        channels = integer("channels", channels, 1, MOST_CHANNELS)
        self._threads = integer("threads", os.cpu_count() or 1 if threads is None else threads, 1)
        self._reader = estimator.copy()
        if self._reader.is_waiting:
            self._reader.update(None)
        self._start = self._reader.state.copy()
        self._states = np.repeat(self._start[np.newaxis], channels)

    def __repr__(self) -> str:
        """Class, number of channels, and the kind of estimator."""
        return f"<{type(self).__name__}: {len(self)} channels of {type(self._reader).__name__}>"

    def __len__(self) -> int:
        """Return the number of channels."""
        return len(self._states)

    def _channels_of(self, name: str, values: Any, dimensions: int) -> FloatArray:
        if dimensions == 1 and not (isinstance(values, np.ndarray) and values.dtype.kind in "biuf"):
            # One channel's driver must not stop the others.
            values = [number_or_nan(value) for value in values] if np.iterable(values) else values
        array = np.require(as_floats(name, values), requirements=["C"])
        if array.ndim != dimensions or array.shape[-1] != len(self):
            shape = f"(K, {len(self)})" if dimensions == 2 else f"({len(self)},)"
            raise ValueError(f"{name} must have shape {shape}, got {array.shape}")
        return array

    def _through(self, u: FloatArray, x: FloatArray, every: int) -> FloatArray:
        """Run checked records (K, N); every k-th sample's row of each channel."""
        channels, reader = len(self), self._reader
        rows = np.empty((u.shape[0] // every, channels, reader.row_size))
        parts = min(self._threads, max(1, u.size // SAMPLES_PER_CORE), channels)
        loop = loops.step_channels.of(*reader.layouts)
        edges = [channels * i // parts for i in range(parts + 1)]
        arguments: list[Any] = [
            (self._states, reader.settings, u, x, first, stop, every, rows)
            for first, stop in itertools.pairwise(edges)
        ]
        if parts == 1:
            loop(*arguments[0])
            return rows
        with ThreadPoolExecutor(parts) as pool:
            for task in [pool.submit(loop, *each) for each in arguments]:
                task.result()
        return rows

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
        self._through(u[np.newaxis], x[np.newaxis], 2)

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
        rows = self._through(u, x, every)
        return np.stack([one.theta_of(rows[:, c]) for c, one in enumerate(self._each())], axis=1)

    def _each(self) -> Iterator[CompiledEstimator]:
        """An estimator in the state of each channel, until the next one is asked for."""
        reader = self._reader.copy()
        for c in range(len(self)):
            write(reader.state, self._states[c : c + 1])
            yield reader

    def channel(self, c: int) -> Any:
        """Return an independent estimator in the state of channel c.

        Parameters
        ----------
        c : int
            Number of the channel, from 0.
        """
        single = self._reader.copy()
        write(single.state, self._states[c].reshape(1))
        return single

    @property
    def theta(self) -> FloatArray:
        """Parameters of every channel, shape (N, n)."""
        return np.array([one.theta for one in self._each()])

    @property
    def models(self) -> list[Model]:
        """Admissible models as known now, one for each channel."""
        return [one.model for one in self._each()]

    @property
    def status(self) -> list[Status]:
        """What happened to the samples so far, for each channel."""
        return [one.status for one in self._each()]

    def reset(self) -> None:
        """Return every channel to the state of the estimator given."""
        self._states[:] = self._start
