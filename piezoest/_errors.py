"""What a command says where it cannot go on."""

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import Annotated, Any

import typer
from rich.console import Console
from typer.core import TyperGroup

from piezoest._extras import MissingExtraError

USER_ERROR, INTERRUPTED = 1, 130
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


@contextlib.contextmanager
def errors(debug: bool = False) -> Iterator[None]:
    """Turn a user's mistake into one line on stderr and exit code 1."""
    try:
        yield
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    except BrokenPipeError:
        # Whoever read us has seen enough; Python must not complain about it at its end either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit(0) from None
    except (ValueError, OSError, MemoryError, MissingExtraError) as error:
        if debug:
            raise
        console = Console(stderr=True)
        text = f"error: {_said(error)}".replace("\n", " ")
        console.print(text, style="red", markup=False, highlight=False, soft_wrap=True)
        raise typer.Exit(USER_ERROR) from None


def _said(error: Exception) -> str:
    match error:
        case OSError(filename=name) if name:
            return f"{name}: {error.strerror}"
        case MemoryError():
            return f"not enough memory: {error}"
    return str(error)


class Group(TyperGroup):
    """Commands that all end by `errors`."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        with errors():
            return super().invoke(ctx)
