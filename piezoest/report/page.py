"""One self-contained page: text, tables and plots, with the script that draws them inside."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from piezoest import _extras
from piezoest._checks import FloatArray
from piezoest._files import write_text

# A plot is some thousand dots wide: more points only make the page large and slow.
MOST_POINTS = 4000
MANY_SERIES = 5
DPI = 130  # of pictures

BLUE, ORANGE, GREEN, RED, GREY = "#1f5fa8", "#d9822b", "#2e8b57", "#b22234", "#8a8f98"

STYLE = """
:root { color-scheme: light; }
body { margin: 0 auto; max-width: 1180px; padding: 1.5rem 1.5rem 3rem; color: #1d2129; background: #fff;
       font: 15px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.6rem; margin: 0; overflow-wrap: anywhere; } h2 { font-size: 1.15rem; margin: 2rem 0 .5rem; }
p.sub { color: #5b616b; margin: .2rem 0 1.2rem; }
table { border-collapse: collapse; margin: .5rem 0 1rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding-bottom: .3rem; }
th, td { padding: .25rem .8rem; border-bottom: 1px solid #e3e6ea; text-align: right; }
th { color: #5b616b; font-weight: 600; border-bottom-width: 2px; white-space: pre-line;
     vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; }
.side { display: flex; flex-wrap: wrap; gap: 0 3rem; align-items: flex-start; }
.wide { overflow-x: auto; }
.cards { display: flex; flex-wrap: wrap; gap: .8rem; margin: 1rem 0; }
.card { border: 1px solid #e3e6ea; border-radius: 8px; padding: .6rem 1rem; min-width: 9rem; }
.card b { display: block; font-size: 1.35rem; } .card span { color: #5b616b; font-size: .85rem; }
ul.advice { background: #fff8ec; border-left: 4px solid #d9822b; margin: .5rem 0;
            padding: .6rem 1rem .6rem 2rem; }
details { margin: .6rem 0; } summary { cursor: pointer; font-weight: 600; }
.plot { width: 100%; margin: .4rem 0 1rem; } .picture { max-width: 100%; }
footer { margin-top: 2.5rem; color: #5b616b; font-size: .85rem; border-top: 1px solid #e3e6ea;
         padding-top: .6rem; }
"""


class Page:
    """A page that is put together from top to bottom, and written as one file.

    Parameters
    ----------
    title : str
        Heading, and title of the window.
    subtitle : str
        The line below it.
    """

    __slots__ = ("_parts", "_plots", "_title")

    def __init__(self, title: str, subtitle: str = "") -> None:
        self._title = title
        self._parts = [f"<h1>{html.escape(title)}</h1>"]
        if subtitle:
            self._parts.append(f'<p class="sub">{html.escape(subtitle)}</p>')
        self._plots = 0

    def heading(self, text: str) -> None:
        """Add a heading.

        Parameters
        ----------
        text : str
            What it says.
        """
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def text(self, text: str) -> None:
        """Add a paragraph.

        Parameters
        ----------
        text : str
            What it says.
        """
        self._parts.append(f"<p>{html.escape(text)}</p>")

    def cards(self, cards: Iterable[tuple[str, str]]) -> None:
        """Add figures that are seen first.

        Parameters
        ----------
        cards : iterable of (str, str)
            Each a figure with its unit, and what it is.
        """
        inner = "".join(
            f'<div class="card"><b>{html.escape(value)}</b><span>{html.escape(what)}</span></div>'
            for value, what in cards
        )
        self._parts.append(f'<div class="cards">{inner}</div>')

    def advice(self, sentences: Iterable[str]) -> None:
        """Add a list of sentences.

        Parameters
        ----------
        sentences : iterable of str
            If there are none, nothing is added.
        """
        if items := "".join(f"<li>{html.escape(sentence)}</li>" for sentence in sentences):
            self._parts.append(f'<ul class="advice">{items}</ul>')

    def table(self, heading: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "") -> None:
        """Add a table.

        Parameters
        ----------
        heading : sequence of str
            Titles of the columns.
        rows : iterable of sequence of str
            Cells.
        caption : str
            Title of the table.
        """
        self._parts.append(f'<div class="wide">{_table(heading, rows, caption)}</div>')

    def tables(self, *tables: tuple[Sequence[str], Iterable[Sequence[str]], str]) -> None:
        """Add tables side by side, where there is room.

        Parameters
        ----------
        *tables : tuple
            Of each, heading, rows and caption.
        """
        self._parts.append(f'<div class="side">{"".join(_table(*table) for table in tables)}</div>')

    def plot(self, figure: Any, height: int = 360) -> None:
        """Add a plot.

        Parameters
        ----------
        figure : plotly.graph_objects.Figure
            What to draw.
        height : int
            In dots.
        """
        plotly_io = _extras.load("plotly.io", "report", "an HTML report")
        figure.update_layout(
            template="plotly_white",
            height=height,
            font={"size": 13, "color": "#1d2129"},
            hovermode="closest",
            # No margin grows by itself for the titles of subplots.
            margin={"l": 60, "r": 20, "t": 64, "b": 48},
        )
        if len(figure.data) < MANY_SERIES:
            # Above those titles, beside the buttons; more names than this would run into them.
            figure.update_layout(
                legend={"orientation": "h", "yref": "container", "yanchor": "top", "y": 1.0, "x": 0.0}
            )
        figure.update_xaxes(automargin=True)
        figure.update_yaxes(automargin=True)
        self._plots += 1
        self._parts.append(
            '<div class="plot">'
            + plotly_io.to_html(
                figure,
                include_plotlyjs=False,
                full_html=False,
                config={"displaylogo": False, "displayModeBar": "hover", "responsive": True},
                default_height=f"{height}px",
                div_id=f"plot-{self._plots}",
            )
            + "</div>"
        )

    def picture(self, figure: Any, alt: str) -> None:
        """Add a picture.

        Parameters
        ----------
        figure : matplotlib.figure.Figure
            What to show.
        alt : str
            What it is, for those who do not see it.
        """
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png", dpi=DPI)
        data = base64.b64encode(drawn.getvalue()).decode()
        self._parts.append(
            f'<img class="picture" alt="{html.escape(alt)}" src="data:image/png;base64,{data}">'
        )

    def footer(self, text: str) -> None:
        """Add small print at the end.

        Parameters
        ----------
        text : str
            What it says.
        """
        self._parts.append(f"<footer>{html.escape(text)}</footer>")

    def html(self) -> str:
        """Return the whole page."""
        offline = _extras.load("plotly.offline", "report", "an HTML report")
        # Without an icon of its own, a browser asks for one.
        icon = '<link rel="icon" href="data:,">'
        script = f"<script>{offline.get_plotlyjs()}</script>" if self._plots else ""
        return (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"{icon}<title>{html.escape(self._title)}</title><style>{STYLE}</style>{script}</head>\n<body>\n"
            + "\n".join(self._parts)
            + "\n</body></html>\n"
        )

    def write(self, path: str | Path) -> None:
        """Write the page.

        Parameters
        ----------
        path : str or Path
            File to write; an existing one is replaced.
        """
        write_text(path, self.html())


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]], caption: str) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in heading)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    title = f"<caption>{html.escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def thin(*arrays: FloatArray, points: int = MOST_POINTS) -> list[FloatArray]:
    """Arrays of one length with at most so many points, evenly taken.

    Parameters
    ----------
    *arrays : ndarray, shape (N,)
        Alike in length.
    points : int
        At most, or one more.
    """
    step = max(1, -(-arrays[0].size // points))
    return [short(array[::step]) for array in arrays]


def extremes(x: FloatArray, y: FloatArray, points: int = MOST_POINTS) -> tuple[FloatArray, FloatArray]:
    """Least and largest of each stretch, in their order: no peak is lost.

    Parameters
    ----------
    x, y : ndarray, shape (N,)
        Abscissa and values; NaN in the values counts as absent.
    points : int
        At most, or two more.
    """
    known = np.flatnonzero(np.isfinite(y))
    if known.size <= points:
        return short(x[known]), short(y[known])
    edges = np.linspace(0, known.size, points // 2 + 1).astype(int)[:-1]
    values = y[known]
    step = np.diff([*edges, known.size])
    stretch = np.repeat(np.arange(edges.size), step)
    # The first of those that are least, and the first of those that are largest.
    order = np.lexsort((values, stretch))
    kept = np.unique(np.concatenate([order[edges], order[edges + step - 1]]))
    return short(x[known[kept]]), short(values[kept])


def short(values: FloatArray) -> Any:
    """Values to single precision, in which a plot is drawn anyway."""
    return np.asarray(values, dtype=np.float32)
