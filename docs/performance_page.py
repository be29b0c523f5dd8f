"""Tables of the page `performance`, made from docs/data/speed.json; no number is typed by hand.

Runs at the start of every Sphinx build; by itself: python docs/performance_page.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from paper_page import DOCS, table, write_pieces

SOURCE = DOCS / "data" / "speed.json"
TARGET: Path = DOCS / "generated" / "performance"


def write(app: Any = None) -> None:
    """Write what the page includes."""
    write_pieces(TARGET, pieces(json.loads(SOURCE.read_text(encoding="utf-8"))))


def pieces(document: dict[str, Any]) -> dict[str, str]:
    """Texts by the name of their file."""
    machine = document["machine"]
    targets = [
        [row["what"], f"{row['figure']:.3g}", f"{row['target']:g}", "✓" if row["met"] else "✗"]
        for row in document["targets"]
    ]
    times = [
        [name, f"{value:.1f}", ", ".join(f"{number:.4g}" for number in document["outcome"].get(name, [])[:3])]
        for name, value in document["nanoseconds_per_sample"].items()
    ]
    bank = [
        [
            str(row["channels"]),
            str(row["samples"]),
            *(f"{row[name]:.1f}" for name in ("1", "2", "C", "default, 2")),
        ]
        for row in document["bank"]
    ]
    ring = [
        [
            name,
            f"{row['calls']:,}".replace(",", " "),
            f"{1e-3 * row['median']:.2f}",
            f"{1e-3 * row['p99']:.2f}",
            f"{1e-3 * row['p99.9']:.1f}",
            f"{1e-3 * row['longest']:.0f}",
            f"{row['late']}",
            f"{row['preempted']}",
        ]
        for name, row in (
            ("step(u, x)", document["step"]),
            ("one turn", document["ring"]),
            ("one turn, gc off", document["ring_without_gc"]),
        )
    ]
    return {
        "ring": table(
            "Single calls from Python, µs",
            [
                "what",
                "calls",
                "median",
                "99 %",
                "99.9 %",
                "longest",
                "above 20 µs",
                "taken off the processor",
            ],
            ring,
        ),
        "reasons": reasons(document),
        "targets": table("Figures and targets", ["what", "figure", "target", "met"], targets),
        "times": table("Time per sample, and what came out", ["what", "ns", "first numbers"], times),
        "bank": table(
            "A bank of the paper's law: ns per channel and sample",
            ["channels", "samples", "one thread", "two threads", "C, one thread", "the default, two threads"],
            bank,
        ),
        "conditions": (
            f"{document['date'][:10]}, {machine['cpu']}, {machine['cores']} cores, "
            f"Python {machine['python']}, "
            f"Numba {document['versions']['numba']}; "
            f"C by ``{document['compiler']}``; medians of {document['rounds']} interleaved rounds of "
            f"{document['samples']} samples. ``warmup()`` took {document['cold']['warmup']:.2f} s with a "
            "warm cache.\n"
        ),
    }


def reasons(document: dict[str, Any]) -> str:
    """What costs time, and why targets that were missed are out of reach, in measured figures."""
    times, bank = document["nanoseconds_per_sample"], document["bank"]
    learnt = [len(document["outcome"][name]) for name in ("C, 12 plays, bends, creep", "C, 12 plays")]
    turns = [1e-3 * document[name]["median"] for name in ("ring", "ring_without_gc")]
    jumps, step = document["disturbances"], document["step"]
    return (
        f"- *HysteresisRLS.* The C written by hand is the bare law, {times['C, RLS']:.0f} ns. The same "
        "estimator, exported to C and compiled by the same compiler, takes "
        f"{times['exported C, policies off']:.0f} ns with policies off and "
        f"{times['exported C, default']:.0f} ns by default; Numba "
        f"{times['HysteresisRLS, policies off']:.0f} ns and {times['HysteresisRLS, default']:.0f} ns "
        "(``errors=False``). With policies off it is the look for missing samples and gaps, the counts of "
        "`status` and the innovation that come on top of the law: a sample has more instructions, and the "
        "processor begins fewer samples before the last is done. By default it finds the turns of the "
        "voltage, looks for outliers, measures the sensor's noise, lets P grow, follows the loop's level and "
        "learns a fourth parameter; each of these a user can see, and they are not traded for speed. "
        "Standard errors and `excitation` take it to "
        f"{times['HysteresisRLS, policies off, standard errors']:.0f} ns and "
        f"{times['HysteresisRLS, default, standard errors']:.0f} ns.\n"
        "- *HysteresisEKF.* Each sample waits for the one before, in C as here; Joseph's form, the "
        f"projection and the checks are the difference between {times['C, EKF']:.0f} and "
        f"{times['HysteresisEKF']:.0f} ns.\n"
        f"- *PrandtlIshlinskiiRLS* learns {learnt[0]} parameters with 12 thresholds, the level among them: "
        "each play has a slope for each part of the voltage's range, and there is creep. A C loop that "
        f"learns them at every sample takes {times['C, 12 plays, bends, creep']:.0f} ns, this one "
        f"{times['PrandtlIshlinskiiRLS']:.0f}: it gathers what it sees and learns once a window of travel, "
        "but also moves its grid with the voltage's range, keeps slopes above their least, and leaves out "
        f"what no stage can have made. Without bends and creep both learn {learnt[1]}, in "
        f"{times['PrandtlIshlinskiiRLS, no bends, no creep']:.0f} ns here and {times['C, 12 plays']:.0f} in "
        "C.\n"
        "- *EstimatorBank.* The bare law runs on vector instructions over the channels, here as in C "
        f"({bank[0]['1']:.1f} and {bank[0]['C']:.1f} ns on one thread); what a branch would skip is "
        "computed and masked. Rows of samples are asked for before they are needed, which C leaves to the "
        "processor. The default's branches are too many for that, and its exponential is a call: "
        f"its channels go one by one, {bank[0]['default, 2']:.0f} ns on two threads.\n"
        f"- *First step.* A new process has it after {document['cold']['first step']:.2f} s; Numba's own "
        "import and registries, which any function from its cache needs, take "
        f"{document['cold']['Numba alone']:.2f} s by themselves, SciPy's linear algebra among them. An "
        "extension module compiled when the package is built would spare them, at the price of a compiler on "
        "every machine that installs from source and of a second way from the equations to machine code.\n"
        "- *Late calls and turns.* The clock alone, read again and again with nothing between, jumps by more "
        f"than 5 µs {jumps['per_second']:.0f} times a second on this machine, by "
        f"{1e-3 * jumps['median']:.0f} µs as a rule and by more than 20 µs {jumps['late_per_second']:.0f} "
        f"times. That alone would make {1e-7 * jumps['per_second'] * step['median']:.2f} % of calls of "
        f"{1e-3 * step['median']:.2f} µs take more than 5 µs; {100 * step['above_5us']:.2f} % of the calls "
        f"of ``step`` did, and 99 % of them took no more than {1e-3 * step['p99']:.2f} µs. The garbage "
        f"collector changes nothing: a turn takes {turns[0]:.2f} µs with it and {turns[1]:.2f} µs without.\n"
    )


if __name__ == "__main__":
    write()
