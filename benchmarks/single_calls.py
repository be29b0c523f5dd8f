"""Times of single calls, of whole turns of the ring, and of new processes; part of speed.py."""

from __future__ import annotations

import gc
import itertools
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from c_reference import FloatArray

LATE = 20_000  # [ns], a sample at 50 kHz


def calls(
    function: Callable[..., Any], *columns: FloatArray, count: int | None = None, collect: bool = True
) -> dict[str, float]:
    """Time single calls [ns], the clock's own time taken off: median, 99.9 %, share within 20 µs.

    The columns are gone through again and again until there were `count` calls. Beside the calls that
    came late stands how often the system took the processor away meanwhile.
    """
    clock = time.perf_counter_ns
    rows = list(zip(*(column.tolist() for column in columns), strict=True))
    count = len(rows) if count is None else count
    empty = []
    for _ in range(10_000):
        began = clock()
        empty.append(clock() - began)
    taken = np.empty(count, dtype=np.uint32)
    if not collect:
        gc.disable()
    before = resource.getrusage(resource.RUSAGE_SELF)
    for k, row in enumerate(itertools.islice(itertools.cycle(rows), count)):
        began = clock()
        function(*row)
        taken[k] = min(clock() - began, 2**32 - 1)
    after = resource.getrusage(resource.RUSAGE_SELF)
    gc.enable()
    own = taken - np.median(empty)
    return {
        "calls": count,
        "median": float(np.median(own)),
        "p99": float(np.percentile(own, 99.0)),
        "p99.9": float(np.percentile(own, 99.9)),
        "longest": float(own.max()),
        "within_20us": float(np.mean(own <= LATE)),
        "late": int(np.sum(own > LATE)),
        "preempted": after.ru_nivcsw - before.ru_nivcsw,
        "page_faults": after.ru_minflt - before.ru_minflt,
    }


def disturbances(seconds: float = 1.0, least: int = 5_000) -> dict[str, float]:
    """How often a second the clock, read again and again, jumps by more than `least` [ns]; the median jump.

    Nothing of the library runs: what takes the processor away here takes it from any call.
    """
    clock = time.perf_counter_ns
    began = last = clock()
    jumps = []
    while last - began < 1e9 * seconds:
        now = clock()
        if now - last > least:
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
