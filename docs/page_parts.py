"""What the programs of the pages share: reading docs/data, tables, and numbers that stand in sentences.

Each page has a module NAME_page whose `pieces` gives the texts that it includes, by the name of their file.
"""

import csv
import io
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from textwrap import indent
from typing import Any

from piezoest._files import write_text
from piezoest._tables import Columns, cells_of, shown
from piezoest.bench import report
from piezoest.bench.origin import code_of_parts, machine_of
from piezoest.bench.report import Table
from piezoest.bench.scenarios import UNREPEATED

DOCS = Path(__file__).resolve().parent

Document = dict[str, Any]
# Columns of the tables on the first page and in the README.
NEEDS = {"you have or want": "you have or want", "take": "take", "error\n[%]": "error [%]"}
SPEED = {
    "estimator": "estimator", "settles": "settles [periods]", "first": "first [%]", "settled": "settled [%]",
    "step\n[µs]": "step [µs]",
}  # fmt: skip
# What a dash means in the tables of speed.
UNSETTLED = (
    "in *settles*, fewer than half of the runs settle; in other columns, it was not run there, or not timed."
)
# Folders of the package whose code makes the numbers of a document.
RUNS = ("compensators", "equations", "estimators", "models", "signals", "stage")
CONTROLLED, FITTED = (*RUNS, "controller"), ("equations", "fitting", "models", "symbolic")
ABOUT = {
    "controller": CONTROLLED, "logs": (*FITTED, "identification", "bench/zoo"), "paper": RUNS,
    "policies": (*RUNS, "policies"), "real_data": (*FITTED, "identification", "records"),
    "safety": (*CONTROLLED, "bench/zoo"), "speed": (*CONTROLLED, "export"), "table": (*CONTROLLED, *FITTED),
    "target": (*CONTROLLED, "export"), "tuning": RUNS,
}  # fmt: skip


def read(name: str) -> Document:
    """What docs/data/NAME.json holds; with ``changed``, where the code has changed since it was made."""
    document = dict(json.loads((DOCS / "data" / f"{name}.json").read_text(encoding="utf-8")))
    before, now = document["code"], code_of_parts()
    changed = sorted(part for part in set(ABOUT[name]) if before.get(part) != now[part])
    return {**document, "changed": changed}


def write_page(page: Any, app: Any = None) -> None:
    """Write what a page includes, from the pieces that its module makes of docs/data at every Sphinx build.

    `page`: module NAME_page; it may name its `SOURCES`, else docs/data/NAME.json is. Files stay untouched
    where nothing changed, so that no rebuild follows. No line ends before a per cent sign.
    """
    name = page.__name__.removesuffix("_page")
    documents = {source: read(source) for source in getattr(page, "SOURCES", (name,))}
    for source, document in documents.items():
        if document["changed"]:
            parts = ", ".join(document["changed"])
            print(f"docs/data/{source}.json is older than the code of {parts}: make figures, or make safety")
    texts = page.pieces(*documents.values())
    target = DOCS / "generated" / name
    target.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        path, text = target / f"{name}.inc", text.replace(" %", "\N{NO-BREAK SPACE}%")
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            write_text(path, text)


def table(title: str, heading: Iterable[str], body: Iterable[Iterable[Any]], dash: str = "") -> str:
    """A csv-table; ✗ in bold. `dash`: what a dash means in it, for the line below a table that has one."""
    rows = [[f"**{text}**" if text.endswith("✗") else text for text in map(shown, row)] for row in body]
    if not rows:
        return f"*{title}: none.*\n"
    written = io.StringIO()
    writer = csv.writer(written, lineterminator="\n", quoting=csv.QUOTE_ALL)
    writer.writerows([[name.replace("\n", " ") for name in heading], *rows])
    header, _, lines = written.getvalue().partition("\n")
    text = f".. csv-table:: {title}\n   :header: {header}\n   :widths: auto\n\n{indent(lines, '   ')}"
    if not any("—" in cell for row in rows for cell in row):
        return text
    if not dash:
        raise ValueError(f"table {title or header!r}: say what a dash means in it")
    return f"{text}\n.. rst-class:: legend\n\n—: {dash}\n"


def table_of(title: str, rows: Iterable[Any], columns: Columns | None = None, dash: str = "") -> str:
    """A csv-table with a line for each row; without columns, the keys of the rows are the headings."""
    return table(title, *cells_of(rows, columns), dash)


def part_of(of: Table, columns: Mapping[str, str]) -> Table:
    """Some columns of a table, under other headings, without the estimators that were tuned."""
    places = [of[0].index(name) for name in columns]
    rows = [[row[k] for k in places] for row in of[1] if not row[0].endswith(", tuned")]
    return list(columns.values()), rows


def speed_table(document: Document) -> Table:
    """How fast each estimator adapts on the first stage, and the share of runs that settle on the others."""
    heading, body = part_of(report.overview_table(document), SPEED)
    first, runs = document["plan"]["stages"][0], {}
    for cell in document["cells"]:
        if cell["stage"] != first and cell["scenario"] not in UNREPEATED:
            name = document["estimators"][cell["estimator"]]["name"]
            runs.setdefault(name, []).append((cell["settled_runs"], cell["runs"]))
    for row in body:
        settled, total = map(sum, zip(*runs.get(row[0], [(0, 0)]), strict=True))
        row.insert(2, f"{100 * settled // total} %" if total else "—")
    return [*heading[:2], "others settle", *heading[2:]], body


def cold_start(document: Document) -> str:
    """Error of the controller in the first period from a cold start, on the first stage [%]."""
    at = ("AdaptiveFeedforward", "cold-start", document["plan"]["stages"][0])
    cells = {(cell["estimator"], cell["scenario"], cell["stage"]): cell for cell in document["cells"]}
    return report.percent(cells[at]["first"][0])


def replacements(prefix: str, values: dict[str, Any], document: Document | None = None) -> str:
    """Substitutions for numbers that stand in sentences; with a document, when and where it was made, too."""
    if document is not None:
        date = document["date"][:10] + since(document)
        values = {"date": date, "machine": machine_of(document), **values}
    return "".join(f".. |{prefix} {name}| replace:: {value}\n" for name, value in values.items())


def since(document: Document) -> str:
    """Which code has changed since a document was made, for a sentence; nothing if none has."""
    changed = ", ".join(document["changed"])
    return f" (since then the code of {changed} has changed)" if changed else ""


def percent(share: float | None) -> str:
    return "—" if share is None else f"{100.0 * share:.3g} %"


def of_all(count: int, total: int) -> str:
    """A count, the total, and the share in per cent."""
    return f"{count} of {total} ({percent(count / total)})" if total else "—"
