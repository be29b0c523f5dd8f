"""What a fit found: a model, how far to trust it, and what it predicts."""

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray, array_1d, positive
from piezoest.fitting import trust
from piezoest.fitting.coordinates import bridged, late
from piezoest.fitting.design import Design
from piezoest.fitting.forms import FORMS
from piezoest.fitting.runs import BoolArray, IntArray
from piezoest.models import Model


class Prediction(NamedTuple):
    """Displacement (N,) [µm], and bounds between which 95 of 100 readings are expected."""

    x: FloatArray
    lower: FloatArray
    upper: FloatArray

    def __repr__(self) -> str:
        """Number of samples, and the widest bounds."""
        return f"<Prediction of {self.x.size} samples, within {np.max(self.upper - self.lower) / 2.0:.3g} µm>"


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to a record.

    Parameters
    ----------
    model : Model
        With offset.
    form : str
        Its kind, one of `FORMS`.
    parameters : int
        Number of fitted parameters; slopes at their bound do not count.
    standard_errors : dict of str to float
        Of the estimated parameters, by name, in their units; valid for residuals that are not white.
    delay : float
        Samples by which the displacement lags the voltage.
    delay_estimated : bool
        Whether the delay was estimated.
    initial_state : float or ndarray
        Initial state for `model.simulate` on this record: of plays in V, of a loop and of creep in µm.
    held_out : float
        Prediction error of each of five blocks except the first, from a fit to the others [µm rms]. It is not
        the held-out error of `identify`.
    ahead : float
        Prediction error of the last two blocks, from a fit to those before them [µm rms]; under voltages and
        loops that those have seen, if they are a fifth of the blocks.
    spread : Spread
        Distance from the prediction that 95 of 100 readings do not exceed [µm].
    counts : ndarray of bool, shape (N,)
        True for samples that were fitted: not missing, no spike, settled.
    left_out : int
        Samples at the start that were left out, because the stage had not settled.
    spikes : int
        Samples that were left out because they are single and far off.
    jumps : ndarray, shape (J,), int
        First samples after jumps of the sensor that are only seen beside the fit: further ones than `flaws`.
    drift : float
        Drift over the record, fitted together with the model [µm].
    solver : str
        Name of the solver, and the result of the check.

    Examples
    --------
    >>> import numpy as np, piezoest as pz
    >>> u = 40.0 * np.sin(np.linspace(0.0, 60.0, 6000))
    >>> x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(u)
    >>> found = pz.fit(u, x, sample_rate=1000.0, model='coleman-hodgdon')
    >>> found.form, bool(found.held_out < 1e-3)
    ('coleman-hodgdon', True)
    """

    model: Model
    form: str
    parameters: int
    standard_errors: dict[str, float]
    delay: float
    delay_estimated: bool
    initial_state: Any = field(repr=False)
    held_out: float
    ahead: float
    spread: trust.Spread
    counts: BoolArray = field(repr=False)
    left_out: int
    spikes: int
    jumps: IntArray
    drift: float
    solver: str
    _design: Design = field(repr=False)
    _w: FloatArray = field(repr=False)
    _rest: FloatArray = field(repr=False)
    _u: FloatArray = field(repr=False)

    @property
    def label(self) -> str:
        """Kind of the model in words."""
        return FORMS[self.form].label

    def predict(self, u: FloatArray | None = None) -> Prediction:
        """Displacement simulated from the voltage alone.

        Parameters
        ----------
        u : array_like, shape (N,), optional
            Voltage [V] of another record, before which the stage rests at 0 V. Default: that of the fitted
            record, with its drift and jumps.
        """
        if u is None:
            return self.continued(self._u)
        x = self.elsewhere(u)
        half = self.spread.along(_without_gaps(u), np.zeros(1))
        return Prediction(x, x - half, x + half)

    def elsewhere(self, u: FloatArray, *, sample_rate: float | None = None) -> FloatArray:
        """Displacement for a voltage, from a stage that has rested at 0 V [µm], without drift and jumps.

        Parameters
        ----------
        u : ndarray, shape (N,)
            [V].
        sample_rate : float, optional
            [Hz]; by default that of the fitted record.
        """
        own = self._design.sample_rate
        rate = own if sample_rate is None else positive("sample_rate", sample_rate)
        u = _without_gaps(u, rate)
        v = late(u, self.delay * rate / own)
        design, w = replace(self._design.afresh(v[0]), sample_rate=rate), self._w.copy()
        w[design.crept] = self._rest
        w[design.offset + 1 :] = 0.0
        return design.output(v, w)

    def continued(self, u: FloatArray) -> Prediction:
        """Displacement along a voltage that begins as the fitted one does, and goes on.

        What drifted in the record goes on, at a rate that becomes less, as that of creep does.

        Parameters
        ----------
        u : array_like, shape (N,)
            [V].
        """
        u = _without_gaps(u, self._design.sample_rate)
        x = self._design.output(late(u, self.delay), self._w)
        half = self.spread.along(u, np.maximum(np.arange(u.size) / self._u.size - 1.0, 0.0))
        return Prediction(x, x - half, x + half)

    def __repr__(self) -> str:
        return (
            f"<Fit of {self.label}: {self.held_out:.3g} µm rms on blocks left out, "
            f"{self.parameters} parameters, delay {self.delay:.3g} samples>"
        )


def _without_gaps(u: FloatArray, sample_rate: float | None = None) -> FloatArray:
    u = array_1d("u", u, allow_nan=True, sample_rate=sample_rate)
    if not np.any(np.isfinite(u)):
        raise ValueError(f"u must hold a voltage, none of its {u.size} samples is a number")
    return bridged(u)
