"""Write ``oracle.npz`` by the code as it is: ``python -m tests.oracle.make_oracle [FILE [PREFIX ...]]``.

With prefixes of names only those cases are made anew, and the others stay; the computer must be the file's.
"""

import sys
from pathlib import Path

import numpy as np

from tests.oracle import storage
from tests.oracle.cases import CASES


def main(path: Path, prefixes: tuple[str, ...]) -> None:
    kept: dict[str, storage.Array] = {}
    if prefixes:
        made, kept = storage.read(path)
        if made != storage.home():
            raise SystemExit("the file was made on another computer: make all of its cases anew")
    numbers = {
        name: kept[name]
        if prefixes and name in kept and not name.startswith(prefixes)
        else np.concatenate(list(storage.sampled(case()).values()))
        for name, case in CASES.items()
    }
    storage.write(numbers, path, storage.home())


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else storage.FILE, tuple(sys.argv[2:]))
