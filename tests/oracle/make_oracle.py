"""Write ``oracle.npz`` by the code as it is: ``python -m tests.oracle.make_oracle [FILE]``."""

import sys
from pathlib import Path

import numpy as np

from tests.oracle import storage
from tests.oracle.cases import CASES

if __name__ == "__main__":
    numbers = {name: np.concatenate(list(storage.sampled(case()).values())) for name, case in CASES.items()}
    storage.write(numbers, Path(sys.argv[1]) if len(sys.argv) > 1 else storage.FILE, storage.home())
