"""Which model a recorded stage needs: all kinds fitted to one part and judged on the other."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from piezoest._checks import FloatArray
from piezoest.estimators.coordinates import late
from piezoest.estimators.play_rls import PrandtlIshlinskiiRLS
from piezoest.identification.data import prepare
from piezoest.identification.procedure import identify
from piezoest.identification.residual import Misfit, autocorrelation
from piezoest.identification.result import Identification
from piezoest.models import Model, PrandtlIshlinskii
from piezoest.records import Record

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# A simpler model is preferred until a richer one is better by this part on the held-out samples.
WORTH_IT = 0.05


@dataclass(frozen=True, slots=True)
class Candidate:
    """One kind of model, fitted and judged.

    Parameters
    ----------
    name : str
        What it is.
    model : Model
        With offset.
    parameters : int
        How many were fitted; weights at zero do not count.
    train, held_out : Misfit
        Free-running error where it was fitted and where it was not.
    bic : float
        Bayesian information criterion of the fitted part, n log(rms²) + parameters log(n), with n
        the samples that count for independent, n (1 - rho_1)/(1 + rho_1). Lower is better.
    residual : ndarray, shape (N,)
        Measured displacement less the free-running model's [µm].
    """

    name: str
    model: Model
    parameters: int
    train: Misfit
    held_out: Misfit
    bic: float
    residual: FloatArray = field(repr=False)


@dataclass(frozen=True, slots=True)
class ModelChoice:
    """Models of all kinds side by side, and which to use.

    Parameters
    ----------
    candidates : tuple of Candidate
        From the simplest to the richest.
    best : Candidate
        The one to use.
    reason : str
        Why, with the figures.
    base : Identification
        Of the Coleman-Hodgdon model, whose delay all share.
    """

    candidates: tuple[Candidate, ...]
    best: Candidate
    reason: str
    base: Identification = field(repr=False)

    @property
    def model(self) -> Model:
        """Model of the best candidate."""
        return self.best.model

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary; the model to use under ``"model"``."""
        rows = [
            {
                "name": item.name,
                "parameters": item.parameters,
                "train": item.train.to_dict(),
                "held_out": item.held_out.to_dict(),
                "bic": item.bic,
            }
            for item in self.candidates
        ]
        return {
            "format": "piezoest-choice-1",
            "source": self.base.record.source,
            "sample_rate_Hz": self.base.record.sample_rate,
            "delay_samples": self.base.delay,
            "model": self.model.to_dict(),
            "best": self.best.name,
            "reason": self.reason,
            "candidates": rows,
        }

    def plot(self) -> Figure:
        """Draw the errors of all candidates, and the residuals of the simplest and of the best.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from matplotlib.figure import Figure

        figure = Figure(figsize=(11, 6.5), layout="constrained")
        bars, series = figure.subplots(2, 1)
        place = np.arange(len(self.candidates))
        for shift, name, color in ((-0.2, "train", "0.6"), (0.2, "held_out", "C0")):
            values = [getattr(item, name).rms for item in self.candidates]
            drawn = bars.barh(place + shift, values, 0.38, color=color, label=name.replace("_", " "))
            bars.bar_label(drawn, fmt="%.3g", padding=3, fontsize="small")
        bars.set_yticks(
            place, [f"{'▸ ' if item is self.best else ''}{item.name}" for item in self.candidates]
        )
        bars.invert_yaxis()
        bars.set(xlabel="free-running error [µm rms]", title=f"{Path(self.base.record.source).name}")
        bars.legend(loc="lower right")
        time = self.base.record.time
        thin = slice(None, None, max(1, time.size // 20_000))
        for item, color in ((self.candidates[0], "0.7"), (self.best, "C0")):
            series.plot(time[thin], item.residual[thin], lw=0.7, color=color, label=item.name)
        series.axvspan(time[self.base.trained], time[-1], color="C1", alpha=0.12, lw=0, label="held out")
        series.set(xlabel="time [s]", ylabel="measured − model [µm]")
        series.legend(loc="upper right", fontsize="small", ncols=3)
        series.margins(x=0.01)
        # What was left out at the start would hide everything else.
        settled = self.candidates[0].residual[max(self.base.left_out, time.size // 50) :]
        largest = 1.1 * float(np.nanmax(np.abs(settled)))
        series.set_ylim(-largest, largest)
        return figure


def choose_model(
    record: Record,
    *,
    train: float = 0.5,
    delay: float | Literal["auto"] = "auto",
    settle: float | None = None,
) -> ModelChoice:
    """Fit models of all kinds to a record and say which to use.

    Straight line, Coleman-Hodgdon, and Prandtl-Ishlinskii (PI) with and without creep and
    asymmetry, these in one pass of `PrandtlIshlinskiiRLS`, are fitted to the first part. What
    each misses on the rest, running free, decides: the simplest model whose held-out error is
    within 5 % of the best one's.

    Parameters
    ----------
    record : Record
        With NaN where samples are missing.
    train : float
        Part of the record to fit, from its start; the rest is held out. 0.1 to 0.9.
    delay : float or "auto"
        Samples by which the displacement lags the voltage, as in `identify`.
    settle : float, optional
        Seconds to leave out at the start, as in `identify`.

    Returns
    -------
    ModelChoice

    Raises
    ------
    ValueError
        As `identify`.
    """
    base = identify(record, train=train, delay=delay, settle=settle)
    whole = prepare(record.voltage, record.displacement)
    voltage = late(whole.u, base.delay)
    first = slice(base.left_out, base.trained)
    counts = whole.counts[: base.trained].copy()
    counts[: base.left_out] = False

    def judged(name: str, model: Model, parameters: int, prediction: FloatArray) -> Candidate:
        error = np.where(whole.counts, record.displacement - prediction, np.nan)
        return Candidate(
            name, model, parameters, Misfit.of(error[first]), Misfit.of(error[base.trained :]), np.nan, error
        )

    candidates = [
        judged("straight line", base.line, 2, base.line.simulate(voltage)),
        judged("Coleman-Hodgdon", base.model, 5, base.prediction),
    ]
    rate = record.sample_rate
    for name, creep, asymmetric in (
        ("Prandtl-Ishlinskii (PI)", False, False),
        ("PI, creep", True, False),
        ("PI, asymmetric", False, True),
        ("PI, asymmetric, creep", True, True),
    ):
        options: dict[str, Any] = {} if asymmetric else {"bends": 0}
        if not creep:
            options["creep"] = ()
        estimator = PrandtlIshlinskiiRLS(rate, initial_model=base.model, **options)
        displacement = np.where(counts, record.displacement[: base.trained], np.nan)
        estimator.run(voltage[: base.trained], displacement, every=base.trained)
        model = estimator.model
        if isinstance(model, PrandtlIshlinskii):
            parameters = int(np.sum(estimator.theta > 0.0)) + 1
            candidates.append(judged(name, model, parameters, model.simulate(voltage)))
    # Of one effective number of samples, so that the criteria compare.
    n = _independent(candidates[-1].residual[first])
    candidates = [
        dataclasses.replace(
            item, bic=n * float(np.log(item.train.rms**2)) + item.parameters * float(np.log(n))
        )
        for item in candidates
    ]
    least = min(item.held_out.rms for item in candidates)
    best = next(item for item in candidates if item.held_out.rms <= (1.0 + WORTH_IT) * least)
    return ModelChoice(tuple(candidates), best, _reason(candidates, best), base)


def _independent(residual: FloatArray) -> float:
    """Samples that count for independent: n (1 - rho_1)/(1 + rho_1)."""
    rho = min(max(float(autocorrelation(residual, 1)[1]), 0.0), 0.999)
    return max(float(np.sum(np.isfinite(residual))) * (1.0 - rho) / (1.0 + rho), 2.0)


def _reason(candidates: list[Candidate], best: Candidate) -> str:
    line = candidates[0]
    said = f"{best.name}: {best.held_out.rms:.3g} µm rms held out"
    if best is not line:
        said += f", {100.0 * (1.0 - best.held_out.rms / line.held_out.rms):.0f} % less than a straight line"
    rivals = [item for item in candidates if item.held_out.rms < best.held_out.rms]
    if rivals:
        rival = min(rivals, key=lambda item: item.held_out.rms)
        said += (
            f"; {rival.name} has {rival.held_out.rms:.3g}, which is not worth "
            f"{rival.parameters - best.parameters} more parameters"
        )
    by_criterion = min(candidates, key=lambda item: item.bic)
    agrees = "agrees" if by_criterion is best else f"would take {by_criterion.name}"
    return f"{said}. The information criterion of the fitted part {agrees}."
