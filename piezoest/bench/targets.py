"""Targets of an adaptation that needs no tuning: the runs that show them, and the verdicts.

Settled within two periods after a change, in nearly every run; settled error near that of the best fixed
memory chosen with hindsight; far below linear feed-forward; unmoved by a dwell.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from piezoest.bench.adaptation import FIXED_MEMORIES, SOON, Job
from piezoest.bench.scenarios import SCENARIOS

DEFAULT, OUTPUT_ERROR = "HysteresisRLS", "OutputErrorRLS"
# As the paper has it, and with the offset that the default learns.
FIXED = tuple(
    f"{DEFAULT}(memory={memory:g}{offset})" for memory in FIXED_MEMORIES for offset in ("", ", offset=True")
)
CHANGES = ("cold-start", "amplitude-switch", "amplitude-drop", "gain-step")
LEAST_SETTLED = 0.95
LARGEST_OVER_BEST = 1.2
LARGEST_RATIO = 0.03
LARGEST_REST_EXCURSION = 1e-3
LARGEST_AFTER_REST = 1.1  # noise makes two equal periods differ by a few per cent

# The paper's triangle rows (µm, Hz), at its rate: the stage's filters belong to them.
TRIANGLES = ((2.5, 5.0), (5.0, 5.0), (7.5, 5.0), (5.0, 2.5))
PAPER_RATE = 50_000.0
FEW = 20  # seeds of what costs much and scatters little

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Situation:
    """A scenario under some conditions, with the estimators that have a target in it.

    Parameters
    ----------
    scenario : str
        Name in `SCENARIOS`.
    estimators : tuple of str
        As `piezoest.bench.candidates.candidate` reads them.
    title : str
        What its runs are said to be of.
    description : str
        One line.
    overrides : dict
        Fields of `piezoest.bench.cases.Conditions`.
    seeds : int or None
        At most so many.
    """

    scenario: str
    estimators: tuple[str, ...]
    title: str
    description: str
    overrides: dict[str, Any] = field(default_factory=dict)
    seeds: int | None = None


def triangle_title(amplitude: float, frequency: float) -> str:
    """What the runs of a triangle row are said to be of.

    Parameters
    ----------
    amplitude : float
        [µm].
    frequency : float
        [Hz].
    """
    return f"triangle of {amplitude:g} µm at {frequency:g} Hz"


WITHOUT_CREEP = "dwell without creep"

SITUATIONS: tuple[Situation, ...] = (
    *(
        Situation(name, (DEFAULT, *FIXED, OUTPUT_ERROR), name, SCENARIOS[name].description)
        for name in CHANGES
    ),
    Situation("dwell", (DEFAULT,), "dwell", SCENARIOS["dwell"].description),
    Situation(
        "dwell", (DEFAULT,), WITHOUT_CREEP, "The same on a stage that does not creep.",
        {"creep": False}, FEW,
    ),
    *(
        Situation(
            "cold-start", (DEFAULT, OUTPUT_ERROR), triangle_title(amplitude, frequency),
            f"Cold start at {PAPER_RATE:g} Hz, with the stage's filters.",
            {"amplitude": amplitude, "frequency": frequency, "sample_rate": PAPER_RATE}, FEW,
        )
        for amplitude, frequency in TRIANGLES
    ),
)  # fmt: skip


def target_jobs(seeds: int, overrides: dict[str, Any]) -> list[Job]:
    """Every run that the criteria need.

    Parameters
    ----------
    seeds : int
        Runs of each situation, fewer of those that cost much.
    overrides : dict
        Fields of `piezoest.bench.cases.Conditions`; a situation's own come first.

    Returns
    -------
    list of Job
    """
    return [
        Job(one.scenario, seed, one.estimators, {**overrides, **one.overrides}, title=one.title)
        for one in SITUATIONS
        for seed in range(min(seeds, one.seeds or seeds))
    ]


def describe(titles: Iterable[str]) -> dict[str, str]:
    """One line about each.

    Parameters
    ----------
    titles : iterable of str
        Names of scenarios, or titles of `SITUATIONS`.
    """
    known = {one.title: one.description for one in SITUATIONS}
    return {
        title: SCENARIOS[title].description if title in SCENARIOS else known[title]
        for title in dict.fromkeys(titles)
    }


def criteria(rows: Iterable[Row]) -> list[Row]:
    """Check what the rows allow to check.

    Parameters
    ----------
    rows : iterable of dict
        From `piezoest.bench.adaptation.summarise`.

    Returns
    -------
    list of dict
        ``what``, ``value``, ``bound``, whether it is the ``least``, whether it is ``met``, and the
        ``kind`` of the criterion.
    """
    table = {(row["scenario"], row["estimator"]): row for row in rows}
    found: list[Row] = []

    def check(criterion: str, what: str, value: float | None, bound: float, *, least: bool = False) -> None:
        met = value is not None and (value >= bound if least else value <= bound)
        found.append(
            {"kind": criterion, "what": what, "value": value, "bound": bound, "least": least, "met": met}
        )

    for name in CHANGES:
        if row := table.get((name, DEFAULT)):
            what = f"{name}: part settled within {SOON} periods"
            check("settling", what, row["settled_soon"], LEAST_SETTLED, least=True)
    for name in CHANGES:
        best = best_fixed(table, name)
        if best is not None and (row := table.get((name, DEFAULT))):
            settled = row["settled_max"]["median"]
            over = None if settled is None else settled / best["settled_max"]["median"]
            what = f"{name}: settled error over the best fixed memory's"
            check("hindsight", what, over, LARGEST_OVER_BEST)
    for name in ("cold-start", *(triangle_title(*triangle) for triangle in TRIANGLES)):
        if row := table.get((name, OUTPUT_ERROR)):
            what = f"{name}, {OUTPUT_ERROR}: settled error over linear feed-forward's"
            check("linear", what, row["ratio"]["median"], LARGEST_RATIO)
    for name in ("dwell", WITHOUT_CREEP):
        if row := table.get((name, DEFAULT)):
            what = f"{name}: parameters' excursion"
            check("rest", what, row["rest_excursion"]["q95"], LARGEST_REST_EXCURSION)
            what = f"{name}: first error after over last before"
            check("rest", what, row["first_after_rest"]["q95"], LARGEST_AFTER_REST)
    mine = [row for row in table.values() if row["estimator"] == DEFAULT]
    if mine:
        check(
            "divergence",
            "runs that diverged, without the guard",
            float(sum(row["diverged"] for row in mine)),
            0.0,
        )
    return found


def best_fixed(table: dict[tuple[str, str], Row], scenario: str) -> Row | None:
    """Row of the fixed memory whose settled error is the least in the median; None if none settled.

    Parameters
    ----------
    table : dict
        Rows of `piezoest.bench.adaptation.summarise` by scenario and estimator.
    scenario : str
        Whose.
    """
    rows = [table[scenario, name] for name in FIXED if (scenario, name) in table]
    rows = [row for row in rows if row["settled_max"]["median"]]
    return min(rows, key=lambda row: float(row["settled_max"]["median"]), default=None)
