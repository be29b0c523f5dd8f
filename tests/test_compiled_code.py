"""Machine code that is kept on the disk is that of the function, of the present sources, or not run."""

import importlib
import inspect
import os
import pkgutil
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import pytest
from numba.core.dispatcher import Dispatcher

import piezoest
from piezoest import compile, machine_code
from piezoest.compensators import inverse_kernel
from piezoest.compile import Compiled, compiled
from piezoest.controller import kernel

PACKAGE = Path(piezoest.__file__).parent


@compiled
def tripled(x: float) -> float:
    return 3.0 * x


def test_sources_are_all_that_compiled_functions_are_made_of() -> None:
    names = [each.name for each in pkgutil.walk_packages([str(PACKAGE)], "piezoest.")]
    values = [value for name in names for value in vars(importlib.import_module(name)).values()]
    assert not any(isinstance(value, Dispatcher) for value in values), "use piezoest.compile.compiled"
    functions: list[Any] = [value.function for value in values if isinstance(value, Compiled)]
    functions += filter(compile.is_marked, {value for value in values if inspect.isfunction(value)})
    # Chains of policies' hooks have no file.
    files = {each.__code__.co_filename for each in functions if Path(inspect.getfile(each)).is_file()}
    assert len(files) > 50
    assert files <= {str(path) for path in machine_code.sources()}

    def inner(x: float) -> float:
        return x

    with pytest.raises(TypeError, match="inner must stand at module level"):
        compiled(inner)


LOOP = """
import piezoest as pz

print(pz.PrandtlIshlinskii(0.1, [1.0], [0.02]).simulate([0.0, 1.0, -2.0]).tolist())
"""


def test_a_loop_that_another_process_has_compiled_does_the_same(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", LOOP]
    runs = [subprocess.run(command, env=environment, capture_output=True, text=True) for _ in range(2)]
    assert list(tmp_path.rglob("*.nbc"))
    assert [run.returncode for run in runs] == [0, 0]
    assert runs[0].stdout == runs[1].stdout != ""


# Edits of what compiled functions are made of, and of what they are not.
EDITS = [
    ("equations/coleman_hodgdon.py", "def inverse_increment", "# edited\ndef inverse_increment"),
    ("_checks.py", "WILDEST = 1e9", "WILDEST = 1e8"),
    ("policies/dead_zone.py", "information = 0.0", "information = 1.0"),
    ("compiled_records.py", "def _place", "# edited\ndef _place"),
]
OTHER_EDITS = [
    ("estimators/rls.py", "PAPER_MEMORY = 0.4", "PAPER_MEMORY = 0.5"),
    ("policies/norm_bound.py", "limit: float = 100.0", "limit: float = 90.0"),
    *((f"{name}.py", "import", "# edited\nimport") for name in ("bench/run", "cli/__init__", "tracking")),
]


def test_only_an_edit_of_a_source_makes_machine_code_anew(tmp_path: Path, monkeypatch: Any) -> None:
    copy = tmp_path / "piezoest"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(machine_code, "_PACKAGE", copy)
    monkeypatch.setattr(machine_code, "sources", inspect.unwrap(machine_code.sources))

    def digest(*edits: tuple[str, str, str]) -> str:
        for file, old, new in edits:
            text = (PACKAGE / file).read_text(encoding="utf-8")
            assert old in text
            (copy / file).write_text(text.replace(old, new, 1), encoding="utf-8")
        found = str(inspect.unwrap(machine_code.digest)())
        for file, _, _ in edits:
            shutil.copy(PACKAGE / file, copy / file)
        return found

    before = digest()
    assert digest(*OTHER_EDITS) == before
    assert len({before, *(digest(edit) for edit in EDITS)}) == 1 + len(EDITS)


def loaded() -> int:
    """Compile the function as a new process would: 1 if its machine code was taken from the disk."""
    made = compiled(tripled.function)
    assert made(2.0) == 6.0
    return sum(made.dispatcher.stats.cache_hits.values())


def test_damaged_files_other_sources_and_options_are_compiled_anew(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(machine_code, "folder", lambda: tmp_path)
    assert loaded() == 0
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    for damaged in (b"", whole[:40], whole[:-1], whole[:200] + bytes([whole[200] ^ 1]) + whole[201:]):
        file.write_bytes(damaged)
        assert loaded() == 0
    assert loaded() == 1
    assert list(tmp_path.iterdir()) == [file]
    for name, value in (("digest", lambda: "another"), ("_own_source", lambda path: "another")):
        with monkeypatch.context() as changed:
            changed.setattr(machine_code, name, value)
            assert loaded() == 0
    monkeypatch.setitem(compile._OPTIONS, "nogil", False)
    assert loaded() == 0


def test_without_a_folder_that_can_be_written_all_works_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise PermissionError

    monkeypatch.setattr("tempfile.TemporaryFile", refuse)
    find: Any = inspect.unwrap(machine_code.folder)
    with pytest.warns(RuntimeWarning, match="name one in NUMBA_CACHE_DIR"):
        assert find() is None
    monkeypatch.setattr(machine_code, "folder", lambda: None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert loaded() == 0


@pytest.mark.slow
def test_an_edit_of_what_a_model_of_ones_own_imports_counts(tmp_path: Path) -> None:
    names = 'offset: float = 0.0\n    parameter_names = parameter_units = state_names = ("gain",)\n'
    (tmp_path / "mine.py").write_text(
        "import helper\nfrom dataclasses import dataclass\n"
        "from piezoest.compile import inlined\nfrom piezoest.models import StepModel\n"
        f"@dataclass(frozen=True, slots=True)\nclass Mine(StepModel):\n    gain: float\n    {names}"
        "@inlined\ndef displacement(state, u_0, u, constants):\n    return helper.twice(u)\n"
        "@inlined\ndef voltage(state, u_0, x, constants):\n    return x\n"
    )
    program = [sys.executable, "-c", "from mine import Mine; print(Mine(1.0).simulate([1.0])[0])"]
    path = os.pathsep.join((str(PACKAGE.parent), str(tmp_path)))
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    for factor in ("2.0", "5.0"):
        text = f"from piezoest.compile import inlined\n@inlined\ndef twice(u):\n    return {factor} * u\n"
        (tmp_path / "helper.py").write_text(text)
        done = subprocess.run(program, capture_output=True, text=True, check=True, env=environment)
        assert done.stdout.strip() == factor


def forget(monkeypatch: pytest.MonkeyPatch, *loops: Any) -> None:
    for loop in loops:
        monkeypatch.setattr(loop, "_entries", {})


def test_the_class_stands_for_a_controller_of_any_rate_and_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    loops = (kernel.step, kernel.learn, kernel.run, kernel.learn_all)  # what a live loop will call
    forget(monkeypatch, *loops)
    assert piezoest.warmup(piezoest.AdaptiveFeedforward) > 0.0
    loaded = [list(loop._entries) for loop in loops]
    controller = piezoest.AdaptiveFeedforward(1234.0, limits=piezoest.VoltageLimits(-3.0, 7.0, 100.0, 1234.0))
    assert loaded == [[controller.layouts]] * len(loops)


def test_what_is_warmed_up_is_left_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    limits = piezoest.VoltageLimits(0.0, 100.0)
    controller = piezoest.AdaptiveFeedforward(1000.0, limits=limits, estimators=())
    model = piezoest.PrandtlIshlinskii(0.1, [1.0, 2.0, 3.0], [0.02, 0.01, 0.01])
    compensator = piezoest.InverseCompensator(model, sample_rate=1000.0)
    before = controller.to_dict()
    forget(monkeypatch, inverse_kernel.step, inverse_kernel.run)
    piezoest.warmup(controller, compensator)
    assert controller.to_dict() == before
    assert compensator.status.samples == 0
    for loop in (inverse_kernel.step, inverse_kernel.run):
        assert compensator.layouts in loop._entries
