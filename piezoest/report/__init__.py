"""Reports as one page of HTML, which needs no network and no server."""

from piezoest.report.identified import write_report
from piezoest.report.page import Page

__all__ = ["Page", "write_report"]
