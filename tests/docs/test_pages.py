"""The documentation: its numbers are those of docs/data, its pages are complete, its links are checked."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def program(name: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A program of docs/, as a module."""
    monkeypatch.syspath_prepend(str(DOCS))
    specification = importlib.util.spec_from_file_location(f"docs_{name}", DOCS / f"{name}.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


# ---------------------------------------------------------------- README


def test_readme_has_the_figures_of_the_data(monkeypatch: pytest.MonkeyPatch) -> None:
    readme = program("readme", monkeypatch)
    _, inside, _ = readme.parts((ROOT / "README.md").read_text(encoding="utf-8"))
    assert inside == readme.figures(), "run python docs/readme.py"


def test_readme_shows_its_picture_and_two_commands() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)
    assert pictures
    assert all((ROOT / picture).stat().st_size > 10_000 for picture in pictures)
    for target in re.findall(r"make ([a-z-]+)", text):
        assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M), target


# ---------------------------------------------------------------- figures and data


def test_every_figure_and_number_is_made_by_one_command() -> None:
    """`make figures` names, or runs what names, each file that README and pages show."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    found = re.search(r"^figures:.*?(?=^\S|\Z)", makefile, re.S | re.M)
    assert found is not None
    commands = found[0]
    programs = [ROOT / path for path in re.findall(r"python (\S+\.py)", commands)]
    assert all(path.is_file() for path in programs)
    # Whole names, or folders that a command writes into; what tools print is joined from parts.
    said = commands + "".join(path.read_text(encoding="utf-8") for path in programs)
    shown = {
        path.relative_to(DOCS).as_posix()
        for folder in ("data", "figures")
        for path in (DOCS / folder).rglob("*")
        if path.is_file()
    }
    assert len(shown) > 10
    for name in shown:
        folder, file = name.rsplit("/", 1)
        assert file in said or f"docs/{folder}" in commands, f"{name} is made by no command of make figures"


def test_pages_show_only_figures_that_exist_and_all_of_them() -> None:
    pages = [*DOCS.glob("*.rst"), ROOT / "README.md"]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    named = set(re.findall(r"figures/[\w/]+\.png", text))
    there = {path.relative_to(DOCS).as_posix() for path in (DOCS / "figures").rglob("*.png")}
    assert named == there


def test_every_page_is_in_a_table_of_contents() -> None:
    pages = {page.stem for page in DOCS.glob("*.rst")} - {"index", "sg_execution_times"}
    text = "\n".join(page.read_text(encoding="utf-8") for page in DOCS.glob("*.rst"))
    listed = set(re.findall(r"^   ([\w/]+)$", text, re.M))
    assert pages <= listed


# ---------------------------------------------------------------- links


GOOD = (
    '<html><body id="top"><a href="other.html#there">x</a><a href="https://example.org">y</a></body></html>'
)


@pytest.mark.parametrize(
    ("link", "said"),
    [
        ('<a href="none.html">', "none.html does not exist"),
        ('<a href="other.html#gone">', "no such anchor"),
        ('<a href="#gone">', "no such anchor"),
        ('<img src="none.png">', "does not exist"),
        ('<script src="https://cdn.example.org/x.js"></script>', "comes from elsewhere"),
        ('<link rel="stylesheet" href="//cdn.example.org/x.css">', "comes from elsewhere"),
    ],
)
def test_links_that_lead_nowhere_are_found(tmp_path: Path, link: str, said: str) -> None:
    (tmp_path / "index.html").write_text(GOOD, encoding="utf-8")
    (tmp_path / "other.html").write_text('<p id="there">z</p>', encoding="utf-8")
    command = [sys.executable, str(DOCS / "check_links.py"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (tmp_path / "index.html").write_text(GOOD + link, encoding="utf-8")
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert said in done.stderr


def test_tests_that_pages_name_are_there() -> None:
    pages = [*DOCS.glob("*.rst"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    texts = [page.read_text(encoding="utf-8") for page in pages]
    named = [found for text in texts for found in re.findall(r"(tests/[\w/]+\.py)::(\w+)", text)]
    assert named
    missing = [
        each for each in named if f"def {each[1]}(" not in (ROOT / each[0]).read_text(encoding="utf-8")
    ]
    assert not missing
