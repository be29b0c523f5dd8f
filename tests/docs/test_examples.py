"""The examples in docstrings run and show what they print."""

import doctest
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import piezoest as pz

pytestmark = pytest.mark.slow


def found() -> Iterator[tuple[str, Any]]:
    names = ("signals", "export", "records", "report")
    modules = {"": pz, **{f"{name}.": getattr(pz, name) for name in names}}
    for prefix, module in modules.items():
        for name in module.__all__:
            value = getattr(module, name)
            if inspect.isclass(value) or inspect.isfunction(value):
                yield prefix + name, value


OBJECTS = dict(found())
EXAMPLES = {name: value for name, value in OBJECTS.items() if ">>>" in (inspect.getdoc(value) or "")}


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = inspect.getdoc(EXAMPLES[name]) or ""
    case = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    said: list[str] = []
    assert not doctest.DocTestRunner().run(case, out=said.append).failed, "".join(said)
