"""What a controller said about a fault, and how soon the run was as good as before."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo.faults import NONE, TRANSIENT
from piezoest.bench.zoo.rig import Rig

LAST = 3  # cycles that a settled error is taken over, and the least number after a fault that tells anything
BACK = 1.2  # of the settled error


def named(rig: Rig, controller: Any) -> dict[str, Any]:
    """What a controller said: names of faults, how soon after the fault, and what drove at last."""
    events = list(getattr(controller, "events", ()))
    status = getattr(controller, "status", {})
    status = status if isinstance(status, dict) else _public(status)
    fault, start = rig.fault, rig.fault.start / rig.sample_rate
    said = [(float(event.time), _name(event)) for event in events]
    later = [(time - start, name) for time, name in said if time >= start] if fault.kind != NONE else []
    right = [time for time, name in later if name in fault.names]
    return {
        "events": len(events),
        "named": "; ".join(_distinct(name for _, name in said)),
        "named_first": later[0][1] if later else None,
        "named_after": later[0][0] if later else None,
        "named_right": bool(right) if fault.names else None,
        "named_periods": right[0] * rig.plain.frequency if right else None,
        "driver": next(
            (_short(status[key]) for key in ("driving", "driver", "drives", "model") if key in status), None
        ),
        "status": "; ".join(f"{key}={_short(value)}" for key, value in status.items()),
    }


def settled(error: FloatArray, cycle: int) -> float | None:
    """Median of the largest errors in the last cycles, None if there is none."""
    ends = [error[max(0, error.size - (k + 1) * cycle) : error.size - k * cycle] for k in range(LAST)]
    worst = [float(part.max()) for part in ends if part.size]
    return float(np.median(worst)) if worst else None


def recovery(rig: Rig, error: FloatArray, floor: float) -> dict[str, Any]:
    """How soon after a transient fault the error is as small as before.

    `error` (N,): absolute errors of the run [µm]. `floor`: error that is small anyway [µm]. Returns
    ``recovery``: whether it is judged: after a transient fault, where the reference repeats itself and goes
    on for three cycles. ``recovered``: the cycle, from the fault's end on, in which the largest error is
    below 1.2 times the settled one before the fault; None if none is. Without a settled error before, for the
    fault was there at the start, it is the one at the end.
    """
    fault, cycle, first = rig.fault, rig.plain.cycle, rig.judged_from
    after = [error[begin : begin + cycle].max() for begin in range(fault.stop, error.size - cycle + 1, cycle)]
    asked = fault.mode == TRANSIENT and rig.plain.repeats and len(after) >= LAST
    if not asked:
        return {"recovery": False, "recovered": None}
    level = settled(error[first : fault.start] if first < fault.start else error[first:], cycle)
    small = np.flatnonzero(np.array(after) < BACK * max(level or 0.0, floor))
    return {"recovery": True, "recovered": int(small[0]) + 1 if small.size else None}


def _name(event: Any) -> str:
    """The fault's name where a reason begins with it, else what was done."""
    head = str(getattr(event, "reason", "")).partition(":")
    return head[0] if head[1] else str(getattr(event, "name", None) or getattr(event, "action", ""))


def _public(status: Any) -> dict[str, Any]:
    """Fields of a record."""
    names = getattr(status, "__dataclass_fields__", {})
    return {name: getattr(status, name) for name in names}


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)[:80]


def _distinct(names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(names))
