"""`piezoest export`: its commands. Heavy imports wait inside them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from piezoest._errors import errors
from piezoest._files import read_json

if TYPE_CHECKING:
    from piezoest.models import Model

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Take a model or an estimator to a controller: C, co-simulation unit, tables.",
)

Source = Annotated[
    Path,
    typer.Argument(
        metavar="MODEL_OR_PROFILE",
        help="JSON: a model, what identify --output wrote, an estimator's to_dict(), or both under "
        "model and estimator, with limits.",
    ),
]
Learns = Annotated[
    str | None, typer.Option("--estimator", help="rls or ekf learns from the model on; none keeps it.")
]
Rate = Annotated[float | None, typer.Option(help="Samples per second of the controller.")]
Minimum = Annotated[float | None, typer.Option(help="Least voltage [V].")]
Maximum = Annotated[float | None, typer.Option(help="Largest voltage [V].")]
Slew = Annotated[float | None, typer.Option(help="Largest change of voltage [V/s].")]
Name = Annotated[str, typer.Option(help="Prefix of all names, and name of the files.")]
Precision = Annotated[str, typer.Option(help="double or float.")]
Interval = Annotated[int, typer.Option(min=1, help="Samples between two changes of the model.")]


@app.callback()
def _export() -> None:
    """Take a model or an estimator to a controller: C, co-simulation unit, tables."""


@app.command(
    epilog="Examples: piezoest export c model.json -o firmware --minimum 0 --maximum 150; "
    "piezoest export c model.json -o firmware --estimator rls --sample-rate 50000 --precision float"
)
def c(
    source: Source,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for header and source.")],
    estimator: Learns = None,
    sample_rate: Rate = None,
    minimum: Minimum = None,
    maximum: Maximum = None,
    slew_rate: Slew = None,
    name: Name = "piezoest_controller",
    precision: Precision = "double",
    update_interval: Interval = 50,
) -> None:
    """Write a controller in C99: one header, one source, no allocation."""
    with errors():
        from piezoest.export.c_code import c as generate

        pair = _pair(source, estimator, sample_rate, minimum, maximum, slew_rate)
        kind: Any = precision
        code = generate(*pair, name=name, precision=kind, update_interval=update_interval)
        for path in code.write(output):
            typer.echo(path)


@app.command(
    epilog="Example: piezoest export fmu model.json -o stage.fmu --estimator rls --sample-rate 50000"
)
def fmu(
    source: Source,
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write, ending in .fmu.")],
    estimator: Learns = None,
    sample_rate: Rate = None,
    minimum: Minimum = None,
    maximum: Maximum = None,
    slew_rate: Slew = None,
    name: Name = "piezoest_controller",
    precision: Precision = "double",
    update_interval: Interval = 50,
) -> None:
    """Write a co-simulation unit (FMI 2.0), with sources and the binary for this computer."""
    with errors():
        from piezoest.export.co_simulation import fmu as generate

        pair = _pair(source, estimator, sample_rate, minimum, maximum, slew_rate)
        kind: Any = precision
        path = generate(
            *pair, output, name=name, precision=kind, update_interval=update_interval, sample_rate=sample_rate
        )
        typer.echo(path)


@app.command(epilog="Example: piezoest export table model.json period.csv -o tables")
def table(
    source: Source,
    reference: Annotated[
        Path, typer.Argument(metavar="REFERENCE", help="CSV with one period: time_s, reference_um.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for waveform.csv and branches.csv.")],
    points: Annotated[int, typer.Option(min=2, help="Entries of each branch.")] = 257,
    column: Annotated[str | None, typer.Option(help="Column of the reference, if not guessed.")] = None,
    sample_rate: Annotated[float | None, typer.Option(help="Hz, if there is no column of time.")] = None,
) -> None:
    """Write the settled voltage of a periodic reference and the branches of its loop as CSV."""
    with errors():
        from piezoest.export.tables import table as generate
        from piezoest.records import read_reference

        model, _, _ = _read(source)
        signal = read_reference(reference, column=column, sample_rate=sample_rate)
        for path in generate(model, signal, points=points).write(output):
            typer.echo(path)


def _read(path: Path) -> tuple[Model, Any, dict[str, Any]]:
    """Model, estimator or None, and limits of a JSON file."""
    from piezoest.estimators.ekf import HysteresisEKF
    from piezoest.estimators.rls import HysteresisRLS
    from piezoest.models import model_from_dict

    data = read_json(path)
    if not isinstance(data, dict):
        raise ValueError(f"{path} holds no model: write it with identify --output")
    learnt = data if isinstance(data.get("estimator"), str) else data.get("estimator")
    estimator = None
    if isinstance(learnt, dict):
        kinds: dict[str, Any] = {"HysteresisRLS": HysteresisRLS, "HysteresisEKF": HysteresisEKF}
        kind = kinds.get(str(learnt.get("estimator")))
        if kind is None:
            raise ValueError(
                f"{path}: estimator must be one of {sorted(kinds)}, got {learnt.get('estimator')!r}"
            )
        # Where the file is the estimator's own, model and limits may stand beside it.
        beside = ("model", "limits") if learnt is data else ()
        own = {key: value for key, value in learnt.items() if key not in beside}
        try:
            estimator = kind.from_dict(own)
        except ValueError as error:
            raise ValueError(f"{path}: its estimator is not what to_dict() gave: {error}") from None
    limits = data.get("limits") or {}
    if not isinstance(limits, dict):
        raise ValueError(f'{path}: limits must be names with numbers, such as {{"maximum": 150}}')
    inner = data.get("model")
    described: dict[str, Any] = inner if isinstance(inner, dict) else data
    if estimator is not None and described is data:
        return estimator.model, estimator, dict(limits)
    try:
        model = model_from_dict(
            {key: v for key, v in described.items() if key not in ("estimator", "limits")}
        )
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return model, estimator, dict(limits)


def _pair(
    path: Path,
    kind: str | None,
    sample_rate: float | None,
    minimum: float | None,
    maximum: float | None,
    slew_rate: float | None,
) -> tuple[Any, Any]:
    """Estimator and compensator of a file and the options beside it."""
    from piezoest.compensators import InverseCompensator, LinearCompensator, VoltageLimits
    from piezoest.estimators.ekf import HysteresisEKF
    from piezoest.estimators.rls import HysteresisRLS
    from piezoest.models import LinearGain

    model, estimator, limits = _read(path)
    if kind not in (None, "none", "rls", "ekf"):
        raise ValueError(f"--estimator must be rls, ekf or none, got {kind!r}")
    if kind in ("rls", "ekf"):
        if sample_rate is None:
            raise ValueError("an estimator needs --sample-rate")
        made: Any = HysteresisRLS if kind == "rls" else HysteresisEKF
        estimator = made(sample_rate, initial_model=model)
    elif kind == "none":
        estimator = None
    stated = {"minimum": minimum, "maximum": maximum, "slew_rate": slew_rate}
    limits |= {name: value for name, value in stated.items() if value is not None}
    rate = sample_rate or getattr(estimator, "sample_rate", None)
    if rate is not None:
        limits["sample_rate"] = rate
    try:
        voltage = VoltageLimits(**{name: value for name, value in limits.items() if value is not None})
    except (TypeError, OverflowError) as error:
        raise ValueError(f"{path}: limits: {error}") from None
    if isinstance(model, LinearGain):
        return estimator, LinearCompensator(model, voltage)
    return estimator, InverseCompensator(model, voltage)
