"""Check, without a network, that every link, anchor and file that built pages name exists.

Addresses elsewhere are not opened, but none may be needed to show a page: no script, style or picture comes
from another host.

    python docs/check_links.py docs/_build/html
"""

import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# What a page cannot be shown without, by tag and attribute.
NEEDED = {("script", "src"), ("img", "src"), ("link", "href"), ("source", "src"), ("iframe", "src")}
# Parts of Sphinx's own machinery that are no pages to read.
LEFT_OUT = ("_static/webpack-macros.html",)
# Listings of source files: sphinx.ext.viewcode links back from all objects of a file under one module's name,
# though a file may hold objects of two. Of these links only the page is checked.
SOURCES = "_modules"


class Page(HTMLParser):
    """Links of a page, and the anchors that others may point to."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[tuple[int, str, bool]] = []
        self.anchors: set[str] = {""}
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value is None:
                continue
            if name == "id" or (tag == "a" and name == "name"):
                self.anchors.add(value)
            elif name in ("href", "src"):
                needed = (tag, name) in NEEDED and dict(attrs).get("rel") not in ("canonical", "license")
                self.links.append((self.getpos()[0], value, needed))


def broken(folder: Path) -> Iterator[str]:
    """Sentences on links that lead nowhere."""
    paths = [path for path in sorted(folder.rglob("*.html")) if not str(path).endswith(LEFT_OUT)]
    pages = {path.resolve(): Page(path) for path in paths}
    if not pages:
        yield f"{folder}: no pages"
    for path, page in pages.items():
        for line, link, needed in page.links:
            place = f"{path.relative_to(folder.resolve())}:{line}: {link}"
            parts = urlsplit(link)
            if parts.scheme in ("data", "mailto", "javascript"):
                continue
            if parts.scheme or parts.netloc:
                if needed:
                    yield f"{place} comes from elsewhere"
                continue
            anchor = unquote(parts.fragment)
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if target.is_dir():
                target /= "index.html"
            if not target.is_file():
                yield f"{place} does not exist"
            elif SOURCES not in path.parts and target in pages and anchor not in pages[target].anchors:
                yield f"{place}: no such anchor"


if __name__ == "__main__":
    if found := list(broken(Path(sys.argv[1]))):
        sys.exit("\n".join([*found, f"{len(found)} broken links"]))
    print("all links lead somewhere")
