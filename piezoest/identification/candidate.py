"""One of the kinds of model that were fitted to a log."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting import Fit, Prediction
from piezoest.fitting.regression import Fitted
from piezoest.identification.residual import Misfit
from piezoest.models import Model


def left_out_error(fitted: Fit | Fitted) -> float:
    """Geometric mean of a fit's errors on blocks between others, and on blocks behind all others [µm rms]."""
    return float(np.sqrt(fitted.held_out * fitted.ahead))


@dataclass(frozen=True, slots=True)
class Candidate:
    """One kind of model, fitted and judged.

    Parameters
    ----------
    fit : Fit
        The fit.
    train, held_out : Misfit
        Error of the simulated displacement where it was fitted and where it was not.
    prediction : Prediction
        Simulated displacement over the record, and the bounds within which readings are expected [µm].
    residual : ndarray, shape (N,)
        Measured minus simulated displacement, without jumps of the sensor after the fitted part [µm]; NaN
        where a sample is missing or faulty.
    """

    fit: Fit
    train: Misfit
    held_out: Misfit
    prediction: Prediction = field(repr=False)
    residual: FloatArray = field(repr=False)

    @property
    def name(self) -> str:
        """Kind of the model, as `piezoest.fit` names it."""
        return self.fit.form

    @property
    def label(self) -> str:
        """The same in words."""
        return self.fit.label

    @property
    def model(self) -> Model:
        """The model, with offset."""
        return self.fit.model

    @property
    def parameters(self) -> int:
        """Number of fitted parameters."""
        return self.fit.parameters

    @property
    def creep(self) -> float:
        """What the model creeps by, in all terms together, relative to its way."""
        return float(np.sum(getattr(getattr(self.model, "creep", None), "gains", 0.0)))

    @property
    def cross_validated(self) -> float:
        """Error on blocks of the fitted part that were left out of the fit [µm rms]; it decides the choice.

        The geometric mean of that on blocks between others, and of that on blocks after all others.
        """
        return left_out_error(self.fit)

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary of the figures."""
        return {
            "name": self.name,
            "parameters": self.parameters,
            "cross_validated_um": self.cross_validated,
            "between_um": self.fit.held_out,
            "ahead_um": self.fit.ahead,
            "train": self.train.to_dict(),
            "held_out": self.held_out.to_dict(),
        }
