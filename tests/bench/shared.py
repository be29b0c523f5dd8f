"""What tests of benchmarks share: a small rig, modules of one's own, and the command."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from piezoest._checks import FloatArray
from piezoest.bench.store import opened
from piezoest.bench.zoo import draw
from piezoest.bench.zoo.rig import Rig
from piezoest.cli import app
from piezoest.compensators import VoltageLimits

# A run of the table, and a rig of the zoo.
SMALL: dict[str, Any] = {
    "sample_rate": 2000.0, "before": 1, "after": 6, "rest": 0.2, "drift": 1.4, "updates": 20,
}  # fmt: skip
SHORT: dict[str, Any] = {
    "family": "coleman-hodgdon", "limits": "±100", "gain": 0.15, "width": 0.15, "sample_rate": 1000.0,
    "frequency": 10.0, "amplitude": 10.0, "waves": 14, "reference": "triangle", "delay": 0, "noise": 1e-3,
    "hum": 0.0, "drift": 0.0, "creep": 0.0, "mechanics": "none", "slew": np.inf, "resolution": 0.0,
    "volts": 0.0, "block": 20,
}  # fmt: skip


class Line:
    """u = (r - centre)/gain within the limits; learns nothing. `gain`, `centre`: [µm/V] and [µm]."""

    def __init__(self, gain: float, centre: float, limits: VoltageLimits) -> None:
        self._gain, self._centre, self._limits = gain, centre, limits
        self.events: tuple[()] = ()
        self.status: dict[str, Any] = {"model": "line"}

    def step(self, r: float) -> float:
        u = (r - self._centre) / self._gain
        return min(max(u, self._limits.minimum), self._limits.maximum)

    def run(self, r: FloatArray) -> FloatArray:
        return np.clip((r - self._centre) / self._gain, self._limits.minimum, self._limits.maximum)

    def learn(self, u: Any, x: Any) -> None:
        pass


def rig_with(fault: str = "none", mode: str | None = None, **given: Any) -> Rig:
    return draw(5, **{**SHORT, "fault": fault, "mode": mode, **given})


def bench(*arguments: object, columns: int = 80) -> Result:
    words = ["bench", *map(str, arguments)]
    return CliRunner().invoke(app, words, env={"COLUMNS": str(columns)})


def said(result: Result) -> str:
    """What it printed, out of its boxes."""
    return " ".join(result.output.replace("│", " ").split())


def own_module(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> str:
    """A module of one's own in the folder one is in; another of the same name would stay loaded."""
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)
    name = f"own_{folder.name}"
    (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return name


def kept(path: Path) -> int:
    """How many rows a store has."""
    with opened(path) as file:
        return int(file.execute("SELECT count(*) FROM runs").fetchone()[0])
