"""The head that every file of results has, and where such a file goes."""

from __future__ import annotations

import json
import math
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


def json_text(document: dict[str, Any]) -> str:
    """Text of a document."""
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def put(document: dict[str, Any], path: Path | None) -> None:
    """Write results to a file, or print them where there is none."""
    if path is None:
        print(json_text(document), end="")
    else:
        write_text(path, json_text(document))


def json_safe(value: Any, digits: int | None = None) -> Any:
    """The same with plain lists, None for what is not finite, and so many significant digits."""
    match value:
        case dict():
            return {key: json_safe(item, digits) for key, item in value.items()}
        case list() | tuple():
            return [json_safe(item, digits) for item in value]
        case float() if not math.isfinite(value):
            return None
        case float() if digits is not None:
            return float(f"{value:.{digits}g}")
    return value
