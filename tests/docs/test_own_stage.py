"""The program for hardware, `examples/own_stage.py`, on simulated drivers, of which some fail."""

import importlib
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    module = importlib.import_module("own_stage")
    now = [0.0]

    def sleep(left: float = 1e-5) -> float:
        now[0] += left
        return now[0]

    monkeypatch.setattr(module.time, "perf_counter", sleep)
    monkeypatch.setattr(module.time, "sleep", sleep)
    return module


def driver(program: Any, fails_at: int = -1, error: BaseException | None = None) -> Any:
    """The program's own driver, which keeps what was written and may fail once."""

    used = program.Driver()
    used.written, write = [], used.write

    def watched(voltage: float) -> None:
        used.written.append(voltage)
        if len(used.written) == fails_at + 1 and error is not None:
            raise error
        write(voltage)

    used.write, used.close = watched, partial(used.written.append, np.inf)
    return used


def test_it_follows_and_ends_at_rest(program: Any) -> None:
    used = driver(program)
    assert program.main(lambda: used) == 0
    assert used.written.pop() == np.inf  # closed
    record = np.load("run.npz")
    error = record["reference"] - record["displacement"]
    assert error.size == 2000
    assert np.max(np.abs(error[-400:])) < 0.1
    u = np.array(used.written)
    assert program.LIMITS.minimum <= u.min() <= u.max() <= program.LIMITS.maximum
    ramp = int(program.BIAS / program.SLOPE * program.RATE)
    largest = program.SLOPE / program.RATE * (1.0 + 1e-9)
    assert np.max(np.abs(np.diff(u[:ramp], prepend=program.REST))) <= largest
    assert u[-1] == program.REST
    assert abs(u[-2]) <= largest


@pytest.mark.parametrize("error", [OSError("the cable is off"), KeyboardInterrupt()])
def test_a_run_that_is_cut_short_is_kept_and_ends_at_rest(program: Any, error: Any, capsys: Any) -> None:
    ramp = int(program.BIAS / program.SLOPE * program.RATE)
    used = driver(program, ramp + 700, error)
    assert program.main(lambda: used) == 1
    assert f"stopped: {type(error).__name__}" in capsys.readouterr().err
    voltage = np.load("run.npz")["voltage"]
    assert voltage.size == 700
    assert np.all(np.isfinite(voltage))
    assert used.written[-2:] == [program.REST, np.inf]
    after = np.diff(used.written[ramp + 701 : -1], prepend=voltage[-1])
    assert np.max(np.abs(after)) <= program.SLOPE / program.RATE * 1.001


def test_a_displacement_that_is_too_far_stops_the_run(program: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program, "FARTHEST", 1.0)
    used = driver(program)
    assert program.main(lambda: used) == 1
    assert used.written[-2:] == [program.REST, np.inf]
    assert 0 < np.load("run.npz")["displacement"].size < 2000


@pytest.mark.parametrize("reading", [None, np.nan])
def test_a_sensor_that_is_silent_stops_the_run(program: Any, reading: float | None, capsys: Any) -> None:
    used, read = driver(program), program.Driver.read
    done: list[bool] = []

    def silent() -> float | None:
        done.append(True)
        return read(used) if len(done) < 500 else reading

    used.read = silent
    assert program.main(lambda: used) == 1
    assert used.written[-2:] == [program.REST, np.inf]
    assert "no reading for 0.1 s" in capsys.readouterr().err
    assert 400 < np.load("run.npz")["displacement"].size < 700


def test_a_fault_stops_the_run(program: Any, capsys: Any) -> None:
    used, read = driver(program), program.Driver.read
    frozen: list[float] = []

    def stuck() -> float:
        frozen.append(read(used) if len(frozen) < 700 else frozen[-1])
        return frozen[-1]

    used.read = stuck
    assert program.main(lambda: used) == 1
    assert "the controller reports a fault" in capsys.readouterr().err
