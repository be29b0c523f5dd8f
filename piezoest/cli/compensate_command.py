"""`piezoest compensate`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from piezoest._errors import errors
from piezoest._files import read_object
from piezoest._options import grouped
from piezoest.cli.shared import Debug, check_writable, progress

if TYPE_CHECKING:
    from piezoest.models import Model

EPILOG = (
    "Examples: piezoest compensate reference.csv --parameters model.json -o voltage.csv; "
    "piezoest compensate reference.csv --alpha 0.017 --beta 0.148 --gamma 0.0038 --maximum 150 -o voltage.csv"
)

NO_MODEL = "model: write it with identify --output"  # behind the name of a file that holds none


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """The model: in a file, or by its parameters."""

    parameters: Annotated[
        Path | None,
        typer.Option("--parameters", "-p", help="Model as JSON, such as identify --output wrote."),
    ] = None
    alpha: Annotated[float | None, typer.Option(help="1/V")] = None
    beta: Annotated[float | None, typer.Option(help="µm/V")] = None
    gamma: Annotated[float | None, typer.Option(help="µm/V²")] = None
    offset: Annotated[float | None, typer.Option(help="µm at 0 V; replaces that of --parameters.")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What the amplifier can do."""

    minimum: Annotated[float | None, typer.Option(help="Least voltage [V].")] = None
    maximum: Annotated[float | None, typer.Option(help="Largest voltage [V].")] = None


@grouped
def compensate(
    reference: Annotated[
        Path,
        typer.Argument(
            metavar="REFERENCE", help="File with time_s, reference_um: CSV, Parquet, HDF5, MATLAB or NumPy."
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            help="File to write: time_s, voltage_V, reference_um; its ending says the format (.csv, .mat).",
        ),
    ],
    stated: Stated,
    limits: Limits,
    column: Annotated[str | None, typer.Option(help="Column of the reference, if not guessed.")] = None,
    sample_rate: Annotated[float | None, typer.Option(help="Hz, if there is no column of time.")] = None,
    debug: Debug = False,
) -> None:
    """Turn a reference into the voltage that makes the stage follow it.

    The voltage starts from 0 V without hysteresis, or from the limit nearest to it.
    It learns nothing on the way: on a stage with a sensor, piezoest.AdaptiveFeedforward does, in a script.
    """
    with errors(debug):
        check_writable(
            output, keep=(reference,) if stated.parameters is None else (reference, stated.parameters)
        )
        with progress("loading (compiles once after the installation)"):
            from piezoest.compensators import InverseCompensator, VoltageLimits
            from piezoest.records import read_reference, write_columns, writer_for
            from piezoest.signals import check_continuity

            writer_for(output)  # refuses a name before the work is done
            model = _model(stated)
            voltage_limits = VoltageLimits(
                minimum=-float("inf") if limits.minimum is None else limits.minimum,
                maximum=float("inf") if limits.maximum is None else limits.maximum,
            )
            signal = read_reference(reference, column=column, sample_rate=sample_rate)
            compensator = InverseCompensator(model, voltage_limits, sample_rate=signal.sample_rate)
            check_continuity(signal.values, signal.sample_rate, "the reference")
            voltage = compensator.run(signal.values)
            columns = {"time_s": signal.time, "voltage_V": voltage, "reference_um": signal.values}
            write_columns(output, columns, allow_nan=False)
        typer.echo(
            f"{output}: {voltage.size} samples at {signal.sample_rate:.6g} Hz, "
            f"{voltage.min():.4g} to {voltage.max():.4g} V"
        )
        if limited := compensator.status.saturated:
            typer.echo(
                f"{limited} samples ({100.0 * limited / voltage.size:.1f} %) are at a limit of the voltage: "
                "there the stage will not follow the reference",
                err=True,
            )


def _model(stated: Stated) -> Model:
    """Model from a JSON file, or from the three options."""
    from piezoest.models import ColemanHodgdon, model_from_dict

    path, offset = stated.parameters, stated.offset
    options = {"alpha": stated.alpha, "beta": stated.beta, "gamma": stated.gamma}
    given = {name: value for name, value in options.items() if value is not None}
    if path is None:
        if missing := sorted(set(options) - set(given)):
            raise ValueError(f"no model: pass --parameters FILE, or also --{' --'.join(missing)}")
        return ColemanHodgdon(**given, offset=offset or 0.0)
    if given:
        raise ValueError(f"two models: leave out --parameters or --{' --'.join(given)}")
    data = read_object(path, NO_MODEL)
    match data.get("model", "ColemanHodgdon"):
        case dict(nested):
            data = {"model": "ColemanHodgdon", **nested}
        case str(name):
            data = {**data, "model": name}
        case _:
            raise ValueError(f"{path} holds no {NO_MODEL}")
    try:
        model: Any = model_from_dict(data)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if not hasattr(model, "invert"):
        raise ValueError(f"{path}: a {type(model).__name__} cannot be inverted here: use a ColemanHodgdon")
    return model if offset is None else replace(model, offset=offset)
