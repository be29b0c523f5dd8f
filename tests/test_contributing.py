"""The worked examples of CONTRIBUTING.md: each section "Adding a …" is carried out in a copy of the package.

The first line of a fenced block says where it goes. The last block of a section is a test file; it is run as
plain Python, for to compile the copy would take a minute.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PLACE = re.compile(r"^# (new file|added to) (\S+?)(?:, below (.+))?$")
SECTION = re.compile(r"^## (Adding .*?)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TEXT = (ROOT / "CONTRIBUTING.md").read_text()
EXAMPLES = {title: BLOCK.findall(body) for title, body in SECTION.findall(TEXT)}
FOUND_BY = {
    "Adding a policy": ("VarianceLimit", "tests/test_package.py", "tests/policies/test_base.py"),
    "Adding a model": ("Backlash", "tests/test_package.py"),
    "Adding an estimator": ("SlopeFilter", "tests/test_package.py", "tests/estimators/test_conformance.py"),
}  # fmt: skip


def apply(block: str, folder: Path) -> Path:
    """Write a block to where its first line says; returns the file."""
    comment, _, code = block.partition("\n")
    ((how, name, line),) = PLACE.findall(comment)
    path = folder / name
    assert path.exists() == (how == "added to"), comment
    old = path.read_text() if path.exists() else ""
    if line:
        assert old.count(f"{line}\n") == 1, f"{comment}: the line must stand there once"
        path.write_text(old.replace(f"{line}\n", f"{line}\n{code}"))
    else:
        path.write_text(f"{old}\n\n{code}" if old else code)
    return path


def run(folder: Path, *arguments: str) -> None:
    environment = {**os.environ, "PYTHONPATH": str(folder), "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("title", EXAMPLES)
def test_an_example_does_what_it_says(title: str, tmp_path: Path) -> None:
    without = shutil.ignore_patterns("__pycache__", "_build", "gallery", "generated", "figures", "data")
    for name in ("piezoest", "tests", "docs"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=without)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, tmp_path)
    test = [apply(block, tmp_path) for block in EXAMPLES[title]][-1]
    run(tmp_path, str(test))
    if title in FOUND_BY:
        name, *files = FOUND_BY[title]
        run(tmp_path, *files, "-k", name, "-m", "")
