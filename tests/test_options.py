"""Groups of options: each field of a dataclass is an option of the command, and comes back in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer
from typer.testing import CliRunner

from piezoest._options import grouped


@dataclass(frozen=True)
class Size:
    width: Annotated[int, typer.Option("--width", "-w", min=1, help="How wide.")]
    height: Annotated[float, typer.Option(help="How high.")] = 2.5


app = typer.Typer()


@app.command()
@grouped
def draw(name: Annotated[str, typer.Argument()], size: Size, *, bold: bool = False) -> None:
    """Draw something."""
    typer.echo(f"{name} {size} {bold}")


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, arguments)
    return result.exit_code, result.output


def test_fields_are_options_and_come_back_in_their_class() -> None:
    assert run("box", "-w", "3", "--bold") == (0, f"box {Size(3)} True\n")
    assert run("box", "--width", "3", "--height", "1") == (0, f"box {Size(3, 1.0)} False\n")


def test_options_keep_their_checks_and_their_help() -> None:
    assert run("box")[0] == run("box", "-w", "0")[0] == 2
    code, text = run("--help")
    assert code == 0
    for words in ("Draw something", "--width", "How wide", "How high", "--bold"):
        assert words in text
