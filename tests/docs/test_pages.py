"""README and documentation: their numbers are those of docs/data, their links and tests are there."""

import importlib
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from piezoest.bench.origin import code_of_parts, origin

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def program(name: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module(name)


def test_readme_has_the_figures_of_the_data(monkeypatch: pytest.MonkeyPatch) -> None:
    readme = program("readme", monkeypatch)
    _, inside, _ = readme.parts((ROOT / "README.md").read_text(encoding="utf-8"))
    assert inside == readme.figures(), "run python docs/readme.py"


def test_a_page_says_that_it_is_older_than_the_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = program("page_parts", monkeypatch)
    page = SimpleNamespace(__name__="tuning_page", pieces=lambda document: {})
    monkeypatch.setattr(parts, "DOCS", tmp_path)
    (tmp_path / "data").mkdir()
    for other, changed in (({}, []), ({"stage": "0", "cli": "0"}, ["stage"])):
        text = json.dumps(origin() | {"code": code_of_parts() | other})
        (tmp_path / "data" / "tuning.json").write_text(text, encoding="utf-8")
        document = parts.read("tuning")
        assert document["changed"] == changed
        parts.write_page(page)
        for said in (capsys.readouterr().out, parts.replacements("tuning", {}, document)):
            assert ("code of stage" in said) == bool(changed)


GOOD = (
    '<html><body id="top"><a href="other.html#there">x</a><a href="https://example.org">y</a></body></html>'
)
LINKS = {
    '<a href="none.html">': "none.html does not exist",
    '<a href="other.html#gone">': "other.html#gone: no such anchor",
    '<a href="#lost">': "#lost: no such anchor",
    '<img src="none.png">': "none.png does not exist",
    '<script src="https://cdn.example.org/x.js"></script>': "x.js comes from elsewhere",
    '<link rel="stylesheet" href="//cdn.example.org/x.css">': "x.css comes from elsewhere",
}


def test_links_that_lead_nowhere_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = program("check_links", monkeypatch).broken
    (tmp_path / "other.html").write_text('<p id="there">z</p>', encoding="utf-8")
    (tmp_path / "index.html").write_text(GOOD, encoding="utf-8")
    assert list(broken(tmp_path)) == []
    (tmp_path / "index.html").write_text(GOOD + "".join(LINKS), encoding="utf-8")
    found = list(broken(tmp_path))
    assert len(found) == len(LINKS)
    assert all(said.endswith(end) for said, end in zip(found, LINKS.values(), strict=True))


def test_tests_that_pages_name_are_there() -> None:
    pages = [*DOCS.glob("*.rst"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    texts = [page.read_text(encoding="utf-8") for page in pages]
    named = [found for text in texts for found in re.findall(r"(tests/[\w/]+\.py)::(\w+)", text)]
    assert named
    for file, test in named:
        assert f"def {test}(" in (ROOT / file).read_text(encoding="utf-8")
