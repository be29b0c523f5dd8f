"""The example of a control loop, and the count on an emulated target, run as a reader would run them."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("arm-none-eabi-gcc", "arm-none-eabi-objdump", "qemu-system-arm")
pytestmark = pytest.mark.slow


def run(*arguments: object) -> str:
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("precision", ["double", "float"])
def test_loop_of_the_example_equals_the_library(precision: str, tmp_path: Path) -> None:
    said = run("examples/controller/check.py", "--precision", precision, "--folder", tmp_path)
    assert "equal" in said
    assert (tmp_path / "piezoest_controller.c").exists()


@pytest.mark.skipif(None in map(shutil.which, TOOLS), reason=f"{', '.join(TOOLS)}: make tools")
def test_target_gives_the_voltages_of_the_host(tmp_path: Path) -> None:
    run(
        "benchmarks/target/target.py", "--samples", 400, "--traced", 60, "--only", "RLS and inverse",
        "--precision", "float", "--json", tmp_path / "target.json",
    )  # fmt: skip
    (row,) = json.loads((tmp_path / "target.json").read_text())["rows"]
    assert row["equal_to_the_bit"] == 1.0
    assert 0 < row["instructions_mean"] <= row["instructions_largest"]
    assert row["ram_state"] > 0
