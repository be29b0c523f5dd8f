"""`piezoest compensate`."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from piezoest._errors import Debug, errors
from piezoest._files import check_targets
from piezoest._options import HIGHEST, LOWEST, examples, grouped, pairs, warn_if_unbounded
from piezoest._progress import LOADING, progress

if TYPE_CHECKING:
    from piezoest._checks import FloatArray
    from piezoest.models import LearntModel
    from piezoest.signals import Signal

EPILOG = examples(
    "piezoest compensate r.csv -p model.json --minimum 0 --maximum 150 -o u.csv",
    "piezoest compensate r.csv --alpha 0.017 --beta 0.148 --gamma 0.0038 -o u.csv",
)

# The first step from rest is a jump if it is so many times the largest that follows.
JUMP = 3.0
# ... and more than this fraction of the whole swing.
MUCH = 0.1


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

    minimum: Annotated[float | None, LOWEST] = None
    maximum: Annotated[float | None, HIGHEST] = None


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
    units: Annotated[
        str | None, typer.Option(help="What 1 in a column stands for: reference=nm,time=ms.")
    ] = None,
    sample_rate: Annotated[float | None, typer.Option(help="Hz, if there is no column of time.")] = None,
    debug: Debug = False,
) -> None:
    """Turn a reference into the voltage that makes the stage follow it.

    The voltage starts at 0 V, or at the limit nearest to it; nothing bounds it without --minimum and
    --maximum. The model stays as it is. On a stage with a sensor, piezoest.AdaptiveFeedforward learns it.
    """
    with errors(debug):
        check_targets(filter(None, (reference, stated.parameters)), output=output)
        with progress(LOADING):
            import numpy as np

            from piezoest.compensators import InverseCompensator, VoltageLimits
            from piezoest.records import write_columns, writer_for
            from piezoest.records.record import named_reference
            from piezoest.signals import check_continuity

            writer_for(output)  # refuses a name before the work is done
            learnt = _model(stated)
            given = {name: value for name, value in asdict(limits).items() if value is not None}
            voltage_limits = VoltageLimits(**given)
            signal, title = named_reference(
                reference, column, pairs("--units", "reference=nm", units), sample_rate
            )
            compensator = InverseCompensator(learnt.model, voltage_limits, sample_rate=signal.sample_rate)
            check_continuity(signal.values, signal.sample_rate, "the reference")
            voltage = compensator.run(signal.values)
            columns = {"time_s": signal.time, "voltage_V": voltage, "reference_um": signal.values}
            write_columns(output, columns, allow_nan=False)
        typer.echo(f"reference: column {title}")
        typer.echo(
            f"{output}: {voltage.size} samples at {signal.sample_rate:.6g} Hz, "
            f"{voltage.min():.4g} to {voltage.max():.4g} V"
        )
        warn_if_unbounded(given)
        if limited := compensator.status.saturated:
            typer.echo(
                f"warning: {limited} samples ({100.0 * limited / voltage.size:.1f} %) are at a limit of the "
                "voltage: there the stage will not follow the reference",
                err=True,
            )
        rest = voltage_limits.rest
        usual = max(JUMP * np.abs(np.diff(voltage)).max(initial=0.0), MUCH * np.ptp(voltage))
        if abs(voltage[0] - rest) > usual:
            typer.echo(
                f"warning: the voltage jumps from {rest:g} V to {voltage[0]:.4g} V at its start: take the "
                "stage there slowly before, or let the reference begin at rest (Signal.with_lead_in)",
                err=True,
            )
        for left in _leaves(learnt, voltage, signal):
            typer.echo(
                f"warning: {left}: the model is not tested there; change the reference, or identify a log "
                "that goes as far",
                err=True,
            )


def _model(stated: Stated) -> LearntModel:
    """Model from a JSON file, or from the three options."""
    from piezoest._checks import measured
    from piezoest.models import ColemanHodgdon, LearntModel

    path = stated.parameters
    offset = None if stated.offset is None else measured("offset", stated.offset)
    options = {"alpha": stated.alpha, "beta": stated.beta, "gamma": stated.gamma}
    given = {name: value for name, value in options.items() if value is not None}
    if path is None:
        if len(given) < len(options):
            raise ValueError("no model: pass --parameters FILE, or --alpha, --beta and --gamma")
        return LearntModel(ColemanHodgdon(**given, offset=offset or 0.0))
    if given:
        raise ValueError(f"two models: leave out --parameters or --{' --'.join(given)}")
    learnt = LearntModel.read(path)
    if not hasattr(learnt.model, "invert"):
        kind = type(learnt.model).__name__
        raise ValueError(f"{path}: a {kind} cannot be inverted here: use a ColemanHodgdon")
    return learnt if offset is None else learnt.with_offset(offset)


def _leaves(learnt: LearntModel, voltage: FloatArray, signal: Signal) -> tuple[str, ...]:
    """In what this leaves the ranges that the model was learnt on."""
    from piezoest.models import LearntOn

    if learnt.learnt_on is None:
        return ()
    return learnt.learnt_on.left_by(LearntOn.of(voltage, signal.values, signal.sample_rate))
