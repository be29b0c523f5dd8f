"""One run: a rig and a controller in, a row out; whether it was safe, how good, and what was said."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.origin import json_safe
from piezoest.bench.store import Row
from piezoest.bench.zoo.faults import PERMANENT, TRANSIENT
from piezoest.bench.zoo.line import FittedLine, fit_line, run_learnt_line, run_line
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Factory, Traces, run_controller

LAST = 3  # cycles that a settled error is taken over, and the least number after a fault that tells anything
BACK = 1.2  # of the settled error
ALLOWED, NOISES, NEGLIGIBLE = 1.5, 3.0, 0.002  # of the line's error, of the noise, of the swing
AT_LIMIT, WITHIN = 1e-6, 0.01  # of the voltage's range: on a limit, and clearly within both
ERRORS = ("worst", "line_worst", "learnt_worst", "ratio")


def named(rig: Rig, controller: Any) -> dict[str, Any]:
    """What a controller said: names of faults, how soon after the fault the right one, what drove at last."""
    status = getattr(controller, "status", {})
    now = status if isinstance(status, dict) else {"driving": getattr(status, "driving", None)}
    drives = now.get("driving", now.get("model"))
    fault, start = rig.fault, rig.fault.start / rig.sample_rate
    said = [(float(event.time), _name(event)) for event in getattr(controller, "events", ())]
    right = [time - start for time, name in said if time >= start and name in fault.names]
    return {
        "events": len(said),
        "named": "; ".join(dict.fromkeys(name for _, name in said)),
        "named_right": bool(right) if fault.names else None,
        "named_periods": right[0] * rig.plain.frequency if right else None,
        "driver": str(drives)[:80] if drives is not None else None,
    }


def settled(error: FloatArray, cycle: int) -> float | None:
    """Median of the largest errors in the last cycles, None if there is none."""
    ends = [error[max(0, error.size - (k + 1) * cycle) : error.size - k * cycle] for k in range(LAST)]
    worst = [float(part.max()) for part in ends if part.size]
    return float(np.median(worst)) if worst else None


def recovery(rig: Rig, error: FloatArray, floor: float) -> dict[str, Any]:
    """How soon after a transient fault the error is as small as before.

    `error` (N,): absolute errors of the run [µm]. `floor`: error that is small anyway [µm]. Returns
    ``recovery``: whether it is judged, which needs three more cycles of a reference that repeats itself.
    ``recovered``: the first cycle after the fault whose largest error is below 1.2 times the settled one
    before it, or at the end if the fault was there at the start; None if there is no such cycle.
    """
    fault, cycle, first = rig.fault, rig.plain.cycle, rig.judged_from
    after = [error[begin : begin + cycle].max() for begin in range(fault.stop, error.size - cycle + 1, cycle)]
    if fault.mode != TRANSIENT or not rig.plain.repeats or len(after) < LAST:
        return {"recovery": False, "recovered": None}
    level = settled(error[first : fault.start] if first < fault.start else error[first:], cycle)
    small = np.flatnonzero(np.array(after) < BACK * max(level or 0.0, floor))
    return {"recovery": True, "recovered": int(small[0]) + 1 if small.size else None}


def _name(event: Any) -> str:
    """The fault's name where a reason begins with it, else what was done."""
    head = str(getattr(event, "reason", "")).partition(":")
    return head[0] if head[1] else str(getattr(event, "name", None) or getattr(event, "action", ""))


class Lines(NamedTuple):
    """The line drawn in hindsight; traces under it and under the learnt one, and from when on that drives."""

    line: FittedLine
    fitted: Traces
    learnt: Traces
    knows: int


@np.errstate(all="ignore")
def judge(rig: Rig, run: Traces, lines: Lines) -> dict[str, Any]:
    """Numbers of a run beside the larger error of both lines in each part; None where nothing is judged."""
    n, first, cycle = run.reference.size, rig.judged_from, rig.plain.cycle
    swing = 2.0 * rig.plain.amplitude
    floor = max(NOISES * rig.noise * abs(rig.coordinates[0]), NEGLIGIBLE * swing)
    error = np.abs(run.error)
    errors_line = [np.abs(each.error) for each in (lines.fitted, lines.learnt)]
    u = run.voltage
    row: dict[str, Any] = {
        "finite": bool(np.all(np.isfinite(u))),
        "within_limits": bool(np.all((u >= rig.reach.low) & (u <= rig.reach.high))),
        "rail": _rail(rig, run, lines)[first:].max(initial=0) / (0.125 * rig.plain.wave),
        "swing": swing,
        "noise": rig.noise,
        "floor": floor,
        "judged_from": first / rig.sample_rate,
    }
    row["rests_at_rail"] = bool(row["rail"] > 1.0)
    windows = {"": first, "last_": max(first, n - cycle), "after_": _after(rig)}
    for name, start in windows.items():
        row |= _compared(name, error[start:], [each[start:] for each in errors_line], floor)
    row["cycle_ratio"] = _in_each_cycle(cycle, error[first:], [each[first:] for each in errors_line], floor)
    return {**row, "settled": settled(error[first:], cycle), **recovery(rig, error, floor)}


def _after(rig: Rig) -> int:
    """First sample after a transient fault, or the beginning of one that stays, and time to learn."""
    n, fault = rig.plain.values.size, rig.fault
    over = {TRANSIENT: fault.stop, PERMANENT: fault.start}.get(fault.mode, n)
    return min(over + rig.learning, n)


def _compared(
    name: str, error: FloatArray, errors_line: Sequence[FloatArray], floor: float
) -> dict[str, Any]:
    """`ERRORS` of a part: of the controller, of the worse line and of the learnt one; and the ratio."""
    names = [f"{name}{column}" for column in ERRORS]
    if error.size == 0:
        return dict.fromkeys(names)
    worst, *of_lines = (float(np.max(each)) for each in (error, *errors_line))
    line = max(of_lines)
    return dict(zip(names, (worst, line, of_lines[-1], worst / max(ALLOWED * line, floor)), strict=True))


def _in_each_cycle(
    cycle: int, error: FloatArray, errors_line: Sequence[FloatArray], floor: float
) -> float | None:
    """Largest ratio of all cycles, each with the lines' errors in that very cycle."""
    if error.size == 0:
        return None
    worst, *of_lines = (
        np.maximum.reduceat(each, range(0, each.size, cycle)) for each in (error, *errors_line)
    )
    return float(np.max(worst / np.maximum(ALLOWED * np.maximum(*of_lines), floor)))


def _rail(rig: Rig, run: Traces, lines: Lines) -> Any:
    """For how many samples the voltage has rested at a limit though it should lie within, shape (N,)."""
    low, high = rig.reach.low, rig.reach.high
    span = high - low
    zero = rig.coordinates[1]
    # Where the gain has become smaller, less is within reach.
    needed = lines.line.voltage((run.reference - (zero - zero[0])) / rig.gain_factor)
    # Half a loop beside the line is where an exact inverse may be.
    within = (WITHIN + 0.5 * rig.width) * span
    inside = (needed > low + within) & (needed < high - within)
    # Where the gauge's zero jumps, nobody knows at once.
    for jump in np.flatnonzero(np.diff(zero)) + 1:
        inside[jump : jump + rig.learning] = False
    # Where no reading has been true, nobody knows where to go.
    inside[: lines.knows] = False
    u = run.voltage
    rests = ((u <= low + AT_LIMIT * span) | (u >= high - AT_LIMIT * span)) & inside
    count = np.cumsum(rests)
    return count - np.maximum.accumulate(np.where(rests, 0, count))


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
        controller = factory(rig.sample_rate, limits=rig.limits)
        run, seconds = run_controller(rig, controller)
        row |= judge(rig, run, lines)
        row |= named(rig, controller)
        row["microseconds"] = 1e6 * seconds / run.reference.size
    except Exception as error:
        row["failure"] = f"{type(error).__name__}: {error}"
    return json_safe(row), Both(run, lines, tuple(getattr(controller, "events", ())))
