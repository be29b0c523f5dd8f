"""Gaps and wrong voltages of a log: models are judged where the stage is known, and never by NaN."""

import dataclasses

import numpy as np
import pytest

from piezoest.identification import Identification, identify
from piezoest.records import Record
from tests.identification.test_identify import LOOP, made

RECORD = made(delay=0.0)
HALF = len(RECORD) // 2
TURN = HALF + int(np.argmax(RECORD.voltage[HALF:]))


AROUND, NONE = slice(TURN - 60, TURN + 60), slice(0)
# Voltages and displacements that are missing.
LOST_TURN = {"rows": (AROUND, AROUND), "voltage": (AROUND, NONE)}
OTHERS = {
    "at both ends": (slice(-400, None), slice(HALF, HALF + 300)),
    "most": (NONE, slice(HALF, len(RECORD) - 300)),
    "spike": (NONE, NONE),
}


def wrong(name: str) -> Record:
    u, x = RECORD.voltage.copy(), RECORD.displacement.copy()
    lost = (LOST_TURN | OTHERS)[name]
    u[lost[0]], x[lost[1]] = np.nan, np.nan
    if name == "spike":
        u[TURN - 200] = -300.0
    return dataclasses.replace(RECORD, voltage=u, displacement=x)


def fitted(record: Record, model: str = LOOP, validate: tuple[Record, ...] = ()) -> Identification:
    return identify(record, model=model, delay=0.0, validate=list(validate))


WHOLE = fitted(RECORD, validate=(RECORD,))


@pytest.mark.parametrize("gap", OTHERS)
def test_what_does_not_count_hurts_no_figure(gap: str) -> None:
    found = fitted(wrong(gap))
    assert found.held_out.rms < 1.1 * WHOLE.held_out.rms
    assert found.held_out.max < 1.1 * WHOLE.held_out.max
    assert 0.0 < found.best.cross_validated < 1.1 * WHOLE.best.cross_validated
    error, whole = fitted(RECORD, validate=(wrong(gap),)).validations[0], WHOLE.validations[0]
    assert 0.0 < error.error.rms < 1.5 * whole.error.rms
    assert 0.0 < error.without_mean.rms < 1.5 * whole.without_mean.rms


@pytest.mark.parametrize("gap", LOST_TURN)
def test_what_comes_after_a_lost_turn_is_judged_when_it_is_forgotten(gap: str) -> None:
    record = wrong(gap)
    found = fitted(record)
    missed = (found.prediction - record.displacement)[HALF:]
    known = np.isfinite(record.voltage + record.displacement)[HALF:]
    assert found.held_out.rms < 0.5 * np.sqrt(np.mean(missed[known] ** 2))
    error = fitted(RECORD, validate=(record,)).validations[0]
    assert 0.0 < error.error.rms < 1.5 * WHOLE.validations[0].error.rms


def test_a_held_out_part_that_does_not_count_is_refused() -> None:
    x = RECORD.displacement.copy()
    x[HALF + 30 :] = np.nan
    with pytest.raises(ValueError, match=r"held-out part of .* 30 usable samples"):
        fitted(dataclasses.replace(RECORD, displacement=x))


def test_wrong_voltages_are_said_and_shown_as_missing() -> None:
    found = fitted(wrong("spike"))
    assert [each.name for each in found.findings if each.name == "wrong voltage"]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.record.voltage)), [TURN - 200])
    assert not any(each.name == "wrong voltage" for each in WHOLE.findings)
