"""One self-contained page: text, tables and pictures, which needs no network."""

import base64
import html
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from piezoest._files import write_text

DPI = 130  # of pictures

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
.picture { max-width: 100%; }
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

    Examples
    --------
    >>> import piezoest as pz
    >>> page = pz.report.Page("My stage", "measured on Monday")
    >>> page.table(["amplitude [µm]", "error [µm]"], [["5", "0.04"]])
    >>> page.write("report.html")
    """

    __slots__ = ("_parts", "_title")

    def __init__(self, title: str, subtitle: str = "") -> None:
        self._title = title
        self._parts = [f"<h1>{html.escape(title)}</h1>"]
        if subtitle:
            self._parts.append(f'<p class="sub">{html.escape(subtitle)}</p>')

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
        # Without an icon of its own, a browser asks for one.
        icon = '<link rel="icon" href="data:,">'
        return (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"{icon}<title>{html.escape(self._title)}</title><style>{STYLE}</style></head>\n<body>\n"
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
