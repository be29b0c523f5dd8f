"""A fair ranking: every estimator tuned by the same budget on the same runs, and judged on others.

Tuned: of some settings all over its space and its default, the one whose typical error over the
training runs is least. That is the geometric mean of the largest error of each period after
the change, which weighs how fast an estimator adapts and where it ends alike. Judged: on seeds it was not
tuned on, in all scenarios, most of which it was not tuned on either, and on the other stage.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from piezoest.bench import campaign, tuning
from piezoest.bench.adaptation import follow, json_safe
from piezoest.bench.campaign import Execute, value_of
from piezoest.bench.candidates import candidate
from piezoest.bench.estimators import cost
from piezoest.bench.machine import fingerprint
from piezoest.bench.runner import STAGES, Row, Settings, Stage, Task
from piezoest.bench.scenarios import SCENARIOS
from piezoest.bench.store import Store
from piezoest.bench.tuning import Tunable
from piezoest.bench.verdicts import decide, overall, weaknesses

OTHER_STAGE: Stage = "preisach"
# What is no better than not following at all.
WORST = 1.0
FIRST_TRAINING_SEED = 1000
SHIFT = 0  # seed of the points' common shift


@dataclass(frozen=True, slots=True)
class Budget:
    """What every estimator gets.

    Parameters
    ----------
    draws : int
        Settings that are tried beside the default: a power of two.
    training_scenarios : tuple of str
        To be tuned on.
    training_seeds, seeds : tuple of int
        To be tuned on, and to be judged on.
    slow_seeds : tuple of int
        The latter for estimators that are marked slow.
    training, judging : Settings
        What the runs share.
    other_scenarios : tuple of str
        To be judged on also with the other stage, on which none is tuned.

    Raises
    ------
    ValueError
        If a seed is used for both.
    """

    draws: int = 16
    training_scenarios: tuple[str, ...] = ("cold-start", "amplitude-drop", "gain-step", "two-tone")
    training_seeds: tuple[int, ...] = (FIRST_TRAINING_SEED, FIRST_TRAINING_SEED + 1)
    seeds: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
    slow_seeds: tuple[int, ...] = (0, 1, 2)
    training: Settings = field(default_factory=lambda: Settings(before=3, after=5, after_long=2))
    judging: Settings = field(default_factory=lambda: Settings(rest=3.0, drift=4.0))
    other_scenarios: tuple[str, ...] = ("cold-start", "amplitude-drop")

    def __post_init__(self) -> None:
        if both := set(self.training_seeds) & {*self.seeds, *self.slow_seeds}:
            raise ValueError(f"seeds {sorted(both)} are tuned on: judge on others")


def tune(
    candidates: Sequence[Tunable], budget: Budget, store: Store, execute: Execute, progress: Any
) -> list[dict[str, Any]]:
    """Find the best settings of each.

    Parameters
    ----------
    candidates : sequence of Tunable
        From `piezoest.bench.tuning.tunables`.
    budget : Budget
        Of each.
    store : Store
        Where runs are kept.
    execute : callable
        Such as `piezoest.bench.campaign.over_cores`.
    progress : callable
        As `piezoest.bench.campaign.run` calls it.

    Returns
    -------
    list of dict
        Of each candidate its trials with their scores, and the one that was chosen.
    """
    # The same points for all: two with the same space get the same settings.
    trials = {each.name: tuning.draws(each, budget.draws, SHIFT) for each in candidates}
    texts = [text for some in trials.values() for text in some]
    tasks = campaign.plan(budget.training_scenarios, texts, budget.training_seeds, budget.training)
    campaign.run(tasks, store, execute, progress)
    runs: dict[str, list[Row]] = {}
    for row in store.rows(campaign.keys_of(tasks)):
        runs.setdefault(row["estimator"], []).append(row)
    found = []
    for each in candidates:
        scored: list[dict[str, Any]] = [
            {"estimator": text, "score": score(runs[text])} for text in trials[each.name]
        ]
        best = min(scored, key=lambda trial: trial["score"])
        found.append(
            {
                "name": each.name,
                "default": each.default,
                "space": {name: asdict(values) for name, values in each.space.items()},
                "slow": each.slow,
                "trials": scored,
                "default_score": scored[0]["score"],
                "chosen": best["estimator"],
                "chosen_score": best["score"],
            }
        )
    return found


def score(rows: Iterable[Row]) -> float:
    """Typical error over some runs, relative to the amplitude; less is better.

    Parameters
    ----------
    rows : iterable of dict
        From `piezoest.bench.runner.play`. A run that failed counts as one that followed nothing.
    """
    parts = [
        min(value_of(row, "mean_error") / row["amplitude"], WORST) if row["amplitude"] else WORST
        for row in rows
    ]
    return float(np.exp(np.mean(np.log(parts))))


def judge(
    tuned: Sequence[dict[str, Any]], budget: Budget, store: Store, execute: Execute, progress: Any
) -> list[Row]:
    """Run the chosen settings of each on other seeds, in all scenarios, and on the other stage.

    Parameters
    ----------
    tuned : sequence of dict
        From `tune`.
    budget : Budget
        Of each.
    store : Store
        Where runs are kept.
    execute : callable
        Such as `piezoest.bench.campaign.over_cores`.
    progress : callable
        As `piezoest.bench.campaign.run` calls it.

    Returns
    -------
    list of dict
        Rows whose estimator is the candidate's name; linear feed-forward among them.
    """
    tasks: dict[str, Task] = {}
    other = dataclasses.replace(budget.judging, stage=OTHER_STAGE)
    for slow, seeds in ((False, budget.seeds), (True, budget.slow_seeds)):
        texts = [each["chosen"] for each in tuned if each["slow"] == slow]
        if texts:
            some = campaign.plan(list(SCENARIOS), texts, seeds, budget.judging)
            some += campaign.plan(budget.other_scenarios, texts, seeds, other)
            tasks |= {task.key: task for task in some}
    # Those with the same seed and scenario one after the other; the sort is stable.
    order = list(SCENARIOS)
    ordered = sorted(
        tasks.values(), key=lambda task: (task.seed, task.settings.stage, order.index(task.scenario))
    )
    campaign.run(ordered, store, execute, progress)
    names = {each["chosen"]: each["name"] for each in tuned}
    return [
        {**row, "estimator": names.get(row["estimator"], row["estimator"])}
        for row in store.rows(campaign.keys_of(ordered))
    ]


def costs(
    tuned: Sequence[dict[str, Any]], budget: Budget, say: Callable[[str], None] = lambda _: None
) -> dict[str, dict[str, Any]]:
    """Time of each per sample, alone on a recorded cold start, one after the other.

    Parameters
    ----------
    tuned : sequence of dict
        From `tune`.
    budget : Budget
        Whose first seed is recorded.
    say : callable
        Called with a line before each.

    Returns
    -------
    dict
        By name; what fails has no times.
    """
    case = SCENARIOS["cold-start"].build(budget.seeds[0], **budget.judging.conditions("cold-start"))
    found: dict[str, dict[str, Any]] = {}
    for each in tuned:
        say(f"timing {each['name']}")
        text = each["chosen"]

        def new(text: str = text) -> Any:
            return candidate(text)(case.sample_rate, case.start)

        try:
            found[each["name"]] = cost(new, follow(case, text))
        except Exception as error:
            found[each["name"]] = {"failure": f"{type(error).__name__}: {error}"}
    return found


def describe(
    tuned: Sequence[dict[str, Any]],
    rows: Sequence[Row],
    times: dict[str, dict[str, Any]],
    budget: Budget,
    origin: dict[str, Any],
) -> dict[str, Any]:
    """Put it all into one document.

    Parameters
    ----------
    tuned : sequence of dict
        From `tune`.
    rows : sequence of dict
        From `judge`.
    times : dict
        From `costs`.
    budget : Budget
        Of each.
    origin : dict
        Date, machine, versions and seconds.

    Returns
    -------
    dict
        JSON-safe.
    """
    lines = overall(rows, times)
    document = {
        "suite": "ranking",
        **origin,
        "code": fingerprint(),
        "budget": asdict(budget),
        "stages": {name: stage.__name__ for name, stage in STAGES.items()},
        "scenarios": {name: scenario.description for name, scenario in SCENARIOS.items()},
        "candidates": list(tuned),
        "overall": lines,
        "needs": decide(rows, lines),
        "weaknesses": weaknesses(rows, lines),
        "costs": times,
        "summary": campaign.summarise(rows),
        "failures": campaign.failures(rows),
    }
    return dict(json_safe(document))
