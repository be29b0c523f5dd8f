"""The example of a control loop, and the count on an emulated target, run as a reader would run them."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "float"])
def test_loop_of_the_example_equals_the_library(precision: str, tmp_path: Path) -> None:
    if not (shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")):
        pytest.skip("no C compiler")
    done = run("examples/controller/check.py", "--precision", precision, "--folder", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "equal" in done.stdout
    assert (tmp_path / "piezoest_controller.c").exists()


@pytest.mark.slow
def test_target_gives_the_voltages_of_the_host(tmp_path: Path) -> None:
    absent = [
        name for name in ("arm-none-eabi-gcc", "arm-none-eabi-objdump", "qemu-system-arm")
        if shutil.which(name) is None
    ]  # fmt: skip
    if absent:
        pytest.skip(f"{', '.join(absent)} not installed: make tools")
    target = tmp_path / "target.json"
    done = run(
        "benchmarks/target/target.py", "--samples", 400, "--traced", 60, "--only", "RLS and inverse",
        "--precision", "float", "--json", target,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    (row,) = json.loads(target.read_text())["rows"]
    assert row["equal_to_the_bit"] == 1.0
    assert 0 < row["instructions_mean"] <= row["instructions_largest"]
    assert row["ram_state"] > 0
