"""What tables and files say of a model: its parameters, what it misses, and whether that is white."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray

Row = tuple[str, float, float, str]
# More parameters than this are not listed one by one.
MOST_ROWS = 12
WHITENESS_LAGS = 20


def parameter_rows(model: Any, delay: float, errors: dict[str, float]) -> list[Row]:
    """Rows of parameter name, value, standard error (zero if it was not estimated) and unit."""
    values = list(zip(model.parameter_names, model.theta.tolist(), model.parameter_units, strict=True))
    if len(values) > MOST_ROWS:
        values = [row for row in values if row[0] == "gain" or row[0].startswith("creep")]
        weights = [(name, value) for name, value in zip(model.parameter_names, model.theta, strict=True)
                   if name.startswith("weights")]  # fmt: skip
        values.append((f"sum of {len(weights)} weights", float(sum(value for _, value in weights)), "µm/V"))
    values += [("offset", model.offset, "µm"), ("delay", delay, "samples")]
    return [(name, value, errors.get(name, 0.0), unit) for name, value, unit in values]


@dataclass(frozen=True, slots=True)
class Misfit:
    """Error of a model that computes the displacement from the voltage alone.

    Parameters
    ----------
    rms, max : float
        Root mean square and largest absolute value [µm].
    """

    rms: float
    max: float

    @classmethod
    def of(cls, error: FloatArray) -> Misfit:
        """Make it of an error [µm]; NaN does not count.

        Parameters
        ----------
        error : ndarray, shape (N,)
            [µm].
        """
        known = error[np.isfinite(error)]
        return cls(float(np.sqrt(np.mean(known**2))), float(np.max(np.abs(known))))

    def to_dict(self) -> dict[str, float]:
        """Return a JSON-safe dictionary."""
        return {"rms_um": self.rms, "max_um": self.max}


class Kind(NamedTuple):
    """A kind of model beside the others, by what it misses; None where that is not known."""

    label: str
    chosen: bool
    left_out: float  # on blocks left out of the fit, by which the kind was chosen [µm rms]
    parameters: int | None = None
    train: Misfit | None = None
    held_out: Misfit | None = None

    def cells(self) -> tuple[str, ...]:
        """Label, marked if it was chosen, parameters, and errors: fitted, left out, held out, largest."""
        errors = (
            None if self.train is None else self.train.rms,
            self.left_out,
            None if self.held_out is None else self.held_out.rms,
            None if self.held_out is None else self.held_out.max,
        )
        return (
            f"{'▸' if self.chosen else ' '} {self.label}",
            "" if self.parameters is None else f"{self.parameters}",
            *("" if error is None else f"{error:.3g}" for error in errors),
        )


@dataclass(frozen=True, slots=True)
class Whiteness:
    """Ljung-Box test of a residual: Q = n(n+2) sum_k rho_k^2/(n-k) over the first lags.

    Parameters
    ----------
    lags : int
        Number of lags m.
    statistic : float
        Q, chi-squared with m degrees of freedom if the residual is white.
    p_value : float
        Probability of a Q at least as large in white noise.
    first_autocorrelation : float
        rho_1.

    Notes
    -----
    Source: G. M. Ljung, G. E. P. Box, Biometrika 65 (1978) 297-303.
    """

    lags: int
    statistic: float
    p_value: float
    first_autocorrelation: float

    @property
    def is_white(self) -> bool:
        """Whether the test passes at the 1 % level."""
        return self.p_value >= 0.01

    @classmethod
    def of(cls, residual: FloatArray, lags: int = WHITENESS_LAGS) -> Whiteness:
        """Test a residual; NaN counts as absent.

        Parameters
        ----------
        residual : ndarray, shape (N,)
            In any unit.
        lags : int
            Number of lags.
        """
        from scipy.special import chdtrc

        rho = autocorrelation(residual, lags)[1:]
        n = int(np.sum(np.isfinite(residual)))
        Q = float(n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, lags + 1))))
        return cls(lags, Q, float(chdtrc(lags, Q)), float(rho[0]))

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary."""
        return {
            "test": "Ljung-Box",
            "lags": self.lags,
            "statistic": self.statistic,
            "p_value": self.p_value,
            "first_autocorrelation": self.first_autocorrelation,
            "white": self.is_white,
        }


def autocorrelation(residual: FloatArray, lags: int) -> FloatArray:
    """Autocorrelation at lags 0 to `lags`, shape (lags + 1,); NaN counts as absent."""
    known = np.isfinite(residual)
    e = np.where(known, residual - np.mean(residual[known]), 0.0)
    power = float(e @ e) or 1.0
    return np.array([float(e[: e.size - k] @ e[k:]) / power for k in range(lags + 1)])


def figures_of(found: Any) -> dict[str, Any]:
    """What the dictionaries of all identifications have."""
    return {
        "source": found.source,
        "samples": found.samples,
        "sample_rate_Hz": found.sample_rate,
        "model": found.model.to_dict(),
        "learnt_on": found.learnt_on.to_dict(),
        "kind": found.chosen,
        "units": {name: unit for name, _, _, unit in found.table()},
        "delay_samples": found.delay,
        "trained_samples": found.trained,
        "left_out_samples": found.left_out,
        "train": found.train.to_dict(),
        "held_out": found.held_out.to_dict(),
        "straight_line": {
            "model": found.line.to_dict(),
            "train": found.line_train.to_dict(),
            "held_out": found.line_held_out.to_dict(),
        },
        "notes": list(found.notes),
        "advice": list(found.advice),
    }
