"""`piezoest export`: what it writes and refuses."""

import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import piezoest as pz
from piezoest.cli import app
from piezoest.records import write_columns

START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["export", *map(str, arguments)], env={"COLUMNS": "120"})


def refused(result: Result, word: str) -> None:
    """One sentence on stderr, exit code 1."""
    assert result.exit_code == 1
    assert result.stderr.startswith("error: ")
    assert len(result.stderr.splitlines()) == 1
    assert word in result.stderr


@pytest.fixture
def model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "model.json"
    path.write_text(json.dumps({"model": "ColemanHodgdon", "alpha": 0.02, "beta": 0.12, "gamma": 0.0036}))
    return path


@pytest.mark.parametrize(
    ("kind", "made"), [("none", None), ("rls", pz.HysteresisRLS), ("ekf", pz.HysteresisEKF)]
)
def test_a_model_becomes_what_the_library_makes_of_it(model: Path, kind: str, made: type | None) -> None:
    own = ("--estimator", kind, "--sample-rate", 50_000, "--minimum", 0, "--maximum", 150)
    result = run("c", model, "-o", "out", *own, "--name", "stage", "--precision", "float")
    assert result.exit_code == 0, result.output
    estimator = made and made(50_000.0, initial_model=START)
    compensator = pz.InverseCompensator(START, pz.VoltageLimits(0.0, 150.0, sample_rate=50_000.0))
    code = pz.export.c(estimator, compensator, name="stage", precision="float")
    assert Path("out/stage.c").read_text() == code.source
    plays = pz.PrandtlIshlinskii(0.1, [1.0, 5.0], [0.02, 0.03], creep=pz.Creep([0.01], [1.0]))
    model.write_text(json.dumps(plays.to_dict()))
    result = run("c", model, "-o", "out", *own)
    if made is None:
        assert result.exit_code == 0
    else:
        refused(result, "Prandtl")


@pytest.mark.slow
def test_an_adaptive_feedforward_needs_no_model(tmp_path: Path) -> None:
    own = ("-o", tmp_path, "--sample-rate", 10_000, "--minimum", -20, "--maximum", 120, "--name", "stage")
    result = run("adaptive", *own, "--estimators", "ekf", "--slew-rate", 5000)
    assert result.exit_code == 0, result.output
    slewed = pz.VoltageLimits(-20.0, 120.0, 5000.0, 10_000.0)
    controller = pz.AdaptiveFeedforward(10_000.0, limits=slewed, estimators=(pz.HysteresisEKF,))
    assert (tmp_path / "stage.c").read_text() == pz.export.c(controller, name="stage").source
    assert run("adaptive", *own, "--estimators", "none").exit_code == 0
    assert run("adaptive", *own, "--estimators", "kalman").exit_code == 2


def test_profile_is_the_same_as_the_objects(model: Path) -> None:
    estimator = pz.OutputErrorRLS(50_000.0)
    profile = {
        "model": START.to_dict(),
        "estimator": estimator.to_dict(),
        "limits": {"minimum": -9, "maximum": 99},
    }
    model.write_text(json.dumps(profile))
    assert run("c", model, "-o", "out", "--name", "stage").exit_code == 0
    limits = pz.VoltageLimits(-9.0, 99.0, sample_rate=50_000.0)
    code = pz.export.c(estimator, pz.InverseCompensator(START, limits), name="stage")
    assert Path("out/stage.c").read_text() == code.source


def test_a_saved_adaptive_feedforward_becomes_code(model: Path) -> None:
    controller = pz.AdaptiveFeedforward(5000.0, limits=pz.VoltageLimits(-10.0, 10.0), estimators=())
    model.write_text(json.dumps(controller.to_dict()))
    assert run("c", model, "-o", "firmware").exit_code == 0
    assert Path("firmware/piezoest_controller.c").read_text() == pz.export.c(controller).source
    refused(run("c", model, "-o", "firmware", "--maximum", 3), "AdaptiveFeedforward")
    refused(run("fmu", model, "-o", "x.fmu"), "AdaptiveFeedforward")


def test_the_delay_that_identify_measured_is_told_the_estimator(model: Path) -> None:
    found = {"model": json.loads(model.read_text()), "sample_rate_Hz": 1000.0, "delay_samples": 1.5}
    for known, delay in ((True, 75.0), (False, 0.0)):
        model.write_text(json.dumps({**found, "delay_known": known}))
        result = run("c", model, "-o", "out", "--estimator", "rls", "--sample-rate", 50_000, "--minimum", 0)
        assert result.stderr == "warning: no --maximum: nothing bounds the voltage from above\n"
        limits = pz.VoltageLimits(minimum=0.0, sample_rate=50_000.0)
        estimator = pz.HysteresisRLS(50_000.0, initial_model=START, delay=delay)
        code = pz.export.c(estimator, pz.InverseCompensator(START, limits))
        assert Path("out/piezoest_controller.c").read_text() == code.source
    for damaged in ([1.5], "abc", -1.0, math.inf):
        model.write_text(json.dumps({**found, "delay_samples": damaged}))
        refused(run("c", model, "-o", "out"), "delay_samples must be")


def test_tables_are_written(model: Path) -> None:
    r = pz.signals.triangle(2.0, 5.0, 1, 1000.0)
    write_columns("r.csv", {"time_s": r.time, "reference_um": r.values})
    result = run("table", model, "r.csv", "-o", "out", "--points", 33)
    assert result.exit_code == 0, result.output
    assert len(Path("out/waveform.csv").read_text().splitlines()) == 1 + len(r)
    assert len(Path("out/branches.csv").read_text().splitlines()) == 1 + 2 * 33


def test_mistakes_are_one_sentence(model: Path) -> None:
    refused(run("c", model, "-o", "out", "--estimator", "rls"), "--sample-rate")
    refused(run("c", model, "-o", "out", "--minimum", 5, "--maximum", 1), "minimum")
    refused(run("fmu", model, "-o", "out.fmu"), "sample_rate")
    assert run("c", model, "-o", "out", "--precision", "half").exit_code == 2
