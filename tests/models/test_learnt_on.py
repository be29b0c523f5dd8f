"""Ranges that a model was learnt on, and models with them in files."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.models import LearntModel, LearntOn

FS = 5000.0
LOOP = pz.ColemanHodgdon(0.02, 0.12, 0.0036, offset=3.0)
KNOWN = LearntOn((-40.0, 40.0), (-6.0, 6.0), 800.0, (4.0, 6.0))
STILL = LearntOn((0.0, 0.0), (0.0, 0.0), 0.0)


def wave(amplitude: float = 40.0, frequency: float = 5.0, periods: int = 8) -> FloatArray:
    time = np.arange(round(periods * FS / frequency)) / FS
    return amplitude * np.interp(time * frequency % 1.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])


def test_a_log_has_its_ranges_without_what_is_wild_or_missing_and_so_have_its_blocks() -> None:
    u = np.concatenate((wave(20.0, 2.0), wave(40.0, 10.0)))
    x = 0.1 * u + 1.0
    parts = [LearntOn.of(part, 0.1 * part + 1.0, FS) for part in np.split(u, 4)]
    joined = parts[0].joined(parts[1]).joined(parts[2]).joined(parts[3])
    for wild in (False, True):
        if wild:
            u[700], x[[100, 3000]] = np.nan, [1e6, -1e6]
            u[1000:1100], x[2000:2010] = np.nan, np.nan
        for found in (LearntOn.of(u, x, FS), joined):
            assert found.voltage == (-40.0, 40.0)
            assert found.displacement == pytest.approx((-3.0, 5.0), abs=0.05)
            assert found.rate == pytest.approx(1600.0)
            assert found.frequency == pytest.approx((2.0, 10.0), rel=0.01)
    assert STILL.joined(KNOWN) == KNOWN.joined(STILL) == KNOWN
    assert STILL.joined(STILL) == STILL


def test_steps_spikes_rests_and_converters_are_no_rate() -> None:
    u, rest = wave(), np.zeros(200_000)
    stepped, spiked = u.copy(), u.copy()
    stepped[4000:] += 30.0
    spiked[4000] += 30.0
    steps = 0.5 * np.round(u / 0.5)  # each of three samples or so
    for each in (stepped, spiked, np.concatenate((rest, u, rest)), steps):
        assert LearntOn.of(each, each, FS).rate == pytest.approx(800.0, rel=0.2)
    assert LearntOn.of(rest, rest, FS) == STILL


@pytest.mark.parametrize(
    ("used", "count"),
    [
        (KNOWN, 0),
        # Within 5 % of the width, of the frequency, a factor of 1.5.
        (LearntOn((-43.9, 43.9), (-6.5, 6.5), 1190.0, (3.9, 6.2)), 0),
        (LearntOn((-1.0, 1.0), (-0.1, 0.1), 1.0), 0),
        (LearntOn((-44.1, 40.0), (-6.0, 6.0), 1.0), 1),
        (LearntOn((0.0, 44.1), (0.0, 6.7), 1.0), 2),
        (LearntOn((0.0, 1.0), (-6.7, 0.0), 1.0), 1),
        (LearntOn((0.0, 1.0), (0.0, 1.0), 1234.5), 1),
        (LearntOn((0.0, 1.0), (0.0, 1.0), 1.0, (5.0, 6.4)), 1),
        (LearntOn((0.0, 1.0), (0.0, 1.0), 1.0, (3.5, 3.5)), 1),
    ],
)
def test_who_leaves_a_range_is_told(used: LearntOn, count: int) -> None:
    assert len(KNOWN.left_by(used)) == count


@pytest.mark.parametrize("kind", [pz.signals.triangle, pz.signals.sine])
def test_the_same_reference_again_leaves_nothing(kind: Any) -> None:
    """Though the inverse is steeper after a turn than on the way."""
    r = kind(5.0, 5.0, 4, FS).values
    u = pz.InverseCompensator(LOOP).run(r + LOOP.offset)
    known = LearntOn.of(np.ptp(u) / 10.0 * r, r, FS)
    assert known.left_by(LearntOn.of(u, r, FS)) == ()


def test_a_model_comes_in_many_forms(tmp_path: Path) -> None:
    plain, both = LearntModel(LOOP), LearntModel(LOOP, KNOWN)
    for given, expected in (
        (LOOP, plain), (both, both), (SimpleNamespace(model=LOOP), plain),
        (SimpleNamespace(model=LOOP, learnt_on=KNOWN), both),
    ):  # fmt: skip
        assert LearntModel.of(given) == expected
    assert LearntModel.of(pz.HysteresisRLS(FS, initial_model=LOOP)).learnt_on is None
    file, bare = tmp_path / "model.json", {"alpha": 0.02, "beta": 0.12, "gamma": 0.0036, "offset": 3.0}
    more = both.to_dict() | {"format": "piezoest-identification-1", "advice": []}
    for data, expected in ((more, both), (LOOP.to_dict(), plain), ({"model": bare}, plain)):
        file.write_text(json.dumps(data), encoding="utf-8")
        assert LearntModel.of(file) == LearntModel.of(str(file)) == expected
    line = LearntModel(pz.LinearGain(0.1), KNOWN)
    assert LearntModel.from_dict(line.to_dict()) == line
    with pytest.raises(ValueError, match="dictionary"):
        LearntModel.from_dict([1])  # type: ignore[arg-type]
