"""The head that every file of results has, and where such a file goes."""

from __future__ import annotations

import json
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from piezoest._files import write_text
from piezoest.bench.machine import describe_machine, versions


def origin(began: float | None = None) -> dict[str, Any]:
    """When, on what and by which versions; and how long it took since `began` on `time.perf_counter`."""
    head = {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": describe_machine(),
        "versions": versions(),
    }
    return head if began is None else {**head, "seconds": round(time.perf_counter() - began, 1)}


def put(document: dict[str, Any], path: Path | None) -> None:
    """Write results to a file, or print them where there is none."""
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    if path is None:
        print(text)
    else:
        write_text(path, text + "\n")
