"""Reports: what is on them, and that they need nothing from elsewhere."""

from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import piezoest as pz
from piezoest.cli import app
from piezoest.report import write_report


@pytest.fixture
def record() -> pz.Record:
    time = np.arange(8000) / 2000.0
    voltage = 20.0 * np.sin(2.0 * np.pi * 3.0 * time) * (1.0 + 0.3 * np.sin(2.0 * np.pi * 0.4 * time))
    displacement = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(voltage, allow_jumps=True)
    displacement += np.random.default_rng(0).normal(0.0, 2e-3, time.size)
    displacement[100:110] = np.nan
    return pz.Record.from_arrays(voltage, displacement, 2000.0, "a <stage> & its log.csv")


class Outline(HTMLParser):
    """Tags that are left open, and addresses."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "link", "img"):
            self.open.append(tag)
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_page_is_sound_and_self_contained(record: pz.Record, tmp_path: Path) -> None:
    found = pz.identify(record, delay=0.0)
    write_report(found, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    outline = Outline(text)
    assert outline.open == []
    assert all(address.startswith("data:") for address in outline.addresses)
    assert sum(address.startswith("data:image/png") for address in outline.addresses) == 1
    assert "a &lt;stage&gt; &amp; its log.csv: what was identified" in text
    for name, value, _, _ in found.table():
        assert f"<td>{name}</td><td>{value:.6g}</td>" in text or abs(value) < 1e-9
    for item in found.candidates:
        assert f"{item.label}</td><td>{item.parameters}</td><td>{item.train.rms:.3g}</td>" in text
    assert all(sentence in text for sentence in (found.reason, *found.advice))
    assert len(text) < 1_000_000


@pytest.mark.slow
def test_command_writes_the_report(record: pz.Record, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    record.write("log.csv")
    arguments = ["identify", "log.csv", "--no-plot"]
    result = CliRunner().invoke(app, [*arguments, "--delay", "0", "--html", "report.html"])
    assert result.exit_code == 0, result.output
    assert "Report: report.html" in result.stdout
    assert Path("report.html").stat().st_size > 100_000
    for name, words in (("report.pdf", ".html"), ("no/such/report.html", "no folder"), ("log.csv", ".html")):
        result = CliRunner().invoke(app, [*arguments, "--html", name])
        assert result.exit_code == 1
        assert words in result.stderr
