"""What is healthy gets no name, and what is wrong gets the right one, on rigs of the zoo."""

import pytest

import piezoest as pz
from piezoest.bench.zoo import draw, play
from piezoest.controller.readings import FAULTS


def _named(seed: int, fault: str) -> list[str]:
    rig = draw(seed, fault=fault)
    row = play(rig, lambda sample_rate, limits: pz.AdaptiveFeedforward(sample_rate, limits=limits))
    assert row["failure"] is None
    return [name for name in row["named"].split("; ") if name in FAULTS[1:6]]


# Steps, walks and sums of sines with minor loops; a block that was planned before the reference was reached.
@pytest.mark.parametrize("seed", [92035, 92129, 92148, 92176, 92189, 92232, 92235])
def test_a_healthy_stage_gets_no_name(seed: int) -> None:
    assert _named(seed, "none") == []


# A thousand times too large; reversed, in few samples; a thousand times too small.
@pytest.mark.parametrize(("seed", "name"), [(92026, "scaled"), (92020, "reversed"), (92022, "scaled")])
def test_a_wrong_factor_has_its_name(seed: int, name: str) -> None:
    assert name in _named(seed, "sensor-factor")
