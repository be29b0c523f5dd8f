"""Pages of the benchmarks, made of the JSON that the documentation shows, in a real browser."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from piezoest.bench.html_report import write_html
from piezoest.bench.suite_report import percent
from piezoest.cli import app
from tests.browser import check_report

pytest.importorskip("plotly")

DATA = Path(__file__).resolve().parents[2] / "docs" / "data"


def read(name: str) -> dict[str, Any]:
    return dict(json.loads((DATA / f"{name}.json").read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def adaptation(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    folder = tmp_path_factory.mktemp("adaptation")
    arguments = ["bench", "adaptation", "--scenario", "gain-step", "--scenario", "dwell", "--seeds", "1"]
    arguments += ["--sample-rate", "5000", "--periods", "5", "--jobs", "1"]
    arguments += ["--estimator", "HysteresisRLS", "--estimator", "HysteresisRLS(memory=0.4)"]
    arguments += ["--json", str(folder / "a.json"), "--html", str(folder / "report_bench_adaptation.html")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert "Report: " in result.stderr
    return json.loads((folder / "a.json").read_text()), folder / "report_bench_adaptation.html"


def test_adaptation_in_a_browser(adaptation: tuple[dict[str, Any], Path]) -> None:
    document, page = adaptation
    plots, text = check_report(page, plots=3)
    for name, description in document["scenarios"].items():
        assert name in text
        assert description in text
    for row in document["summary"]:
        assert row["estimator"].split("(")[0] in text
    assert {plot["traces"] for plot in plots} == {3}


def test_estimators_in_a_browser(tmp_path: Path) -> None:
    document = read("estimators")
    write_html(document, tmp_path / "report_bench_estimators.html")
    plots, text = check_report(tmp_path / "report_bench_estimators.html", plots=2)
    for row in document["rows"]:
        if row["failure"] is None:
            assert f"{row['name']} {row['settled_error']:.4f}" in text
    assert plots[0]["traces"] == sum(row["failure"] is None for row in document["rows"])


def test_paper_in_a_browser(tmp_path: Path) -> None:
    document = read("paper")
    write_html(document, tmp_path / "report_bench_paper.html")
    _, text = check_report(tmp_path / "report_bench_paper.html", plots=3)
    for sentence in ("Table I:", "Table II:", "Table III:", "numbers within their bounds"):
        assert sentence in text


def test_suite_in_a_browser(tmp_path: Path) -> None:
    page = tmp_path / "report_bench_suite.html"
    arguments = ["bench", "--quick", "--output", str(tmp_path / "runs"), "--table", "csv", "--jobs", "1"]
    arguments += ["--only", "HysteresisRLS", "--only", "OutputErrorRLS"]
    arguments += ["--scenario", "gain-step", "--scenario", "two-tone", "--stage", "preisach"]
    result = CliRunner().invoke(app, [*arguments, "--html", str(page)])
    assert result.exit_code == 0, result.output
    assert f"Report: {page}" in " ".join(result.stderr.split())
    document = json.loads((tmp_path / "runs" / "suite.json").read_text(encoding="utf-8"))
    plots, text = check_report(page, plots=4)
    # Linear feed-forward costs nothing, and is in all plots but that of the costs.
    assert [plot["traces"] for plot in plots] == [2, 3, 3, 3]
    for name, description in document["scenarios"].items():
        assert f"{name}, other stage" in text
        assert description in text
    for row in document["overview"]:
        cells = [percent(row[name]) for name in ("settled_max", "worst_error")]
        assert " ".join([row["estimator"], *cells]) in text
    assert "6 runs at 2000 Hz on the preisach stage" in text


def test_suite_of_the_documentation_in_a_browser(tmp_path: Path) -> None:
    document = read("suite")
    write_html(document, tmp_path / "report_bench_campaign.html")
    plots, text = check_report(
        tmp_path / "report_bench_campaign.html",
        plots=2 + len({row["scenario"] for row in document["summary"]}),
    )
    assert plots[1]["traces"] == len(document["estimators"])
    for row in document["overview"]:
        assert row["estimator"] in text


def test_a_suite_without_a_page_of_its_own(tmp_path: Path) -> None:
    rows = [
        {"scenario": f"s{i}", "estimator": "E", "error_um": 0.1 * i, "ok": True, "deep": {}} for i in range(4)
    ]
    write_html({"suite": "other", "seeds": 2, "summary": rows}, tmp_path / "report_bench_other.html")
    _, text = check_report(tmp_path / "report_bench_other.html", plots=1)
    assert "s3 E 0.3 ✓" in text
    with pytest.raises(ValueError, match="document has no suite"):
        write_html({}, tmp_path / "none.html")


@pytest.mark.parametrize("command", [[], ["adaptation"], ["estimators"], ["paper"]])
def test_a_report_that_cannot_be_written_is_refused_at_once(command: list[str], tmp_path: Path) -> None:
    for name in ("report.pdf", str(tmp_path / "no" / "report.html")):
        result = CliRunner().invoke(app, ["bench", *command, "--html", name])
        assert result.exit_code == 2
        assert "--html" in result.output
