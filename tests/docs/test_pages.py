"""README and documentation: their numbers are those of docs/data, and tests that they name are there."""

import importlib
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def program(name: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module(name)


def test_readme_has_the_figures_of_the_data(monkeypatch: pytest.MonkeyPatch) -> None:
    readme = program("readme", monkeypatch)
    _, inside, _ = readme.parts((ROOT / "README.md").read_text(encoding="utf-8"))
    assert inside == readme.figures(), "run python docs/readme.py"


def test_tests_that_pages_name_are_there() -> None:
    pages = [*DOCS.glob("*.rst"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    texts = [page.read_text(encoding="utf-8") for page in pages]
    named = [found for text in texts for found in re.findall(r"(tests/[\w/]+\.py)::(\w+)", text)]
    assert named
    for file, test in named:
        assert f"def {test}(" in (ROOT / file).read_text(encoding="utf-8")
