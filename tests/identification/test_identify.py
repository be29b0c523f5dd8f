"""Identification of a recorded log: known models, the real recording, what says too little."""

import dataclasses
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


def swings() -> FloatArray:
    return np.tile(np.asarray(signals.multi_amplitude([20.0, 35.0, 10.0, 30.0], 5.0, 2, RATE)), 2)


def made(seed: int = 0, delay: float = DELAY) -> Record:
    u = swings()
    index = np.arange(u.size)
    x = TRUE.simulate(np.interp(index - delay, index, u), initial_state=-1.0)
    return Record.from_arrays(u, x + noise(2e-3, seed, u.size), RATE)


def changed(displacement: FloatArray, of: Record | None = None) -> Record:
    of = made() if of is None else of
    return Record.from_arrays(of.voltage, displacement, of.sample_rate)


def plays_log(seed: int = 0, rate: float = 1000.0, **kinds: Any) -> Record:
    rng = np.random.default_rng(seed)
    u = voltage(rng, 40.0, 40.0)
    x = stage(rng, **kinds).simulate(u)
    return Record.from_arrays(u, x + noise(1e-3 * float(np.ptp(x)), seed), rate)


@pytest.mark.slow
def test_finds_a_known_model_within_its_standard_errors() -> None:
    z = []
    for seed in range(8):
        found = identify(made(seed), model=LOOP)
        true = np.array([TRUE.alpha, TRUE.beta, TRUE.gamma, TRUE.offset, DELAY])
        values = np.array([value for _, value, _, _ in found.table()])
        z.append((values - true) / np.array([error for _, _, error, _ in found.table()]))
        assert found.held_out.rms == pytest.approx(2e-3, rel=0.1)
        assert found.whiteness.is_white
        assert found.left_out == 0
    # Standard errors that are right give 1; eight runs of five leave it within this.
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5


@pytest.mark.slow
def test_a_lag_that_swings_alike_cannot_tell_is_used_but_not_told() -> None:
    u = 30.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(8000) / RATE)
    found = identify(u, TRUE.simulate(u) + noise(2e-3, 0, u.size), sample_rate=RATE)
    assert not found.delay_known
    assert found.delay < 0.5
    assert found.held_out.rms == pytest.approx(2e-3, rel=0.1)
    assert any("lag of the displacement is not known" in sentence for sentence in found.advice)
    assert identify(made()).delay_known


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


AT = np.arange(swings().size)
# What is made of a log, and what is said of it.
FLAWS: dict[str, tuple[Any, str]] = {
    "unipolar": (lambda u, x: (u + 60.0, x), "not centred"),
    "gaps": (
        lambda u, x: (np.where(AT == 500, np.nan, u), np.where(abs(AT - 115) < 15, np.nan, x)),
        "without",
    ),
    "unsettled": (lambda u, x: (u, x - 5.0 * np.exp(-AT / 10.0)), "do not fit the rest"),
    "rest and jump": (lambda u, x: resting_first(u), "rests once"),
    "late jump": (lambda u, x: (u, x + 5.0 * (AT[::-1] < 400)), "jumps once"),
    "spikes": (lambda u, x: (u, x + 20.0 * np.isin(AT, [300, 700])), "2 of the fitted samples are off"),
}


@pytest.mark.parametrize("name", FLAWS)
@pytest.mark.slow_but_first
def test_flaws_of_a_log_do_not_matter_and_are_said(name: str) -> None:
    change, said = FLAWS[name]
    record = made(delay=0.0)
    u, x = change(record.voltage, record.displacement)
    found = identify(u, x, sample_rate=RATE, model=LOOP, delay=0.0)
    np.testing.assert_allclose(found.model.theta, TRUE.theta, rtol=0.01)
    assert found.held_out.rms < 4e-3
    assert np.all(np.isfinite(found.prediction))
    assert sum(said in sentence for sentence in (*found.advice, *found.record.notes)) == 1


@pytest.mark.slow
def test_drift_is_found_and_said() -> None:
    found = identify(changed(made().displacement + np.linspace(0.0, 0.5, len(made()))), model=LOOP)
    assert found.fit.drift + found.drift > 0.2
    assert any("drifts" in sentence for sentence in found.advice)


@pytest.mark.slow
def test_noise_is_what_repeated_periods_differ_by() -> None:
    # White noise is seen in neighbouring samples as well, slow noise only in periods that repeat.
    assert identify(made(), model="line").noise_floor == pytest.approx(2e-3, rel=0.1)
    rng = np.random.default_rng(3)
    u = 30.0 * np.sin(2.0 * np.pi * np.arange(16_000) / 400.0)
    slow = np.convolve(rng.standard_normal(u.size + 60), np.ones(60) / np.sqrt(60.0), mode="valid")[: u.size]
    x = TRUE.simulate(u) + 0.02 * slow + noise(1e-4, 0, u.size)
    assert identify(u, x, sample_rate=RATE, model="line").noise_floor == pytest.approx(0.02, rel=0.2)


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
    found = identify(u, ColemanHodgdon(0.02, 0.14, 0.004).simulate(u) + noise(2e-3, 0, t.size),
                     sample_rate=1000.0)  # fmt: skip
    assert found.chosen == LOOP
    line = identify(u, 0.2 * u + noise(5e-3, 0, t.size), sample_rate=1000.0)
    assert line.chosen == "line"
    assert any("straight line does about as well" in sentence for sentence in found.advice) is False


def test_a_stage_of_relays_needs_asymmetry() -> None:
    t = np.arange(16_000) / RATE
    u = 30.0 * np.sin(4.0 * np.pi * t) * np.linspace(0.4, 1.0, t.size) + 5.0 * np.sin(18.0 * np.pi * t)
    found = identify(u, pz.PreisachStage(RATE, seed=0).run(u), sample_rate=RATE, delay=0.0)
    assert "asymmetric" in found.chosen
    errors = {item.name: item.held_out.rms for item in found.candidates}
    assert list(errors) == list(FORMS)
    assert errors[found.chosen] < 0.4 * errors[LOOP]
    assert found.best.label in found.reason


@pytest.mark.parametrize("model", FORMS)
@pytest.mark.slow_but_first
def test_one_kind_is_fitted_where_one_is_named(model: str) -> None:
    found = identify(made(), model=model)
    assert found.chosen == model
    assert [each.name for each in found.candidates] == list(dict.fromkeys(["line", model]))
    assert found.line.theta[0] == pytest.approx(found.candidates[0].model.theta[0])


@pytest.mark.slow
def test_arrays_records_files_and_tables_give_the_same(tmp_path: Path) -> None:
    record = made()
    record.write(tmp_path / "log.npy")
    wanted = identify(record, model=LOOP).model.theta
    same = identify(record.voltage, record.displacement, sample_rate=RATE, model=LOOP)
    np.testing.assert_array_equal(same.model.theta, wanted)
    np.testing.assert_allclose(identify(tmp_path / "log.npy", model=LOOP).model.theta, wanted, rtol=1e-6)
    mine = pd.DataFrame({"t": record.time, "mon": 1e3 * record.voltage, "cap": record.displacement})
    named = {"time": "t", "voltage": "mon", "displacement": "cap"}
    found = identify(mine, columns=named, units={"voltage": "mV", "displacement": "um"}, model=LOOP)
    np.testing.assert_allclose(found.model.theta, wanted, rtol=1e-6)


def test_other_logs_are_predicted(tmp_path: Path) -> None:
    other = made(seed=3)
    changed(other.displacement + 1.5, other).write(tmp_path / "other.csv")
    found = identify(made(), model=LOOP, validate=[other, tmp_path / "other.csv"])
    one, shifted = found.validations
    assert shifted.source.endswith("other.csv")
    # They were recorded from a loop of another start, which the first swings forget.
    assert one.without_mean.rms < 0.05
    assert shifted.error.rms == pytest.approx(1.5, abs=0.05)
    assert shifted.without_mean.rms == pytest.approx(one.without_mean.rms, rel=1e-3)
    with pytest.raises(ValueError, match=r"part to validate of .* 30 usable samples"):
        identify(made(), validate=[Record.from_arrays(other.voltage[:30], other.displacement[:30], RATE)])


@pytest.mark.slow
def test_another_log_may_have_another_sample_rate() -> None:
    creep = pz.Creep([0.06], [0.25])
    record = plays_log(1, creep=creep)
    half = Record.from_arrays(record.voltage[::2], record.displacement[::2], 500.0)
    found = identify(record, train=0.9, validate=[half, record])
    assert found.validations[0].error.rms < 1.3 * found.validations[1].error.rms


@pytest.mark.slow
def test_doubts_are_errors_where_they_are_to_be() -> None:
    record = made()
    gap = record.displacement.copy()
    gap[-4000:] = np.nan
    found = identify(changed(gap), model="line", train=0.2)
    assert [each.name for each in found.findings if each.severity == "doubt"] == ["missing"]
    assert found.findings[0].sentence in found.advice
    with pytest.raises(ValueError, match="%"):
        identify(changed(gap), model="line", train=0.2, strict=True)
    assert identify(record, model="line", strict=True).chosen == "line"


def test_every_step_is_told() -> None:
    told: list[str] = []
    identify(made(), say=told.append)
    assert told[0] == "looking at the log"
    fitted = [words for words in told if words.startswith("fitting")]
    assert fitted == [f"fitting {form.label}" for form in FORMS.values()]


def bad_records() -> dict[str, tuple[Record, str]]:
    u, time = swings(), np.arange(swings().size) / RATE
    hiss = noise(1e-2, 0, u.size)
    square = np.where(np.arange(u.size) // 100 % 2, 10.0, -10.0)
    stepped = TRUE.simulate(square, allow_jumps=True) + hiss / 10.0
    ramp = 30.0 * time / time[-1]
    return {
        "constant": (Record.from_arrays(np.full(u.size, 5.0), hiss, RATE), r"the voltage stays at 5 V"),
        "ramp": (Record.from_arrays(ramp, 0.15 * ramp + hiss, RATE), r"moves by 15 V but turns 0 times"),
        "only noise": (Record.from_arrays(u, hiss, RATE), r"displacement moves by .* µm in noise of"),
        "small": (Record.from_arrays(u / 20, TRUE.simulate(u / 20) + hiss, RATE), "alpha = .* known only"),
        "two levels": (Record.from_arrays(square, stepped, RATE), "(alpha|beta|gamma) = .* known only"),
        "falls": (Record.from_arrays(u, -TRUE.simulate(u), RATE), "falls as the voltage rises"),
        "even": (Record.from_arrays(u, 0.1 * np.abs(u), RATE), "leaves .* % of the displacement"),
        "short": (Record.from_arrays(u[:60], TRUE.simulate(u[:60]), RATE), "part .* 30 usable samples"),
    }  # fmt: skip


@pytest.mark.parametrize("name", list(bad_records()))
def test_records_that_say_too_little_are_refused(name: str) -> None:
    record, words = bad_records()[name]
    with pytest.raises(ValueError, match=words):
        identify(record, model=LOOP)


@pytest.mark.parametrize("name", ["small", "two levels"])
def test_what_tells_little_of_a_loop_is_fitted_by_another_kind(name: str) -> None:
    found = identify(bad_records()[name][0])
    assert found.chosen != LOOP


@pytest.mark.parametrize(
    "arguments",
    [{"train": 0.0}, {"train": 1.0}, {"delay": 11.0}, {"delay": "later"}, {"settle": -1.0},
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
        (lambda: identify(record, validate=text), "validate must be a list"),
        (lambda: findings(text), "record must be a Record"),
        (lambda: identify(text), r"log\.csv"),
    ):
        with pytest.raises((ValueError, OSError), match=words):
            call()


@pytest.mark.parametrize("model", FORMS)
@pytest.mark.slow_but_first
def test_dictionary_is_json_and_holds_the_model(model: str, tmp_path: Path) -> None:
    found = identify(plays_log(1, creep=pz.Creep([0.06], [0.25])), model=model)
    (tmp_path / "found.json").write_text(json.dumps(found.to_dict(), allow_nan=False), encoding="utf-8")
    learnt = LearntModel.read(tmp_path / "found.json")
    assert (learnt, learnt.learnt_on) == (LearntModel.of(found), found.learnt_on)
    data = found.to_dict()
    assert data["held_out"]["rms_um"] == found.held_out.rms
    assert set(data["standard_errors"]) == {*found.model.parameter_names, "offset", "delay"}
    first = found.record.voltage[:500]
    r = cast(Any, found.model).simulate(np.concatenate([np.linspace(0.0, first[0], 300), first]))
    u = pz.InverseCompensator(learnt.model, sample_rate=1000.0).run(r)
    model_again: Any = learnt.model
    assert np.max(np.abs(model_again.simulate(u) - r)) < 1e-6


def test_text_names_what_matters() -> None:
    found = identify(made(), model=LOOP)
    text = found.report()
    assert str(found) == text
    assert "held out" in text
    assert found.reason in text
    assert all(sentence in text for sentence in found.advice)
    assert found.best.label in repr(found)
    lines = found.compare(identify(made(), model="line")).splitlines()
    assert [word in line for word, line in zip(("Coleman-Hodgdon", "straight line"), lines[1:], strict=True)]
    table = identify(plays_log()).table()
    assert [row[0] for row in table][-2:] == ["offset", "delay"]
    assert len(table) <= 12


def test_prediction_is_that_of_the_best_fit() -> None:
    found = identify(made(), model=LOOP)
    np.testing.assert_array_equal(found.predict().x, found.prediction)
    x, expected = found.record.displacement, found.predict()
    assert 0.9 < np.mean((x >= expected.lower) & (x <= expected.upper)) < 0.99
    v = swings()[:3000]
    np.testing.assert_array_equal(found.predict(v).x, found.fit.predict(v).x)


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
@pytest.mark.slow_but_first
def test_what_does_not_count_hurts_no_figure(gap: str) -> None:
    found = fitted(wrong(gap))
    assert found.held_out.rms < 1.1 * WHOLE.held_out.rms
    assert found.held_out.max < 1.1 * WHOLE.held_out.max
    assert 0.0 < found.best.cross_validated < 1.1 * WHOLE.best.cross_validated
    error, whole = fitted(RECORD, validate=(wrong(gap),)).validations[0], WHOLE.validations[0]
    assert 0.0 < error.error.rms < 1.5 * whole.error.rms
    assert 0.0 < error.without_mean.rms < 1.5 * whole.without_mean.rms


@pytest.mark.parametrize("gap", LOST_TURN)
@pytest.mark.slow_but_first
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


@pytest.fixture(scope="module")
def real(data_dir: Path) -> Identification:
    folder = data_dir / "discrete_backlash_operator"
    return identify(folder / "test_1hz.csv", validate=[folder / "model_1hz.csv"])


@pytest.mark.slow
def test_real_recording_free_running(real: Identification) -> None:
    assert real.trained == pytest.approx(len(real.record) / 2, abs=1)
    assert real.held_out.rms <= 0.30
    assert real.held_out.rms < 0.2 * real.line_held_out.rms
    assert real.model.is_admissible
    # The lag of the sensor is found, and the start, where the stage came from 0 V, left out.
    assert 0.5 < real.delay < 4.0
    assert 0 < real.left_out < 200


@pytest.mark.slow
def test_real_recordings_predict_each_other(real: Identification, data_dir: Path) -> None:
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
    blind = identify(changed(x, record))
    np.testing.assert_allclose(blind.prediction, real.prediction, atol=1e-6)


def test_an_interval_holds_what_kinds_expect_that_may_be_right_as_well() -> None:
    """Beyond the fitted voltages, where they differ by more than what any of them misses within."""
    found = identify(plays_log(0, bends=2))
    u = 2.0 * (found.record.voltage - 40.0) + 40.0
    expected = found.predict(u)
    least = 1.5 * found.best.cross_validated
    rivals = [each for each in found.candidates if each is not found.best and each.cross_validated < least]
    assert rivals
    apart = np.max([np.abs(each.fit.predict(u).x - expected.x) for each in rivals], axis=0)
    assert apart.max() > found.fit.spread.within
    own = found.fit.predict(u)
    # Kinds that are not as good may differ by even more.
    assert np.all(expected.upper - expected.x >= 0.9999 * np.hypot(own.upper - own.x, apart))
    np.testing.assert_allclose(expected.x - expected.lower, expected.upper - expected.x)
