"""The file of the oracle: some numbers of every case.

Written by the code as it is: ``python -m tests.oracle.make_oracle [FILE]``.
"""

import json
import platform
import sys
from pathlib import Path

import llvmlite.binding
import numba
import numpy as np
import scipy

from tests.oracle.cases import CASES, Array, Outcome

FILE = Path(__file__).with_name("oracle.npz")
# Numbers that are kept of a case, shared by its arrays, and the least of each array.
KEPT, LEAST = 60, 3


def home() -> str:
    """What the last bit depends on: processor and libraries, and which of its loops NumPy chose."""
    features = sorted(name for name, has in llvmlite.binding.get_host_cpu_features().items() if has)
    loops = np.lib.introspect.opt_func_info(func_name="^(exp|expm1|log|sin|sqrt)$")
    libraries = (np.__version__, numba.__version__, scipy.__version__, llvmlite.binding.llvm_version_info)
    computer = (llvmlite.binding.get_host_cpu_name(), features, platform.machine(), platform.libc_ver())
    return json.dumps([computer, libraries, loops])


def sampled(outcome: Outcome) -> Outcome:
    """Numbers of each array, evenly from the first to the last."""
    counts = {name: min(values.size, max(LEAST, KEPT // len(outcome))) for name, values in outcome.items()}
    return {
        name: values[np.unique(np.linspace(0, values.size - 1, counts[name]).astype(int))]
        for name, values in outcome.items()
    }


def write(cases: dict[str, Array], path: Path, home: str) -> None:
    """All numbers in one array, with an index: so many small ones would be as large as the numbers again."""
    index = json.dumps({"home": home, "sizes": {name: values.size for name, values in cases.items()}})
    # Bytes of one significance stand together, which packs better.
    numbers = np.concatenate(list(cases.values())).view(np.uint8).reshape(-1, 8).T.copy()
    np.savez_compressed(path, index=np.array(index), numbers=numbers)


def read(path: Path) -> tuple[str, dict[str, Array]]:
    """Where the file was made, and the numbers of each case."""
    with np.load(path) as file:
        index = json.loads(str(file["index"]))
        numbers = np.ascontiguousarray(file["numbers"].T).view(np.float64).ravel()
    stops = np.cumsum(list(index["sizes"].values()))
    return index["home"], dict(zip(index["sizes"], np.split(numbers, stops[:-1]), strict=True))


if __name__ == "__main__":
    made = {name: np.concatenate(list(sampled(case()).values())) for name, case in CASES.items()}
    write(made, Path(sys.argv[1]) if len(sys.argv) > 1 else FILE, home())
