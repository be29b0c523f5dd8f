"""`piezoest compensate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from piezoest._errors import errors
from piezoest._files import read_json
from piezoest.cli.shared import Debug, check_writable, progress

if TYPE_CHECKING:
    from piezoest.models import Model

EPILOG = (
    "Examples: piezoest compensate reference.csv --parameters model.json -o voltage.csv; "
    "piezoest compensate reference.csv --alpha 0.017 --beta 0.148 --gamma 0.0038 --maximum 150 -o voltage.csv"
)


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
    parameters: Annotated[
        Path | None,
        typer.Option("--parameters", "-p", help="Model as JSON, such as identify --output wrote."),
    ] = None,
    alpha: Annotated[float | None, typer.Option(help="1/V")] = None,
    beta: Annotated[float | None, typer.Option(help="µm/V")] = None,
    gamma: Annotated[float | None, typer.Option(help="µm/V²")] = None,
    offset: Annotated[float | None, typer.Option(help="µm at 0 V; replaces that of --parameters.")] = None,
    minimum: Annotated[float | None, typer.Option(help="Least voltage [V].")] = None,
    maximum: Annotated[float | None, typer.Option(help="Largest voltage [V].")] = None,
    column: Annotated[str | None, typer.Option(help="Column of the reference, if not guessed.")] = None,
    sample_rate: Annotated[float | None, typer.Option(help="Hz, if there is no column of time.")] = None,
    debug: Debug = False,
) -> None:
    """Turn a reference into the voltage that makes the stage follow it.

    The voltage starts from 0 V without hysteresis, or from the limit nearest to it.
    """
    with errors(debug):
        check_writable(output, keep=(reference,) if parameters is None else (reference, parameters))
        with progress("loading (compiles once after the installation)"):
            from piezoest.compensators import InverseCompensator, VoltageLimits
            from piezoest.records import read_reference, write_columns, writer_for
            from piezoest.signals import check_continuity

            writer_for(output)  # refuses a name before the work is done
            model = _model(parameters, {"alpha": alpha, "beta": beta, "gamma": gamma}, offset)
            limits = VoltageLimits(
                minimum=-float("inf") if minimum is None else minimum,
                maximum=float("inf") if maximum is None else maximum,
            )
            signal = read_reference(reference, column=column, sample_rate=sample_rate)
            compensator = InverseCompensator(model, limits, sample_rate=signal.sample_rate)
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


def _model(path: Path | None, given: dict[str, float | None], offset: float | None) -> Model:
    """Model from a JSON file, or from the three options."""
    import dataclasses

    from piezoest.models import ColemanHodgdon, LinearGain, PrandtlIshlinskii, model_from_dict

    stated = {name: value for name, value in given.items() if value is not None}
    if path is None:
        if missing := sorted(set(given) - set(stated)):
            raise ValueError(f"no model: pass --parameters FILE, or also --{' --'.join(missing)}")
        return ColemanHodgdon(**stated, offset=offset or 0.0)
    if stated:
        raise ValueError(f"two models: leave out --parameters or --{' --'.join(stated)}")
    data = read_json(path)
    if isinstance(data, dict) and isinstance(data.get("model"), dict):
        data = data["model"]
    if not isinstance(data, dict) or not isinstance(data.get("model", ""), str):
        raise ValueError(f"{path} holds no model: write it with identify --output")
    data.setdefault("model", "ColemanHodgdon")
    try:
        model = model_from_dict(data)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if not isinstance(model, ColemanHodgdon | LinearGain | PrandtlIshlinskii):
        raise ValueError(f"{path}: a {type(model).__name__} cannot be inverted here: use a ColemanHodgdon")
    return model if offset is None else dataclasses.replace(model, offset=offset)
