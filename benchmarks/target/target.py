"""Run exported controllers on an emulated Cortex-M4F: equal voltages, instructions, cycles, flash, RAM.

Needs arm-none-eabi-gcc with newlib, and qemu-system-arm (`make tools`).

    python benchmarks/target/target.py [--samples N] [--traced N] [--json FILE]
"""

import copy
import re
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer
from cycles import count_cycles

import piezoest as pz
from piezoest._options import one_of
from piezoest.bench.origin import origin, put
from piezoest.bench.scenarios import SCENARIOS

HERE = Path(__file__).resolve().parent
CROSS, EMULATOR = "arm-none-eabi-", "qemu-system-arm"
CPU = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")
# -std=c99 leaves fused multiply-add out, so that the voltages can be compared bit for bit.
FLAGS = ("-std=c99", "-O3", "-ffunction-sections", "-fdata-sections")
SAMPLE_RATE, CLOCK = 50_000.0, 168e6  # Hz
# Exported in the midst of their work, shortly before the reference turns: twenty periods at 5 Hz, more swings
# than a compensator remembers.
LEARNT = 4.048  # s
SAMPLES, TRACED = 4000, 400
MOVED = "RLS, model moved"
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
OUTSIDE = pz.ColemanHodgdon(0.02, 0.12, 0.0072)
LIMITS = pz.VoltageLimits(-60.0, 60.0)


def controllers() -> dict[str, tuple[Any, Any]]:
    """What is measured, by name: estimator and compensator."""
    rls, inverse = partial(pz.HysteresisRLS, SAMPLE_RATE), partial(pz.InverseCompensator, START, LIMITS)
    line = pz.LinearGain(0.15)
    return {
        "inverse alone": (None, inverse()),
        "linear gain learnt": (rls(initial_model=line), pz.LinearCompensator(line, LIMITS)),
        "RLS and inverse": (rls(initial_model=START), inverse()),
        # Outside of the admissible set, and sure of it: every model handed over has to be moved.
        MOVED: (rls(initial_model=OUTSIDE, uncertainty=1e-3), inverse()),
        "RLS, the paper's memory": (rls(initial_model=START, memory=0.4), inverse()),
        "EKF and inverse": (pz.HysteresisEKF(SAMPLE_RATE, initial_model=START), inverse()),
    }


def prepare(name: str, samples: int) -> tuple[Any, Any, Any, Any]:
    """Estimator and compensator that have worked for a while, and what comes next.

    That is the reference, and the displacement measured before each sample of it, from the simulated stage.
    """
    estimator, compensator = controllers()[name]
    case = SCENARIOS["cold-start"].build(0, sample_rate=SAMPLE_RATE, after=30)
    r, stage = case.reference.values, case.new_stage()
    learnt, end = round(LEARNT * SAMPLE_RATE), round(LEARNT * SAMPLE_RATE) + samples
    teacher = estimator
    if name == MOVED:
        teacher = pz.HysteresisRLS(SAMPLE_RATE, initial_model=compensator.model)
    pz.track(r[:learnt], stage=stage, compensator=compensator, estimator=teacher)
    estimator, before = copy.deepcopy(estimator), compensator.copy()
    record = pz.track(r[learnt:end], stage=stage, compensator=compensator, estimator=teacher)
    return estimator, before, r[learnt:end], np.concatenate([[np.nan], record.measured[:-1]])


def measure(name: str, precision: Any, samples: int, traced: int) -> dict[str, Any]:
    """Build, run and count one controller."""
    estimator, compensator, r, x = prepare(name, samples)
    code = pz.export.c(estimator, compensator, name="controller", precision=precision)
    expected = pz.export.CompiledController(code).run(r, x)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        code.write(folder)
        firmware = build(folder, precision, r, x)
        voltages, stack = run(firmware, precision)
        counts, cycles = trace(build(folder, precision, r[:traced], x[:traced]))
        sizes = flash_and_ram(folder, firmware)
    apart = np.abs(voltages - expected) / np.max(np.abs(expected))
    budget = CLOCK / SAMPLE_RATE
    # The first turns are lighter: no regression is whole yet.
    return {
        "controller": name,
        "precision": precision,
        "samples": samples,
        "largest_difference_from_host": float(np.max(apart)),
        "equal_to_the_bit": float(np.mean(apart == 0.0)),
        "instructions_mean": float(np.mean(counts[10:])),
        "instructions_largest": int(np.max(counts)),
        "cycles_mean": float(np.mean(cycles[10:])),
        "cycles_largest": int(np.max(cycles)),
        "load_mean": float(np.mean(cycles[10:])) / budget,
        "load_largest": int(np.max(cycles)) / budget,
        "stack": stack,
        **sizes,
    }


def build(folder: Path, precision: str, r: Any, x: Any) -> Path:
    """Firmware with the log in it."""
    suffix = "f" if precision == "float" else ""

    def listed(values: Any) -> str:
        texts = ("NAN" if np.isnan(v) else f"{v!r}{suffix}" for v in map(float, values))
        return "{" + ",\n".join(texts) + "}"

    (folder / "log.h").write_text(
        f"#include <math.h>\ntypedef {precision} real_t;\n#define LOG_SIZE {len(r)}\n"
        f"static const real_t log_r[] = {listed(r)};\nstatic const real_t log_x[] = {listed(x)};\n"
    )
    target = folder / f"firmware_{len(r)}.elf"
    command = [
        f"{CROSS}gcc", *CPU, *FLAGS, "-I", str(folder), str(HERE / "firmware.c"), "controller.c",
        "-nostartfiles", "-T", str(HERE / "stm32f405.ld"), "-Wl,--gc-sections", "-o", str(target),
        "--specs=nano.specs", "-lm",
    ]  # fmt: skip
    subprocess.run(command, cwd=folder, check=True)
    return target


def emulate(firmware: Path, *options: str) -> str:
    """What the firmware prints."""
    command = [
        EMULATOR, "-M", "netduinoplus2", "-nographic", "-monitor", "none", "-serial", "none",
        "-semihosting-config", "enable=on,target=native", *options, "-kernel", str(firmware),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    text = done.stdout + done.stderr
    if "fault" in text or "stack" not in text:
        raise RuntimeError(f"the firmware did not end well:\n{text[-2000:]}")
    return text


def run(firmware: Path, precision: str) -> tuple[Any, int]:
    """Voltages and bytes of stack."""
    size = 4 if precision == "float" else 8
    before, after = emulate(firmware).split("stack ")
    words = re.findall(rf"^[0-9a-f]{{{2 * size}}}$", before, re.M)
    voltages = np.frombuffer(bytes.fromhex("".join(words)), f">f{size}").astype(np.float64)
    return voltages, int(after.split()[0], 16)


def trace(firmware: Path) -> tuple[Any, Any]:
    """Instructions and cycles of each step, from a trace of every instruction."""
    listing = printed(f"{CROSS}objdump", "-d", "--no-show-raw-insn", str(firmware))
    path = firmware.with_suffix(".trace")
    emulate(firmware, "-singlestep", "-d", "exec,nochain", "-D", str(path))
    return count_cycles(listing, path)


def printed(*command: str) -> str:
    """What a program prints."""
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def flash_and_ram(folder: Path, firmware: Path) -> dict[str, int]:
    """Bytes of the controller's code and constants, and of its state."""
    subprocess.run([f"{CROSS}gcc", *CPU, *FLAGS, "-c", "controller.c", "-o", "c.o"], cwd=folder, check=True)
    flash = int(printed(f"{CROSS}size", str(folder / "c.o")).splitlines()[1].split()[0])
    symbols = map(str.split, printed(f"{CROSS}nm", "-S", "--defined-only", str(firmware)).splitlines())
    state = next(int(row[1], 16) for row in symbols if len(row) == 4 and row[3] == "state")
    return {"flash_controller": flash, "ram_state": state}


def main(
    samples: int = SAMPLES, traced: int = TRACED,
    only: Annotated[str | None, typer.Option(callback=one_of(*controllers()))] = None,
    precision: Literal["float", "double"] | None = None, json: Path | None = None,
) -> None:  # fmt: skip
    """Compare SAMPLES with the host, count the instructions of TRACED; ONLY one controller, one PRECISION.

    Fails if a voltage differs from the host's by more than rounding.
    """
    programs = (f"{CROSS}gcc", f"{CROSS}objdump", EMULATOR)
    if absent := [name for name in programs if shutil.which(name) is None]:
        print(f"not found: {', '.join(absent)}: run make tools", file=sys.stderr)
        sys.exit(2)
    rows = [
        measure(name, kind, samples, traced)
        for name in ([only] if only else controllers())
        for kind in ([precision] if precision else ("float", "double"))
    ]
    for row in rows:
        print(", ".join(f"{name} {value}" for name, value in row.items()))
    if json is not None:
        tools = [printed(name, "--version").splitlines()[0] for name in (f"{CROSS}gcc", EMULATOR)]
        head = {**origin(), "clock_Hz": CLOCK, "sample_rate_Hz": SAMPLE_RATE, "tools": tools}
        put({**head, "rows": rows}, json)
    sys.exit(any(not row["largest_difference_from_host"] < 1e-5 for row in rows))


if __name__ == "__main__":
    typer.run(main)
