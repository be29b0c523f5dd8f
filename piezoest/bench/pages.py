"""Results of a benchmark as one page of HTML, from the document alone."""

from pathlib import Path
from typing import Any

from piezoest.bench import figures, paper_report, report
from piezoest.report import Page

Document = dict[str, Any]  # from `piezoest.bench.table.describe`

HEADINGS = {"overview": "Errors", "adaptation": "Adaptation", "settled": "Where each is weak", "cost": "Cost"}


def write_html(document: Document, path: str | Path) -> None:
    """Write a result of `piezoest bench` as one page that needs no network."""
    suite, machine = document["suite"], document["machine"]
    page = Page(f"piezoest bench: {suite}", f"{document['date'][:10]}, {machine['cpu']}, {machine['python']}")
    (_paper if suite == "paper" else _table)(page, document)
    page.footer(", ".join(f"{name} {version}" for name, version in document["versions"].items()))
    page.write(path)


def _table(page: Page, document: Document) -> None:
    page.table(*report.overview_table(document))
    page.text(report.LOGS_KEY if report.on_logs(document) else report.KEY)
    page.advice(f"Failed: {failure}" for failure in document["failures"])
    if document["needs"] and not report.on_logs(document):
        page.heading("Which estimator")
        page.table(*report.needs_table(document))
    for name, figure in figures.drawings(document).items():
        page.heading(HEADINGS[name])
        page.picture(figure, name)
    for scenario, stage in dict.fromkeys((cell["scenario"], cell["stage"]) for cell in document["cells"]):
        page.heading(f"{scenario}, {stage}" if stage else scenario)
        page.text(document["scenarios"][scenario])
        page.table(*report.scenario_table(document, scenario, stage))


def _paper(page: Page, document: Document) -> None:
    page.table(*paper_report.verdict(document["tables"]), paper_report.WITHIN)
    for number, title in paper_report.TITLES.items():
        page.heading(title)
        page.table(*paper_report.table(document["tables"], number))
    page.text(paper_report.KEY)
    page.heading(paper_report.TRANSIENTS)
    page.table(*paper_report.transients(document["adaptation"]))
    if document["memory"]:
        page.heading("Memory of the estimator")
        page.table(*paper_report.memories(document["memory"]))
