"""What estimators have in common that fit once in a while and hold the fit between."""

from abc import abstractmethod

from piezoest._checks import FloatArray
from piezoest.estimators.base import EstimatorBase
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
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`; a last one, ``offset``, where it is estimated."""
        names = self._initial.parameter_names
        return names if "offset" in self._coordinates.held else (*names, "offset")

    def _model_of(self, theta: FloatArray) -> FreeRunning:
        """Model of the class that is fitted, with these parameters."""
        n = self._initial.theta.size
        offset = float(theta[n]) if theta.size > n else self._initial.offset
        return type(self._initial).from_theta(theta[:n], offset)
