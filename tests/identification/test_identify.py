"""Identification of a recorded log: known models, the real recording, what says too little."""

import json
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

import piezoest as pz
from piezoest import signals
from piezoest._checks import FloatArray
from piezoest.fitting import FORMS
from piezoest.identification import Identification, Whiteness, identify
from piezoest.identification.sense import findings
from piezoest.models import ColemanHodgdon
from piezoest.models.reading import LearntModel
from piezoest.records import Record
from tests.fitting.stages import noise, stage, voltage

RATE = 2000.0
TRUE = ColemanHodgdon(0.02, 0.12, 0.0036, offset=3.0)
DELAY = 2.3
LOOP = "coleman-hodgdon"
SWINGS = np.tile(np.asarray(signals.multi_amplitude([20.0, 35.0, 10.0, 30.0], 5.0, 2, RATE)), 2)
AT = np.arange(SWINGS.size)


def made(seed: int = 0, delay: float = DELAY) -> Record:
    x = TRUE.simulate(np.interp(AT - delay, AT, SWINGS), initial_state=-1.0)
    return log(SWINGS, x + noise(2e-3, seed, AT.size))


def log(u: FloatArray, x: FloatArray, rate: float = RATE) -> Record:
    return Record.from_arrays(u, x, rate)


def plays_log(seed: int = 0, **kinds: Any) -> Record:
    rng = np.random.default_rng(seed)
    u = voltage(rng, 40.0, 40.0)
    x = stage(rng, **kinds).simulate(u)
    return log(u, x + noise(1e-3 * float(np.ptp(x)), seed), 1000.0)


@pytest.mark.slow
def test_a_lag_that_swings_alike_cannot_tell_is_used_but_not_told() -> None:
    u = 30.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(8000) / RATE)
    found = identify(u, TRUE.simulate(u) + noise(2e-3, 0, u.size), sample_rate=RATE)
    assert not found.delay_known
    assert found.delay < 0.5
    assert found.held_out.rms == pytest.approx(2e-3, rel=0.1)
    assert any("lag of the displacement is not known" in sentence for sentence in found.advice)


@pytest.mark.slow
def test_corners_of_one_triangle_show_a_lag_to_the_fit() -> None:
    u = 30.0 * (2.0 * np.abs(np.arange(8000) / 400.0 % 2.0 - 1.0) - 1.0)
    x = np.roll(TRUE.simulate(u), 3)[3:]
    found = identify(u[3:], x + noise(2e-3, 0, x.size), sample_rate=RATE)
    assert not found.delay_known
    assert found.delay == pytest.approx(3.0, abs=0.2)
    assert found.held_out.rms < 2.5e-3


def resting_first(u: FloatArray) -> tuple[FloatArray, FloatArray]:
    u = np.concatenate([np.zeros(1500), u[:-1500]])
    return u, TRUE.simulate(u) + noise(2e-3, 0, u.size) + 0.7 * (np.arange(u.size) >= 700)


# What is made of a log, and what is said of it.
FLAWS: dict[str, tuple[Any, str]] = {
    "unipolar": (lambda u, x: (u + 60.0, x), "not centred"),
    "gaps": (
        lambda u, x: (np.where(AT == 500, np.nan, u), np.where(abs(AT - 115) < 15, np.nan, x)),
        "without",
    ),
    "unsettled": (lambda u, x: (u, x - 5.0 * np.exp(-AT / 10.0)), "do not fit the rest"),
    "rest and jump": (lambda u, x: resting_first(u), "rests once"),
    "dropout": (lambda u, x: (u, np.where(abs(AT - 1000) < 30, x[970], x)), "stands still while"),
    "late jump": (lambda u, x: (u, x + 5.0 * (AT[::-1] < 400)), "jumps once"),
    "spikes": (lambda u, x: (u, x + 20.0 * np.isin(AT, [300, 700])), "2 of the fitted samples are spikes"),
}


@pytest.mark.parametrize("name", FLAWS)
@pytest.mark.slow_but_first
def test_flaws_of_a_log_do_not_matter_and_are_said(name: str) -> None:
    change, said = FLAWS[name]
    found = identify(*change(SWINGS, made(delay=0.0).displacement), sample_rate=RATE, model=LOOP, delay=0.0)
    np.testing.assert_allclose(found.model.theta, TRUE.theta, rtol=0.01)
    assert found.held_out.rms < 4e-3
    assert np.all(np.isfinite(found.prediction))
    assert sum(said in sentence for sentence in (*found.advice, *found.record.notes)) == 1


@pytest.mark.slow
def test_drift_is_found_and_said() -> None:
    found = identify(log(SWINGS, made().displacement + np.linspace(0.0, 0.5, AT.size)), model=LOOP)
    assert found.fit.drift + found.drift > 0.2
    assert any("drifts" in sentence for sentence in found.advice)


@pytest.mark.parametrize(
    ("kinds", "wanted"),
    [({}, {"plays"}),
     ({"creep": pz.Creep([0.08], [0.25])}, {"plays-creep"}),
     ({"bends": 2}, {"plays-asymmetric", "plays-asymmetric-creep"}),
     ({"bends": 2, "creep": pz.Creep([0.08], [0.25])}, {"plays-creep", "plays-asymmetric-creep"})],
)  # fmt: skip
@pytest.mark.slow_but_first
def test_the_kind_that_a_stage_needs_is_chosen(kinds: dict[str, Any], wanted: set[str]) -> None:
    found = [identify(plays_log(seed, **kinds), delay=0.0) for seed in range(3)]
    assert len([each for each in found if each.chosen in wanted]) >= 2
    for each in found:
        assert each.held_out.rms < 1.6 * min(item.held_out.rms for item in each.candidates)


@pytest.mark.slow
def test_the_simplest_that_will_do_is_chosen() -> None:
    t = np.arange(8000) / 1000.0
    u = 30.0 * np.sin(2.0 * np.pi * 1.7 * t) * np.linspace(1.0, 0.5, t.size)
    x = ColemanHodgdon(0.02, 0.14, 0.004).simulate(u) + noise(2e-3, 0, t.size)
    found = identify(u, x, sample_rate=1000.0)
    assert found.chosen == LOOP
    assert not any("straight line does about as well" in sentence for sentence in found.advice)
    assert identify(u, 0.2 * u + noise(5e-3, 0, t.size), sample_rate=1000.0).chosen == "line"


@pytest.mark.parametrize("model", FORMS)
@pytest.mark.slow_but_first
def test_one_kind_is_fitted_where_one_is_named_and_its_dictionary_is_json(model: str, tmp_path: Path) -> None:
    found = identify(plays_log(1, creep=pz.Creep([0.06], [0.25])), model=model)
    assert found.chosen == model
    assert [each.name for each in found.candidates] == list(dict.fromkeys(["line", model]))
    assert found.line == found.candidates[0].model
    data = found.to_dict()
    (tmp_path / "found.json").write_text(json.dumps(data, allow_nan=False), encoding="utf-8")
    learnt = LearntModel.read(tmp_path / "found.json")
    assert (learnt, learnt.learnt_on) == (LearntModel.of(found), found.learnt_on)
    assert data["held_out"]["rms_um"] == found.held_out.rms
    assert set(data["standard_errors"]) == {*found.model.parameter_names, "offset", "delay"}


def test_arrays_records_files_and_tables_give_the_same(tmp_path: Path) -> None:
    record = made()
    record.write(tmp_path / "log.npy")
    mine = pd.DataFrame({"t": record.time, "mon": 1e3 * record.voltage, "cap": record.displacement})
    named: dict[str, Any] = {
        "columns": {"time": "t", "voltage": "mon", "displacement": "cap"},
        "units": {"voltage": "mV", "displacement": "um"},
    }
    whole, same, file, table = (
        identify(*data, **options, model="line", delay=0.0).model.theta
        for data, options in (
            ((record,), {}),
            ((record.voltage, record.displacement), {"sample_rate": RATE}),
            ((tmp_path / "log.npy",), {}),
            ((mine,), named),
        )
    )
    np.testing.assert_array_equal(same, whole)
    np.testing.assert_allclose([file, table], [whole, whole], rtol=1e-6)


def test_other_logs_are_predicted(tmp_path: Path) -> None:
    other = made(seed=3)
    log(SWINGS, other.displacement + 1.5).write(tmp_path / "other.csv")
    found = identify(made(), model=LOOP, validate=[other, tmp_path / "other.csv"])
    one, shifted = found.validations
    assert shifted.source.endswith("other.csv")
    # They were recorded from a loop of another start, which the first swings forget.
    assert one.without_mean.rms < 0.05
    assert shifted.error.rms == pytest.approx(1.5, abs=0.05)
    assert shifted.without_mean.rms == pytest.approx(one.without_mean.rms, rel=1e-3)
    with pytest.raises(ValueError, match=r"part to validate of .* 30 usable samples"):
        identify(made(), model="line", validate=[log(other.voltage[:30], other.displacement[:30])])


@pytest.mark.slow
def test_another_log_may_have_another_sample_rate() -> None:
    record = plays_log(1, creep=pz.Creep([0.06], [0.25]))
    half = log(record.voltage[::2], record.displacement[::2], 500.0)
    found = identify(record, train=0.9, validate=[half, record])
    assert found.validations[0].error.rms < 1.3 * found.validations[1].error.rms


HISS, SQUARE, RAMP = noise(1e-2, 0, AT.size), np.where(AT // 100 % 2, 10.0, -10.0), 30.0 * AT / AT[-1]
BAD = {
    "constant": (np.full(AT.size, 5.0), HISS, r"the voltage stays at 5 V"),
    "ramp": (RAMP, 0.15 * RAMP + HISS, r"moves by 15 V but turns 0 times"),
    "only noise": (SWINGS, HISS, r"displacement moves by .* µm in noise of"),
    "small": (SWINGS / 20, TRUE.simulate(SWINGS / 20) + HISS, "alpha = .* known only"),
    "two levels": (
        SQUARE,
        TRUE.simulate(SQUARE, allow_jumps=True) + HISS / 10,
        "(alpha|beta|gamma) = .* known",
    ),
    "falls": (SWINGS, -TRUE.simulate(SWINGS), "falls as the voltage rises"),
    "even": (SWINGS, 0.1 * np.abs(SWINGS), "hardly follows the voltage"),
    "short": (SWINGS[:60], TRUE.simulate(SWINGS[:60]), "part .* 30 usable samples"),
}


@pytest.mark.parametrize("name", BAD)
def test_records_that_say_too_little_are_refused(name: str) -> None:
    u, x, words = BAD[name]
    with pytest.raises(ValueError, match=words):
        identify(u, x, sample_rate=RATE, model=LOOP)


@pytest.mark.parametrize("name", ["small", "two levels"])
def test_what_tells_little_of_a_loop_is_fitted_by_another_kind(name: str) -> None:
    assert identify(*BAD[name][:2], sample_rate=RATE).chosen != LOOP


@pytest.mark.parametrize(
    "arguments",
    [{"train": 0.0}, {"train": 1.0}, {"delay": 31.0}, {"delay": "later"}, {"settle": -1.0},
     {"model": "spline"}, {"sample_rate": 100.0}],
)  # fmt: skip
def test_arguments_out_of_range(arguments: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(arguments))):
        identify(made(), **arguments)


def test_what_is_no_log_is_refused() -> None:
    record, text = made(), cast(Any, "log.csv")
    for call, words in (
        (lambda: identify(record.voltage), "data must be a log"),
        (lambda: identify(record.voltage, record.displacement), "sample_rate must be given"),
        (lambda: identify(SWINGS, np.nan * SWINGS, sample_rate=RATE), "displacement has no finite sample"),
        (lambda: identify(record, validate=text), "validate must be a list"),
        (lambda: findings(text), "record must be a Record"),
        (lambda: identify(text), r"log\.csv"),
    ):
        with pytest.raises((ValueError, OSError), match=words):
            call()


def test_every_step_is_told_and_the_text_names_what_matters() -> None:
    told: list[str] = []
    found = identify(plays_log(), say=told.append)
    assert told[0] == "looking at the log"
    fitted = [words for words in told if words.startswith("fitting")]
    assert fitted == [f"fitting {form.label}" for form in FORMS.values()]
    text = found.report()
    assert str(found) == text
    assert "held out" in text
    assert [item.name for item in found.candidates] == list(FORMS)
    assert found.best.label in found.reason
    assert all(sentence in text for sentence in (found.reason, *found.advice))
    assert found.best.label in repr(found)
    lines = found.compare(identify(made(), model="line")).splitlines()
    assert [found.best.label in lines[1], "straight line" in lines[2], len(lines)] == [True, True, 3]
    assert [row[0] for row in found.table()][-2:] == ["offset", "delay"]
    assert len(found.table()) <= 12
    # Other kinds may be right as well: the interval is wider for it.
    u = 2.0 * (found.record.voltage - 40.0) + 40.0
    expected, own = found.predict(u), found.fit.predict(u)
    assert np.max((expected.upper - expected.lower) / (own.upper - own.lower)) > 1.01


def test_whiteness() -> None:
    white = np.random.default_rng(0).standard_normal(2000)
    assert Whiteness.of(white).is_white
    coloured = Whiteness.of(np.convolve(white, np.ones(5), mode="valid"))
    assert not coloured.is_white
    assert coloured.first_autocorrelation == pytest.approx(0.8, abs=0.05)


# Gaps and wrong voltages: models are judged where the stage is known, and never by NaN.
RECORD = made(delay=0.0)
HALF = len(RECORD) // 2
TURN = HALF + int(np.argmax(RECORD.voltage[HALF:]))
AROUND, NONE = slice(TURN - 60, TURN + 60), slice(0)
# Voltages and displacements that are missing; the last two hide a turn.
GAPS = {
    "at both ends": (slice(-400, None), slice(HALF, HALF + 300)),
    "most": (NONE, slice(HALF, len(RECORD) - 300)),
    "spike": (NONE, NONE),
    "rows": (AROUND, AROUND),
    "voltage": (AROUND, NONE),
}


def wrong(name: str) -> Record:
    u, x = RECORD.voltage.copy(), RECORD.displacement.copy()
    u[GAPS[name][0]], x[GAPS[name][1]] = np.nan, np.nan
    if name == "spike":
        u[TURN - 200] = -300.0
    return log(u, x)


def fitted(record: Record, *validate: Record) -> Identification:
    return identify(record, model=LOOP, delay=0.0, validate=validate)


WHOLE = fitted(RECORD, RECORD)


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.slow_but_first
def test_what_does_not_count_or_comes_after_a_lost_turn_hurts_no_figure(gap: str) -> None:
    record, whole = wrong(gap), WHOLE.validations[0]
    found, other = fitted(record), fitted(RECORD, record).validations[0]
    assert 0.0 < other.error.rms < 1.5 * whole.error.rms
    if gap in ("rows", "voltage"):
        known = np.isfinite(record.voltage + record.displacement)[HALF:]
        missed = (found.prediction - record.displacement)[HALF:][known]
        assert found.held_out.rms < 0.5 * np.sqrt(np.mean(missed**2))
        return
    assert found.held_out.rms < 1.1 * WHOLE.held_out.rms
    assert found.held_out.max < 1.1 * WHOLE.held_out.max
    assert 0.0 < found.best.cross_validated < 1.1 * WHOLE.best.cross_validated
    assert 0.0 < other.without_mean.rms < 1.5 * whole.without_mean.rms


def test_a_held_out_part_that_does_not_count_is_refused() -> None:
    x = RECORD.displacement.copy()
    x[HALF + 30 :] = np.nan
    with pytest.raises(ValueError, match=r"held-out part of .* 30 usable samples"):
        fitted(log(RECORD.voltage, x))


def test_wrong_voltages_are_said_and_shown_as_missing() -> None:
    found = fitted(wrong("spike"))
    assert [each.name for each in found.findings if each.name == "wrong voltage"]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.record.voltage)), [TURN - 200])
    assert not any(each.name == "wrong voltage" for each in WHOLE.findings)


def test_a_known_model_is_found_to_its_noise_and_its_prediction_is_that_of_the_fit() -> None:
    assert WHOLE.held_out.rms == pytest.approx(2e-3, rel=0.1)
    assert WHOLE.whiteness.is_white
    assert WHOLE.delay_known
    assert WHOLE.left_out == 0
    x, expected, v = WHOLE.record.displacement, WHOLE.predict(), SWINGS[:3000]
    np.testing.assert_array_equal(expected.x, WHOLE.prediction)
    assert 0.9 < np.mean((x >= expected.lower) & (x <= expected.upper)) < 0.99
    np.testing.assert_array_equal(WHOLE.predict(v).x, WHOLE.fit.predict(v).x)


@pytest.fixture(scope="module")
def real(data_dir: Path) -> Identification:
    folder = data_dir / "discrete_backlash_operator"
    return identify(folder / "test_1hz.csv", validate=[folder / "model_1hz.csv"])


@pytest.mark.slow
def test_real_recordings_are_identified_and_predict_each_other(real: Identification, data_dir: Path) -> None:
    assert real.trained == pytest.approx(len(real.record) / 2, abs=1)
    assert real.held_out.rms <= 0.30
    assert real.held_out.rms < 0.2 * real.line_held_out.rms
    assert real.model.is_admissible
    # The lag of the sensor is found, and the start, where the stage came from 0 V, left out.
    assert 0.5 < real.delay < 4.0
    assert 0 < real.left_out < 200
    folder = data_dir / "discrete_backlash_operator"
    other = identify(folder / "model_1hz.csv", validate=[folder / "test_1hz.csv"])
    assert real.validations[0].without_mean.rms <= 0.45
    assert other.validations[0].without_mean.rms <= 0.45
    # It swings alike all the time: a lag cannot be told.
    assert not other.delay_known


def test_free_running_sees_only_the_voltage(real: Identification) -> None:
    record = real.record
    x = record.displacement.copy()
    x[real.trained :] = np.where(np.arange(x.size - real.trained) % 2, 1.0, -1.0)
    blind = identify(log(record.voltage, x, record.sample_rate))
    np.testing.assert_allclose(blind.prediction, real.prediction, atol=1e-6)
