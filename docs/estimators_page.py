"""Tables and numbers of the page `estimators`, made from docs/data; no number is typed by hand.

Runs at the start of every Sphinx build; by itself: python docs/estimators_page.py
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paper_page import table, write_pieces

DOCS = Path(__file__).resolve().parent
DATA = DOCS / "data"
TARGET = DOCS / "generated" / "estimators"
NAMES = ("estimators", "speed", "consistency")
# Least part of the runs that must lie within three standard errors.
CONSISTENT = 0.95

Document = dict[str, Any]


def write(app: Any = None) -> None:
    """Write what the page includes."""
    documents = {name: json.loads((DATA / f"{name}.json").read_text(encoding="utf-8")) for name in NAMES}
    write_pieces(TARGET, pieces(documents))


def pieces(documents: Mapping[str, Document]) -> dict[str, str]:
    """Texts by the name of their file."""
    ring, speed, known = (documents[name] for name in NAMES)
    return {
        "ring": ring_table(ring),
        "options": options(ring),
        "consistency": consistency_table(known),
        "inconsistent": inconsistent(known),
        "fits": fits_table(speed),
        "numbers": numbers(ring, speed, known),
    }


def ring_table(document: Document) -> str:
    """Errors and costs of each estimator in the ring."""
    heading = [
        "estimator", "settled, µm", "settles, s (periods)", "run, µs", "step, µs", "longest step, µs", "kB",
    ]  # fmt: skip
    body = []
    for row in document["rows"]:
        if row["failure"] is not None:
            body.append([row["name"], f"failed: {row['failure']}", *["—"] * 5])
            continue
        periods, seconds = row["settling_periods"], row["settling_time"]
        body.append(
            [
                row["name"],
                f"{row['settled_error']:.4f}",
                "never" if seconds is None else f"{seconds:.1f} ({periods})",
                short(row["run_microseconds"]),
                short(row["step_microseconds"]),
                f"{row['longest_step_microseconds']:.0f}",
                f"{row['memory_bytes'] / 1e3:.1f}",
            ]
        )
    return table("The same run for all", heading, body)


def options(document: Document) -> str:
    """Arguments beside the defaults, as list items."""
    items = [
        f"- ``{row['name']}(…, {words(row['options'])})``\n" for row in document["rows"] if row.get("options")
    ]
    return "".join(items)


def consistency_table(document: Document) -> str:
    """What estimators say of their errors, and what is true."""
    heading = [
        "estimator", "with", "Hz", "within three", "error / standard error", "√P / standard error",
    ]  # fmt: skip
    body = [
        [
            row["name"],
            words(row["options"]) or "defaults",
            f"{row['sample_rate']:g}",
            f"{100.0 * row['within_three']:.1f} %" + ("" if row["within_three"] >= CONSISTENT else " ✗"),
            ", ".join(f"{value:.2f}" for value in row["errors_by_said"]),
            ", ".join(f"{value:.3g}" for value in row["alone_by_said"]),
        ]
        for row in document["rows"]
    ]
    return table(f"{document['runs']} seeds; of α, β, γ", heading, body)


def inconsistent(document: Document) -> str:
    """A sentence for each estimator whose errors are larger than it says."""
    items = []
    for row in document["rows"]:
        if row["within_three"] < CONSISTENT:
            ratio = max(row["errors_by_said"])
            items.append(
                f"- ``{row['name']}`` is not consistent: its errors are {ratio:.3g} times those it reports, "
                f"and only {100.0 * row['within_three']:.1f} % of the runs lie within three of them.\n"
            )
    return "".join(items) or "Every row keeps the promise: at least 95 % of the runs within three.\n"


def fits_table(document: Document) -> str:
    """Times of fits and solves, and their ratio to a simulation."""
    body = [
        [row["name"], str(row["samples"]), short(1e3 * row["seconds"]), f"{row['simulations']:.0f}"]
        for row in document["fits"]
    ]
    return table("One fit, one solve", ["", "samples", "ms", "simulations"], body)


def numbers(ring: Document, speed: Document, known: Document) -> str:
    """Substitutions for numbers that stand in sentences."""
    scenario = ring["scenario"]
    solve, full = (row for row in speed["fits"] if row["name"].startswith("MovingHorizon"))
    bare, face = (
        next(row for row in speed["against_python"] if row["peer"] == peer)
        for peer in ("filterpy's EKF, bare loop", "FilterPyEKF.run")
    )
    paper = next(row for row in known["rows"] if row["options"].get("memory"))
    low, high = min(paper["alone_by_said"]), max(paper["alone_by_said"])
    values = {
        "date": ring["date"][:10],
        "machine": f"{ring['machine']['cpu']}, {ring['machine']['cores']} cores, {ring['machine']['python']}",
        "library": ring["versions"]["piezoest"],
        "ring": f"{scenario['amplitude_um']:g} µm at {scenario['frequency_hz']:g} Hz for "
        f"{scenario['seconds']:g} s, sampled at {scenario['sample_rate']:g} Hz",
        "settled_below": f"{100.0 * scenario['settled_below']:g} %",
        "update_interval": f"{1e3 * scenario['update_interval_s']:g} ms",
        "seed": scenario["seed"],
        "fits_date": speed["date"][:10],
        "solve": f"{1e3 * solve['seconds']:.0f} ms",
        "full_solve": f"{1e3 * full['seconds']:.0f} ms",
        "runs": known["runs"],
        "known_date": known["date"][:10],
        "by_P": f"{low:.0f} to {high:.0f}",
        "parity_samples": f"{speed['slow']} samples",
        "parity": f"{bare['difference']:.0e}",
        "parity_times": f"{1.0 / bare['ratio']:.0f}",
        "parity_compiled": f"{1e-3 * bare['ns']:.2f} µs",
        "parity_filterpy": f"{1e-3 * bare['peer_ns']:.0f} µs",
        "parity_face": f"{1e-3 * face['peer_ns']:.0f} µs",
    }
    return "".join(f".. |{name}| replace:: {value}\n" for name, value in values.items())


def words(arguments: Mapping[str, Any]) -> str:
    """Arguments as they are written in a call."""
    return ", ".join(f"{name}={value!r}" for name, value in arguments.items())


def short(value: float | None) -> str:
    """About three significant digits."""
    return "—" if value is None else f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


if __name__ == "__main__":
    write()
