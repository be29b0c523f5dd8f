"""Models of two functions: what is wrong with one is said in its own words."""

import importlib
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from piezoest.models._base import REGISTERED

GOOD = """
from dataclasses import dataclass
from piezoest.compile import inlined
from piezoest.models import StepModel

@dataclass(frozen=True, slots=True)
class Mine(StepModel):
    gain: float
    tilt: float
    offset: float = 0.0
    parameter_names = ("gain", "tilt")
    parameter_units = ("µm/V", "µm/V")
    state_names = ("last",)
    is_admissible = True

@inlined
def displacement(state, u_0, u, constants):
    state[0] = u
    return constants[0] * u + constants[1] * u * abs(u) / 100.0

@inlined
def voltage(state, u_0, x, constants):
    return x / constants[0]
"""
Make = Callable[..., Any]
_numbers = itertools.count()


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    """``make(old, new)``: the class of the module above with one text in the place of another."""
    monkeypatch.syspath_prepend(tmp_path)

    def made(old: str = "", new: str = "") -> Any:
        assert old in GOOD
        name = f"step_model_of_a_test_{next(_numbers)}"
        (tmp_path / f"{name}.py").write_text(GOOD.replace(old, new) if old else GOOD)
        importlib.invalidate_caches()
        return importlib.import_module(name).Mine

    with patch.dict(REGISTERED):
        yield made


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('parameter_names = ("gain", "tilt")', "", "Mine.parameter_names must be a tuple"),
        ("state_names =", "state_names: tuple =", "Mine.state_names must be a tuple"),
        ('("µm/V", "µm/V")', '("µm/V",)', "one unit per parameter"),
        ("offset: float = 0.0", "", "must have the fields .'offset'.*"),
        ("tilt: float", "tild: float", "must have the fields .'tilt'.*"),
        ("def voltage", "def volts", "has no function voltage"),
        (
            "@inlined\ndef displacement",
            "def displacement",
            "displacement cannot be compiled: mark it @inlined",
        ),
    ],
)
def test_says_what_is_wrong(make: Make, old: str, new: str, words: str) -> None:
    model = make(old, new)
    with pytest.raises(TypeError, match=words):
        model(0.15, 0.01).simulate(np.zeros(3))
