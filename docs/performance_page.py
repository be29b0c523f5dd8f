"""Tables and numbers of the page `performance`, from docs/data/speed.json; no number is typed by hand."""

from page_parts import Document, replacements, table, table_of

SOURCES = ("speed",)
CALLS = {
    "call": "name",
    "median, µs": lambda row: f"{1e-3 * row['median']:.2f}",
    "99.9 %, µs": lambda row: f"{1e-3 * row['p99.9']:.2f}",
    "above 20 µs, per second": lambda row: f"{row['late_per_second']:.0f}",
}


def pieces(document: Document) -> dict[str, str]:
    bank = document["bank"]
    return {
        "python": against("Against Python", document["against_python"], faster=True),
        "c": against("Against C", document["against_c"], faster=False),
        "calls": table_of(
            "Single calls from Python",
            [{"name": name, **row} for name, row in document["calls"].items()],
            CALLS,
        ),
        "bank": table(
            "A bank: ns per channel and sample",
            ["channels", "samples", *bank[0]["ns"]],
            [[row["channels"], row["samples"], *(f"{ns:.1f}" for ns in row["ns"].values())] for row in bank],
        ),
        "numbers": numbers(document),
    }


def against(title: str, rows: list[Document], *, faster: bool) -> str:
    """A comparison; the ratio as times faster than the peer, or as times its time."""
    body = []
    for row in rows:
        ratio, asked = row["ratio"], row["at_most"]
        mark = "" if asked is None or ratio <= asked else " ✗"
        if faster:
            ratio, asked = 1.0 / ratio, asked and 1.0 / asked
        times = f"{ratio:.0f}{mark}" if ratio >= 100.0 else f"{ratio:.2g}{mark}"
        limit = "" if asked is None else f"{asked:g}"
        compared = [row["ours"], f"{row['ns']:.0f}", row["peer"], f"{row['peer_ns']:.0f}"]
        body.append([*compared, times, limit, row["peer_does"]])
    said = ("times faster", "asked: at least") if faster else ("times its time", "asked: at most")
    return table(title, ["this library", "ns", "compared with", "ns", *said, "which does"], body)


def numbers(document: Document) -> str:
    once = document["once"]
    rows = document["against_c"] + document["against_python"]
    values = {
        "numba": f"Numba {document['versions']['numba']}",
        "compiler": f"``{document['compiler']}``",
        "load": f"{document['load']:.1f}",
        "samples": document["samples"],
        "slow": document["slow"],
        "rounds": document["rounds"],
        "apart": f"{max(row['difference'] or 0.0 for row in rows):.0e}",
        "import": f"{1e3 * once['import']:.0f} ms",
        "first": f"{once['first step']:.2f} s",
        "warmup": f"{once['warmup']:.1f} s",
        "track": f"{1.0 / once['one second of track()']:.0f}",
    }
    return replacements("speed", values, document)
