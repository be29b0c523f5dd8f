"""Identification of a log that need not fit in memory: as that of one which does, whatever its blocks."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.identification.parts import PART, parts, pieces
from piezoest.records import RecordStream, stream_record
from tests.fitting.stages import RATE, noise, stage, voltage

COUNT = 10_000


def drawn(seed: int = 0, **kinds: Any) -> tuple[FloatArray, FloatArray]:
    """Voltage and displacement; the second half is as the first."""
    rng = np.random.default_rng(seed)
    u = np.tile(voltage(rng, 40.0, 40.0 * (seed % 2)), 2)
    x = stage(rng, **kinds).simulate(u)
    return u, x + noise(1e-3 * float(np.ptp(x)), seed, u.size)


def saved(folder: Path, u: FloatArray, x: FloatArray, rows: int = 1000) -> RecordStream:
    np.save(folder / "log.npy", np.column_stack([np.arange(u.size) / RATE, u, x]))
    return stream_record(folder / "log.npy", rows=rows)


@pytest.mark.parametrize(
    ("seed", "kinds", "kind", "missing"),
    [(0, {}, "plays", 0), (0, {"bends": 2}, "plays-asymmetric", 0), (2, {}, "plays", 3000)],
)
@pytest.mark.slow
def test_as_good_as_in_memory(
    tmp_path: Path, seed: int, kinds: dict[str, Any], kind: str, missing: int
) -> None:
    """Also where half of the fitted part is missing."""
    u, x = drawn(seed, **kinds)
    x[2000 : 2000 + missing] = np.nan
    found = pz.identify_stream(saved(tmp_path, u, x), delay=0.0)
    wanted = pz.identify(tmp_path / "log.npy", delay=0.0, model=found.chosen)
    for mine, other, within in (
        (found.held_out.rms, wanted.held_out.rms, 0.05),
        (found.train.rms, wanted.train.rms, 0.05),
        (found.cross_validated[found.chosen], wanted.best.cross_validated, 0.05),
        (found.line_held_out.rms, wanted.line_held_out.rms, 0.01),
    ):
        assert mine == pytest.approx(other, rel=within)
    assert found.chosen in ("plays", kind)
    assert min(found.cross_validated.values()) > 0.0
    assert np.std(found.prediction - wanted.prediction) < 0.02 * np.std(u - u.mean())
    assert (found.samples, found.trained, found.skipped) == (COUNT, COUNT // 2, missing)
    assert any("3000" in said for said in found.advice) == (missing == 3000)


@pytest.mark.slow
def test_whatever_the_blocks_the_same_bits(tmp_path: Path) -> None:
    u, x = drawn(1)
    u[300:340], u[:7], x[:2], x[4000:4010] = np.nan, np.nan, np.nan, np.nan
    x[[800, 4500, 7777]] += 3.0
    wanted = pz.identify_stream(saved(tmp_path, u, x))
    assert wanted.skipped == 40 + 7 + 10 + 3
    for rows in (100, 4501, 10 * COUNT):
        found = pz.identify_stream(stream_record(tmp_path / "log.npy", rows=rows))
        assert found.to_dict() == wanted.to_dict()
        np.testing.assert_array_equal(found.prediction, wanted.prediction)


@pytest.mark.parametrize(("flaw", "skipped"), [("gaps", 1000), ("wrong voltages", 3), ("unsettled", 0)])
@pytest.mark.slow_but_first
def test_flaws_do_no_harm(tmp_path: Path, flaw: str, skipped: int) -> None:
    u, x = drawn(4 if flaw == "unsettled" else 2)
    whole = pz.identify_stream(saved(tmp_path, u, x), delay=0.0)
    if flaw == "gaps":
        u[:600], x[2000:2300], x[6000:6100] = np.nan, np.nan, np.nan
    elif flaw == "wrong voltages":
        u[[1500, 3210, 7000]] = 1e4, 0.0, -300.0
    else:
        x -= np.ptp(x) * np.exp(-np.arange(COUNT) / 20.0)
    found = pz.identify_stream(saved(tmp_path, u, x, rows=500), delay=0.0)
    assert found.skipped == skipped
    assert found.held_out.rms < (2.0 if flaw == "gaps" else 1.2) * whole.held_out.rms
    assert np.all(np.isfinite(found.prediction))
    assert len(found.thinned) == COUNT
    assert any(each.name == "wrong voltage" for each in found.findings) == (flaw == "wrong voltages")


@pytest.mark.parametrize(
    ("change", "name"), [(lambda u, x: (x, u), "clockwise"), (lambda u, x: (u, 1e4 * x), "too large")]
)
@pytest.mark.slow_but_first
def test_the_start_is_checked_progress_told_and_what_was_found_is_json(
    tmp_path: Path, change: Any, name: str
) -> None:
    told: list[tuple[int, int]] = []
    found = pz.identify_stream(saved(tmp_path, *change(*drawn())), progress=lambda *done: told.append(done))
    assert [each.name for each in found.findings if each.severity == "doubt"] == [name]
    assert found.findings[0].sentence in found.advice[0]
    # Three passes, each from the start to the end.
    assert sum(now <= then for (now, _), (then, _) in zip(told[1:], told, strict=False)) == 2
    assert {total for _, total in told} == {told[-1][0]}
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert pz.models.model_from_dict(data["model"]) == found.model
    assert pz.models.reading.LearntModel.from_dict(data).learnt_on == found.learnt_on
    assert data["samples"] == COUNT


@pytest.mark.slow
def test_a_lag_is_found_and_followed(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    u = np.tile(voltage(rng), 2)
    x = stage(rng).simulate(np.interp(np.arange(u.size) - 2.5, np.arange(u.size), u))
    stream = saved(tmp_path, u, x + noise(1e-3 * float(np.ptp(x)), 0, u.size))
    found = pz.identify_stream(stream)
    assert found.delay == pytest.approx(2.5, abs=0.2)
    given = pz.identify_stream(stream, delay=2.5)
    assert given.delay == 2.5
    assert given.held_out.rms == pytest.approx(found.held_out.rms, rel=0.25)
    assert given.held_out.rms < 0.7 * pz.identify_stream(stream, delay=0.0).held_out.rms


def test_streams_that_show_nothing_are_refused(tmp_path: Path) -> None:
    u, x = drawn()
    for log, words in (
        ((0.0 * u, x), "too little excitation"),
        ((u, -x), "change the sign"),
        ((u, np.nan * x), "usable"),
        ((u, np.where(np.arange(COUNT) < COUNT // 2, x, np.nan)), "held-out part"),
    ):
        with pytest.raises(ValueError, match=words):
            pz.identify_stream(saved(tmp_path, *log))
    with pytest.raises(ValueError, match="log must be a RecordStream, got str"):
        pz.identify_stream("log.npy")  # type: ignore[arg-type]
    for options in ({"train": 1.0}, {"delay": 31.0}, {"delay": np.nan}):
        with pytest.raises(ValueError, match=next(iter(options))):
            pz.identify_stream(saved(tmp_path, u, x), **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("delay", [0.0, 0.4, 3.0, 7.7])
def test_parts_join_to_the_late_voltage(tmp_path: Path, delay: float) -> None:
    u = np.cumsum(np.random.default_rng(0).standard_normal(2 * PART + 123))
    stream = saved(tmp_path, u, 0.1 * u, rows=33_333)
    found = list(parts(stream, delay, None))
    assert [part.first for part in found] == [0, PART, 2 * PART]
    expected = np.interp(np.arange(u.size) - delay, np.arange(u.size), u)
    np.testing.assert_allclose(np.concatenate([part.u for part in found]), expected, atol=1e-9)
    np.testing.assert_array_equal(np.concatenate([piece for piece, _ in pieces(stream, None)]), u)


def test_a_part_without_a_voltage_counts_as_missing(tmp_path: Path) -> None:
    u = np.cumsum(np.random.default_rng(0).standard_normal(PART + 500))
    x, first = 0.1 * u, u[PART + 10]
    u[: PART + 10] = np.nan
    found = list(parts(saved(tmp_path, u, x), 0.0, None))
    assert [part.first for part in found] == [0, PART]
    assert not found[0].counts.any()
    np.testing.assert_array_equal(found[0].u, first)
    np.testing.assert_array_equal(found[1].u[:11], first)


def test_recording_of_a_real_stage(data_dir: Path) -> None:
    found = pz.identify_stream(stream_record(data_dir / "discrete_backlash_operator/test_1hz.csv", rows=1000))
    assert found.held_out.rms < 0.45
    assert found.line_held_out.rms > 1.2
