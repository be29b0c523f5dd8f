"""The pages about estimators are no older than the code: some of their numbers are made again."""

import json
import random
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from piezoest.cli import app

TABLE = Path(__file__).resolve().parents[2] / "docs" / "data" / "table.json"
# Of a median over all seeds, beside its interval: other processors round otherwise.
TOLERANCE = 0.05
QUANTITIES = ("settled", "first", "worst")


def drawn() -> list[dict[str, Any]]:
    """Three cells of the table, others each time it is made, of fast estimators without arguments."""
    document = json.loads(TABLE.read_text(encoding="utf-8"))
    names = document["estimators"]
    cells = [
        cell for cell in document["cells"]
        if not names[cell["estimator"]]["slow"] and names[cell["estimator"]]["name"] == cell["estimator"]
        and cell["estimator"] != "linear feed-forward"
    ]  # fmt: skip
    return random.Random(document["date"]).sample(cells, 3)


@pytest.mark.slow
@pytest.mark.parametrize("cell", drawn(), ids=lambda cell: "-".join(map(str, list(cell.values())[:3])))
def test_numbers_of_the_table_are_those_of_the_code(cell: dict[str, Any], tmp_path: Path) -> None:
    words = ["--only", cell["estimator"], "--scenario", cell["scenario"], "--stage", cell["stage"]]
    words += ["--seeds", str(cell["runs"]), "--output", str(tmp_path), "--json", str(tmp_path / "new.json")]
    result = CliRunner().invoke(app, ["bench", *words])
    assert result.exit_code == 0, result.output
    made = json.loads((tmp_path / "new.json").read_text(encoding="utf-8"))["cells"]
    (again,) = (each for each in made if each["estimator"] == cell["estimator"])
    for quantity in QUANTITIES:
        _, low, high = cell[quantity]
        median = again[quantity][0]
        assert (1.0 - TOLERANCE) * low <= median <= (1.0 + TOLERANCE) * high, f"{quantity}: make figures"
