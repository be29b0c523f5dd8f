"""`piezoest bench adaptation`."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

EPILOG = (
    "Examples: piezoest bench adaptation --scenario gain-step --seeds 20; "
    'piezoest bench adaptation --estimator "HysteresisRLS(memory=0.2)" --estimator my_module:MyEstimator '
    "--json adaptation.json"
)


def adaptation(
    scenario: Annotated[
        list[str] | None, typer.Option("--scenario", help="Only this one; may be repeated. Default all.")
    ] = None,
    estimator: Annotated[
        list[str] | None,
        typer.Option(
            "--estimator",
            metavar="NAME|MODULE:CLASS",
            help='May be repeated, and have arguments: "HysteresisRLS(memory=0.4)".',
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each scenario and estimator.")] = 5,
    sample_rate: Annotated[
        float,
        typer.Option(min=2000.0, help="Hz; at 20 000 and below the stage leaves its filters out."),
    ] = 50_000.0,
    periods: Annotated[int, typer.Option(min=4, help="Of the reference, after the change.")] = 15,
    json_to: Annotated[
        str | None,
        typer.Option("--json", metavar="FILE", help="Write JSON; - prints it instead of the tables."),
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default one for each core.")] = None,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Write a page with interactive plots.")
    ] = None,
) -> None:
    """How fast estimators adapt: scenarios × estimators × seeds, beside linear feed-forward.

    Errors are those of the true displacement in the ring of the simulated stage and the inverse
    compensator, 5 µm at 5 Hz where nothing else is said.
    """
    from piezoest.bench.commands import (
        INTERRUPTED,
        _check_html,
        _json_target,
        _origin,
        _progress,
        _write_html,
    )

    target = _json_target(json_to)
    _check_html(html)
    began = time.perf_counter()
    overrides = {"sample_rate": sample_rate, "after": periods}
    try:
        with _progress() as say:
            say("loading (compiles once after the installation)")
            from piezoest.bench.adaptation import default_estimators, in_parallel, jobs_for
            from piezoest.bench.scenarios import SCENARIOS

            names = scenario or list(SCENARIOS)
            chosen = estimator or default_estimators()
            try:
                work = jobs_for(names, chosen, range(seeds), overrides)
            except ValueError as error:
                raise typer.BadParameter(str(error)) from None
            runs: list[Any] = []
            for done, some in enumerate(in_parallel(work, jobs), 1):
                runs += some
                # Some fifty lines where stderr is a file.
                if done * 50 // len(work) > (done - 1) * 50 // len(work):
                    say(f"{done} of {len(work)} cases, {time.perf_counter() - began:.0f} s")
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    origin = {**_origin(), "seconds": round(time.perf_counter() - began, 1), "seeds": seeds}
    document = _document(runs, origin, overrides, list(chosen))
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    _write_html(document, html)
    if json_to == "-":
        typer.echo(text)
        return
    from piezoest.bench.adaptation_report import print_report

    print_report(document, Console())
    if target is not None:
        target.write_text(text + "\n", encoding="utf-8")
        typer.echo(f"JSON: {target}")


def _document(
    runs: list[Any], origin: dict[str, Any], overrides: dict[str, Any], chosen: list[str]
) -> dict[str, Any]:
    from piezoest.bench.adaptation import summarise
    from piezoest.bench.adaptation_report import criteria
    from piezoest.bench.scenarios import SCENARIOS

    runs = sorted(runs, key=lambda run: (list(SCENARIOS).index(run.scenario), run.seed))
    summary = summarise(runs)
    names = dict.fromkeys(run.scenario for run in runs)
    failures = [
        f"{run.scenario}, seed {run.seed}, {run.estimator}: {run.failure}" for run in runs if run.failure
    ]
    return {
        "suite": "adaptation",
        **origin,
        "conditions": overrides,
        "scenarios": {name: SCENARIOS[name].description for name in names},
        "estimators": chosen,
        "summary": summary,
        "criteria": criteria(summary),
        "failures": failures,
        "runs": [run.to_dict() for run in runs],
    }
