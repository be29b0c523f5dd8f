"""The file of the oracle: some numbers of every case, and a fingerprint of all of them."""

import hashlib
import json
import platform
from pathlib import Path
from typing import NamedTuple

import llvmlite.binding
import numba
import numpy as np
import scipy
from numpy.typing import NDArray

from tests.oracle.outcome import Outcome
from tests.oracle.records import Array

FILE = Path(__file__).with_name("oracle.npz")
# Numbers that are kept of a case, shared by its arrays, and the least of each array.
KEPT, LEAST = 60, 3
# What is smaller than this part of an array's largest number is compared as if it were as large.
FLOOR = 1e-3


class Stored(NamedTuple):
    """One array of a case as the file has it."""

    size: int
    fingerprint: int
    kept: Array


def home() -> dict[str, str]:
    """What the last bit depends on: processor and libraries."""
    features = json.dumps(sorted(llvmlite.binding.get_host_cpu_features().items()))
    return {
        "cpu": llvmlite.binding.get_host_cpu_name(),
        "features": hashlib.sha256(features.encode()).hexdigest()[:16],
        "machine": platform.machine(),
        "libc": " ".join(platform.libc_ver()),
        "numpy": np.__version__,
        # Which of its loops NumPy chose for this processor.
        "loops": json.dumps(
            np.lib.introspect.opt_func_info(func_name="^(exp|expm1|log|sin|sqrt)$"), sort_keys=True
        ),
        "numba": numba.__version__,
        "llvm": ".".join(map(str, llvmlite.binding.llvm_version_info)),
        "scipy": scipy.__version__,
    }


def fingerprint(values: Array) -> int:
    """Hash of all bits; one NaN is as good as another, and so is the sign of a zero."""
    canonical = np.where(np.isnan(values), np.nan, values + 0.0)
    return int.from_bytes(hashlib.blake2b(canonical.tobytes(), digest_size=4).digest(), "little")


def places(size: int, arrays: int) -> NDArray[np.int64]:
    """Positions that are kept of an array, evenly from the first to the last."""
    count = min(size, max(LEAST, KEPT // arrays))
    return np.unique(np.linspace(0, size - 1, count).astype(np.int64)) if size else np.empty(0, np.int64)


def stored(outcome: Outcome) -> dict[str, Stored]:
    return {
        name: Stored(values.size, fingerprint(values), values[places(values.size, len(outcome))])
        for name, values in outcome.items()
    }


def write(entries: dict[str, dict[str, Stored]], path: Path = FILE) -> None:
    index = {name: {key: array.size for key, array in entry.items()} for name, entry in entries.items()}
    arrays = [array for entry in entries.values() for array in entry.values()]
    text = json.dumps({"home": home(), "cases": index}, separators=(",", ":"))
    np.savez_compressed(
        path,
        index=np.frombuffer(text.encode(), dtype=np.uint8),
        fingerprints=np.array([array.fingerprint for array in arrays], dtype=np.uint32),
        # Bytes of one significance stand together, which packs better.
        kept=np.concatenate([array.kept for array in arrays]).view(np.uint8).reshape(-1, 8).T.copy(),
    )


def read(path: Path = FILE) -> tuple[dict[str, str], dict[str, dict[str, Stored]]]:
    """Where the file was made, and all cases in it."""
    with np.load(path) as file:
        data = json.loads(file["index"].tobytes().decode())
        fingerprints = iter(file["fingerprints"].tolist())
        kept = np.ascontiguousarray(file["kept"].T).view(np.float64).ravel()
    cases: dict[str, dict[str, Stored]] = {}
    start = 0
    for name, sizes in data["cases"].items():
        cases[name] = {}
        for key, size in sizes.items():
            stop = start + places(size, len(sizes)).size
            cases[name][key] = Stored(size, next(fingerprints), kept[start:stop])
            start = stop
    return data["home"], cases


def differences(outcome: Outcome, expected: dict[str, Stored], tolerance: dict[str, float]) -> list[str]:
    """What differs from the file, in words, by each array's tolerance: of zero by the last bit."""
    if outcome.keys() != expected.keys():
        return [f"arrays {sorted(outcome)} instead of {sorted(expected)}"]
    return [
        f"{name}: {text}"
        for name, values in outcome.items()
        if (text := _difference(values, expected[name], len(outcome), tolerance[name]))
    ]


def _difference(values: Array, expected: Stored, arrays: int, tolerance: float) -> str:
    if values.size != expected.size:
        return f"{values.size} numbers instead of {expected.size}"
    if tolerance == 0.0 and fingerprint(values) == expected.fingerprint:
        return ""
    index = places(values.size, arrays)
    new, old = values[index], expected.kept
    finite = np.isfinite(old)
    with np.errstate(invalid="ignore", over="ignore"):
        floor = FLOOR * np.max(np.abs(old[finite]), initial=0.0)
        error = np.abs(new - old) / np.maximum(np.abs(old), max(floor, np.finfo(np.float64).tiny))
    same = (new == old) | (np.isnan(new) & np.isnan(old))
    error = np.where(same, 0.0, np.where(np.isfinite(error), error, np.inf))
    worst = int(np.argmax(error)) if error.size else 0
    if error.size and error[worst] > tolerance:
        return (
            f"{np.count_nonzero(error > tolerance)} of {error.size} kept numbers differ, most at "
            f"[{index[worst]}] of {values.size}: {new[worst]:.17g} instead of {old[worst]:.17g}, "
            f"relative {error[worst]:.3g}"
        )
    return "" if tolerance else "bits differ, in none of the numbers that are kept"
