"""`piezoest bench safety` is not flooded by what its runs warn of."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from piezoest.bench.quiet import quiet
from piezoest.cli import app

OWN = """
import logging
from piezoest.bench.zoo.controllers import Line

class Loud(Line):
    def __init__(self, sample_rate, limits):
        super().__init__(0.15, 0.0, limits)
        logging.getLogger("piezoest.controller").warning("fell back")
"""


def flood(capfd: Any) -> str:
    """What Python writes where nobody handles a warning of piezoest."""
    logging.getLogger("piezoest.controller").warning("fell back")
    return str(capfd.readouterr().err)


@pytest.mark.parametrize("how", [("--workers", "2"), ("--show", "0")])
def test_warnings_of_runs_are_not_on_the_screen(
    how: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    name = f"loud_controller_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(OWN, encoding="utf-8")
    words = ["bench", "safety", "-c", f"{name}:Loud", "-o", str(tmp_path / "out"), "--runs", "2", *how]
    with monkeypatch.context() as unheard:
        unheard.setattr(logging.getLogger(), "handlers", [])  # pytest's own
        assert "fell back" in flood(capfd)
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, result.output
        assert "fell back" not in result.output + capfd.readouterr().err
        assert "fell back" in flood(capfd), "as it was before"


def test_who_listens_hears_them(caplog: pytest.LogCaptureFixture) -> None:
    with quiet():
        logging.getLogger("piezoest.controller").warning("fell back")
    assert caplog.messages == ["fell back"]
