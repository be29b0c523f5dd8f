"""What runs say of estimators: means with their intervals, orders, and whether a difference is beyond chance.

Runs with the same scenario, stage and seed are paired, so that what a seed brings with it cancels. The
logarithm of the ratio of two errors, averaged over scenarios and stages for each seed, is put to Wilcoxon's
signed-rank test. Many comparisons are allowed for: by Holm's correction where estimators are put in order, by
the false discovery rate where two campaigns are compared.

F. Wilcoxon, Biometrics Bulletin 1 (1945) 80-83; S. Holm, Scandinavian Journal of Statistics 6 (1979) 65-70;
Y. Benjamini, Y. Hochberg, Journal of the Royal Statistical Society B 57 (1995) 289-300.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from piezoest._checks import FloatArray
from piezoest.bench.estimators import LINEAR

QUANTITIES = ("typical", "settled", "first", "worst")
FAILED = 10.0  # error of a run that failed or left all bounds, relative to the amplitude
RESAMPLED = 2000
LEVEL = 0.05


@dataclass(frozen=True, slots=True)
class Need:
    """Something one may want of an estimator, and the number that tells."""

    words: str  # what is wanted
    quantity: str  # error that should be small
    scenarios: tuple[str, ...] = ()  # where it is taken; empty for all


CHANGES = ("amplitude-switch", "amplitude-drop", "gain-step")
NEEDS = (
    Need("Unknown use: mean over all scenarios", "typical"),
    Need("A start without correct parameters", "typical", ("cold-start",)),
    Need("Fast recovery after a change of amplitude or gain", "typical", CHANGES),
    Need("A small first error at such a change", "first", CHANGES),
    Need("The least error once settled, one amplitude", "settled", ("cold-start",)),
    Need("Minor loops and signals that do not repeat", "settled", ("prbs", "random-walk", "two-tone")),
    Need("A gain that falls by 1 % a second", "settled", ("drift",)),
    Need("Rests of 5 s", "first", ("dwell",)),
    Need("A sensor with 0.1 to 30 nm of noise", "settled", ("noise",)),
)


def relative(runs: pd.DataFrame) -> pd.DataFrame:
    """Runs with errors relative to the amplitude; what failed has large ones, and never settles."""
    frame = runs.copy()
    amplitude = frame["amplitude"].astype(float)
    for name in QUANTITIES:
        errors = (frame[name].astype(float) / amplitude).to_numpy(float, na_value=np.inf)
        frame[name] = np.clip(errors, 1e-12, FAILED)
    frame["settles"] = frame["settles"].to_numpy(float, na_value=np.inf)
    frame["period"] = frame["period"].to_numpy(float, na_value=np.nan)
    frame["diverged"] = frame["diverged"].fillna(True).astype(bool)
    return frame


def logarithms(frame: pd.DataFrame, quantity: str) -> pd.DataFrame:
    """Logarithm of an error: a row for each stage and scenario, a column for each seed."""
    return np.log(frame.pivot_table(index=["stage", "scenario"], columns="seed", values=quantity))


def over_scenarios(frame: pd.DataFrame, quantity: str) -> float:
    """Geometric mean over stages and scenarios of the median over the seeds."""
    return math.exp(float(logarithms(frame, quantity).median(axis=1).mean()))


def interval(frame: pd.DataFrame, quantity: str) -> list[float]:
    """The same, and the 95 % interval that other seeds would lie in, by the bootstrap over the seeds."""
    return _interval(logarithms(frame, quantity).to_numpy())


def _interval(values: FloatArray) -> list[float]:
    """Geometric mean of medians over the seeds, and its 95 % interval. `values`: a column for each seed."""
    seeds = values.shape[1]
    drawn = values[:, np.random.default_rng(0).integers(0, seeds, (RESAMPLED, seeds))]
    means = np.nanmean(np.nanmedian(drawn, axis=2), axis=0)
    found = np.mean(np.nanmedian(values, axis=1))
    return [math.exp(value) for value in (found, *np.quantile(means, (0.025, 0.975)))]


def order(frame: pd.DataFrame, need: Need, stages: Sequence[str]) -> list[dict[str, Any]]:
    """Estimators in order of a need, the best first, each compared with the best by the runs they share.

    `frame`: runs, from `relative`. `stages`: of the campaign; who ran on the first one only is never the
    best. Returns ``value``, over the stages on which an estimator ran, and ``ratio`` to the best, both with
    their intervals, and ``p``, allowed for the number of comparisons (Holm).
    """
    there = frame[frame["scenario"].isin(need.scenarios)] if need.scenarios else frame
    runs = {str(name): group for name, group in there.groupby("estimator", sort=False) if name != LINEAR}
    everywhere = {name for name, group in runs.items() if set(group["stage"]) >= set(stages)}
    ranked = sorted(runs, key=lambda name: over_scenarios(runs[name], need.quantity))
    best = next((name for name in ranked if name in everywhere), ranked[0])
    found: list[dict[str, Any]] = []
    for name in ranked:
        d = _by_seed(runs[name], runs[best], need.quantity)
        found.append(
            {
                "estimator": name,
                "everywhere": name in everywhere,
                "value": interval(runs[name], need.quantity),
                "ratio": _interval(d[np.newaxis]),
                "p": 1.0 if name == best else signed_rank(d),
            }
        )
    for row, p in zip(found, holm([row["p"] for row in found]), strict=True):
        row["p"] = p
    return sorted(found, key=lambda row: (row["ratio"][0], row["estimator"] != best))


def _by_seed(ours: pd.DataFrame, theirs: pd.DataFrame, quantity: str) -> FloatArray:
    """Mean logarithm of the ratio of two estimators' errors, for each seed that both have."""
    difference = logarithms(ours, quantity) - logarithms(theirs, quantity)
    return difference.mean(axis=0).dropna().to_numpy()


def holm(p: Sequence[float]) -> list[float]:
    """Values of p that allow for the number of comparisons (Holm 1979)."""
    number = sum(value < 1.0 for value in p)
    found, largest = list(p), 0.0
    for rank, k in enumerate(sorted(range(len(p)), key=lambda k: p[k])):
        largest = max(largest, min(1.0, p[k] * max(number - rank, 1)))
        found[k] = largest
    return found


def signed_rank(d: FloatArray) -> float:
    """Two-sided p of Wilcoxon's signed ranks; zeros are left out, infinite ones are the largest."""
    from scipy.stats import PermutationMethod, wilcoxon

    d = d[d != 0.0]
    if d.size < 2:
        return 1.0
    finite = np.abs(d[np.isfinite(d)])
    d = np.clip(d, -1.0 - np.max(finite, initial=0.0), 1.0 + np.max(finite, initial=0.0))
    exact = PermutationMethod(n_resamples=2**13) if d.size <= 13 else "auto"
    return float(wilcoxon(d, method=exact).pvalue)
