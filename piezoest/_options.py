"""Groups of options: a command has a dataclass for an argument, and typer shows the options of its fields."""

import functools
import inspect
import re
from collections.abc import Callable, Collection
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, get_type_hints

import typer

# Limits of a voltage, of whatever command.
LOWEST = typer.Option(help="Lowest voltage that stage and amplifier bear [V].")
HIGHEST = typer.Option(help="Highest voltage that stage and amplifier bear [V].")


def warn_if_unbounded(given: Collection[str]) -> None:
    """Say which limit of the voltage is not among the given ones."""
    for name, side in (("minimum", "below"), ("maximum", "above")):
        if name not in given:
            typer.echo(f"warning: no --{name}: nothing bounds the voltage from {side}", err=True)


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """The command as typer reads it: fields of the dataclasses among its arguments become options.

    Paragraphs of its docstring become lines, which the help wraps to the terminal.
    """
    signature = inspect.signature(command, eval_str=True)
    groups: dict[str, Any] = {
        name: each.annotation for name, each in signature.parameters.items() if is_dataclass(each.annotation)
    }
    parameters: list[inspect.Parameter] = []
    for name, parameter in signature.parameters.items():
        given = _options(groups[name]) if name in groups else [parameter]
        parameters += [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in given]

    @functools.wraps(command)
    def run(**given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{field.name: given.pop(field.name) for field in fields(group)})
        command(**given)

    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    run.__doc__ = re.sub(r"(?<!\n)\n(?!\n)", " ", inspect.cleandoc(command.__doc__ or ""))
    return run


def examples(*commands: str) -> str:
    """The end of a help text: a line for each command."""
    return "\n\n".join(("Example:" if len(commands) == 1 else "Examples:", *commands))


def one_of(*known: str) -> Callable[[str | None], str | None]:
    """Callback of an option that takes one of these words."""

    def check(given: str | None) -> str | None:
        if given is not None and given not in known:
            raise typer.BadParameter(f"{given!r} is not one of {', '.join(known)}")
        return given

    return check


def pairs(option: str, example: str, text: str | None) -> dict[str, str] | None:
    """``voltage=u,displacement=3`` as a dictionary."""
    if text is None:
        return None
    given = [pair.partition("=") for pair in text.split(",")]
    if any(not name.strip() or not value.strip() for name, _, value in given):
        raise typer.BadParameter(f"{text!r} does not read like {example}", param_hint=option)
    return {name.strip(): value.strip() for name, _, value in given}


def _options(group: Any) -> list[inspect.Parameter]:
    types = get_type_hints(group, include_extras=True)
    return [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            annotation=types[field.name],
            default=inspect.Parameter.empty if field.default is MISSING else field.default,
        )
        for field in fields(group)
    ]
