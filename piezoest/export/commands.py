"""`piezoest export`: its commands. Heavy imports wait inside them."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from piezoest._errors import Group
from piezoest._files import read_object
from piezoest._options import HIGHEST, LOWEST, examples, grouped, one_of, warn_if_unbounded

if TYPE_CHECKING:
    from piezoest.models import Model

app = typer.Typer(
    cls=Group,
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Take a model or an estimator to a controller: C, co-simulation unit, tables.",
    epilog=examples("piezoest export c model.json -o firmware --minimum 0 --maximum 150"),
)

Source = Annotated[
    Path,
    typer.Argument(
        metavar="MODEL_OR_PROFILE",
        help="JSON: a model, what identify --output wrote, an estimator's to_dict(), or both under "
        "model and estimator, with limits; for c also an AdaptiveFeedforward's to_dict().",
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """What stands beside the file, or replaces what is in it."""

    estimator: Annotated[
        str | None,
        typer.Option(
            callback=one_of("rls", "ekf", "none"), help="rls or ekf learns from the model on; none keeps it."
        ),
    ] = None
    sample_rate: Annotated[float | None, typer.Option(help="Samples per second of the controller.")] = None
    minimum: Annotated[float | None, LOWEST] = None
    maximum: Annotated[float | None, HIGHEST] = None
    slew_rate: Annotated[float | None, typer.Option(help="Largest change of voltage [V/s].")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """What the code is to be like."""

    name: Annotated[str, typer.Option(help="Prefix of all names, and name of the files.")] = (
        "piezoest_controller"
    )
    precision: Annotated[str, typer.Option(callback=one_of("double", "float"), help="double or float.")] = (
        "double"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Code(Written):
    """What the code of an estimator and a compensator is to be like."""

    update_interval: Annotated[int, typer.Option(min=1, help="Samples between two changes of the model.")] = (
        50
    )


@app.command(
    epilog=examples(
        "piezoest export c model.json -o firmware --minimum 0 --maximum 150",
        "piezoest export c model.json -o firmware --estimator rls --sample-rate 50000 "
        "--minimum 0 --maximum 150",
    )
)
@grouped
def c(
    source: Source,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for header and source.")],
    stated: Stated,
    code: Code,
) -> None:
    """Write a controller in C99: one header, one source, no allocation."""
    from piezoest.controller.adaptive_feedforward import AdaptiveFeedforward
    from piezoest.export.c_code import c as generate
    from piezoest.models.reading import NO_MODEL

    if "controller" in (data := read_object(source, NO_MODEL)):
        controller = AdaptiveFeedforward.from_dict(data)
        if any(value is not None for value in asdict(stated).values()):
            raise ValueError(f"{source} holds an AdaptiveFeedforward, with all that: give no limits, no rate")
        made = generate(controller, **asdict(code))
    else:
        made = generate(*(pair := _pair(source, stated)), **asdict(code))
        _warn(pair)
    for path in made.write(output):
        typer.echo(path)


@app.command(
    epilog=examples("piezoest export adaptive -o firmware --sample-rate 50000 --minimum 0 --maximum 150")
)
@grouped
def adaptive(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for header and source.")],
    sample_rate: Annotated[float, typer.Option(help="Samples per second of the controller.")],
    minimum: Annotated[float, LOWEST],
    maximum: Annotated[float, HIGHEST],
    written: Written,
    slew_rate: Annotated[float | None, typer.Option(help="Largest change of voltage [V/s].")] = None,
    estimators: Annotated[
        str, typer.Option(help="Some of rls, output-error, plays, ekf, with commas; or none: the line alone.")
    ] = "rls,output-error,plays",
) -> None:
    """Write an AdaptiveFeedforward in C99, which needs no model: it finds out what the stage does."""
    import piezoest as pz
    from piezoest.export.c_code import c as generate

    known: dict[str, Any] = {
        "rls": pz.HysteresisRLS, "output-error": pz.OutputErrorRLS, "plays": pz.PrandtlIshlinskiiRLS,
        "ekf": pz.HysteresisEKF,
    }  # fmt: skip
    names = [] if estimators == "none" else estimators.split(",")
    if unknown := [name for name in names if name not in known]:
        said = f"{unknown[0]!r} is not one of {', '.join(known)}, none"
        raise typer.BadParameter(said, param_hint="--estimators")
    limits = pz.VoltageLimits(minimum, maximum, slew_rate, sample_rate)
    factories = tuple(known[name] for name in names)
    controller = pz.AdaptiveFeedforward(sample_rate, limits=limits, estimators=factories)
    for path in generate(controller, **asdict(written)).write(output):
        typer.echo(path)


@app.command(
    epilog=examples(
        "piezoest export fmu model.json -o stage.fmu --estimator rls --sample-rate 50000 "
        "--minimum 0 --maximum 150"
    )
)
@grouped
def fmu(
    source: Source,
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write, ending in .fmu.")],
    stated: Stated,
    code: Code,
) -> None:
    """Write a co-simulation unit (FMI 2.0), with sources and the binary for this computer."""
    from piezoest.export.co_simulation import fmu as generate

    pair = _pair(source, stated)
    typer.echo(generate(*pair, output, **asdict(code), sample_rate=stated.sample_rate))
    _warn(pair)


@app.command(epilog=examples("piezoest export table model.json period.csv -o tables"))
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
    from piezoest.export.tables import table as generate
    from piezoest.records import read_reference

    model, *_ = _read(source)
    signal = read_reference(reference, column=column, sample_rate=sample_rate)
    for path in generate(model, signal, points=points).write(output):
        typer.echo(path)


def _read(path: Path) -> tuple[Model, Any, dict[str, Any], float]:
    """Model, estimator or None, limits, and the delay that identify measured [s], of a JSON file."""
    import piezoest as pz
    from piezoest._checks import class_named
    from piezoest.models.reading import NO_MODEL, model_from_dict

    data = read_object(path, NO_MODEL)
    if "controller" in data:
        raise ValueError(f"{path} holds an AdaptiveFeedforward: only export c takes it")
    limits = data.pop("limits", None) or {}
    if not isinstance(limits, dict):
        raise ValueError(f'{path}: limits must be names with numbers, such as {{"maximum": 150}}')
    described = data.pop("model") if isinstance(data.get("model"), dict) else data
    # The file may be the estimator's own, with model and limits beside its fields.
    learnt = data if isinstance(data.get("estimator"), str) else data.pop("estimator", None)
    estimator = None
    if learnt is not None:
        try:
            kind = class_named(learnt, "estimator", (pz.HysteresisRLS, pz.HysteresisEKF, pz.OutputErrorRLS))
            estimator = kind.from_dict(learnt)
        except ValueError as error:
            raise ValueError(f"{path}: its estimator is not what to_dict() gave: {error}") from None
    if estimator is not None and described is data:
        return estimator.model, estimator, limits, 0.0
    if "model" not in described:
        raise ValueError(f"{path} names no model: expected the JSON that identify --output wrote")
    try:
        return model_from_dict(described), estimator, limits, _delay(data)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _delay(data: dict[str, Any]) -> float:
    """The delay that identify measured [s]; zero if the log could not tell it."""
    if not (data.get("delay_known", True) and data.get("sample_rate_Hz") and data.get("delay_samples")):
        return 0.0
    from piezoest._checks import non_negative, positive

    samples = non_negative("delay_samples", data["delay_samples"])
    return samples / positive("sample_rate_Hz", data["sample_rate_Hz"])


def _warn(pair: tuple[Any, Any]) -> None:
    """Say which limit a compensator lacks."""
    limits = pair[1].limits
    warn_if_unbounded([name for name in ("minimum", "maximum") if math.isfinite(getattr(limits, name))])


def _pair(path: Path, stated: Stated) -> tuple[Any, Any]:
    """Estimator and compensator of a file and the options beside it."""
    import piezoest as pz

    model, estimator, limits, delay = _read(path)
    if stated.estimator == "none":
        estimator = None
    elif stated.estimator is not None:
        if stated.sample_rate is None:
            raise ValueError("an estimator needs --sample-rate")
        if not isinstance(model, pz.ColemanHodgdon | pz.LinearGain):
            raise ValueError(
                f"--estimator {stated.estimator} needs a ColemanHodgdon or a LinearGain, {path} holds a "
                f"{type(model).__name__}: run identify with --model coleman-hodgdon, or leave --estimator out"
            )
        kind: Any = {"rls": pz.HysteresisRLS, "ekf": pz.HysteresisEKF}[stated.estimator]
        # Without the delay that identify measured, the estimator would take it for hysteresis.
        estimator = kind(stated.sample_rate, initial_model=model, delay=delay * stated.sample_rate)
    rate = stated.sample_rate or getattr(estimator, "sample_rate", None)
    own = {"minimum": stated.minimum, "maximum": stated.maximum, "slew_rate": stated.slew_rate}
    limits |= {name: value for name, value in {**own, "sample_rate": rate}.items() if value is not None}
    try:
        voltage = pz.VoltageLimits(**{name: value for name, value in limits.items() if value is not None})
    except (TypeError, OverflowError) as error:
        raise ValueError(f"{path}: limits: {error}") from None
    feed_forward: Any = pz.LinearCompensator if isinstance(model, pz.LinearGain) else pz.InverseCompensator
    return estimator, feed_forward(model, voltage)
