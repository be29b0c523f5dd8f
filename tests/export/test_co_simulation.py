"""The co-simulation unit: valid, and equal to the library where it runs."""

import errno
import os
import zipfile
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

import piezoest as pz

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install piezoest[export]")
fmi2 = pytest.importorskip("fmpy.fmi2")
validation = pytest.importorskip("fmpy.validation")

FS = 50_000.0


def pair(kind: str = "rls") -> tuple[Any, Any]:
    if kind == "line":
        return None, pz.LinearCompensator(pz.LinearGain(0.15), pz.VoltageLimits(sample_rate=FS))
    start = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
    made = pz.HysteresisRLS if kind == "rls" else pz.HysteresisEKF
    return made(FS, initial_model=start), pz.InverseCompensator(start, pz.VoltageLimits(-60.0, 60.0))


@pytest.mark.parametrize(("kind", "precision"), [("rls", "double"), ("ekf", "float"), ("line", "double")])
def test_is_valid(kind: str, precision: Any, tmp_path: Path) -> None:
    path = pz.export.fmu(*pair(kind), tmp_path / "a.fmu", precision=precision)
    assert validation.validate_fmu(str(path)) == []


def start(unit: Path, folder: Path) -> Any:
    description = fmpy.read_model_description(str(unit))
    fmpy.extract(str(unit), unzipdir=str(folder))
    running = fmi2.FMU2Slave(
        guid=description.guid, unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier, instanceName="one",
    )  # fmt: skip
    running.instantiate()
    running.setupExperiment(startTime=0.0)
    running.enterInitializationMode()
    running.exitInitializationMode()
    return running


def test_equals_the_library(tmp_path: Path) -> None:
    running = start(pz.export.fmu(*pair(), tmp_path / "controller.fmu"), tmp_path)
    assert running.getReal([2]) == [0.0]
    r = pz.signals.triangle(5.0, 5.0, 1, FS).values[:6000]
    estimator, compensator = pair()
    record = pz.track(r, stage=pz.PaperStage(FS, seed=0), compensator=compensator, estimator=estimator)
    u, x = np.empty(r.size), np.nan
    for k in range(r.size):
        if k == 3000:
            saved = running.getFMUState()
        running.setReal([0, 1], [float(r[k]), x])
        running.doStep(k / FS, 1.0 / FS)
        u[k] = running.getReal([2])[0]
        x = float(record.measured[k])
    np.testing.assert_allclose(u, record.voltage, rtol=0.0, atol=1e-12 * np.max(np.abs(u)))
    assert running.getReal([5])[0] == pytest.approx(record.theta[-1, 0], rel=0.5)
    running.setFMUState(saved)
    running.setReal([0, 1], [float(r[3000]), float(record.measured[2999])])
    running.doStep(3000 / FS, 1.0 / FS)
    assert running.getReal([2])[0] == u[3000]
    running.freeFMUState(saved)
    running.setBoolean([0], [True])
    assert running.getBoolean([0]) == [True]
    running.setReal([3, 4], [-1.0, 1.0])
    running.doStep(3001 / FS, 2.0 / FS)
    assert abs(running.getReal([2])[0]) <= 1.0
    running.reset()
    assert running.getReal([2, 3, 4]) == [0.0, -60.0, 60.0]
    running.terminate()
    running.freeInstance()


@pytest.mark.parametrize(
    ("parts", "name", "options", "words"),
    [
        (pair(), "a.zip", {}, r"\.fmu"),
        ((None, pz.LinearCompensator(pz.LinearGain(0.15))), "a.fmu", {}, "sample_rate"),
        (pair(), "a.fmu", {"sample_rate": 1e3}, "sample_rate"),
    ],
)
def test_wrong_arguments_are_refused(parts: Any, name: str, options: Any, words: str, tmp_path: Path) -> None:
    estimator, compensator = parts
    with pytest.raises(ValueError, match=words):
        pz.export.fmu(estimator, compensator, tmp_path / name, **options)


def test_a_full_disk_leaves_the_old_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "stage.fmu"
    path.write_bytes(b"as it was")
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    monkeypatch.setattr(zipfile.ZipFile, "writestr", Mock(side_effect=full))
    with pytest.raises(OSError, match=r"stage\.fmu"):
        pz.export.fmu(*pair("line"), path)
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [b"as it was"]
