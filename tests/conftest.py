"""What every test shares: reproducible hypothesis runs, and the folder of recorded data."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).resolve().parents[1]


def _fresh_numba_cache() -> Path:
    """Folder of compiled code for just these sources.

    Numba looks only at the file of the function it compiled, not at those it calls into:
    after an edit of an equation its own cache would be stale.
    """
    digest = hashlib.sha256()
    for source in sorted((ROOT / "piezoest").rglob("*.py")):
        digest.update(source.read_bytes())
    return ROOT / ".numba_cache" / digest.hexdigest()[:16]


# Before anything imports Numba; subprocesses of tests inherit it.
os.environ.setdefault("NUMBA_CACHE_DIR", str(_fresh_numba_cache()))

settings.register_profile("deterministic", derandomize=True, deadline=None)
settings.load_profile("deterministic")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder with the recordings of real stages: PIEZOEST_DATA, or ../shared/data beside the checkout."""
    folder = Path(os.environ.get("PIEZOEST_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"no recorded data in {folder}: name their folder in PIEZOEST_DATA")
    return folder
