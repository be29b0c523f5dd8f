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

OBJECTS = public_objects()
# Protocols describe what others make; a base class without a keyword of its own is not made by users.
MADE_BY_USERS: dict[str, Any] = {
    name: value
    for name, value in OBJECTS.items()
    if inspect.isclass(value)
    and not getattr(value, "_is_protocol", False)
    and not inspect.isabstract(value)
    and value.__init__ is not object.__init__
}


def test_import_loads_nothing_heavy() -> None:
    code = f"import sys, piezoest; print(set(sys.modules) & set({HEAVY!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout == "set()\n"


def test_version_is_one_and_the_same() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert piezoest.__version__ == importlib.metadata.version("piezoest")
    assert f"\nversion: {project['version']}\n" in citation


@pytest.mark.parametrize("name", OBJECTS)
def test_name_is_in_the_reference(name: str) -> None:
    pages = "\n".join(page.read_text(encoding="utf-8") for page in ROOT.glob("docs/reference*.rst"))
    if f".. automodule:: piezoest.{name.split('.')[0]}\n" in pages:
        return
    listed = {line.strip() for line in pages.splitlines()}
    assert {name, f"piezoest.{name}"} & listed, f"add {name} to docs/reference.rst"


@pytest.mark.parametrize("name", MADE_BY_USERS)
def test_unknown_keyword_is_refused(name: str) -> None:
    with pytest.raises(TypeError, match="no_such_keyword"):
        MADE_BY_USERS[name](no_such_keyword=1)


pz: Any = piezoest  # unchecked: what is asked here is wrong on purpose
FS, LIMITS = 1000.0, pz.VoltageLimits(-50.0, 100.0)


@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        (lambda: pz.PaperStage(FS).run(None), "must be an array, got None"),
        (lambda: pz.track([0.0], stage=object(), controller=1, sample_rate=FS), "must have step(u)"),
        (lambda: pz.foo, "piezoest has no attribute 'foo'"),
    ],
)
def test_messages_name_the_mistake(mistake: Any, words: str) -> None:
    with pytest.raises((ValueError, AttributeError), match=re.escape(words)):
        mistake()


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: pz.AdaptiveFeedforward(FS, limits=LIMITS, estimators=()), "seeking"),
        (lambda: pz.InverseCompensator(pz.LinearGain(0.5)), "gain=0.5"),
        (lambda: pz.PaperStage(FS), "1000 Hz"),
        (lambda: pz.RecursiveLeastSquares(2), "[0., 0.]"),
        (lambda: pz.EstimatorBank(pz.HysteresisRLS(FS), 3), "3 channels"),
    ],
)
def test_texts_are_short(make: Any, text: str) -> None:
    assert text in repr(make())


@pytest.mark.parametrize("name", MADE_BY_USERS)
def test_misspelt_attribute_is_refused(name: str) -> None:
    cls = MADE_BY_USERS[name]
    has_no_dict = cls.__dictoffset__ == 0 and not any("__dict__" in vars(base) for base in cls.__mro__[:-1])
    checks_names = cls.__setattr__ is not object.__setattr__
    assert has_no_dict or checks_names, f"{name} accepts any attribute: give it and its bases __slots__"


MARKDOWN_CODE = re.compile(r"^```python\n(.*?)^```", re.S | re.M)
SPHINX_CODE = re.compile(r"^\.\. code-block:: python\n\n(.*?)(?=^\S|\Z)", re.S | re.M)
PAGES = {
    path.name: SPHINX_CODE if path.suffix == ".rst" else MARKDOWN_CODE
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.rst")))
    if "python\n" in path.read_text(encoding="utf-8")
}


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.slow_but_first
def test_code_of_the_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = ROOT / page if page == "README.md" else ROOT / "docs" / page
    text = path.read_text(encoding="utf-8")
    blocks = list(PAGES[page].finditer(text))
    assert blocks
    namespace: dict[str, Any] = {}
    for block in blocks:
        # Blank lines before it make a traceback name the line of the page.
        above = "\n" * text[: block.start(1)].count("\n")
        exec(compile(above + textwrap.dedent(block[1]), str(path), "exec"), namespace)


def test_readme_links_exist() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    targets = [target for target in re.findall(r"\]\(([^)#]+)", text) if "://" not in target]
    assert targets
    assert [target for target in targets if not (ROOT / target).exists()] == []
