"""The examples in docstrings run and show what they print."""

import doctest
import inspect
from pathlib import Path

import pytest

import piezoest as pz

pytestmark = pytest.mark.slow
MODULES = {"": pz, "signals.": pz.signals, "export.": pz.export, "records.": pz.records, "report.": pz.report}
PUBLIC = {prefix + name: getattr(of, name) for prefix, of in MODULES.items() for name in of.__all__}
CODE = {name: value for name, value in PUBLIC.items() if inspect.isclass(value) or inspect.isfunction(value)}
EXAMPLES = {name: text for name, value in CODE.items() if ">>>" in (text := inspect.getdoc(value) or "")}


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    case = doctest.DocTestParser().get_doctest(EXAMPLES[name], {}, name, None, 0)
    said: list[str] = []
    assert not doctest.DocTestRunner().run(case, out=said.append).failed, "".join(said)
