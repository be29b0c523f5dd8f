"""Every case gives what the file says: to the last bit where the file was made, else closely."""

import os
from pathlib import Path

import numpy as np
import pytest

from tests.oracle import make_oracle as storage
from tests.oracle.cases import CASES

# Another file, written on this computer by the code to compare with, makes it a comparison of bits here too.
MADE, STORED = storage.read(Path(os.environ.get("PIEZOEST_ORACLE", storage.FILE)))
# Elsewhere, with the BLAS of another processor, 9e-10 was seen.
TOLERANCE = 0.0 if storage.home() == MADE else 1e-7


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if "default" not in name else ()) for name in CASES]
)
def test_case(name: str) -> None:
    assert name in STORED, "not in the file: python -m tests.oracle.make_oracle"
    found, old = storage.sampled(CASES[name]()), STORED[name]
    sizes = [values.size for values in found.values()]
    assert sum(sizes) == old.size
    for (array, new), expected in zip(found.items(), np.split(old, np.cumsum(sizes)[:-1]), strict=True):
        # What is smaller than this part of an array's largest number is compared as if it were as large.
        floor = 1e-3 * np.max(np.abs(expected[np.isfinite(expected)]), initial=0.0)
        np.testing.assert_allclose(new, expected, rtol=TOLERANCE, atol=TOLERANCE * floor, err_msg=array)
