"""Kinds of model that were fitted to a log: which to use, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting import Fit, Prediction
from piezoest.fitting.regression import Fitted
from piezoest.identification.residual import Misfit
from piezoest.models import Model

# A simpler model is preferred until a richer one is better by this fraction on the blocks left out. It is
# small, for noise may be most of what both miss there: with 2 %, richer models of half the error lose.
WORTH_IT = 0.005
# Where the log does not tell creep from a wider loop, creep of more than this part of the way is believed
# only if the model misses no more than this part of what others do: else it drifts away at the next rest.
MUCH_CREEP, CLEARLY = 0.15, 0.4


def left_out_error(fitted: Fit | Fitted) -> float:
    """Geometric mean of a fit's errors on blocks between others, and on blocks behind all others [µm rms]."""
    return float(np.sqrt(fitted.held_out * fitted.ahead))


@dataclass(frozen=True, slots=True, eq=False)
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


def simplest(errors: Sequence[float]) -> int:
    """Place of the simplest whose error is about the least; from the simplest to the richest."""
    least = min(errors)
    return next(i for i, each in enumerate(errors) if each <= (1.0 + WORTH_IT) * least)


def best_of(candidates: Sequence[Candidate], *, tells_creep: bool = True) -> Candidate:
    """The simplest of those that predict blocks left out about best; from the simplest to the richest."""
    if not tells_creep:
        most = CLEARLY * min(item.cross_validated for item in candidates if not item.creep)
        candidates = [each for each in candidates if each.creep <= MUCH_CREEP or each.cross_validated <= most]
    return candidates[simplest([item.cross_validated for item in candidates])]


def reason_for(candidates: Sequence[Candidate], best: Candidate) -> str:
    """Why that one, with the figures; candidates come from the simplest to the richest."""
    line, error = candidates[0], best.cross_validated
    said = (
        f"{best.label}: {error:.3g} µm rms in the choice (geometric mean of the errors on "
        "blocks left out and on blocks ahead)"
    )
    if best is not line and 0.0 < error < line.cross_validated:
        said += f", {100.0 * (1.0 - error / line.cross_validated):.0f} % less than a straight line"
    rival = min(candidates, key=lambda item: item.cross_validated)
    if rival.cross_validated < error:
        richer = candidates.index(rival) > candidates.index(best)
        said += f"; {rival.label} has {rival.cross_validated:.3g}" + (
            ", which is not enough less for a richer model" if richer else " and is simpler"
        )
    return f"{said}."
