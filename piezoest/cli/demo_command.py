"""`piezoest demo`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from piezoest._errors import Debug, errors
from piezoest._files import check_targets, save_figure
from piezoest._options import examples, grouped
from piezoest._progress import LOADING, progress
from piezoest._tables import print_cells, say

if TYPE_CHECKING:
    from piezoest.demo import Demo

EPILOG = examples("piezoest demo --output figure.png")


@grouped
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Figure to write (PNG, PDF, SVG).")] = Path(
        "piezoest_demo.png"
    ),
    periods: Annotated[int, typer.Option(min=5, max=1000, help="Periods of the reference, 0.2 s each.")] = 15,
    seed: Annotated[int, typer.Option(min=0, help="Start of the random numbers of the stage.")] = 0,
    debug: Debug = False,
) -> None:
    """Compare linear feed-forward with adaptive compensation on a simulated stage.

    A smoothed triangle of 5 µm at 5 Hz, noise and quantisation on, from wrong start parameters; and with
    AdaptiveFeedforward, which is told the limits of the voltage and nothing else.
    """
    with errors(debug):
        check_targets(figure=output)
        with progress(LOADING) as shown:
            from piezoest.demo import run_demo

            result = run_demo(periods, seed, shown)
            shown("drawing")
            save_figure(result.plot(), output, dpi=130)
        _print_demo(result)
        typer.echo(f"Figure: {output}")


def _print_demo(result: Demo) -> None:
    from piezoest.demo import ADAPTIVE, AMPLITUDE, CONTROLLER, ESTIMATOR, FREQUENCY, LIMITS, SETTLED_PERIODS

    console = Console()
    body = []
    for name, record in result.records.items():
        first = (f"{e:.3f}" for e in record.max_error_per_period()[:4])
        body.append((name, *first, f"{record.max_error(SETTLED_PERIODS):.4f}"))
    title = f"Largest error [µm]: {AMPLITUDE:g} µm at {FREQUENCY:g} Hz, simulated stage"
    heading = ("compensation", *(f"period {period}" for period in range(1, 5)), f"last {SETTLED_PERIODS}")
    print_cells(console, title, heading, body)
    adaptive = result.records[ADAPTIVE]
    changes = zip(adaptive.parameter_names, adaptive.theta[0], adaptive.theta[-1], strict=True)
    say(
        console,
        f"Learnt from a wrong start: {', '.join(f'{name} {a:.4g} → {b:.4g}' for name, a, b in changes)}",
        f"Learnt from nothing: {', '.join(f'{name} {value:.4g}' for name, value in result.learnt.items())}",
        "Adaptive compensation reduces the settled error of linear feed-forward by "
        f"{100.0 * result.reduction(ADAPTIVE):.1f} %, AdaptiveFeedforward by "
        f"{100.0 * result.reduction(CONTROLLER):.1f} % ({result.seconds:.1f} s for the four runs).",
        "AdaptiveFeedforward is told only the sample rate and the limits of the voltage, "
        f"{LIMITS.minimum:g} V to {LIMITS.maximum:g} V. Here {ESTIMATOR.__name__} is its only estimator, "
        "which compiles sooner than those that it has by default.",
    )
