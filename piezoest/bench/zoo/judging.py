"""Whether a run was safe, and how good: the numbers of its row."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo.faults import PERMANENT, TRANSIENT
from piezoest.bench.zoo.line import FittedLine
from piezoest.bench.zoo.naming import recovery, settled
from piezoest.bench.zoo.rig import Rig
from piezoest.bench.zoo.running import Traces

ALLOWED, NOISES, NEGLIGIBLE = 1.5, 3.0, 0.002  # of the line's error, of the noise, of the swing
AT_LIMIT, WITHIN = 1e-6, 0.01  # of the voltage's range: on a limit, and clearly within both
ERRORS = ("worst", "rms", "line_worst", "line_rms", "learnt_worst", "learnt_rms", "ratio", "ratio_rms")


class Lines(NamedTuple):
    """The line drawn in hindsight; traces under it and under the learnt one, and from when on that drives."""

    line: FittedLine
    fitted: Traces
    learnt: Traces
    knows: int


def judge(rig: Rig, run: Traces, lines: Lines) -> dict[str, Any]:
    """Numbers of a run beside the larger error of both lines in each part; None where nothing is judged."""
    n, first, cycle = run.reference.size, rig.judged_from, rig.plain.cycle
    swing = 2.0 * rig.plain.amplitude
    floor = max(NOISES * rig.noise * abs(rig.coordinates[0]), NEGLIGIBLE * swing)
    error = np.abs(run.error)
    errors_line = [np.abs(each.error) for each in (lines.fitted, lines.learnt)]
    finite = bool(np.all(np.isfinite(run.voltage)))
    low, high = rig.reach.low, rig.reach.high
    row: dict[str, Any] = {
        "finite": finite,
        "within_limits": bool(np.all((run.voltage >= low) & (run.voltage <= high))),
        "rail": _rail(rig, run, lines)[first:].max(initial=0) / (0.125 * rig.plain.wave),
        "swing": swing,
        "noise": rig.noise,
        "floor": floor,
        "judged_from": first / rig.sample_rate,
    }
    row["rests_at_rail"] = bool(row["rail"] > 1.0)
    last = min(cycle, n - first)
    windows = {"": slice(first, n), "last_": slice(n - last, n), "after_": _after(rig)}
    for name, window in windows.items():
        row |= _compared(name, error[window], [each[window] for each in errors_line], floor)
    row["cycle_ratio"] = _in_each_cycle(cycle, error[first:], [each[first:] for each in errors_line], floor)
    return {**row, "settled": settled(error[first:], cycle), **recovery(rig, error, floor)}


def _after(rig: Rig) -> slice:
    """After the end of a transient fault, or the beginning of one that stays, and time to learn."""
    n, fault = rig.plain.values.size, rig.fault
    if fault.mode not in (TRANSIENT, PERMANENT):
        return slice(n, n)
    over = fault.stop if fault.mode == TRANSIENT else fault.start
    return slice(min(over + rig.learning, n), n)


def _compared(
    name: str, error: FloatArray, errors_line: Sequence[FloatArray], floor: float
) -> dict[str, Any]:
    """Worst and rms error of a part; the larger ones of the lines, and the learnt one's; both ratios."""
    if error.size == 0:
        return dict.fromkeys(f"{name}{column}" for column in ERRORS)
    found = {}
    for column, of in (("worst", np.max), ("rms", _rms)):
        found[f"{name}{column}"] = float(of(error))
        found[f"{name}line_{column}"] = max(float(of(each)) for each in errors_line)
        found[f"{name}learnt_{column}"] = float(of(errors_line[-1]))
    ratio = [
        found[f"{name}{column}"] / max(ALLOWED * found[f"{name}line_{column}"], floor)
        for column in ("worst", "rms")
    ]
    return {**found, f"{name}ratio": ratio[0], f"{name}ratio_rms": ratio[1]}


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


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


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
