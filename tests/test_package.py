"""The package itself: light to import, complete in names and docstrings, strict about keywords."""

from __future__ import annotations

import ast
import importlib.metadata
import inspect
import os
import re
import subprocess
import sys
import textwrap
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import piezoest
from piezoest.estimators.compiled import CompiledEstimator
from piezoest.models import FreeRunning, Model
from piezoest.policies import Policy

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "piezoest"

# Each takes longer to load than all of `import piezoest` may.
HEAVY = ("casadi", "filterpy", "matplotlib", "numba", "pandas", "pyarrow", "scipy.signal")


def public_objects() -> Iterator[tuple[str, Any]]:
    """Every public class and function, once, under its shortest public name."""
    values = {name: getattr(piezoest, name) for name in piezoest.__all__}
    seen = []
    for name, value in values.items():
        if inspect.isclass(value) or inspect.isfunction(value):
            seen.append(value)
            yield name, value
    for name, module in values.items():
        if inspect.ismodule(module):
            for inner in public_names_of(module):
                if getattr(module, inner) not in seen:
                    yield f"{name}.{inner}", getattr(module, inner)


def public_names_of(module: Any) -> list[str]:
    """Return `__all__`, or else the classes and functions that the module defines itself."""
    if hasattr(module, "__all__"):
        names = list(module.__all__)
    else:
        names = [
            name
            for name, value in vars(module).items()
            if not name.startswith("_") and getattr(value, "__module__", None) == module.__name__
        ]
    return [
        name
        for name in names
        if inspect.isclass(getattr(module, name)) or inspect.isfunction(getattr(module, name))
    ]


OBJECTS = dict(public_objects())
CLASSES: dict[str, Any] = {name: value for name, value in OBJECTS.items() if inspect.isclass(value)}
# A protocol describes objects that others make.
CONCRETE = {
    name: value
    for name, value in CLASSES.items()
    if not getattr(value, "_is_protocol", False) and not inspect.isabstract(value)
}
# Base classes that carry no keyword of their own are not made by users.
MADE_BY_USERS = {name: value for name, value in CONCRETE.items() if value.__init__ is not object.__init__}


def run_python(code: str) -> str:
    """Return what the code prints in a fresh interpreter."""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


# ---------------------------------------------------------------- light to import

LOADED = f"import sys; print('loaded:', *sorted(set(sys.modules) & set({HEAVY!r})))"


def test_import_loads_nothing_heavy() -> None:
    assert run_python(f"import piezoest; {LOADED}").split() == ["loaded:"]


def test_help_loads_nothing_heavy() -> None:
    code = f"""
import sys
from piezoest.cli import main
sys.argv = ["piezoest", "--help"]
try:
    main()
except SystemExit as stop:
    assert not stop.code, stop.code
{LOADED}
"""
    last = run_python(code).splitlines()[-1]
    assert last.split() == ["loaded:"]


# ---------------------------------------------------------------- names


def stub_names() -> set[str]:
    """Names that the stub imports, which are the ones that lazy_loader serves."""
    tree = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    return {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def test_all_equals_the_stub() -> None:
    tree = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    declared = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
    ]
    assert set(piezoest.__all__) == stub_names()
    assert [set(names) for names in declared] == [stub_names()]


@pytest.mark.parametrize("name", piezoest.__all__)
def test_name_imports_and_is_listed(name: str) -> None:
    assert getattr(piezoest, name) is not None
    assert name in dir(piezoest)


def test_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = piezoest.no_such_name  # type: ignore[attr-defined]


def test_types_are_shipped() -> None:
    assert (PACKAGE / "py.typed").is_file()


def test_version_is_one_and_the_same() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert piezoest.__version__ == importlib.metadata.version("piezoest")
    assert f"\nversion: {project['version']}\n" in citation


@pytest.mark.parametrize("name", [name for name in OBJECTS if not name.startswith("__")])
def test_name_is_in_the_reference(name: str) -> None:
    pages = "\n".join(page.read_text(encoding="utf-8") for page in ROOT.glob("docs/reference*.rst"))
    if f".. automodule:: piezoest.{name.split('.')[0]}\n" in pages:
        return
    listed = {line.strip() for line in pages.splitlines()}
    assert {name, f"piezoest.{name}"} & listed, f"add {name} to docs/reference.rst"


# ---------------------------------------------------------------- docstrings


def documented_parameters(docstring: str) -> list[str]:
    """Names in the Parameters section of a NumPy-style docstring; none without the section."""
    section = re.search(r"^Parameters\n-{3,}\n(.*?)(?=^\S[^\n]*\n-{3,}\n|\Z)", docstring, re.S | re.M)
    if section is None:
        return []
    heads = [line for line in section[1].splitlines() if line.strip() and not line.startswith(" ")]
    return [name.strip().lstrip("*") for head in heads for name in head.split(" : ")[0].split(",")]


def actual_parameters(function: Callable[..., Any]) -> list[str]:
    """Names of the parameters that a caller may give."""
    names = [name for name in inspect.signature(function).parameters if not name.startswith("_")]
    return [name for name in names if name not in ("self", "cls")]


# What others ask of a model, a policy or a compiled estimator is described once, at its face.
FACES: tuple[type, ...] = (Model, FreeRunning, Policy, CompiledEstimator)


def own_methods(cls: type) -> Iterator[tuple[str, Any]]:
    """Public methods and properties that the class or a base of ours defines."""
    for name in dir(cls):
        value = inspect.getattr_static(cls, name)
        if name.startswith("_") or name in getattr(cls, "__dataclass_fields__", {}):
            continue
        # What the library asks of a class is described once, at its face.
        if any(cls is not face and issubclass(cls, face) and name in vars(face) for face in FACES):
            continue
        if isinstance(value, property):
            yield name, value
        function = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if inspect.isfunction(function) and function.__module__.startswith("piezoest"):
            yield name, function


METHODS = {f"{name}.{method}": value for name, cls in CLASSES.items() for method, value in own_methods(cls)}


@pytest.mark.parametrize("name", OBJECTS)
def test_docstring_names_every_parameter(name: str) -> None:
    value = OBJECTS[name]
    docstring = inspect.getdoc(value)
    assert docstring, f"{name} has no docstring"
    if name in CLASSES and name not in MADE_BY_USERS:
        return
    assert sorted(documented_parameters(docstring)) == sorted(actual_parameters(value))


@pytest.mark.parametrize("name", METHODS)
def test_method_is_documented(name: str) -> None:
    value = METHODS[name]
    docstring = inspect.getdoc(value)
    assert docstring, f"{name} has no docstring"
    if isinstance(value, property):
        return
    assert sorted(documented_parameters(docstring)) == sorted(actual_parameters(value))


# A quantity says its unit, or what it counts or is a part of.
UNIT = re.compile(
    r"\[[^\]]+\]|\b(Hz|µm|V|°C|units?|[Ss]amples?|periods?|[Ss]econds?|parts?|Part|[Ff]actor|fraction|ratio|[Nn]umber|swings)\b"
    r"|multiple|[Ss]tandard deviations?|Coefficients|Positions|0 to 1|Type of|\b0 \(no|relative|weight|rad/s"
)
# Of any regression, or of whichever estimator made them: their units are those of its data.
WITHOUT_A_UNIT_OF_THEIR_OWN = ("BatchFitResult", "RecursiveLeastSquares", "Trace")
CALLABLES = {**OBJECTS, **{name: value for name, value in METHODS.items() if not isinstance(value, property)}}


def described_parameters(docstring: str) -> Iterator[tuple[str, str]]:
    """Head and description of each parameter."""
    section = re.search(r"^Parameters\n-{3,}\n(.*?)(?=^\S[^\n]*\n-{3,}\n|\Z)", docstring, re.S | re.M)
    if section is not None:
        yield from re.findall(r"^(\S[^\n]*)\n((?:[ \t]+[^\n]*\n?|\n)*)", section[1], re.M)


@pytest.mark.parametrize("name", CALLABLES)
def test_quantities_have_units(name: str) -> None:
    if name.split(".")[0] in WITHOUT_A_UNIT_OF_THEIR_OWN:
        return
    for head, text in described_parameters(inspect.getdoc(CALLABLES[name]) or ""):
        if re.search(r": .*(float|ndarray|array_like)", head):
            assert UNIT.search(text), f"{name}: {head}: {text.strip()}"


# An equation of the paper, a year of a publication, a named source, or the word that there is none.
SOURCE = re.compile(
    r"\b(19|20)\d\d\b|\(\d+\)|\([ABC]\d+\)|App(endix|\.) [A-C]|Source:|Equations: |, sec\. \d"
)
METHOD_MODULES = ("models", "estimators", "compensators", "stage", "policies")
# They hold values, describe an instrument, or are what others fill in.
WITHOUT_A_METHOD = (
    "Amplifier", "BatchFitResult", "CompensatorStatus", "Estimator", "Event", "Gauge", "Status", "Trace",
    "VoltageLimits", "models.FreeRunning", "models.LearntModel", "models.Model", "models.StepModel",
)  # fmt: skip


@pytest.mark.parametrize("name", CLASSES)
def test_methods_name_their_source(name: str) -> None:
    module = CLASSES[name].__module__.split(".")[1]
    if module in METHOD_MODULES and name not in WITHOUT_A_METHOD:
        assert SOURCE.search(inspect.getdoc(CLASSES[name]) or ""), f"{name} names no source"


@pytest.mark.parametrize("name", [*CALLABLES, *METHODS])
def test_what_is_raised_is_said(name: str) -> None:
    value = {**CALLABLES, **METHODS}[name]
    function: Any = value.fget if isinstance(value, property) else value
    if getattr(function, "_is_protocol", False):
        return
    if inspect.isclass(function):
        # A dataclass checks what it is given behind its generated constructor.
        function = getattr(function, "__post_init__", function.__init__)
    try:
        source = inspect.getsource(function)
    except (OSError, TypeError):  # generated, or built in
        return
    if re.search(r"^\s+raise (ValueError|KeyError|TypeError|RuntimeError)", source, re.M):
        assert "Raises\n---" in (inspect.getdoc(value) or ""), f"{name} raises and does not say so"


# ---------------------------------------------------------------- misspelt keywords and attributes


@pytest.mark.parametrize("name", MADE_BY_USERS)
def test_unknown_keyword_is_refused(name: str) -> None:
    with pytest.raises(TypeError, match="no_such_keyword"):
        MADE_BY_USERS[name](no_such_keyword=1)


@pytest.mark.parametrize("name", MADE_BY_USERS)
def test_misspelt_attribute_is_refused(name: str) -> None:
    cls = MADE_BY_USERS[name]
    has_no_dict = cls.__dictoffset__ == 0 and not any("__dict__" in vars(base) for base in cls.__mro__[:-1])
    checks_names = cls.__setattr__ is not object.__setattr__
    assert has_no_dict or checks_names, f"{name} accepts any attribute: give it and its bases __slots__"


# ---------------------------------------------------------------- pages, layers


MARKDOWN_CODE = re.compile(r"^```python\n(.*?)^```", re.S | re.M)
SPHINX_CODE = re.compile(r"^\.\. code-block:: python\n\n(.*?)(?=^\S|\Z)", re.S | re.M)
PAGES = {
    path.name: SPHINX_CODE if path.suffix == ".rst" else MARKDOWN_CODE
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.rst")))
    if "python\n" in path.read_text(encoding="utf-8")
}


@pytest.mark.parametrize("page", PAGES)
def test_code_of_the_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
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


def test_modules_import_only_from_floors_below() -> None:
    code = (
        "import sys\n"
        "from importlinter.cli import lint_imports\n"
        "sys.exit(lint_imports(no_cache=True, is_debug_mode=False))"
    )
    pytest.importorskip("importlinter")
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        encoding="utf-8",
        cwd=ROOT,
        env=environment,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout + done.stderr
