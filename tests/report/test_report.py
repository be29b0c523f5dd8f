"""Reports: what is on them, that they stay small, and that a real browser draws them without a network."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import piezoest as pz
from piezoest.cli import app
from piezoest.fitting import FORMS
from piezoest.report import Page, write_report
from piezoest.report.page import extremes, thin
from tests.browser import check_report, chromium, console_of

pytest.importorskip("plotly")

TRUE = pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
RATE = 2000.0


@pytest.fixture(scope="module")
def record() -> pz.Record:
    time = np.arange(8000) / RATE
    voltage = 20.0 * np.sin(2.0 * np.pi * 3.0 * time) * (1.0 + 0.3 * np.sin(2.0 * np.pi * 0.4 * time))
    displacement = TRUE.simulate(voltage, allow_jumps=True)
    displacement += np.random.default_rng(0).normal(0.0, 2e-3, time.size)
    displacement[100:110] = np.nan
    return pz.Record.from_arrays(voltage, displacement, RATE, "a <stage> & its log.csv")


@pytest.fixture(scope="module")
def found(record: pz.Record) -> pz.Identification:
    return pz.identify(record, delay=0.0)


@pytest.fixture(scope="module")
def streamed(record: pz.Record, tmp_path_factory: pytest.TempPathFactory) -> pz.StreamedIdentification:
    file = tmp_path_factory.mktemp("streamed") / "log.npy"
    np.save(file, np.column_stack([record.time, record.voltage, record.displacement]))
    return pz.identify_stream(pz.stream_record(file, rows=500), delay=0.0)


class Outline(HTMLParser):
    """Tags that are opened, and those left open at the end."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "link"):
            self.open.append(tag)
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_page_is_sound_and_self_contained(found: pz.Identification, tmp_path: Path) -> None:
    write_report(found, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    outline = Outline(text)
    assert outline.open == []
    assert outline.addresses == ["data:,"]
    assert "a &lt;stage&gt; &amp; its log.csv: what was identified" in text
    body = text.split("<body>")[1]
    for name, value, error, unit in found.table():
        assert re.search(rf"<td>{re.escape(name)}</td><td>{value:.6g}</td>", body) or abs(value) < 1e-9
        assert f"<td>{error:.2g}</td>" in body or error == 0.0
        assert f"<td>{unit}</td>" in body
    for words in (found.reason, *found.advice, *(item.label for item in found.candidates)):
        assert words in body
    # Of which plotly's script is 4.8 MB.
    assert len(body) < 600_000


def test_size_does_not_grow_with_the_record(tmp_path: Path) -> None:
    sizes = []
    for samples in (10_000, 100_000):
        time = np.arange(samples) / 10_000.0
        u = 20.0 * np.sin(2.0 * np.pi * 3.0 * time)
        x = TRUE.simulate(u, allow_jumps=True) + np.random.default_rng(1).normal(0.0, 1e-3, samples)
        write_report(pz.identify(pz.Record.from_arrays(u, x, 10_000.0), delay=0.0), tmp_path / "r.html")
        sizes.append((tmp_path / "r.html").stat().st_size)
    assert sizes[1] < sizes[0] + 100_000


def test_thinning_keeps_peaks_and_order() -> None:
    x = np.arange(100_000.0)
    y = np.sin(x / 50.0)
    y[40_321], y[77_777], y[12] = 9.0, -7.0, np.nan
    short_x, short_y = extremes(x, y, points=1000)
    assert short_x.size <= 1002
    assert np.all(np.diff(short_x) > 0.0)
    assert (short_y.max(), short_y.min()) == (9.0, -7.0)
    assert short_x[np.argmax(short_y)] == 40_321.0
    np.testing.assert_array_equal(extremes(x[:10], y[:10])[1], y[:10].astype(np.float32))
    a, b = thin(x, y, points=1000)
    assert a.size == b.size <= 1001


def test_other_things_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="found must come from identify or identify_stream, got str"):
        write_report("log.csv", tmp_path / "report.html")  # type: ignore[arg-type]


def test_other_logs_are_on_the_page(record: pz.Record, tmp_path: Path) -> None:
    moved = pz.Record.from_arrays(record.voltage, record.displacement + 0.5, RATE, "another <day>.csv")
    found = pz.identify(record, model="coleman-hodgdon", delay=0.0, validate=[moved])
    write_report(found, tmp_path / "report.html")
    body = (tmp_path / "report.html").read_text(encoding="utf-8").split("<body>")[1]
    judged = found.validations[0]
    assert f"<td>another &lt;day&gt;.csv</td><td>{judged.error.rms:.3g}</td>" in body
    assert f"<td>{judged.without_mean.rms:.3g}</td>" in body


def test_command_writes_the_report(
    record: pz.Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    record.write("log.csv")
    for options in ((), ("--stream",)):
        arguments = ["identify", "log.csv", "--no-plot", "--delay", "0", "--html", "report.html", *options]
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, result.output
        assert "Report: report.html" in result.stdout
        assert Path("report.html").stat().st_size > 4_000_000
        Path("report.html").unlink()
    for name, words in {
        "report.pdf": ".html",
        "no/such/report.html": "no folder",
        "log.csv": ".html",
    }.items():
        result = CliRunner().invoke(app, ["identify", "log.csv", "--no-plot", "--html", name])
        assert result.exit_code == 1
        assert words in result.stderr
    result = CliRunner().invoke(app, ["identify", "log.csv", "--stream", "--plot", "figure.png"])
    assert "leave out --stream" in result.stderr
    result = CliRunner().invoke(app, ["identify", "log.csv", "--units", "voltage"])
    assert "--units must read like" in result.stderr


def test_missing_plotly_is_named(record: pz.Record, tmp_path: Path) -> None:
    record.write(tmp_path / "log.csv")
    code = (
        "import sys; sys.modules['plotly'] = None\n"
        f"sys.argv = ['piezoest', 'identify', {str(tmp_path / 'log.csv')!r}, '--no-plot', '--delay', '0', "
        f"'--html', {str(tmp_path / 'report.html')!r}]\n"
        "from piezoest.cli import main; import piezoest.records\n"
        "def read(*_, **__): raise AssertionError('plotly must be missed before anything is read')\n"
        "piezoest.records.read_record = read; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "needs plotly, which is not installed: pip install 'piezoest[report]'" in done.stderr
    assert "Traceback" not in done.stderr


# ---------------------------------------------------------------- in a browser


def test_identification_in_a_browser(found: pz.Identification, tmp_path: Path) -> None:
    write_report(found, tmp_path / "report_identify.html")
    plots, text = check_report(tmp_path / "report_identify.html", plots=4)
    titles = [title for plot in plots for title in plot["titles"]]
    for title in ("voltage [V]", "displacement [µm]", "loop", "held out", "autocorrelation, fitted part"):
        assert title in titles
    assert f"{found.table()[0][1]:.6g}" in text
    assert found.reason in text
    for item in found.candidates:
        assert item.label in text
    assert [plot["traces"] for plot in plots] == [3, 4, 3, 3]


def test_stream_in_a_browser(streamed: pz.StreamedIdentification, tmp_path: Path) -> None:
    write_report(streamed, tmp_path / "report_stream.html")
    _, text = check_report(tmp_path / "report_stream.html", plots=4)
    assert FORMS[streamed.chosen].label in text


def test_the_check_would_see_what_is_wrong(tmp_path: Path) -> None:
    """A page that fails, asks the network for something, or draws nothing does not pass."""
    page = Page("broken")
    page.text("no plots")
    html = page.html()
    script = "<script>fetch('http://example.com/x.js'); throw new Error('broken');</script></body>"
    (tmp_path / "broken.html").write_text(html.replace("</body>", script), encoding="utf-8")
    with pytest.raises(AssertionError):
        check_report(tmp_path / "broken.html", plots=0)
    with chromium() as driver:
        driver.get((tmp_path / "broken.html").as_uri())
        assert any("broken" in message for message in console_of(driver))
