"""Every case gives what the file says: to the last bit where the file was made, else closely."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from pathlib import Path

import pytest

from tests.oracle import storage
from tests.oracle.cases import CASES, TOLERATED, tolerance

# Another file, written on this computer by the code to compare with, makes it a comparison of bits here too.
MADE, STORED = storage.read(Path(os.environ.get("PIEZOEST_ORACLE", storage.FILE)))
AT_HOME = storage.home() == MADE


@pytest.mark.parametrize("name", CASES)
def test_case(name: str) -> None:
    if name.startswith("c/") and not any(map(shutil.which, ("cc", "gcc", "clang"))):
        pytest.skip("no C compiler found: make tools")
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


# No number depends on these: the discrete law is normalised by construction, and nothing passes the bound of
# a covariance that only shrinks.
NO_EFFECT = {"rls/alone-normalisation", "rls/alone-norm-bound", "law/default", "law/no-policy"}


@pytest.mark.parametrize("group", ["rls", "ekf", "output-error", "plays", "horizon", "batch", "law"])
def test_every_option_shows(group: str) -> None:
    """An option that is silently not carried out cannot hide: some case of it differs from all others."""
    same = Counter(_all_bits(name) for name in STORED)
    own: dict[str, bool] = {}
    for name in STORED:
        if name.startswith(f"{group}/"):
            option = name if group == "law" else name.rpartition("/")[0]
            own[option] = own.get(option, False) or same[_all_bits(name)] == 1
    assert {option for option, shows in own.items() if not shows} == {
        option for option in NO_EFFECT if option.startswith(f"{group}/")
    }


def _all_bits(name: str) -> tuple[tuple[str, int], ...]:
    return tuple((key, array.fingerprint) for key, array in STORED[name].items())
