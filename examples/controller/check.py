"""Generate the controller, compile the loop of main.c, run it with a log and compare it with the library.

    python examples/controller/check.py [LOG.csv] [--precision float] [--folder DIR]

The log has the columns reference_um and displacement_um; the displacement is measured after the voltage of
the same line. Without a log, one is made with the simulated stage.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import piezoest as pz
from piezoest.export.compiled import compiler

HERE = Path(__file__).resolve().parent
SAMPLE_RATE = 50_000.0  # Hz
LIMITS = pz.VoltageLimits(minimum=-60.0, maximum=60.0)
LARGEST_DIFFERENCE = {"double": 1e-12, "float": 2e-3}  # relative to the largest voltage


def objects() -> tuple[Any, Any]:
    """Estimator and compensator that run on the board."""
    start = pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
    return pz.HysteresisRLS(SAMPLE_RATE, initial_model=start), pz.InverseCompensator(start, LIMITS)


def simulated_log() -> tuple[Any, Any]:
    """Reference and displacement of half a second on the simulated stage, a few measurements missing."""
    r = pz.signals.triangle(5.0, 5.0, 2.5, SAMPLE_RATE)
    estimator, compensator = objects()
    stage = pz.PaperStage(SAMPLE_RATE, seed=0)
    record = pz.track(r, stage=stage, compensator=compensator, estimator=estimator)
    x = record.measured.copy()
    x[12_000:12_040] = np.nan
    return record.reference, x


def read_log(path: Path) -> tuple[Any, Any]:
    """Columns reference_um and displacement_um of a CSV file."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    return table["reference_um"], table["displacement_um"]


def run_loop(folder: Path, precision: Any, r: Any, before: Any) -> Any:
    """Voltages of the compiled loop."""
    pz.export.c(*objects(), precision=precision).write(folder)
    command = [
        compiler(), "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-O2",
        "-ffp-contract=off", f"-DREAL={precision}", "-I.", str(HERE / "main.c"), "piezoest_controller.c",
        "-o", "loop", "-lm",
    ]  # fmt: skip
    subprocess.run(command, cwd=folder, check=True)
    lines = "".join(f"{a!r} {b!r}\n" for a, b in zip(r.tolist(), before.tolist(), strict=True))
    done = subprocess.run([str(folder / "loop")], input=lines, capture_output=True, text=True, check=True)
    # The first line is the voltage at rest.
    return np.array([float(line) for line in done.stdout.split()])[1:]


def main() -> int:
    """Print the comparison; 1 if board and library differ."""
    parser = argparse.ArgumentParser(description="Compare the board's loop with the library.")
    parser.add_argument("log", type=Path, nargs="?", help="CSV with reference_um, displacement_um")
    parser.add_argument("--precision", choices=["double", "float"], default="double")
    parser.add_argument("--folder", type=Path, help="keep the generated code there")
    arguments = parser.parse_args()
    r, x = simulated_log() if arguments.log is None else read_log(arguments.log)
    before = np.concatenate([[np.nan], x[:-1]])
    library = pz.export.Controller(*objects()).run(r, before)
    with tempfile.TemporaryDirectory() as place:
        folder = arguments.folder or Path(place)
        folder.mkdir(parents=True, exist_ok=True)
        board = run_loop(folder, arguments.precision, r, before)
    difference = float(np.max(np.abs(board - library)) / np.max(np.abs(library)))
    limit = LARGEST_DIFFERENCE[arguments.precision]
    print(
        f"{r.size} samples in {arguments.precision}: off by at most {difference:.2g} of the largest voltage"
    )
    print("equal" if difference <= limit else f"differs: more than {limit:g}")
    return 0 if difference <= limit else 1


if __name__ == "__main__":
    sys.exit(main())
