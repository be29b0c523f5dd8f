"""References that do not repeat: minor loops, a walk, and the first period of all."""

from typing import Any

import numpy as np

import piezoest as pz

FS = 5000.0
AMPLITUDE = 5.0


def error(r: Any) -> Any:
    """Error relative to the amplitude, of the default controller on the paper's stage."""
    driver = pz.AdaptiveFeedforward(FS, limits=pz.VoltageLimits(minimum=-100.0, maximum=100.0))
    return pz.track(r, stage=pz.PaperStage(FS, seed=1), controller=driver).error / AMPLITUDE


def largest(error: Any) -> float:
    return float(np.max(np.abs(error)))


def test_minor_loops_are_followed_like_waves() -> None:
    # 10 % where the corridor goes by the last legs alone, 3 % where the line's changes slow the models down.
    r = pz.signals.two_tone([0.7 * AMPLITUDE, 0.3 * AMPLITUDE], [2.0, 7.0], 4.0, FS)
    assert largest(error(r)[-5000:]) < 0.01


def test_a_walk_is_not_left_to_the_line() -> None:
    # 4 % to 12 % where models are measured by the smallest miss of the line, whatever the last legs were.
    r = pz.signals.random_walk(AMPLITUDE, 10.0, 10.0, FS, seed=0)
    late = error(r)[10_000:]
    assert float(np.sqrt(np.mean(late**2))) < 0.02


def test_a_model_drives_from_the_first_turn_on() -> None:
    # 2 % where two legs have to pass.
    r = pz.signals.triangle(AMPLITUDE, 5.0, 3, FS)
    assert largest(error(r)[1000:]) < 0.012
