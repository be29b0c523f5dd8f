"""What a model misses: its size, and whether it is white."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray

WHITENESS_LAGS = 20
# Parts of a residual whose spectra are averaged, and half of the width of a peak [lines].
SEGMENTS, PEAK = 16, 2


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


class Oscillation(NamedTuple):
    """The strongest oscillation of a residual."""

    frequency: float  # [Hz]
    share: float  # part that it makes of the residual's square, without a steady drift

    @classmethod
    def of(cls, residual: FloatArray, sample_rate: float) -> Oscillation:
        """Look for the strongest one; NaN counts as absent.

        The spectrum is the mean of those of `SEGMENTS` parts (Welch, 1967).
        """
        from scipy import signal

        known = np.flatnonzero(np.isfinite(residual))
        length = residual.size // SEGMENTS
        if length < 4 * PEAK:
            return cls(0.0, 0.0)
        e = np.zeros(residual.size)
        e[known] = residual[known] - np.polyval(np.polyfit(known, residual[known], 1), known)
        _, power = signal.welch(e, nperseg=length, detrend=False)
        k = PEAK + int(np.argmax(power[PEAK:]))
        share = float(np.sum(power[max(k - PEAK, PEAK) : k + PEAK + 1]) / max(float(np.sum(power)), 1e-300))
        # Between two frequencies of the spectrum both have some of it.
        near = np.arange(max(k - 1, 0), min(k + 2, power.size))
        place = float(near @ np.sqrt(power[near]) / max(np.sum(np.sqrt(power[near])), 1e-300))
        return cls(place * sample_rate / length, share)


def autocorrelation(residual: FloatArray, lags: int) -> FloatArray:
    """Autocorrelation at lags 0 to `lags`, shape (lags + 1,); NaN counts as absent."""
    known = np.isfinite(residual)
    e = np.where(known, residual - np.mean(residual[known]), 0.0)
    power = float(e @ e) or 1.0
    return np.array([float(e[: e.size - k] @ e[k:]) / power for k in range(lags + 1)])
