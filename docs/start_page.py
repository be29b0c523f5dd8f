"""What the code of the page `start` prints: it runs at every Sphinx build."""

import contextlib
import io
import re
import tempfile
import textwrap
from typing import Any

from page_parts import DOCS

CODE = re.compile(r"^\.\. code-block:: python\n\n(.*?)(?=^\S|\Z)", re.S | re.M)
SOURCES = ()
MARGIN = {"initial_indent": "   ", "subsequent_indent": "       "}


def pieces() -> dict[str, str]:
    """For the number of each block of code, what it prints."""
    page = (DOCS / "start.rst").read_text(encoding="utf-8")
    texts, names = {}, dict[str, Any]()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for number, block in enumerate(CODE.findall(page), 1):
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                exec(textwrap.dedent(block), names)
            lines = (textwrap.fill(line, 90, **MARGIN) for line in printed.getvalue().splitlines())
            texts[str(number)] = "\n".join([".. code-block:: text", "", *lines, ""])
    return texts
