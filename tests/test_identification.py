"""Identification of a recorded log: known models, the real recording, too little excitation."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import piezoest as pz
from piezoest import signals
from piezoest.identification import Identification, Whiteness, identify
from piezoest.models import ColemanHodgdon
from piezoest.records import Record, read_record

RATE = 2000.0
TRUE = ColemanHodgdon(0.02, 0.12, 0.0036, offset=3.0)
DELAY = 2.3

Array = NDArray[np.float64]


def voltage(centre: float = 0.0) -> Array:
    values = np.asarray(signals.multi_amplitude([20.0, 35.0, 10.0, 30.0], 5.0, 2, RATE))
    return np.tile(values, 2) + centre


def made(noise: float = 2e-3, seed: int = 0, centre: float = 0.0, drift: float = 0.0) -> Record:
    u = voltage(centre)
    index = np.arange(u.size)
    x = TRUE.simulate(np.interp(index - DELAY, index, u), initial_state=-1.0)
    x += noise * np.random.default_rng(seed).standard_normal(u.size) + drift * index / u.size
    return Record.from_arrays(u, x, RATE)


def true_values() -> Array:
    return np.array([TRUE.alpha, TRUE.beta, TRUE.gamma, TRUE.offset, DELAY])


def test_finds_a_known_model_within_its_standard_errors() -> None:
    z = []
    for seed in range(8):
        found = identify(made(seed=seed))
        values = np.array([value for _, value, _, _ in found.table()])
        z.append((values - true_values()) / np.array([error for _, _, error, _ in found.table()]))
        assert found.held_out.rms == pytest.approx(2e-3, rel=0.1)
        assert found.whiteness.is_white
        assert found.left_out == 0
    # Standard errors that are right give 1; eight runs of five leave it within this.
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5


def test_unipolar_voltage() -> None:
    found = identify(made(centre=60.0))
    np.testing.assert_allclose(found.model.theta, TRUE.theta, rtol=5e-3)
    assert found.model.offset == pytest.approx(TRUE.offset, abs=0.05)
    assert any("not centred" in sentence for sentence in found.advice)


def test_given_delay_is_kept() -> None:
    found = identify(made(), delay=DELAY)
    assert found.delay == DELAY
    assert found.standard_errors["delay"] == 0.0
    assert not found.delay_estimated
    np.testing.assert_allclose(found.model.theta, TRUE.theta, rtol=5e-3)


def test_missing_samples_do_not_matter() -> None:
    whole = made()
    u, x = whole.voltage.copy(), whole.displacement.copy()
    x[100:130], x[2000], u[500] = np.nan, np.nan, np.nan
    found = identify(Record.from_arrays(u, x, RATE))
    np.testing.assert_allclose(found.model.theta, TRUE.theta, rtol=5e-3)
    assert np.all(np.isfinite(found.prediction))


def test_unsettled_start_is_left_out() -> None:
    whole = made()
    x = whole.displacement - 5.0 * np.exp(-np.arange(len(whole)) / 10.0)
    found = identify(Record.from_arrays(whole.voltage, x, RATE))
    assert 40 < found.left_out < 400
    np.testing.assert_allclose(found.model.theta, TRUE.theta, rtol=1e-2)
    assert any("left out" in sentence for sentence in found.advice)
    assert identify(Record.from_arrays(whole.voltage, x, RATE), settle=0.05).left_out == 100


def test_drift_is_found_and_said() -> None:
    found = identify(made(drift=0.5))
    assert found.drift == pytest.approx(0.5, rel=0.5)
    assert not found.whiteness.is_white
    assert any("drifts" in sentence for sentence in found.advice)


def test_spikes_are_counted_and_said() -> None:
    whole = made()
    assert not any("spikes" in sentence for sentence in identify(whole).advice)
    x = whole.displacement.copy()
    x[[300, 700]] += 20.0
    advice = identify(Record.from_arrays(whole.voltage, x, RATE)).advice
    assert any(sentence.startswith("2 of the fitted samples are off") for sentence in advice)


def test_what_is_no_record_is_refused_with_the_way_to_one() -> None:
    with pytest.raises(ValueError, match=r"record must be a Record, got str: use read_record\(path\)"):
        identify("log.csv")  # type: ignore[arg-type]


def bad_records() -> dict[str, tuple[Record, str]]:
    u, time = voltage(), np.arange(voltage().size) / RATE
    noise = 1e-2 * np.random.default_rng(0).standard_normal(u.size)
    square = np.where(np.arange(u.size) // 100 % 2, 10.0, -10.0)
    stepped = TRUE.simulate(square, allow_jumps=True) + noise / 10.0
    ramp = 30.0 * time / time[-1]
    return {
        "constant": (Record.from_arrays(np.full(u.size, 5.0), noise, RATE), r"the voltage stays at 5 V"),
        "ramp": (Record.from_arrays(ramp, 0.15 * ramp + noise, RATE), r"moves by 15 V but turns 0 times"),
        "only noise": (Record.from_arrays(u, noise, RATE), r"displacement moves by .* µm in noise of"),
        "small": (Record.from_arrays(u / 20, TRUE.simulate(u / 20) + noise, RATE), "alpha = .* known only"),
        "two levels": (Record.from_arrays(square, stepped, RATE), "(beta|gamma) = .* known only"),
        "falls": (Record.from_arrays(u, -TRUE.simulate(u), RATE), "falls as the voltage rises"),
        "short": (Record.from_arrays(u[:60], TRUE.simulate(u[:60]), RATE), "30 usable samples"),
    }  # fmt: skip


@pytest.mark.parametrize("name", list(bad_records()))
def test_records_that_say_too_little_are_refused(name: str) -> None:
    record, words = bad_records()[name]
    with pytest.raises(ValueError, match=words):
        identify(record)


@pytest.mark.parametrize(
    "arguments", [{"train": 0.0}, {"train": 1.0}, {"delay": 11.0}, {"delay": "later"}, {"settle": -1.0}]
)
def test_arguments_out_of_range(arguments: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(arguments))):
        identify(made(), **arguments)


def test_dictionary_is_json_and_holds_the_model() -> None:
    found = identify(made())
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert ColemanHodgdon.from_dict(data["model"]) == found.model
    assert data["held_out"]["rms_um"] == found.held_out.rms
    assert set(data["standard_errors"]) == {"alpha", "beta", "gamma", "offset", "delay"}
    assert "held out" in str(found)


def test_plot_needs_no_display(tmp_path: Path) -> None:
    identify(made()).plot().savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000


def test_whiteness() -> None:
    noise = np.random.default_rng(0).standard_normal(2000)
    assert Whiteness.of(noise).is_white
    coloured = Whiteness.of(np.convolve(noise, np.ones(5), mode="valid"))
    assert not coloured.is_white
    assert coloured.first_autocorrelation == pytest.approx(0.8, abs=0.05)


@pytest.fixture(scope="module")
def real(data_dir: Path) -> Identification:
    return identify(read_record(data_dir / "discrete_backlash_operator" / "test_1hz.csv"))


def test_real_recording_free_running(real: Identification) -> None:
    assert real.trained == pytest.approx(len(real.record) / 2, abs=1)
    assert real.held_out.rms <= 0.45
    assert real.held_out.rms < 0.4 * real.line_held_out.rms
    assert real.model.is_admissible
    # The lag of the sensor is found, and the start, where the stage came from 0 V, left out.
    assert 0.5 < real.delay < 4.0
    assert 0 < real.left_out < 200


def test_real_recording_with_the_published_lag(data_dir: Path) -> None:
    record = read_record(data_dir / "discrete_backlash_operator" / "test_1hz.csv")
    found = identify(record, delay=1.0)
    assert found.held_out.rms <= 0.45
    assert found.line_held_out.rms == pytest.approx(2.2, abs=0.1)


def test_free_running_sees_only_the_voltage(real: Identification) -> None:
    record = real.record
    x = record.displacement.copy()
    x[real.trained :] = 0.0
    blind = identify(Record.from_arrays(record.voltage, x, record.sample_rate))
    np.testing.assert_allclose(blind.prediction, real.prediction, atol=1e-6)


def test_chooses_the_model_a_stage_needs() -> None:
    rate = 2000.0
    t = np.arange(16_000) / rate
    u = 30.0 * np.sin(2.0 * np.pi * 2.0 * t) * np.linspace(0.4, 1.0, t.size) + 5.0 * np.sin(
        2.0 * np.pi * 9.0 * t
    )
    x = pz.PreisachStage(rate, seed=0).run(u)
    found = pz.choose_model(pz.Record.from_arrays(u, x, rate), delay=0.0)
    assert "asymmetric" in found.best.name
    assert isinstance(found.model, pz.PrandtlIshlinskii)
    errors = {item.name: item.held_out.rms for item in found.candidates}
    assert errors[found.best.name] < 0.25 * errors["Coleman-Hodgdon"]
    assert found.best.name in found.reason
    saved = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert pz.models.model_from_dict(saved["model"]) == found.model
    assert len(found.plot().axes) == 2


def test_chooses_the_simplest_that_will_do() -> None:
    rate = 1000.0
    u = 30.0 * np.sin(2.0 * np.pi * np.arange(8000) / rate * 1.7) * np.linspace(1.0, 0.5, 8000)
    model = pz.ColemanHodgdon(0.02, 0.14, 0.004)
    x = model.simulate(u) + 2e-3 * np.random.default_rng(0).standard_normal(u.size)
    found = pz.choose_model(pz.Record.from_arrays(u, x, rate), delay=0.0)
    assert found.best.name == "Coleman-Hodgdon"
