"""One run: a rig and a controller in, a row out."""

from typing import Any, NamedTuple

import numpy as np

from piezoest.bench.origin import json_safe
from piezoest.bench.store import Row
from piezoest.bench.zoo.judging import Lines, judge
from piezoest.bench.zoo.learnt_line import run_learnt_line
from piezoest.bench.zoo.line import fit_line
from piezoest.bench.zoo.naming import named
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Factory, Traces, run_controller, run_line


class Both(NamedTuple):
    """Traces of the controller, None if it failed; the lines, and what the controller said."""

    run: Traces | None
    lines: Lines
    events: tuple[Any, ...] = ()


def play(rig: Rig, factory: Factory) -> Row:
    """Let a controller drive a rig, and judge it; see `traced`."""
    return traced(rig, factory)[0]


def traced(rig: Rig, factory: Factory) -> tuple[Row, Both]:
    """Let a controller drive a rig, and judge it beside straight lines."""
    line = fit_line(rig)
    lines = Lines(line, run_line(rig, line), *run_learnt_line(rig, line))
    row = {**rig.to_dict(), "line_gain": line.gain, "line_centre": line.centre, "failure": None}
    run: Traces | None = None
    controller: Any = None
    try:
        controller = factory(rig.sample_rate, rig.limits)
        with np.errstate(all="ignore"):
            run, seconds = run_controller(rig, controller)
            row |= judge(rig, run, lines)
            row |= named(rig, controller)
        row["microseconds"] = 1e6 * seconds / run.reference.size
    except Exception as error:
        row["failure"] = f"{type(error).__name__}: {error}"
    row = dict(json_safe(row))
    return row, Both(run, lines, tuple(getattr(controller, "events", ())))
