"""Write ``oracle.npz`` by the code as it is: ``python -m tests.oracle.make_oracle [FILE]``."""

from __future__ import annotations

import sys
import time
from pathlib import Path

from tests.oracle import storage
from tests.oracle.cases import CASES


def main(path: Path) -> None:
    outcomes, slow = {}, []
    for name, case in CASES.items():
        start = time.perf_counter()
        outcomes[name] = case()
        slow.append((time.perf_counter() - start, name))
    storage.write(outcomes, path)
    print(f"{len(outcomes)} cases, {path.stat().st_size / 1000:.0f} kB in {path}; the slowest:")
    for seconds, name in sorted(slow, reverse=True)[:12]:
        print(f"{seconds:8.2f} s  {name}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else storage.FILE)
