"""The paper's tables from the simulated stage, against their bounds."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from piezoest.bench.paper_tables import PRBS_ROW, Published, published
from tests.bench.shared import bench as command

pytestmark = pytest.mark.slow

# What the stage misses: each has to miss still, so that a better stage shortens the list.
MISSES = {
    ("7.5 µm @ 5.0 Hz, parameters of 2.5 µm", "compensated_max_error"): (
        "the parameters of the 2.5 µm row, off by less than their bounds, are extrapolated threefold: "
        "calibration/trade_off.md"
    )
}


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("paper")
    result = command("paper", "--quick", "--json", folder / "paper.json", "--figures", folder)
    assert result.exit_code == 0, result.output
    return folder


@pytest.fixture(scope="session")
def document(folder: Path) -> Any:
    return json.loads((folder / "paper.json").read_text(encoding="utf-8"))


def number_of(document: Any, row: str, quantity: str) -> Any:
    (entry,) = (each for each in document["tables"] if (each["row"], each["quantity"]) == (row, quantity))
    return entry


def bounded_numbers() -> list[Any]:
    return [
        pytest.param(
            number,
            id=f"{number.table}-{number.row}-{number.quantity}".replace("µ", "u"),
            marks=[pytest.mark.xfail(strict=True, reason=reason)]
            if (reason := MISSES.get((number.row, number.quantity)))
            else [],
        )
        for number in published()
        if number.bound is not None
    ]


@pytest.mark.parametrize("number", bounded_numbers())
def test_number_is_within_its_bound(number: Published, document: Any) -> None:
    entry = number_of(document, number.row, number.quantity)
    assert entry["bound"] == number.bound
    assert abs(number.deviation(entry["ours"])) <= entry["bound"]


@pytest.mark.parametrize(
    ("quantity", "sign"), [("alpha", -1), ("beta", 1), ("gamma", -1), ("K", 1), ("compensated_max_error", 1)]
)
def test_slow_row_differs_from_the_fast_one_as_in_the_paper(quantity: str, sign: int, document: Any) -> None:
    slow, fast = (number_of(document, f"5.0 µm @ {f} Hz", quantity) for f in ("2.5", "5.0"))
    assert sign * (slow["value"] - fast["value"]) > 0.0
    assert sign * (slow["ours"] - fast["ours"]) > 0.0


def test_every_number_of_the_paper_has_one_of_ours_and_figures_are_drawn(document: Any, folder: Path) -> None:
    sizes = {path.stem: path.stat().st_size for path in folder.glob("*.png")}
    assert set(sizes) == {"figure3", "figure4", "figure5", "adaptation"}
    assert 10_000 < min(sizes.values()) < max(sizes.values()) < 200_000
    assert len(document["tables"]) == len(published()) == 49
    assert all(math.isfinite(entry["ours"]) for entry in document["tables"])


def test_every_row_adapts_and_settles(document: Any) -> None:
    runs = document["adaptation"]
    assert len(runs) == 10
    for run in runs:
        assert run["settling_periods"] is not None
        if run["compensation"] == "inverse" and run["row"] != PRBS_ROW:
            assert run["max_error_um"][0] > 3.0 * run["stationary_max_error_um"]
