"""Every case gives what the file says: to the last bit where the file was made, else closely."""

import os
import re
from pathlib import Path

import pytest

from tests.oracle import storage
from tests.oracle.cases import CASES, TOLERATED, tolerance

# Another file, written on this computer by the code to compare with, makes it a comparison of bits here too.
MADE, STORED = storage.read(Path(os.environ.get("PIEZOEST_ORACLE", storage.FILE)))
AT_HOME = storage.home() == MADE


# What most users run; the rest of the options, each compiled for itself, are slow.
QUICK = re.compile(
    r"(rls|ekf|output-error|plays|horizon|batch|identify)/default/|rls/paper/|ring/(rls|output-error)/"
    r"|identify/|model|stage|compensator/(inverse|bent|line)-(free|tight)|hand-over/inverse-tight"
)


@pytest.mark.parametrize(
    "name", [name if QUICK.match(name) else pytest.param(name, marks=pytest.mark.slow) for name in CASES]
)
def test_case(name: str) -> None:
    assert name in STORED, "not in the file: python -m tests.oracle.make_oracle"
    allowed = {array: tolerance(f"{name}/{array}", AT_HOME) for array in STORED[name]}
    found = storage.differences(CASES[name](), STORED[name], allowed)
    assert not found, "\n".join([f"{name}:", *found])


def test_the_file_holds_no_other_cases() -> None:
    assert STORED.keys() == CASES.keys()


def test_every_tolerance_has_a_case_and_a_reason() -> None:
    arrays = [f"{name}/{array}" for name, stored in STORED.items() for array in stored]
    for prefix, (allowed, reason) in TOLERATED.items():
        assert any(name.startswith(prefix) for name in arrays)
        # More than a solver's tolerance is for cases that are named.
        assert 0.0 < allowed <= (0.25 if "/" in prefix else 1e-5)
        assert reason
