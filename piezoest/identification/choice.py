"""Which of several fitted models to use, and why."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piezoest.fitting import Fit
from piezoest.fitting.regression import Fitted
from piezoest.identification.result import Candidate

# A simpler model is preferred until a richer one is better by this fraction on the blocks left out.
WORTH_IT = 0.02


def _score(fit: Fit | Fitted) -> float:
    """Geometric mean of the errors on blocks between others, and on blocks behind all others [µm rms].

    Of what follows a log, the latter says more; the former is surer.
    """
    return float(np.sqrt(fit.held_out * fit.ahead))


def simplest(fits: Sequence[Fit | Fitted]) -> int:
    """Place of the simplest that predicts blocks left out about best; from the simplest to the richest."""
    scores = [_score(fit) for fit in fits]
    least = min(scores)
    return next(i for i, each in enumerate(scores) if each <= (1.0 + WORTH_IT) * least)


def score(item: Candidate) -> float:
    """What a candidate is chosen by [µm rms]."""
    return _score(item.fit)


def best_of(candidates: Sequence[Candidate]) -> Candidate:
    """The simplest of those that predict blocks left out about best; from the simplest to the richest."""
    return candidates[simplest([item.fit for item in candidates])]


def reason_for(candidates: Sequence[Candidate], best: Candidate) -> str:
    """Why that one, with the figures."""
    line = candidates[0]
    said = f"{best.label}: {score(best):.3g} µm rms on blocks left out of the fit"
    if best is not line and score(line) > 0.0:
        said += f", {100.0 * (1.0 - score(best) / score(line)):.0f} % less than a straight line"
    rivals = [item for item in candidates if score(item) < score(best)]
    if rivals:
        rival = min(rivals, key=score)
        said += (
            f"; {rival.label} has {score(rival):.3g}, which is not worth "
            f"{rival.parameters - best.parameters} more parameters"
        )
    return f"{said}."
