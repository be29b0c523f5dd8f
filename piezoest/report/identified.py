"""What an identification found, as a page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from piezoest import _extras
from piezoest._checks import FloatArray
from piezoest._version import __version__
from piezoest.identification.choice import ModelChoice
from piezoest.identification.data import prepare, turning_voltages
from piezoest.identification.residual import Misfit, autocorrelation
from piezoest.identification.result import Identification
from piezoest.identification.streamed import StreamedIdentification
from piezoest.identification.terminal import remarks, residual_sentence
from piezoest.records import Record
from piezoest.report.page import BLUE, GREEN, GREY, ORANGE, RED, Page, extremes, short, thin


def write_report(found: Identification | ModelChoice | StreamedIdentification, path: str | Path) -> None:
    """Write what was identified as one page of HTML that needs no network.

    Parameters
    ----------
    found : Identification, ModelChoice or StreamedIdentification
        From `identify`, `choose_model` or `identify_stream`.
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
    match found:
        case ModelChoice():
            page = _choice_page(found)
        case Identification() | StreamedIdentification():
            page = _page(f"{Path(found.source).name}: what was identified", found)
        case _:
            raise ValueError(
                f"found must come from identify, choose_model or identify_stream, got {type(found).__name__}"
            )
    page.write(path)


def _page(title: str, found: Identification | StreamedIdentification) -> Page:
    page = Page(title, _what(found))
    page.cards(_cards(found.held_out, found.line_held_out))
    _add_sections(page, found)
    return page


def _what(found: Identification | StreamedIdentification) -> str:
    return (
        f"{found.samples} samples at {found.sample_rate:.6g} Hz; the first {found.trained} fitted, "
        f"the other {found.samples - found.trained} held out"
    )


def _cards(held: Misfit, line: Misfit) -> list[tuple[str, str]]:
    cards = [
        (f"{held.rms:.3g} µm", "free-running error, held out, rms"),
        (f"{held.max:.3g} µm", "the same, largest"),
    ]
    less = 100.0 * (1.0 - held.rms / line.rms)
    return [*cards, (f"{less:.0f} %", f"less than a straight line ({line.rms:.3g} µm rms)")]


def _add_sections(page: Page, found: Identification | StreamedIdentification) -> None:
    _add_parameters(page, found)
    record, _ = _drawn(found)
    _add_loops(page, found, record, found.prediction)
    _add_residual(page, found, record, found.prediction)
    _add_excitation(page, found, record)
    page.footer(f"piezoest {__version__}. Source: {found.source}")


def _drawn(found: Identification | StreamedIdentification) -> tuple[Record, str]:
    """Record that the figures show, and what a sample of it is."""
    match found:
        case StreamedIdentification():
            return found.thinned, "drawn samples"
        case Identification():
            return found.record, "samples"


def _add_parameters(page: Page, found: Identification | StreamedIdentification) -> None:
    page.heading("Parameters")
    page.tables(
        (
            ("Coleman-Hodgdon", "value", "± standard error", "unit"),
            [
                (name, f"{value:.6g}", f"± {error:.2g}" if error > 0.0 else "not estimated", unit)
                for name, value, error, unit in found.table()
            ],
            "",
        ),
        (
            ("free-running error [µm]", "fitted, rms", "held out, rms", "held out, largest"),
            [
                (name, f"{fitted.rms:.4g}", f"{held.rms:.4g}", f"{held.max:.4g}")
                for name, fitted, held in (
                    ("model", found.train, found.held_out),
                    ("straight line, same lag", found.line_train, found.line_held_out),
                )
            ],
            "",
        ),
    )
    sentences = remarks(found)
    if sentences:
        page.heading("Advice")
        page.advice(sentences)


def _add_loops(
    page: Page, found: Identification | StreamedIdentification, record: Record, prediction: FloatArray
) -> None:
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
    settled = slice(getattr(found, "left_out", 0), None)
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


def _add_residual(
    page: Page, found: Identification | StreamedIdentification, record: Record, prediction: FloatArray
) -> None:
    page.heading("Residual")
    page.text(
        "Measured displacement less the model's. "
        + (residual_sentence(found) or "Of every k-th sample, as the log was read in blocks.")
    )
    figure = _plotly("subplots").make_subplots(
        rows=1, cols=2, column_widths=[0.65, 0.35], horizontal_spacing=0.09,
        subplot_titles=("over time", "autocorrelation, fitted part"),
    )  # fmt: skip
    residual = record.displacement - prediction
    t, y = extremes(record.time, residual)
    figure.add_scatter(
        x=t, y=y, mode="lines", line={"color": RED, "width": 1}, name="measured − model", row=1, col=1
    )
    _mark_held_out(figure, found, record, row=1, col=1)
    start = getattr(found, "left_out", 0)
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


def _add_excitation(page: Page, found: Identification | StreamedIdentification, record: Record) -> None:
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


# ---------------------------------------------------------------- models of all kinds


def _choice_page(found: ModelChoice) -> Page:
    base, best = found.base, found.best
    page = Page(f"{Path(base.source).name}: which model", _what(base))
    page.cards([(best.name, "to be used"), *_cards(best.held_out, base.line_held_out)])
    page.heading("Models of all kinds")
    page.text(found.reason)
    page.table(
        ("model", "parameters", "fitted rms [µm]", "held out rms [µm]", "held out largest [µm]", "BIC"),
        [
            (
                f"{'▸ ' if item is best else ''}{item.name}",
                f"{item.parameters}",
                *(f"{value:.4g}" for value in (item.train.rms, item.held_out.rms, item.held_out.max)),
                f"{item.bic:.0f}",
            )
            for item in found.candidates
        ],
    )
    page.plot(_bars(found), 320)
    page.plot(_residuals(found), 320)
    page.heading("Of these, the Coleman-Hodgdon model")
    _add_sections(page, base)
    return page


def _bars(found: ModelChoice) -> Any:
    names = [item.name for item in found.candidates]
    figure = _plotly("graph_objects").Figure()
    for samples, color in (("train", GREY), ("held_out", BLUE)):
        values = [getattr(item, samples).rms for item in found.candidates]
        figure.add_bar(
            y=names, x=values, orientation="h", marker_color=color,
            name={"train": "fitted", "held_out": "held out"}[samples],
        )  # fmt: skip
    figure.update_yaxes(autorange="reversed")
    figure.update_xaxes(title_text="free-running error [µm rms]")
    return figure


def _residuals(found: ModelChoice) -> Any:
    figure = _plotly("graph_objects").Figure()
    for item, color in ((found.candidates[0], GREY), (found.best, BLUE)):
        t, y = extremes(found.base.record.time, item.residual)
        figure.add_scatter(x=t, y=y, mode="lines", line={"color": color, "width": 1}, name=item.name)
    settled = found.candidates[0].residual[max(found.base.left_out, found.base.samples // 50) :]
    largest = 1.1 * float(np.nanmax(np.abs(settled)))
    figure.update_yaxes(range=[-largest, largest], title_text="measured − model [µm]")
    figure.update_xaxes(title_text="time [s]")
    return figure
