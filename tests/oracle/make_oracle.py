"""Write ``oracle.npz`` by the code as it is: ``python -m tests.oracle.make_oracle [FILE [PREFIX ...]]``.

With prefixes of names only those cases are made anew, and the others stay; the computer must be the file's.
"""

import sys
import time
from pathlib import Path

from tests.oracle import storage
from tests.oracle.cases import CASES


def main(path: Path, prefixes: tuple[str, ...]) -> None:
    entries, slow = {}, []
    kept: dict[str, dict[str, storage.Stored]] = {}
    if prefixes:
        made, kept = storage.read(path)
        if made != storage.home():
            raise SystemExit("the file was made on another computer: make all of its cases anew")
    for name, case in CASES.items():
        if prefixes and name in kept and not name.startswith(prefixes):
            entries[name] = kept[name]
            continue
        start = time.perf_counter()
        entries[name] = storage.stored(case())
        slow.append((time.perf_counter() - start, name))
    storage.write(entries, path)
    print(f"{len(slow)} of {len(entries)} cases, {path.stat().st_size / 1000:.0f} kB in {path}; the slowest:")
    for seconds, name in sorted(slow, reverse=True)[:12]:
        print(f"{seconds:8.2f} s  {name}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else storage.FILE, tuple(sys.argv[2:]))
