"""What identification says of a log: advice, noise, other logs; and what it does not say."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import piezoest as pz
from piezoest import signals
from piezoest._checks import FloatArray
from piezoest.identification import identify
from piezoest.identification.candidate import best_of
from piezoest.models import ColemanHodgdon
from piezoest.records import Record
from tests.fitting.stages import noise

FS = 1000.0
LOOP = ColemanHodgdon(0.02, 0.12, 0.0036)
WEIGHTS = np.exp(-np.linspace(0.0, 2.0, 30))
PLAYS = pz.PrandtlIshlinskii(0.065, np.linspace(2.0, 50.0, 30), 0.035 * WEIGHTS / WEIGHTS.sum())


def swings() -> FloatArray:
    return np.tile(signals.multi_amplitude([20.0, 35.0, 10.0, 30.0], 5.0, 2, FS).values, 2)


def late(x: FloatArray, samples: int) -> FloatArray:
    return np.interp(np.arange(x.size) - samples, np.arange(x.size), x)


def log(u: FloatArray, x: FloatArray, deviation: float = 2e-3) -> Record:
    return Record.from_arrays(u, x + noise(deviation, 0, u.size), FS)


def test_nothing_lies_between_noise_and_an_error_held_out_that_is_noise() -> None:
    u = signals.multi_amplitude([10.0, 30.0, 50.0, 20.0, 40.0, 50.0], 5.0, 4, FS).values
    found = identify(log(u, PLAYS.simulate(u), 8e-3))
    # Only blocks of the part that grows are foreseen worse.
    assert found.best.cross_validated > 1.5 * found.noise_floor
    assert not any("Between the noise" in said for said in found.advice)


def test_a_log_is_centred_whatever_the_offset_of_its_model() -> None:
    u = 50.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(12_000) / FS)
    found = identify(log(u, late(PLAYS.simulate(u), 30), 8e-3))
    assert abs(found.model.offset) > 1.0
    assert not any("not centred" in said for said in found.advice)


def test_a_line_is_not_recommended_for_columns_swapped() -> None:
    right = log(swings(), LOOP.simulate(swings()))
    swapped = identify(right.displacement, right.voltage, sample_rate=FS, model="plays")
    assert any("clockwise" in said for said in swapped.advice)
    assert not any("straight line" in said for said in swapped.advice)


def test_a_lag_longer_than_is_looked_for_is_said() -> None:
    found = identify(log(swings(), late(LOOP.simulate(swings()), 14)), model="line")
    assert any("10 samples or more" in said for said in found.advice)


def test_what_a_fast_voltage_moves_is_no_noise() -> None:
    u = np.random.default_rng(4).uniform(-30.0, 30.0, 6000)
    x = pz.PrandtlIshlinskii(0.1, [5.0, 15.0], [0.02, 0.02]).simulate(u)
    assert identify(log(u, x, 5e-3), model="plays").noise_floor == pytest.approx(5e-3, rel=0.2)


@pytest.mark.slow
def test_what_goes_beyond_the_fitted_part_is_said() -> None:
    u = signals.multi_amplitude([10.0, 20.0, 40.0, 40.0], 5.0, 4, FS).values
    grows, steady = log(u, LOOP.simulate(u)), log(swings(), LOOP.simulate(swings()))
    fast = Record.from_arrays(steady.voltage, steady.displacement, 2.0 * FS)
    said = identify(grows, model="line", validate=[steady]).advice
    (held,) = [each for each in said if each.startswith("The held-out part goes beyond")]
    assert "the voltage goes from -38.8 to 38.8 V, the model was learnt from -19.4 to 19.4 V" in held
    assert any(each.startswith("Other log") and "learnt from -19.4 to 19.4 V" in each for each in said)
    said = identify(steady, model="line", validate=[steady, fast]).advice
    (other,) = [each for each in said if "goes beyond" in each]
    assert "V/s" in other
    assert "swings at 10 Hz" in other


@pytest.mark.slow
def test_ringing_is_said() -> None:
    """A square voltage makes a stage ring; a loop that is missed has harmonics, and does not ring."""
    u = 30.0 * np.sign(np.sin(2.0 * np.pi * 2.0 * np.arange(8000) / FS) + 1e-9)
    x = LOOP.simulate(u, allow_jumps=True)
    pole = 0.99 * np.exp(2j * np.pi * 80.0 / FS)
    ringing = lfilter([abs(1.0 - pole) ** 2], [1.0, -2.0 * pole.real, abs(pole) ** 2], x)
    (said,) = [each for each in identify(log(u, ringing), model="plays").advice if "oscillates" in each]
    assert "at 80" in said
    missed = identify(log(swings(), LOOP.simulate(swings())), model="line")
    assert missed.train.rms > 0.05
    assert not any("oscillates" in each for each in missed.advice)


@pytest.mark.slow
def test_other_logs_are_checked_too() -> None:
    right, falls = log(swings(), LOOP.simulate(swings())), log(swings(), -LOOP.simulate(swings()))
    found = identify(right, model="line", validate=[right, falls])
    assert [said for said in found.advice if "falls" in said]
    assert not found.findings
    with pytest.raises(ValueError, match="falls"):
        identify(right, model="line", validate=[falls], strict=True)


@pytest.mark.parametrize(
    ("creep", "missed", "chosen"),
    [(0.1, 0.8, 1), (0.18, 0.8, 0), (0.4, 0.5, 0), (0.4, 0.35, 1), (0.0, 0.8, 1)],
)
def test_much_creep_that_a_log_cannot_tell_must_be_clearly_better(
    creep: float, missed: float, chosen: int
) -> None:
    kinds: Any = [
        SimpleNamespace(creep=0.0, cross_validated=1.0),
        SimpleNamespace(creep=creep, cross_validated=missed),
    ]
    assert best_of(kinds, tells_creep=False) is kinds[chosen]
    assert best_of(kinds) is kinds[1]


@pytest.mark.parametrize(("missed", "chosen"), [(0.997, 0), (0.985, 1)])
def test_a_little_better_is_better(missed: float, chosen: int) -> None:
    """Where noise is most of what is missed, a per cent less is much less of the model's own error."""
    kinds: Any = [SimpleNamespace(creep=0.0, cross_validated=each) for each in (1.0, missed)]
    assert best_of(kinds) is kinds[chosen]


@pytest.mark.slow
def test_creep_is_known_where_the_voltage_rests() -> None:
    model = pz.PrandtlIshlinskii(0.1, [5.0, 15.0], [0.02, 0.02], creep=pz.Creep([0.1], [1.0]), sample_rate=FS)
    u = 50.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(8000) / FS)
    rests = np.insert(u, 2050, np.full(1000, u[2050]))
    said = [" ".join(identify(log(v, model.simulate(v))).advice) for v in (u, rests)]
    assert ["Creep is not known" in each for each in said] == [True, False]


@pytest.mark.slow
def test_rounding_is_noise() -> None:
    # Periods that repeat to the bit show no noise.
    u = 40.0 * np.sin(2.0 * np.pi * np.arange(12_000) / 1000.0)
    found = identify(Record.from_arrays(u, np.round(5.0 * PLAYS.simulate(u)) / 5.0, FS))
    assert found.noise_floor == pytest.approx(0.2 / np.sqrt(12.0), rel=0.2)
    assert not any("no model here" in each for each in found.advice)


def test_a_stage_of_another_gain_or_offset_is_told_apart() -> None:
    u = swings()
    others = [
        Record.from_arrays(u, factor * PLAYS.simulate(u) + offset + noise(2e-3, 1, u.size), FS, name)
        for factor, offset, name in ((1.0, 0.0, "same"), (2.0, 0.0, "gain"), (1.0, 2.5, "offset"))
    ]
    said = [each for each in identify(log(u, PLAYS.simulate(u)), validate=others).advice if "log" in each]
    about = {
        name: [each for each in said if each.startswith(f"Other log {name}")] for name in ("same", "gain")
    }
    assert about["same"] == []
    assert any("misses it" in each for each in about["gain"])
    assert any("only its offset differs, by 2.5 µm" in each for each in said)


def test_a_column_without_a_number_is_refused() -> None:
    u = swings()
    with pytest.raises(ValueError, match="displacement has no finite sample"):
        identify(u, np.full(u.size, np.nan), sample_rate=FS)
