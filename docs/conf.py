"""Sphinx configuration. The build needs no network, and neither do the pages it makes."""

import re
import sys
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import piezoest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

project = "piezoest"
author = "The piezoest developers"
copyright = f"2026, {author}"
version = release = piezoest.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
    "sphinx-mathjax-offline",
]
templates_path = ["_templates"]
exclude_patterns = ["_build", "examples", "sg_execution_times.rst", "gallery/sg_execution_times.rst"]
source_suffix = {".rst": "restructuredtext", ".md": "markdown"}

# Docstrings put symbols and code in single backticks.
default_role = "literal"

autosummary_generate = True
autodoc_member_order = "bysource"
# The types are in the Parameters sections, in words.
autodoc_typehints = "none"
numpydoc_show_class_members = False
toc_object_entries_show_parents = "hide"

html_theme = "pydata_sphinx_theme"
html_title = "piezoest"
html_show_sourcelink = False
html_static_path = ["_static"]
html_css_files = ["page.css"]
html_context = {"default_mode": "auto"}
html_theme_options = {
    "show_toc_level": 2,
    "header_links_before_dropdown": 4,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
# The pages of this folder list what they lead to themselves.
html_sidebars: dict[str, list[str]] = {"*": []}

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "capture_repr": (),
    "show_memory": False,
    "show_signature": False,
}


def escape_symbols(line: str) -> str:
    r"""Escape what docstrings mean literally, outside of literals.

    `|` is an absolute value and not a substitution; `*arguments` does not begin an emphasis.
    """
    parts = re.split(r"(``.*?``|`.*?`)", line)
    return "".join(
        piece if piece.startswith("`") else re.sub(r"\||(?<![\w*\\])\*(?=\w)(?!.*\w\*)", r"\\\g<0>", piece)
        for piece in parts
    )


def process_docstring(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Escape symbols in running text, not in the indented blocks of directives and code."""
    block: int | None = None
    for i, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        if block is not None and line.strip() and indent <= block:
            block = None
        if block is None:
            lines[i] = escape_symbols(line)
            if line.rstrip().endswith("::"):
                block = indent


def setup(app: Any) -> None:
    write = import_module("page_parts").write_page
    for page in sorted(HERE.glob("*_page.py")):
        app.connect("builder-inited", partial(write, import_module(page.stem)))
    # After numpydoc (500), which makes sections of the docstring.
    app.connect("autodoc-process-docstring", process_docstring, priority=600)
