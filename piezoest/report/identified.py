"""What an identification found, as a page."""

from pathlib import Path

from piezoest._version import __version__
from piezoest.identification import compared
from piezoest.identification.compared import Found
from piezoest.identification.data import prepare, turning_voltages
from piezoest.identification.drawing import draw
from piezoest.identification.result import Identification
from piezoest.identification.streamed import StreamedIdentification
from piezoest.report.page import Page


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
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import piezoest as pz
    >>> found = pz.identify(pz.records.example_log(), model="line")
    >>> pz.report.write_report(found, "report.html")
    """
    if not isinstance(found, Identification | StreamedIdentification):
        raise ValueError(f"found must come from identify or identify_stream, got {type(found).__name__}")
    page = Page(f"{Path(found.source).name}: what was identified", compared.log_sentence(found))
    kinds, parameters, *others = compared.tables(found)
    page.cards(_cards(found, parameters.title.partition(": ")[2]))
    page.heading("Models of all kinds")
    if reason := compared.reason_sentence(found):
        page.text(reason)
    page.table(kinds.heading, kinds.rows, kinds.title)
    page.heading("Parameters")
    page.tables(*((each.heading, each.rows, each.title) for each in (parameters, *others)))
    if sentences := compared.remarks(found):
        page.heading("Advice")
        page.advice(sentences)
    page.heading("Fit")
    page.text(
        "Displacement and residual over time, and the loop: what was measured, and the model, which sees "
        "only the voltage. "
        + (
            compared.residual_sentence(found)
            or "Drawn are samples at equal distances, as the log was read in blocks."
        )
    )
    drawn = found.drawn()
    page.picture(draw(drawn), "Voltage, displacement, residual, loop, errors of all kinds, autocorrelation")
    page.heading("Excitation")
    data = prepare(drawn.record.voltage, drawn.record.displacement)
    page.text(
        f"The voltage spans {data.extent:.4g} V about {data.middle:.4g} V and turns "
        f"{turning_voltages(data).size} times. Hysteresis shows only at turns, and the parameters belong to "
        "the amplitudes that occur."
    )
    page.footer(f"piezoest {__version__}. Source: {found.source}")
    page.write(path)


def _cards(found: Found, label: str) -> list[tuple[str, str]]:
    held, line = found.held_out.rms, found.line_held_out.rms
    cards = [
        (label, "the model to use"),
        (f"{held:.3g} µm", "error of the simulated displacement, held out, rms"),
        (f"{found.held_out.max:.3g} µm", "the same, largest"),
    ]
    if found.chosen == "line" or line == 0.0:
        return cards
    share = 100.0 * (1.0 - held / line)
    than = f"than a straight line ({line:.3g} µm rms)"
    return [*cards, (f"{abs(share):.0f} %", f"{'less' if share >= 0.0 else 'more'} {than}")]
