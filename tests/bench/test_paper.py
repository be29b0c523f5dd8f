"""The paper's tables from the simulated stage, against their bounds."""

import json
import math
from pathlib import Path

import pytest

from piezoest.bench.paper_tables import PRBS_ROW, published
from tests.bench.shared import bench

# What the stage misses: each has to miss still, so that a better stage shortens the list. The parameters of
# the 2.5 µm row, off by less than their bounds, are extrapolated threefold: calibration/trade_off.md
MISSES = {("7.5 µm @ 5.0 Hz, parameters of 2.5 µm", "compensated_max_error")}


@pytest.mark.slow
def test_the_papers_numbers_are_within_their_bounds_and_drawn(tmp_path: Path) -> None:
    result = bench("paper", "--quick", "--json", tmp_path / "paper.json", "--figures", tmp_path)
    assert result.exit_code == 0, result.output
    document = json.loads((tmp_path / "paper.json").read_text(encoding="utf-8"))
    found = {(entry["row"], entry["quantity"]): entry for entry in document["tables"]}
    assert len(document["tables"]) == len(found) == len(published()) == 49
    off = set()
    for number in published():
        entry = found[number.row, number.quantity]
        assert math.isfinite(entry["ours"])
        assert entry["bound"] == number.bound
        if number.bound is not None and abs(number.deviation(entry["ours"])) > number.bound:
            off.add((number.row, number.quantity))
    assert off == MISSES

    signs = {"alpha": -1, "beta": 1, "gamma": -1, "K": 1, "compensated_max_error": 1}
    for quantity, sign in signs.items():
        slow, fast = (found[f"5.0 µm @ {f} Hz", quantity] for f in ("2.5", "5.0"))
        for of in ("value", "ours"):
            assert sign * (slow[of] - fast[of]) > 0.0, (quantity, of)

    assert len(document["adaptation"]) == 10
    for run in document["adaptation"]:
        assert run["settling_periods"] is not None
        if run["compensation"] == "inverse" and run["row"] != PRBS_ROW:
            assert run["max_error_um"][0] > 3.0 * run["stationary_max_error_um"]

    sizes = {path.stem: path.stat().st_size for path in tmp_path.glob("*.png")}
    assert set(sizes) == {"figure3", "figure4", "figure5", "adaptation"}
    assert 10_000 < min(sizes.values()) < max(sizes.values()) < 200_000
