"""Times of single calls, of whole turns of the ring, and of new processes; part of speed.py."""

from __future__ import annotations

import gc
import itertools
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from c_reference import FloatArray

LATE = 20_000  # [ns], a sample at 50 kHz
JUMP = 5_000  # [ns], more than any call takes that nothing disturbs


@dataclass(frozen=True)
class Calls:
    """A function to time: its arguments' columns, gone through again and again, and how many calls."""

    function: Callable[..., Any]
    columns: tuple[FloatArray, ...]
    count: int
    collect: bool = True


def calls(wanted: dict[str, Calls], rounds: int = 10) -> dict[str, dict[str, float]]:
    """Time single calls [ns], the clock's own time taken off: median, 99 %, 99.9 %, share within 20 µs.

    Each takes its turn in every round, so that what the machine does meanwhile meets all. Beside the calls
    that came late stands how often the system took the processor away.
    """
    rows = {
        name: itertools.cycle(list(zip(*(column.tolist() for column in calls.columns), strict=True)))
        for name, calls in wanted.items()
    }
    measured: dict[str, list[FloatArray]] = {name: [] for name in wanted}
    preempted, page_faults = dict.fromkeys(wanted, 0), dict.fromkeys(wanted, 0)
    for _ in range(rounds):
        for name, each in wanted.items():
            if not each.collect:
                gc.disable()
            before = resource.getrusage(resource.RUSAGE_SELF)
            measured[name].append(_times(each.function, rows[name], max(1, each.count // rounds)))
            after = resource.getrusage(resource.RUSAGE_SELF)
            gc.enable()
            preempted[name] += after.ru_nivcsw - before.ru_nivcsw
            page_faults[name] += after.ru_minflt - before.ru_minflt
    return {
        name: {
            **_summary(np.concatenate(times)),
            "preempted": preempted[name],
            "page_faults": page_faults[name],
        }
        for name, times in measured.items()
    }


def _times(function: Callable[..., Any], rows: Iterator[tuple[float, ...]], count: int) -> FloatArray:
    """Nanoseconds of each of so many calls."""
    clock = time.perf_counter_ns
    empty = []
    for _ in range(1000):
        began = clock()
        empty.append(clock() - began)
    times = np.empty(count, dtype=np.uint32)
    for k, row in enumerate(itertools.islice(rows, count)):
        began = clock()
        function(*row)
        times[k] = min(clock() - began, 2**32 - 1)
    return np.asarray(times - np.median(empty))


def _summary(times: FloatArray) -> dict[str, float]:
    return {
        "calls": times.size,
        "median": float(np.median(times)),
        "p99": float(np.percentile(times, 99.0)),
        "p99.9": float(np.percentile(times, 99.9)),
        "longest": float(times.max()),
        "within_20us": float(np.mean(times <= LATE)),
        "above_5us": float(np.mean(times > JUMP)),
        "late": int(np.sum(times > LATE)),
    }


def disturbances(seconds: float = 3.0) -> dict[str, float]:
    """How often a second the clock, read again and again, jumps by more than 5 and 20 µs; the median jump.

    Nothing of the library runs: what takes the processor away here takes it from any call.
    """
    clock = time.perf_counter_ns
    began = last = clock()
    jumps = []
    while last - began < 1e9 * seconds:
        now = clock()
        if now - last > JUMP:
            jumps.append(now - last)
        last = now
    return {
        "per_second": len(jumps) / seconds,
        "late_per_second": sum(jump > LATE for jump in jumps) / seconds,
        "median": float(np.median(jumps)) if jumps else 0.0,
    }


def cold() -> dict[str, float]:
    """Seconds of import, first step and warmup in new processes with a warm cache, medians of five."""
    programs = {
        "import": "import piezoest as pz; t = time.perf_counter()",
        "first step": "import piezoest as pz; pz.HysteresisRLS(5e4).step(0.0, 0.0); t = time.perf_counter()",
        # What loading any compiled function from a cache takes, before the function itself.
        "Numba alone": "from numba.core.registry import cpu_target as c; c.typing_context.refresh(); "
        "c.target_context.refresh(); t = time.perf_counter()",
        "warmup": "import piezoest as pz; pz.warmup(); t = time.perf_counter()",
    }
    found = {}
    for name, program in programs.items():
        code = f"import time; s = time.perf_counter(); {program}; print(t - s)"
        times = [
            float(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)
            for _ in range(5)
        ]
        found[name] = float(np.median(times))
    return found
