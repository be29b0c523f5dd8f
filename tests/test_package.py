"""The package itself: light to import, complete in names, strict about keywords; its pages' code runs."""

import importlib.metadata
import inspect
import re
import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path
from typing import Any

import pytest

import piezoest
from docs.check_docstrings import public_objects

ROOT = Path(__file__).resolve().parents[1]
# Each takes longer to load than all of `import piezoest` may.
HEAVY = ("casadi", "filterpy", "matplotlib", "numba", "pandas", "pyarrow", "scipy.signal")
pz: Any = piezoest
FS = 1000.0
OBJECTS: dict[str, Any] = public_objects()
REFERENCE = "\n".join(page.read_text(encoding="utf-8") for page in ROOT.glob("docs/reference*.rst"))
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_import_loads_nothing_heavy() -> None:
    code = f"import sys, piezoest; print(set(sys.modules) & set({HEAVY!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout == "set()\n"
    with pytest.raises(AttributeError, match="piezoest has no attribute 'foo'"):
        pz.foo  # noqa: B018


def test_version_is_one_and_the_same() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert piezoest.__version__ == importlib.metadata.version("piezoest")
    assert f"\nversion: {project['version']}\n" in citation


@pytest.mark.parametrize("name", OBJECTS)
def test_name_is_in_the_reference_and_misspelt_names_are_refused(name: str) -> None:
    if f".. automodule:: piezoest.{name.split('.')[0]}\n" not in REFERENCE:
        listed = {line.strip() for line in REFERENCE.splitlines()}
        assert {name, f"piezoest.{name}"} & listed, f"add {name} to docs/reference.rst"
    cls = OBJECTS[name]
    # Protocols describe what others make; a base class without a keyword of its own is not made by users.
    is_made_by_users = inspect.isclass(cls) and not (
        getattr(cls, "_is_protocol", False) or inspect.isabstract(cls) or cls.__init__ is object.__init__
    )
    if is_made_by_users:
        with pytest.raises(TypeError, match="no_such_keyword"):
            cls(no_such_keyword=1)
        has_dict = cls.__dictoffset__ != 0 or any("__dict__" in vars(base) for base in cls.__mro__[:-1])
        checks_names = cls.__setattr__ is not object.__setattr__
        assert checks_names or not has_dict, f"{name} accepts any attribute: give it and its bases __slots__"


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: pz.AdaptiveFeedforward(FS, limits=pz.VoltageLimits(-50.0, 100.0), estimators=()), "seeking"),
        (lambda: pz.InverseCompensator(pz.LinearGain(0.5)), "gain=0.5"),
        (lambda: pz.PaperStage(FS), "1000 Hz"),
        (lambda: pz.RecursiveLeastSquares(2), "[0., 0.]"),
        (lambda: pz.EstimatorBank(pz.HysteresisRLS(FS), 3), "3 channels"),
    ],
)
def test_texts_are_short(make: Any, text: str) -> None:
    assert text in repr(make())


MARKDOWN_CODE = re.compile(r"^```python\n(.*?)^```", re.S | re.M)
SPHINX_CODE = re.compile(r"^\.\. code-block:: python\n\n(.*?)(?=^\S|\Z)", re.S | re.M)
PAGES = {
    path.name: path
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.rst")))
    if "python\n" in path.read_text(encoding="utf-8")
}


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.slow_but_first
def test_code_of_the_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = PAGES[page].read_text(encoding="utf-8")
    blocks = list((SPHINX_CODE if page.endswith(".rst") else MARKDOWN_CODE).finditer(text))
    assert blocks
    namespace: dict[str, Any] = {}
    for block in blocks:
        # Blank lines before it make a traceback name the line of the page.
        above = "\n" * text[: block.start(1)].count("\n")
        exec(compile(above + textwrap.dedent(block[1]), str(PAGES[page]), "exec"), namespace)


def test_readme_links_exist() -> None:
    targets = [target for target in re.findall(r"\]\(([^)#]+)", README) if "://" not in target]
    assert targets
    assert [target for target in targets if not (ROOT / target).exists()] == []
