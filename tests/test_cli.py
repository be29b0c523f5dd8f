"""The command line: what it prints, writes and refuses."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from piezoest import demo, signals
from piezoest._version import __version__
from piezoest.cli import app
from piezoest.fitting import FORMS
from piezoest.models import ColemanHodgdon, LearntModel, PrandtlIshlinskii
from piezoest.records import Record, read_record, write_columns

RATE = 1000.0
TRUE = ColemanHodgdon(0.02, 0.12, 0.0036, offset=3.0)
THETA = ("--alpha", 0.02, "--beta", 0.12, "--gamma", 0.0036)
OUT = ("-o", "voltage.csv")


def run(*arguments: object, columns: int = 120) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], env={"COLUMNS": str(columns)})


def done(*arguments: object, columns: int = 120) -> Result:
    result = run(*arguments, columns=columns)
    assert result.exit_code == 0, result.output
    return result


def refused(result: Result, *words: str) -> None:
    """One sentence on stderr, exit code 1, nothing on stdout."""
    assert (result.exit_code, result.stdout) == (1, "")
    assert "Traceback" not in result.output
    assert result.stderr.startswith("error: ")
    assert len(result.stderr.strip().splitlines()) == 1
    assert [word for word in words if word not in result.stderr] == []


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    u = np.tile(np.asarray(signals.multi_amplitude([20.0, 35.0, 10.0], 5.0, 2, RATE)), 2)
    x = TRUE.simulate(u) + 2e-3 * np.random.default_rng(0).standard_normal(u.size)
    Record.from_arrays(u, x, RATE).write("log.csv")
    return tmp_path / "log.csv"


@pytest.fixture
def reference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    r = signals.triangle(2.0, 5.0, 2, RATE)
    write_columns("reference.csv", {"time_s": r.time, "reference_um": r.values})
    return tmp_path / "reference.csv"


def test_demo_reduces_the_error_by_ninety_percent(tmp_path: Path) -> None:
    said: list[str] = []
    result = demo.run_demo(progress=said.append)
    assert len(said) == 5
    names = (demo.LINEAR, demo.FIXED, demo.ADAPTIVE, demo.CONTROLLER)
    linear, fixed, adaptive, controller = (result.records[name] for name in names)
    assert result.reduction(demo.ADAPTIVE) >= 0.9
    errors = adaptive.max_error_per_period()
    assert errors[0] > 5.0 * errors[-1]
    # The start is wrong: without adaptation it is worse than the straight line.
    assert fixed.max_error(2) > linear.max_error(2)
    # The controller starts from nothing, and finds what the other one finds.
    assert result.reduction(demo.CONTROLLER) >= 0.89
    assert result.learnt["beta"] == pytest.approx(adaptive.theta[-1, 1], rel=0.05)
    u = controller.voltage
    assert demo.LIMITS.minimum <= u.min() < u.max() <= demo.LIMITS.maximum
    result.plot().savefig(tmp_path / "figure.png")


def test_identify_prints_tables_and_writes_figure_and_model(log: Path) -> None:
    other = Path("a_log_of_another_day_with_a_rather_long_name.csv")
    other.write_bytes(log.read_bytes())
    said = done("identify", log, "--output", "model.json", "--validate", other, columns=80).stdout
    for word in ("alpha", "µm/V²", "▸ Coleman-Hodgdon", "log_identified.png", "model.json", "a_log_of"):
        assert word in said
    rules = [line for line in said.splitlines() if line.startswith("──")]
    assert len(rules) == 3
    assert max(map(len, rules)) <= 80
    assert Path("log_identified.png").stat().st_size > 10_000
    assert json.loads(Path("model.json").read_text(encoding="utf-8"))["model"]["model"] == "ColemanHodgdon"


def test_identify_one_kind_of_a_file_that_is_called_example(log: Path) -> None:
    log.rename("example")
    options = ("--model", "plays", "--json", "--no-plot", "--delay", 0)
    data = json.loads(done("identify", "example", *options).stdout)
    assert (data["kind"], data["delay_samples"]) == ("plays", 0.0)
    assert data["samples"] == len(read_record("example"))
    assert not list(log.parent.glob("*.png"))
    assert [each["name"] for each in data["candidates"]] == ["line", "plays"]
    said = done("identify", "--help").stdout
    assert all(name in said for name in FORMS)


@pytest.mark.slow
def test_identify_predicts_other_logs(log: Path) -> None:
    record = read_record(log)
    Record.from_arrays(record.voltage, record.displacement + 0.5, RATE).write("other.csv")
    options = ("--no-plot", "--validate", "other.csv", "--validate", log, "--json")
    other, same = json.loads(done("identify", log, *options).stdout)["validation"]
    assert (other["source"], same["source"]) == ("other.csv", str(log))
    assert other["error"]["rms_um"] == pytest.approx(0.5, rel=0.01)
    assert other["without_mean"]["rms_um"] < 3e-3
    assert same["error"]["rms_um"] < 3e-3


def test_strict_refuses_a_doubtful_log(log: Path) -> None:
    record = read_record(log)
    # Mirrored about a line of 0.15 µm/V, the loop runs clockwise.
    Record.from_arrays(record.voltage, 0.3 * record.voltage - record.displacement, RATE).write("odd.csv")
    done("identify", "odd.csv", "--no-plot")
    refused(run("identify", "odd.csv", "--no-plot", "--strict"), "clockwise")


@pytest.mark.parametrize("options", [("--model", "plays-creep"), ("--stream",)])
@pytest.mark.slow_but_first
def test_a_model_goes_into_compensate_with_its_ranges(tmp_path: Path, monkeypatch: Any, options: Any) -> None:
    monkeypatch.chdir(tmp_path)
    data = json.loads(done("identify", "example", "--no-plot", "--json", "-o", "model.json", *options).stdout)
    assert data["samples"] == 14_155
    learnt = LearntModel.read("model.json")
    assert isinstance(learnt.model, PrandtlIshlinskii)
    assert learnt.learnt_on is not None
    for amplitude, words in ((12.0, ()), (30.0, ("the displacement goes from", "the voltage goes from"))):
        r = signals.sine(amplitude, 1.0, periods=5, sample_rate=200.0)
        write_columns("reference.csv", {"time_s": r.time, "reference_um": r.values - 96.0})
        said = done("compensate", "reference.csv", "-p", "model.json", *OUT).stderr
        assert all(word in said for word in words)
        assert ("goes from" in said) == bool(words)
        u = read_record("voltage.csv", columns={"displacement": "reference_um"})
        x = learnt.model.simulate(u.voltage, sample_rate=200.0)
        np.testing.assert_allclose(x, u.displacement, atol=1e-3)


def test_compensate_keeps_within_limits_and_says_so(reference: Path) -> None:
    result = done("compensate", reference, *THETA, "--maximum", 10, "--minimum", -8, *OUT)
    assert "reference: column reference_um" in result.stdout
    assert "limit" in result.stderr
    for word in ("--minimum", "--maximum", "jumps"):
        assert word not in result.stderr
    u = read_record("voltage.csv", columns={"displacement": "reference_um"}).voltage
    assert (u.min(), u.max()) == (-8.0, 10.0)
    assert "jumps" in run("compensate", reference, *THETA, *OUT, "--offset", -20).stderr
    # What nothing bounds is said.
    for limits in ((), ("--minimum", -60), ("--maximum", 60)):
        said = done("compensate", reference, *THETA, *limits, *OUT).stderr
        for name in ("--minimum", "--maximum"):
            assert (name in said) == (name not in limits)


LEARNT_ON = {"voltage": [-16.0, 16.0], "displacement": [1.0, 5.0], "rate": 400.0, "frequency": [5.0, 5.0]}


@pytest.mark.parametrize("offset", [3.0, 0.0])
def test_compensate_says_what_the_model_was_not_learnt_on(reference: Path, offset: float) -> None:
    r = signals.triangle(2.0, 5.0, 4, RATE)
    write_columns(reference, {"time_s": r.time, "reference_um": r.values + offset})
    options = ("--minimum", -100, "--maximum", 100, *(() if offset == TRUE.offset else ("--offset", offset)))
    leaves = {"rate": 100.0, "displacement": [2.0, 4.0]}
    for change, lines in (({}, 0), ({"frequency": None}, 0), (leaves, 2)):
        Path("model.json").write_text(json.dumps({"model": TRUE.to_dict(), "learnt_on": LEARNT_ON | change}))
        result = done("compensate", reference, "-p", "model.json", *OUT, *options)
        assert len(result.stderr.strip().splitlines()) == lines


def test_mistakes_in_logs(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for options in (("--model", "plays"), ("--validate", log), ("--strict",), ("--plot", "figure.png")):
        refused(run("identify", log, "--stream", *options), str(options[0]), "leave out --stream")
    for usage in (("identify",), ("demo", "--speed", 3), ("nonsense",), ("demo", "--periods", "x")):
        assert run(*usage).exit_code == 2
    wrong = {"--model": "foo", "--train": 2, "--delay": "soon", "--columns": "voltage", "--units": "nm"}
    for option, word in wrong.items():
        result = run("identify", log, option, word)
        assert result.exit_code == 2
        assert option in result.stderr
    assert isinstance(run("identify", "none.csv", "--debug").exception, OSError)
    text = log.read_text()
    dwell = "".join(f"\n{k / 100},5.0,{1 + k % 2}" for k in range(300))
    for name, content, words in (
        ("empty.csv", "", ["empty"]),
        ("text.csv", text.replace("0.005,", "oops,", 1), ["line 7", "time_s", "oops"]),
        ("columns.csv", text.replace("voltage_V", "current_A"), ["voltage", "current_A"]),
        ("dwell.csv", text.partition("\n")[0] + dwell, ["too little excitation", "5 V"]),
    ):
        Path(name).write_text(content)
        refused(run("identify", name), *words)
    refused(run("identify", "none.csv"), "none.csv", "No such file")
    refused(run("identify", log, "--no-plot", "--validate", "none.csv"), "none.csv", "No such file")
    refused(run("identify", "."), "Is a directory" if sys.platform != "win32" else ".")
    refused(run("identify", log, "--columns", "voltage=foo"), "foo")
    refused(run("identify", log, "--plot", "no/such/figure.png"), "no folder")
    for name in ("figure.xyz", "figure"):
        refused(run("identify", log, "--plot", name), name, ".png")
        refused(run("demo", "--output", name), name, ".png")
    too_long = MemoryError("Unable to allocate 8 TiB")
    monkeypatch.setattr("piezoest.records.read_record", Mock(side_effect=too_long))
    refused(run("identify", log, "--no-plot"), "not enough memory: Unable to allocate 8 TiB")
    monkeypatch.setattr("piezoest.records.read_record", Mock(side_effect=KeyboardInterrupt))
    result = run("identify", log)
    assert (result.exit_code, result.output) == (130, "")


def test_mistakes_in_compensate(reference: Path) -> None:
    write_columns("jump.csv", {"time_s": np.arange(40.0), "r_um": np.repeat([0.0, 1.0], 20)})
    for arguments, *words in (
        ((*OUT,), "no model"),
        ((*THETA, "-o", "voltage.xlsx"), "voltage.xlsx", "no format"),
        (("--alpha", 1, *OUT), "--beta and --gamma"),
        (("--alpha", 1, "--beta", 1, "--gamma", 9, *OUT), "not admissible"),
        ((*THETA, "--minimum", 5, "--maximum", 1, *OUT), "must be below"),
        (("-p", "none.json", *OUT), "none.json"),
        (("-p", "reference.csv", "--alpha", 1, *OUT), "two models"),
        ((*THETA, "-o", "-"), "- is no file"),
        ((*THETA, *OUT, "--sample-rate", 0), "sample_rate must be above zero"),
        ((*THETA, *OUT, "--offset", 1e300), "offset must lie within"),
    ):
        refused(run("compensate", reference, *arguments), *words)
    refused(run("compensate", "jump.csv", *THETA, *OUT), "the reference jumps")
    contents = {
        "{": "not JSON",
        "[1]": "no model",
        '{"model": ["a"]}': "no model",
        '{"model": "Foo"}': "Foo",
        '\ufeff{"model": "StepModel"}': "StepModel",
        json.dumps({"model": TRUE.to_dict(), "learnt_on": LEARNT_ON | {"rate": "fast"}}): "rate must be one",
        '{"alpha": 1}': "ColemanHodgdon has no 'beta'",
        '{"model": "LinearGain", "gain": 5e-324}': "has no inverse: its gain must not be zero",
        "[" * 100_000: "nested too deeply",
        json.dumps({**TRUE.to_dict(), "alpha": 10**400}): "alpha must be a number of at most",
    }
    for text, word in contents.items():
        Path("model.json").write_text(text)
        refused(run("compensate", reference, "-p", "model.json", *OUT), word)
    assert not Path("voltage.csv").exists()
    if Path("/dev/full").exists():
        refused(run("compensate", reference, *THETA, "-o", "/dev/full"), "/dev/full: No space left")


def test_nothing_is_written_over_what_was_read(log: Path, reference: Path) -> None:
    refused(run("identify", log, "--no-plot", "--output", log), "log.csv", "named twice")
    refused(run("identify", log, "--plot", "a.png", "--output", "./a.png"), "named twice")
    refused(run("compensate", reference, *THETA, "-o", reference), "reference.csv", "named twice")
    assert log.read_text().startswith("time_s,voltage_V")
    assert reference.read_text().startswith("time_s,reference_um")


@pytest.mark.slow
def test_an_encoding_without_our_signs_is_no_mistake(log: Path) -> None:
    command = [sys.executable, "-m", "piezoest", "identify", str(log), "--no-plot"]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    result = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert result.returncode == 0, result.stderr
    assert "held out" in result.stdout


def test_help_and_version() -> None:
    assert run("--version").stdout.strip() == f"piezoest {__version__}"
    for command in ((), ("demo",), ("identify",), ("compensate",), ("bench",), ("export",)):
        assert "Example" in done(*command, "--help").stdout
