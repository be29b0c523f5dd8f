"""Tables and numbers of the page `performance`, from docs/data/speed.json; no number is typed by hand."""

from page_parts import Document, replacements, table

SOURCES = ("speed",)


def pieces(document: Document) -> dict[str, str]:
    bank = document["bank"]
    calls = [
        [
            name, f"{1e-3 * row['median']:.2f}", f"{1e-3 * row['p99.9']:.2f}",
            f"{row['late_per_second']:.0f}",
        ]
        for name, row in document["calls"].items()
    ]  # fmt: skip
    return {
        "python": table("Against Python", *against(document["against_python"], faster=True)),
        "c": table("Against C", *against(document["against_c"], faster=False)),
        "calls": table(
            "Single calls from Python",
            ["call", "median, µs", "99.9 %, µs", "above 20 µs, per second"],
            calls,
        ),
        "bank": table(
            "A bank: ns per channel and sample",
            ["channels", "samples", *bank[0]["ns"]],
            [
                [str(row["channels"]), str(row["samples"]), *(f"{value:.1f}" for value in row["ns"].values())]
                for row in bank
            ],
        ),
        "numbers": numbers(document),
    }


def against(rows: list[Document], *, faster: bool) -> tuple[list[str], list[list[str]]]:
    """Heading and body of a comparison; the ratio as times faster than the peer, or as times its time."""
    body = []
    for row in rows:
        ratio, asked = row["ratio"], row["at_most"]
        mark = "" if asked is None or ratio <= asked else " ✗"
        if faster:
            ratio, asked = 1.0 / ratio, asked and 1.0 / asked
        body.append(
            [
                row["ours"], f"{row['ns']:.0f}", row["peer"], f"{row['peer_ns']:.0f}",
                f"{ratio:.0f}{mark}" if ratio >= 100.0 else f"{ratio:.2g}{mark}",
                "" if asked is None else f"{asked:g}", row["peer_does"],
            ]
        )  # fmt: skip
    said = ("times faster", "asked: at least") if faster else ("times its time", "asked: at most")
    return ["this library", "ns", "compared with", "ns", *said, "which does"], body


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
