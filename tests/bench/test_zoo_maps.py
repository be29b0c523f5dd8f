"""How soon a controller settles over its map, and whether it is as good as the best single estimator."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench.metrics import SETTLED
from piezoest.bench.zoo import settling
from piezoest.bench.zoo.contenders import CANDIDATES, DEFAULT
from piezoest.bench.zoo.contest import FLOOR, summarise_contest
from piezoest.bench.zoo.settling import SEGMENTS

CHANGES = [name for name, _, _ in SEGMENTS]


def on_map(seed: int, *periods: int | None, amplitude: float = 1.0, asked: bool = True) -> dict[str, Any]:
    segments = [{"change": name, "periods": each} for name, each in zip(CHANGES, periods, strict=True)]
    return {"family": "paper", "amplitude": amplitude, "frequency": 3.0, "seed": seed, "asked": asked,
            "failure": None, "segments": segments}  # fmt: skip


def test_shares_count_what_is_asked_for() -> None:
    rows = [on_map(seed, 2, 2, 3, None, 0 if seed else 3) for seed in range(20)]
    rows += [on_map(0, *[None] * 5, amplitude=2.0), on_map(1, *[0] * 5, amplitude=2.0, asked=False)]
    found = settling.summarise_cells(rows)
    assert found["cells"]["asked"] == 2
    assert found["cells"]["kept"] == dict(zip(CHANGES, (1, 1, 0, 0, 1), strict=True))
    assert found["others"] == 1
    first = found["by_place"][0]
    assert [first[name] for name in ("runs", "cold-start", "gain-step")] == [20, 1.0, 0.95]
    assert (first["cold-start periods"], first["switch-back periods"]) == (2.0, None)


@pytest.mark.parametrize("seed", range(3))
def test_an_inverse_without_error_settles_in_all_places(seed: int) -> None:
    """Resonance and steps of the voltage leave room: what is asked for can be reached."""
    for cell in settling.cells([seed], ["paper"]):
        rig = settling.cell_rig(cell)
        if not settling.asked(rig):
            continue
        straight = pz.LinearGain(rig.gain)
        stage = replace(rig, model=straight).stage(healthy=True)
        error = np.abs(rig.reference - stage.run(rig.reference / rig.gain)).reshape(-1, rig.plain.cycle)
        first = 0
        for _, factor, periods in SEGMENTS:
            allowed = max(SETTLED * factor * cell.amplitude, settling.NOISES * rig.noise)
            assert error[first + 1 : first + periods].max() < 0.6 * allowed, (cell, factor)
            first += periods


def settled(seed: int, controller: str, error: float | None) -> dict[str, Any]:
    return {"family": "paper", "reference": "sine", "seed": seed, "controller": controller, "settled": error,
            "amplitude": 10.0, "failure": None if error else "none"}  # fmt: skip


def test_the_best_single_estimator_is_chosen_for_each_cell() -> None:
    first, second, third = CANDIDATES
    of = {DEFAULT: (0.2, 0.3, 0.4), first: (0.1, 0.5, 0.9), second: (0.1, 0.2, 0.3), third: (1e-4, 0.4, None)}
    rows = [settled(k, name, error) for name, each in of.items() for k, error in enumerate(each)]
    found = summarise_contest(rows, DEFAULT)
    (cell,) = found["cells"]
    assert (cell["best"], cell["settled"]) == (second, pytest.approx(0.03))
    assert cell["ratio"] == pytest.approx(1.5)
    assert (found["kept"], found["failures"], found["seeds"]) == (0, 1, 3)
    # Below the floor all are alike.
    tiny = [settled(0, name, error) for name, error in ((DEFAULT, 2e-3), (first, 1e-5))]
    assert summarise_contest(tiny, DEFAULT)["cells"][0]["ratio"] == 1.0
    assert summarise_contest(tiny, DEFAULT)["cells"][0]["settled"] == FLOOR
