"""What estimators have in common that fit once in a while and hold the fit between."""

from abc import abstractmethod

import numpy as np

from piezoest._checks import FloatArray
from piezoest.estimators.base import EstimatorBase, Trace
from piezoest.fitting.coordinates import Coordinates
from piezoest.models import FreeRunning

# Slope of a model that is handed out, relative to that of the model to start from.
LEAST_HANDED_OUT = 1e-2


class Hopping(EstimatorBase):
    """Base of estimators that fit a `FreeRunning` model at the end of every hop."""

    __slots__ = ()

    _initial: FreeRunning

    @property
    @abstractmethod
    def _coordinates(self) -> Coordinates:
        """What is fitted."""

    @property
    @abstractmethod
    def _left(self) -> int | None:
        """Samples to the end of this hop; None if there are no hops."""

    @abstractmethod
    def _collect(self, u: FloatArray, x: FloatArray) -> FloatArray | None:
        """Keep samples up to the end of the hop at most; their innovations, if they differ within it."""

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, n = u.size // every, len(self.parameter_names)
        shapes = {"theta": (n,), "P": (n, n), "y": (), "S": ()}
        kept = {name: np.empty((rows, *shapes[name])) for name in ("theta", *want)}

        def keep(first: int, last: int) -> None:
            for name, values in kept.items():
                if first // every < last // every:
                    values[first // every : last // every] = getattr(self, name)

        done = 0
        while done < u.size:
            end = min(done + (self._left or u.size), u.size)
            # Until the last sample is there, the rows hold the fit before it.
            keep(done, end - 1)
            innovations = self._collect(u[done:end], x[done:end])
            keep(end - 1, end)
            if innovations is not None and "y" in want:
                kept["y"][done // every : end // every] = innovations[every - 1 - done % every :: every]
            done = end
        index = np.arange(every - 1, rows * every, every)
        return Trace(index=index, parameter_names=self.parameter_names, **kept)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`; a last one, ``offset``, where it is estimated."""
        names = self._initial.parameter_names
        return names if "offset" in self._coordinates.held else (*names, "offset")

    def _model_of(self, theta: FloatArray) -> FreeRunning:
        """Model of the class that is fitted, with these parameters."""
        n = self._initial.theta.size
        offset = float(theta[n]) if theta.size > n else self._initial.offset
        return type(self._initial).from_theta(theta[:n], offset)
