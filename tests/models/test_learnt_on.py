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
from piezoest.signals.turns import turns

FS = 5000.0
LOOP = pz.ColemanHodgdon(0.02, 0.12, 0.0036, offset=3.0)
KNOWN = LearntOn((-40.0, 40.0), (-6.0, 6.0), 800.0, (4.0, 6.0))


def wave(amplitude: float = 40.0, frequency: float = 5.0, periods: int = 8) -> FloatArray:
    time = np.arange(round(periods * FS / frequency)) / FS
    return amplitude * np.interp(time * frequency % 1.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])


def test_turns_are_the_extremes_that_the_signal_runs_back_from() -> None:
    u = wave(periods=2)
    assert turns(u, 1.0).tolist() == [250, 750, 1250, 1750]
    assert turns(u + 0.3 * np.sin(np.arange(u.size)), 1.0) == pytest.approx([250, 750, 1250, 1750], abs=8)
    assert turns(u, 100.0).size == turns(np.ones(5), 0.0).size == turns([], 1.0).size == 0
    # Of a flat one the first sample counts, where the signal came from does not.
    assert turns([5.0, 0.0, 3.0, 3.0, 3.0, 0.0, 4.0], 1.0).tolist() == [1, 2, 5]


def test_a_log_has_its_ranges_without_what_is_wild_or_missing() -> None:
    u = np.concatenate((wave(20.0, 2.0), wave(40.0, 10.0)))
    x = 0.1 * u + 1.0
    for _ in range(2):
        found = LearntOn.of(u, x, FS)
        assert found.voltage == (-40.0, 40.0)
        assert found.displacement == pytest.approx((-3.0, 5.0), abs=0.05)
        assert found.rate == pytest.approx(1600.0)
        assert found.frequency == pytest.approx((2.0, 10.0), rel=0.01)
        u[700], x[[100, 3000]] = np.nan, [1e6, -1e6]
        u[1000:1100], x[2000:2010] = np.nan, np.nan


def test_steps_spikes_rests_and_converters_are_no_rate() -> None:
    u, rest = wave(), np.zeros(200_000)
    stepped, spiked = u.copy(), u.copy()
    stepped[4000:] += 30.0
    spiked[4000] += 30.0
    steps = 0.5 * np.round(u / 0.5)  # each of three samples or so
    for each in (stepped, spiked, np.concatenate((rest, u, rest)), steps):
        assert LearntOn.of(each, each, FS).rate == pytest.approx(800.0, rel=0.2)
    assert LearntOn.of(rest, rest, FS) == LearntOn((0.0, 0.0), (0.0, 0.0), 0.0)


def test_blocks_of_a_log_have_the_ranges_of_the_log() -> None:
    u = np.concatenate((wave(20.0, 2.0), wave(40.0, 10.0)))
    parts = [LearntOn.of(part, 0.1 * part, FS) for part in np.split(u, 4)]
    joined = parts[0].joined(parts[1]).joined(parts[2]).joined(parts[3])
    whole = LearntOn.of(u, 0.1 * u, FS)
    assert joined.voltage == whole.voltage
    assert joined.rate == pytest.approx(whole.rate)
    assert joined.frequency == pytest.approx(whole.frequency, rel=0.01)
    still = LearntOn((0.0, 0.0), (0.0, 0.0), 0.0)
    assert still.joined(KNOWN) == KNOWN.joined(still) == KNOWN
    assert still.joined(still) == still


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
    log = pz.InverseCompensator(LOOP).run(kind(5.0, 5.0, 4, FS).values + LOOP.offset)
    known = LearntOn.of(kind(np.ptp(log) / 2.0, 5.0, 4, FS).values, r, FS)
    assert known.left_by(LearntOn.of(log, r, FS)) == ()


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
