"""`piezoest bench`: its commands. Heavy imports wait inside them."""

import time
from pathlib import Path
from typing import Annotated

import typer

from piezoest._errors import Group
from piezoest._options import examples, grouped
from piezoest._progress import LOADING, progress
from piezoest.bench import safety_command, shared, table_command
from piezoest.bench.origin import origin

app = typer.Typer(
    cls=Group, rich_markup_mode="rich", context_settings={"help_option_names": ["-h", "--help"]}
)

app.callback(invoke_without_command=True, epilog=table_command.EPILOG)(table_command.table)
app.command(epilog=table_command.COMPARE_EPILOG)(table_command.compare)
app.command(epilog=safety_command.EPILOG)(safety_command.safety)


@app.command(
    epilog=examples(
        "piezoest bench paper",
        "piezoest bench paper --json paper.json --figures figures",
        "piezoest bench paper --quick",
    )
)
@grouped
def paper(
    json_to: shared.Json = None,
    figures: Annotated[
        Path | None,
        typer.Option(
            "--figures", metavar="DIR", file_okay=False, help="Write Figs. 3 to 5 and two more as PNG."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Start of the random numbers of the stage.")] = 0,
    quick: Annotated[bool, typer.Option("--quick", help="Without the sweep over the memory.")] = False,
    jobs: shared.Processes = None,
    html: shared.Html = None,
) -> None:
    """Tables I, II and III of the paper beside those of the simulated stage.

    The paper's procedure at 50 kHz: each row adapts while it runs, until it is stationary. The stage was
    calibrated to the rows marked calibration; it has never seen those marked held out.
    """
    shared.check(json_to, html)
    began = time.perf_counter()
    with shared.usage(), progress("runs", lines=True) as say:
        say(LOADING)
        from piezoest.bench.paper import MEMORIES, run_paper
        from piezoest.bench.paper_report import print_report

        result = run_paper(() if quick else MEMORIES, seed=seed, workers=jobs, progress=say.done)
    document = {"suite": "paper", **origin(began), **result.to_dict()}
    shared.write_html(document, html)
    if figures is not None:
        from piezoest.bench.figures import write_figures
        from piezoest.bench.paper_figures import drawings

        write_figures(drawings(result), figures, quiet=json_to == "-")
    shared.show(document, json_to, print_report)
