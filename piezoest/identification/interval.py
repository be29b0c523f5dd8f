"""Between what a reading will lie, if other kinds than the chosen one may be right as well."""

from collections.abc import Iterable

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting import Prediction
from piezoest.identification.candidate import Candidate

# Kinds may be right as well that miss blocks left out by no more than this times what the chosen one does.
# Those that miss them by up to the second one are not right in the record; but where they differ by more than
# anywhere in it, the voltage does what no kind was tested on. Chosen on 300 simulated logs (seeds 7000 to
# 7299 of benchmarks/logs.py), and on 96 that come to rest behind the fitted part.
AS_WELL, STILL = 1.5, 4.0


def interval(best: Candidate, candidates: Iterable[Candidate], u: FloatArray | None) -> Prediction:
    """Prediction of the best kind along a voltage [V], or the record; wider by how far others are from it."""
    own, apart = _along(best, u), [np.zeros(1)]
    for each in candidates:
        if each is best or each.cross_validated > STILL * best.cross_validated:
            continue
        differs = np.abs(_along(each, u).x - own.x)
        if each.cross_validated > AS_WELL * best.cross_validated:
            fitted = slice(best.fit.left_out, best.fit.counts.size)
            differs -= np.max(np.abs(each.prediction.x - best.prediction.x)[fitted])
        apart.append(differs.clip(0.0))
    half = np.hypot(own.upper - own.x, np.max(np.broadcast_arrays(*apart), axis=0))
    return Prediction(own.x, own.x - half, own.x + half)


def _along(one: Candidate, u: FloatArray | None) -> Prediction:
    return one.prediction if u is None else one.fit.predict(u)
