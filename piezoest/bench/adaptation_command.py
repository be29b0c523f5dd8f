"""`piezoest bench adaptation`."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from piezoest._errors import INTERRUPTED
from piezoest._files import write_text
from piezoest._options import grouped
from piezoest.bench.origin import origin
from piezoest.bench.shared import Html, check_html, json_target, progress, write_html

EPILOG = (
    "Examples: piezoest bench adaptation --scenario gain-step --seeds 20; "
    'piezoest bench adaptation --estimator "HysteresisRLS(memory=0.2)" --estimator my_module:MyEstimator '
    "--json adaptation.json; piezoest bench adaptation --asked --seeds 200 --sample-rate 10000"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Runs:
    """What is run."""

    scenario: Annotated[
        list[str] | None,
        typer.Option("--scenario", "-s", help="Only this one; may be repeated. Default all."),
    ] = None
    estimator: Annotated[
        list[str] | None,
        typer.Option(
            "--estimator",
            "-e",
            metavar="NAME|MODULE:CLASS",
            help='May be repeated, and have arguments: "HysteresisRLS(memory=0.4)".',
        ),
    ] = None
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each scenario and estimator.")] = 5
    sample_rate: Annotated[
        float,
        typer.Option(min=2000.0, help="Hz; at 20 000 and below the stage leaves its filters out."),
    ] = 50_000.0
    periods: Annotated[int, typer.Option(min=4, help="Of the reference, after the change.")] = 15


@grouped
def adaptation(
    runs: Runs,
    *,
    json_to: Annotated[
        str | None,
        typer.Option("--json", metavar="FILE", help="Write JSON; - prints it instead of the tables."),
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default one for each core.")] = None,
    html: Html = None,
    targets: Annotated[
        bool,
        typer.Option(
            "--asked", help="All that is asked of the default estimator, on the scenarios that tell."
        ),
    ] = False,
    policies: Annotated[
        bool,
        typer.Option("--policies", help="Each policy of HysteresisRLS in a combination that makes sense."),
    ] = False,
    figures: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Draw the transients there; with --policies.")
    ] = None,
    single: Annotated[
        bool,
        typer.Option("--runs/--no-runs", help="Every single run in the JSON, or medians and shares only."),
    ] = True,
) -> None:
    """How fast estimators adapt: scenarios × estimators × seeds, beside linear feed-forward.

    Errors are those of the true displacement in the ring of the simulated stage and the inverse
    compensator, 5 µm at 5 Hz where nothing else is said.
    """
    if targets and (runs.scenario or runs.estimator or policies):
        raise typer.BadParameter("goes without --scenario, --estimator and --policies", param_hint="--asked")
    if policies and runs.estimator:
        raise typer.BadParameter("goes without --estimator", param_hint="--policies")
    if figures is not None and not policies:
        raise typer.BadParameter("goes with --policies", param_hint="--figures")
    target = json_target(json_to)
    check_html(html)
    began = time.perf_counter()
    overrides = {"sample_rate": runs.sample_rate, "after": runs.periods}
    try:
        with progress() as say:
            say("loading (compiles once after the installation)")
            from piezoest.bench.adaptation import in_parallel

            work = _work(runs, overrides, targets=targets, policies=policies)
            found: list[Any] = []
            for done, some in enumerate(in_parallel(work, jobs), 1):
                found += some
                # Some fifty lines where stderr is a file.
                if done * 50 // len(work) > (done - 1) * 50 // len(work):
                    say(f"{done} of {len(work)} cases, {time.perf_counter() - began:.0f} s")
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    head = {**origin(began), "seeds": runs.seeds}
    document = _document(found, head, overrides, single=single)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    write_html(document, html)
    if figures is not None:
        from piezoest.bench.policy_figures import write_policies

        for path in write_policies(document, figures):
            typer.echo(f"Figure: {path}", err=json_to == "-")
    if json_to == "-":
        typer.echo(text)
        return
    from piezoest.bench.adaptation_report import print_report

    print_report(document, Console())
    if target is not None:
        write_text(target, text + "\n")
        typer.echo(f"JSON: {target}")


def _work(runs: Runs, overrides: dict[str, Any], *, targets: bool, policies: bool) -> list[Any]:
    """Jobs of the options."""
    from piezoest.bench.adaptation import default_estimators, jobs_for
    from piezoest.bench.combinations import COMBINATIONS
    from piezoest.bench.scenarios import SCENARIOS
    from piezoest.bench.targets import target_jobs

    if targets:
        return list(target_jobs(runs.seeds, overrides))
    chosen = runs.estimator or default_estimators()
    if policies:
        chosen = [one.estimator for one in COMBINATIONS]
    try:
        return list(jobs_for(runs.scenario or list(SCENARIOS), chosen, range(runs.seeds), overrides))
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def _document(
    runs: list[Any], origin: dict[str, Any], overrides: dict[str, Any], *, single: bool
) -> dict[str, Any]:
    from piezoest.bench.adaptation import place, summarise
    from piezoest.bench.estimators import REFERENCE
    from piezoest.bench.targets import criteria, describe

    runs = sorted(runs, key=lambda run: (place(run.scenario), run.seed))
    summary = summarise(runs)
    failures = [
        f"{run.scenario}, seed {run.seed}, {run.estimator}: {run.failure}" for run in runs if run.failure
    ]
    names = dict.fromkeys(run.estimator for run in runs if run.estimator != REFERENCE)
    return {
        "suite": "adaptation",
        **origin,
        "conditions": overrides,
        "scenarios": describe(run.scenario for run in runs),
        "estimators": list(names),
        "summary": summary,
        "criteria": criteria(summary),
        "failures": failures,
        "runs": [run.to_dict() for run in runs] if single else [],
    }
