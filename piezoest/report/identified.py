"""What an identification found, as a page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from piezoest import _extras
from piezoest._checks import FloatArray
from piezoest._version import __version__
from piezoest.identification.compared import (
    Compared,
    Found,
    compared,
    label_of,
    log_sentence,
    parameter_cells,
    reason_sentence,
    remarks,
    residual_sentence,
    validation_cells,
)
from piezoest.identification.data import prepare, turning_voltages
from piezoest.identification.residual import autocorrelation
from piezoest.identification.result import Identification
from piezoest.identification.streamed import StreamedIdentification
from piezoest.records import Record
from piezoest.report.page import BLUE, GREEN, GREY, ORANGE, RED, Page, extremes, short, thin

# It is straight, but for a bend where the fitted part ends.
BAND_POINTS, BAND = 400, "rgba(31, 95, 168, 0.13)"


def write_report(found: Found, path: str | Path) -> None:
    """Write what was identified as one page of HTML that needs no network.

    Parameters
    ----------
    found : Identification or StreamedIdentification
        From `identify` or `identify_stream`.
    path : str or Path
        File to write; an existing one is replaced.

    Raises
    ------
    ValueError
        If `found` is of another kind.
    ImportError
        If plotly, of the extra ``report``, is not installed.
    OSError
        If the file cannot be written.
    """
    if not isinstance(found, Identification | StreamedIdentification):
        raise ValueError(f"found must come from identify or identify_stream, got {type(found).__name__}")
    page = Page(f"{Path(found.source).name}: what was identified", log_sentence(found))
    page.cards(_cards(found))
    _add_kinds(page, found)
    _add_parameters(page, found)
    _add_advice(page, found)
    record, _ = _drawn(found)
    _add_loops(page, found, record)
    _add_residual(page, found, record)
    _add_excitation(page, found, record)
    page.footer(f"piezoest {__version__}. Source: {found.source}")
    page.write(path)


def _cards(found: Found) -> list[tuple[str, str]]:
    held, line = found.held_out.rms, found.line_held_out.rms
    cards = [
        (label_of(found), "the model to use"),
        (f"{held:.3g} µm", "free-running error, held out, rms"),
        (f"{found.held_out.max:.3g} µm", "the same, largest"),
    ]
    if found.chosen == "line" or line == 0.0:
        return cards
    share = 100.0 * (1.0 - held / line)
    than = f"than a straight line ({line:.3g} µm rms)"
    return [*cards, (f"{abs(share):.0f} %", f"{'less' if share >= 0.0 else 'more'} {than}")]


def _add_kinds(page: Page, found: Found) -> None:
    page.heading("Models of all kinds")
    if reason := reason_sentence(found):
        page.text(reason)
    kinds = compared(found)
    page.table(
        ("free-running error [µm]", "parameters", "fitted\nrms", "blocks left out\nrms", "held out\nrms",
         "held out\nlargest"),
        [each.cells() for each in kinds],
    )  # fmt: skip
    page.plot(_errors_of(kinds), 160 + 32 * len(kinds))


def _errors_of(kinds: list[Compared]) -> Any:
    """Errors as dots: a straight line's may be a thousand times those of the others."""
    figure = _plotly("graph_objects").Figure()
    for name, color, symbol, errors in (
        ("fitted", GREY, "circle-open", [each.train and each.train.rms for each in kinds]),
        ("blocks left out", BLUE, "diamond", [each.left_out for each in kinds]),
        ("held out", ORANGE, "circle", [each.held_out and each.held_out.rms for each in kinds]),
    ):
        figure.add_scatter(
            x=errors, y=[each.label for each in kinds], mode="markers", name=name,
            marker={"color": color, "size": 11, "symbol": symbol, "line": {"width": 2, "color": color}},
        )  # fmt: skip
    chosen = next(k for k, each in enumerate(kinds) if each.chosen)
    figure.add_hrect(y0=chosen - 0.5, y1=chosen + 0.5, fillcolor=BLUE, opacity=0.08, line_width=0)
    # A category that comes first stands below the others otherwise.
    figure.update_yaxes(range=[len(kinds) - 0.5, -0.5], type="category")
    figure.update_xaxes(title_text="free-running error [µm rms]", type="log")
    return figure


def _drawn(found: Found) -> tuple[Record, str]:
    """Record that the figures show, and what a sample of it is."""
    match found:
        case StreamedIdentification():
            return found.thinned, "drawn samples"
        case Identification():
            return found.record, "samples"


def _add_parameters(page: Page, found: Found) -> None:
    page.heading("Parameters")
    tables: list[tuple[tuple[str, ...], list[tuple[str, ...]], str]] = [
        (
            (label_of(found), "value", "± standard error", "unit"),
            [tuple(row) for row in parameter_cells(found)],
            "",
        )
    ]
    if isinstance(found, Identification) and found.validations:
        titles = ("other logs, predicted [µm]", "rms", "largest", "rms without mean")
        tables.append((titles, validation_cells(found), ""))
    page.tables(*tables)


def _add_advice(page: Page, found: Found) -> None:
    if sentences := remarks(found):
        page.heading("Advice")
        page.advice(sentences)


def _add_loops(page: Page, found: Found, record: Record) -> None:
    prediction = found.prediction
    page.heading("Loops")
    page.text(
        "Displacement over voltage, and over time: what was measured, and the model, which sees only the "
        "voltage."
    )
    figure = _plotly("subplots").make_subplots(
        rows=1,
        cols=2,
        column_widths=[0.4, 0.6],
        subplot_titles=("loop", "over time"),
        horizontal_spacing=0.09,
    )
    settled = slice(_start(found, record), None)
    u, x, model = thin(record.voltage[settled], record.displacement[settled], prediction[settled])
    figure.add_scatter(
        x=u, y=x, mode="lines", line={"color": GREY, "width": 3}, name="measured", row=1, col=1
    )
    figure.add_scatter(
        x=u, y=model, mode="lines", line={"color": BLUE, "width": 1}, name="model", row=1, col=1
    )
    for y, color, width in ((record.displacement, GREY, 3), (prediction, BLUE, 1)):
        t, y = extremes(record.time, y)
        figure.add_scatter(
            x=t, y=y, mode="lines", line={"color": color, "width": width}, showlegend=False, row=1, col=2
        )
    _mark_held_out(figure, found, record, row=1, col=2)
    figure.update_xaxes(title_text="voltage [V]", row=1, col=1)
    figure.update_xaxes(title_text="time [s]", row=1, col=2)
    figure.update_yaxes(title_text="displacement [µm]", row=1, col=1)
    page.plot(figure, 440)


def _add_residual(page: Page, found: Found, record: Record) -> None:
    page.heading("Residual")
    page.text(
        "Measured displacement less the model's. "
        + (residual_sentence(found) or "Of every k-th sample, as the log was read in blocks.")
    )
    figure = _plotly("subplots").make_subplots(
        rows=1, cols=2, column_widths=[0.65, 0.35], horizontal_spacing=0.09,
        subplot_titles=("over time", "autocorrelation, fitted part"),
    )  # fmt: skip
    residual = _residual(found, record)
    if isinstance(found, Identification):
        _add_band(figure, found)
    t, y = extremes(record.time, residual)
    figure.add_scatter(
        x=t, y=y, mode="lines", line={"color": RED, "width": 1}, name="measured − model", row=1, col=1
    )
    _mark_held_out(figure, found, record, row=1, col=1)
    start = _start(found, record)
    # What was left out at the start would hide everything else.
    largest = 1.1 * float(np.nanmax(np.abs(residual[max(start, residual.size // 100) :])))
    figure.update_yaxes(range=[-largest, largest], title_text="µm", row=1, col=1)
    figure.update_xaxes(title_text="time [s]", row=1, col=1)
    fitted = residual[start : round(residual.size * found.trained / found.samples)]
    lags = min(100, fitted.size // 4)
    rho = autocorrelation(fitted, lags)
    figure.add_bar(
        x=np.arange(lags + 1), y=short(rho), marker_color=RED, name="autocorrelation", showlegend=False,
        row=1, col=2,
    )  # fmt: skip
    bound = 2.58 / np.sqrt(np.sum(np.isfinite(fitted)))
    figure.add_hrect(y0=-bound, y1=bound, fillcolor=BLUE, opacity=0.2, line_width=0, row=1, col=2)
    _, unit = _drawn(found)
    figure.update_xaxes(title_text=f"lag [{unit}]; band: white noise, 99 %", row=1, col=2)
    figure.update_yaxes(range=[-1.05, 1.05], row=1, col=2)
    page.plot(figure, 380)


def _start(found: Found, record: Record) -> int:
    """First sample drawn that was not left out."""
    return -(-found.left_out * len(record) // found.samples)


def _residual(found: Found, record: Record) -> FloatArray:
    return found.residual if isinstance(found, Identification) else record.displacement - found.prediction


def _add_band(figure: Any, found: Identification) -> None:
    """Where the model expects readings, about its prediction."""
    expected = found.predict()
    t, below, above = thin(
        found.record.time, expected.lower - expected.x, expected.upper - expected.x, points=BAND_POINTS
    )
    figure.add_scatter(
        x=np.concatenate([t, t[::-1]]), y=np.concatenate([below, above[::-1]]), mode="lines", fill="toself",
        line={"width": 0}, fillcolor=BAND, name="95 of 100 readings, as expected", row=1, col=1,
    )  # fmt: skip


def _add_excitation(page: Page, found: Found, record: Record) -> None:
    page.heading("Excitation")
    data = prepare(record.voltage, record.displacement)
    turns = turning_voltages(data)
    page.text(
        f"The voltage spans {data.extent:.4g} V about {data.middle:.4g} V and turns {turns.size} times. "
        "Hysteresis shows only at turns, and the parameters belong to the amplitudes that occur."
    )
    if record.sample_rate < 0.99 * found.sample_rate:
        page.text(
            f"Drawn is every {found.sample_rate / record.sample_rate:.0f}th sample: in the spectrum, what is "
            f"faster than {0.5 * record.sample_rate:.4g} Hz is folded back."
        )
    figure = _plotly("subplots").make_subplots(
        rows=1, cols=3, column_widths=[0.5, 0.22, 0.28], horizontal_spacing=0.08,
        subplot_titles=("voltage over time", "where it turns", "its spectrum"),
    )  # fmt: skip
    t, u = extremes(record.time, record.voltage)
    figure.add_scatter(
        x=t, y=u, mode="lines", line={"color": GREEN, "width": 1}, name="voltage", row=1, col=1
    )
    figure.add_histogram(y=short(turns), nbinsy=40, marker_color=GREEN, name="turns", row=1, col=2)
    frequency, density = _spectrum(data.u, record.sample_rate)
    figure.add_scatter(
        x=frequency, y=density, mode="lines", line={"color": GREEN, "width": 1}, name="spectrum", row=1, col=3
    )
    figure.update_layout(showlegend=False, bargap=0.05)
    figure.update_yaxes(title_text="voltage [V]", row=1, col=1)
    figure.update_yaxes(matches="y", row=1, col=2)
    figure.update_yaxes(type="log", title_text="V/√Hz", exponentformat="power", row=1, col=3)
    figure.update_xaxes(title_text="time [s]", row=1, col=1)
    figure.update_xaxes(title_text="turns", row=1, col=2)
    figure.update_xaxes(type="log", title_text="frequency [Hz]", row=1, col=3)
    page.plot(figure, 340)


def _spectrum(u: FloatArray, sample_rate: float) -> tuple[FloatArray, FloatArray]:
    """Amplitude density of the voltage about its mean [V/√Hz], of some thousand frequencies."""
    from scipy.signal import welch

    frequency, power = welch(u, sample_rate, nperseg=min(u.size, 8192), detrend="constant")
    return short(frequency[1:]), short(np.sqrt(np.maximum(power[1:], 1e-30)))


def _mark_held_out(figure: Any, found: Any, record: Record, row: int, col: int) -> None:
    start = record.time[round(len(record) * found.trained / found.samples)]
    figure.add_vrect(
        x0=float(start), x1=float(record.time[-1]), fillcolor=ORANGE, opacity=0.10, line_width=0,
        annotation_text="held out", annotation_position="top right", row=row, col=col,
    )  # fmt: skip


def _plotly(module: str) -> Any:
    return _extras.load(f"plotly.{module}", "report", "an HTML report")
