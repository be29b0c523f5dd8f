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
TWO_PLAYS = pz.PrandtlIshlinskii(0.1, [5.0, 15.0], [0.02, 0.02])
CREEPS = pz.PrandtlIshlinskii(0.1, [5.0, 15.0], [0.02, 0.02], creep=pz.Creep([0.1], [1.0]), sample_rate=FS)
SWINGS = np.tile(signals.multi_amplitude([20.0, 35.0, 10.0, 30.0], 5.0, 2, FS).values, 2)


def late(x: FloatArray, samples: int) -> FloatArray:
    return np.interp(np.arange(x.size) - samples, np.arange(x.size), x)


def sine(size: int, frequency: float = 5.0, peak: float = 50.0) -> FloatArray:
    return np.asarray(peak * np.sin(2.0 * np.pi * frequency * np.arange(size) / FS))


def log(u: FloatArray, x: FloatArray, deviation: float = 2e-3) -> Record:
    return Record.from_arrays(u, x + noise(deviation, 0, u.size), FS)


def ringing() -> Record:
    """A square voltage makes a stage ring; a loop that is missed has harmonics, and does not ring."""
    u = 30.0 * np.sign(np.sin(2.0 * np.pi * 2.0 * np.arange(8000) / FS) + 1e-9)
    pole = 0.99 * np.exp(2j * np.pi * 80.0 / FS)
    x = LOOP.simulate(u, allow_jumps=True)
    return log(u, lfilter([abs(1.0 - pole) ** 2], [1.0, -2.0 * pole.real, abs(pole) ** 2], x))


FOLLOWED = log(SWINGS, LOOP.simulate(SWINGS))
ROUNDED = log(sine(12_000, 1.0, 40.0), np.round(5.0 * PLAYS.simulate(sine(12_000, 1.0, 40.0))) / 5.0, 0.0)
RESTS = np.insert(sine(8000), 2050, np.full(1000, sine(8000)[2050]))
GROWS = signals.multi_amplitude([10.0, 30.0, 50.0, 20.0, 40.0, 50.0], 5.0, 4, FS).values


@pytest.mark.parametrize(
    ("record", "model", "said", "unsaid"),
    [
        # Of the part that grows, blocks are foreseen worse; what is held out is noise.
        (log(GROWS, PLAYS.simulate(GROWS), 8e-3), "plays", "", "no model here"),
        # The offset of its model is above 1 µm.
        (log(sine(12_000), late(PLAYS.simulate(sine(12_000)), 30), 8e-3), "plays", "", "not centred"),
        (log(FOLLOWED.displacement, FOLLOWED.voltage), "plays", "clockwise", "straight line"),
        (log(SWINGS, late(LOOP.simulate(SWINGS), 14)), "line", "by about 13 samples", "oscillates"),
        (FOLLOWED, "line", "", "oscillates"),
        (log(sine(2000, 1.0, 40.0), LOOP.simulate(sine(2000, 1.0, 40.0))), "line", "", "oscillates"),
        (ringing(), "plays", "oscillates at 80", "clockwise"),
        (ROUNDED, "plays", "", "no model here"),
        (log(sine(8000), CREEPS.simulate(sine(8000))), "plays-creep", "Creep is not known", "clockwise"),
        (log(RESTS, CREEPS.simulate(RESTS)), "plays-creep", "rests once", "Creep is not known"),
    ],
)  # fmt: skip
@pytest.mark.slow_but_first
def test_what_is_said_and_what_is_not(record: Record, model: str, said: str, unsaid: str) -> None:
    advice = " ".join(identify(record, model=model).advice)
    assert said in advice
    assert unsaid not in advice


@pytest.mark.slow
def test_noise_is_told_from_what_the_stage_does() -> None:
    rng = np.random.default_rng(4)
    fast, many = rng.uniform(-30.0, 30.0, 6000), sine(16_000, 2.5, 30.0)
    slow = 0.02 * np.convolve(rng.standard_normal(16_059), np.ones(60) / np.sqrt(60.0), mode="valid")
    for record, model, deviation, within in (
        # White noise is seen in neighbouring samples as well, slow noise only in periods that repeat.
        (FOLLOWED, "line", 2e-3, 0.1),
        (log(many, LOOP.simulate(many) + slow, 1e-4), "line", 0.02, 0.2),
        # Periods that repeat to the bit show no noise but that of rounding.
        (ROUNDED, "line", 0.2 / np.sqrt(12.0), 0.2),
        (log(fast, TWO_PLAYS.simulate(fast), 5e-3), "plays", 5e-3, 0.2),
    ):
        assert identify(record, model=model, delay=0.0).noise_floor == pytest.approx(deviation, rel=within)


def test_what_goes_beyond_the_fitted_part_is_said() -> None:
    u = signals.multi_amplitude([10.0, 20.0, 40.0, 40.0], 5.0, 4, FS).values
    fast = Record.from_arrays(FOLLOWED.voltage, FOLLOWED.displacement, 2.0 * FS)
    said = identify(log(u, LOOP.simulate(u)), model="line", delay=0.0, validate=[FOLLOWED]).advice
    (held,) = [each for each in said if each.startswith("The held-out part goes beyond")]
    assert "from -38.8 to 38.8 V, the model was learnt from -19.4 to 19.4 V" in held
    assert any(each.startswith("Other log") and "learnt from -19.4 to 19.4 V" in each for each in said)
    said = identify(FOLLOWED, model="line", delay=0.0, validate=[FOLLOWED, fast]).advice
    (other,) = [each for each in said if "goes beyond" in each]
    assert "V/s" in other
    assert "swings at 10 Hz" in other


def test_other_logs_are_checked_too() -> None:
    falls = log(SWINGS, -LOOP.simulate(SWINGS))
    found = identify(FOLLOWED, model="line", delay=0.0, validate=[FOLLOWED, falls])
    assert [said for said in found.advice if "falls" in said]
    assert not found.findings
    with pytest.raises(ValueError, match="falls"):
        identify(FOLLOWED, model="line", delay=0.0, validate=[falls], strict=True)


@pytest.mark.parametrize(
    ("creep", "missed", "chosen", "chosen_where_creep_is_known"),
    [
        # Much creep that a log cannot tell must be clearly better.
        (0.1, 0.8, 1, 1), (0.18, 0.8, 0, 1), (0.4, 0.5, 0, 1), (0.4, 0.35, 1, 1), (0.0, 0.8, 1, 1),
        # Where noise is most of what is missed, a per cent less is much less of the model's own error.
        (0.0, 0.997, 0, 0), (0.0, 0.985, 1, 1),
    ],
)  # fmt: skip
def test_the_better_of_two_kinds(
    creep: float, missed: float, chosen: int, chosen_where_creep_is_known: int
) -> None:
    kinds: Any = [SimpleNamespace(creep=c, cross_validated=m) for c, m in ((0.0, 1.0), (creep, missed))]
    assert best_of(kinds, tells_creep=False) is kinds[chosen]
    assert best_of(kinds) is kinds[chosen_where_creep_is_known]


def test_a_stage_of_another_gain_or_offset_is_told_apart() -> None:
    x = PLAYS.simulate(SWINGS)
    same, gain, offset = (
        Record.from_arrays(SWINGS, other + noise(2e-3, 1, x.size), FS, name)
        for name, other in (("same", x), ("gain", 2.0 * x), ("offset", x + 2.5))
    )
    advice = identify(log(SWINGS, x), model="plays", validate=[same, gain, offset]).advice
    assert not any(each.startswith("Other log same") for each in advice)
    assert any(each.startswith("Other log gain") and "misses it" in each for each in advice)
    assert any("only its offset differs, by 2.5 µm" in each for each in advice)


def test_a_model_that_predicts_no_better_than_a_line_is_not_to_be_used() -> None:
    t = np.arange(SWINGS.size) / FS
    x = LOOP.simulate(SWINGS, allow_jumps=True)
    found = identify(log(SWINGS, x + np.sin(2.0 * np.pi * t / (0.7 * t[-1]))))
    assert any("do not use this model" in said for said in found.advice)
    assert not any("do not use this model" in said for said in identify(log(SWINGS, x)).advice)
