"""What goes wrong on the rigs of the zoo does what it says, one by one and together."""

from typing import Any

import numpy as np
import pytest

from piezoest._checks import FloatArray
from piezoest.bench.zoo import draw
from piezoest.bench.zoo.faults import FAULTS, START, TRANSIENT
from piezoest.bench.zoo.rig import Rig
from tests.bench import shared

SHORT = {**shared.SHORT, "frequency": 20.0, "amplitude": 5.0, "waves": 20}
MODES = [(kind, mode) for kind, each in FAULTS.items() for mode in each.modes]


def seen(rig: Rig, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    stage = rig.stage()
    x = stage.run(u)
    return x, np.asarray(stage.displacement)


def drive(rig: Rig) -> FloatArray:
    return np.clip(rig.reference / 0.15, -99.0, 99.0)


@pytest.mark.parametrize(("kind", "mode"), MODES)
@pytest.mark.slow_but_first
def test_step_run_and_pieces_give_the_same_bits(kind: str, mode: str) -> None:
    given = {**SHORT, "hum": 0.1, "drift": 0.3, "delay": 2, "resolution": 1e-3}
    rig = draw(11, fault=kind, mode=mode, **given)
    u = drive(rig)
    x, true = seen(rig, u)
    single, piece = rig.stage(), rig.stage()
    np.testing.assert_array_equal(rig.stage().run(u), x)
    both = np.column_stack((x, true))
    steps = [(single.step(float(v)), float(np.ravel(single.displacement)[0])) for v in u]
    np.testing.assert_array_equal(steps, both)
    pieces = [(piece.run(u[k : k + 37]), piece.displacement) for k in range(0, u.size, 37)]
    np.testing.assert_array_equal(np.hstack([np.atleast_2d(each) for each in pieces]).T, both)


@pytest.mark.parametrize(("kind", "mode"), MODES)
def test_it_is_there_when_it_should_be_and_only_then(kind: str, mode: str) -> None:
    rig, sound = draw(11, fault=kind, mode=mode, **SHORT), draw(11, fault="none", **SHORT)
    u = drive(sound)
    fault, n = rig.fault, u.size
    assert (fault.start == 0) == (mode == START or (mode == TRANSIENT and fault.start == 0))
    assert fault.lasting == (mode != TRANSIENT)
    assert 0 <= fault.start < fault.stop <= n
    x, true = seen(rig, u)
    x_sound, true_sound = seen(sound, u)
    np.testing.assert_array_equal(x[: fault.start], x_sound[: fault.start])
    np.testing.assert_array_equal(true[: fault.start], true_sound[: fault.start])
    pairs = ((rig.reference, sound.reference), (x, x_sound), (true, true_sound))
    assert not all(np.array_equal(*pair) for pair in pairs)
    if not fault.lasting and kind not in ("drift", "dwell"):
        np.testing.assert_allclose(x[fault.stop + 300 :], x_sound[fault.stop + 300 :], atol=1e-3)
        np.testing.assert_allclose(true[-60:], true_sound[-60:], atol=1e-3)


def one(kind: str, mode: str | None = "permanent", **given: Any) -> tuple[Rig, FloatArray, FloatArray, Any]:
    rig = draw(11, fault=kind, mode=mode, **{**SHORT, "noise": 0.0, **given})
    x, true = seen(rig, drive(rig))
    return rig, x, true, rig.fault.within(x.size)


def test_what_each_fault_is() -> None:
    for kind in ("amplifier-frozen", "stage-stuck"):
        rig, x, true, within = one(kind, noise=1e-3)
        assert np.ptp(true[within]) == 0.0
        assert np.ptp(true[~within]) > 5.0
        assert 0.0 < np.std(x[within]) < 3e-3
    rig, x, true, within = one("sensor-constant")
    assert np.ptp(x[within]) == 0.0
    assert np.ptp(true[within]) > 5.0
    rig, x, true, within = one("sensor-noise")
    assert 0.0 < np.std(x[within]) < 0.1
    rig, x, true, within = one("sensor-saturated")
    assert np.max(np.abs(x[within])) == pytest.approx(0.6 * 5.0)
    rig, x, true, within = one("sensor-factor")
    np.testing.assert_allclose(x[within], rig.fault.size * true[within])
    rig, x, true, within = one("zero-off")
    np.testing.assert_allclose(x - true, rig.fault.size * within)
    rig, x, true, within = one("spikes")
    assert 0.0 < np.mean(x[within] != true[within]) < 0.05
    rig, x, true, within = one("dropouts")
    assert np.mean(np.isnan(x[within])) == pytest.approx(rig.fault.size, abs=0.1)
    rig, x, true, within = one("gap", "transient")
    np.testing.assert_array_equal(np.isnan(x), within)
    rig, x, true, within = one("hum")
    assert np.std((x - true)[within]) == pytest.approx(rig.fault.size / np.sqrt(2.0), rel=0.05)
    rig, x, true, within = one("glitch", "transient")
    assert x[0] - true[0] == pytest.approx(rig.fault.size)
    np.testing.assert_array_equal(x[1:], true[1:])


def test_faults_of_the_stage_and_of_the_reference() -> None:
    sound, _, true_sound, _ = one("none", None)
    rig, _, _, within = one("gain-step")
    true = seen(rig, drive(sound))[1]
    np.testing.assert_allclose(true[within], rig.fault.size * true_sound[within])
    rig = one("drift")[0]
    assert seen(rig, drive(sound))[1][-1] - true_sound[-1] == pytest.approx(rig.fault.size, rel=0.01)
    rig, _, _, within = one("zero-off-shifted")
    np.testing.assert_allclose(rig.reference - sound.reference, rig.fault.size * within)
    for kind, mode in (("amplitude-drop", "permanent"), ("dwell", None)):
        rig = one(kind, mode)[0]
        assert np.max(np.abs(np.diff(rig.reference))) < 1.1 * np.max(np.abs(np.diff(sound.reference)))
        if kind == "dwell":
            assert np.std(rig.reference[rig.fault.start : rig.fault.stop]) == pytest.approx(1e-4, rel=0.3)
        else:
            assert np.max(np.abs(rig.reference[-100:])) < 0.45 * 5.0


def test_whose_coordinates_count() -> None:
    """A gauge that was never right is right; one that goes wrong is wrong."""
    always = draw(11, fault="sensor-factor", mode=START, **SHORT)
    assert always.coordinates[0] == always.fault.size
    later = draw(11, fault="sensor-factor", mode="permanent", **SHORT)
    assert later.coordinates[0] == 1.0
    for mode, moved in ((START, True), ("permanent", True), (TRANSIENT, False)):
        assert draw(11, fault="zero-off", mode=mode, **SHORT).coordinates[1].any() == moved
    assert draw(11, fault="zero-off-shifted", mode=TRANSIENT, **SHORT).coordinates[1].any()


def test_a_fault_that_is_unknown_is_refused() -> None:
    for given, words in (
        ({"fault": "gremlins"}, "fault must be none or one of"),
        ({"fault": "dwell", "mode": "permanent"}, "dwell is transient"),
        ({"colour": "red"}, "colour: choose one of"),
    ):
        with pytest.raises(ValueError, match=words):
            draw(0, **given)
