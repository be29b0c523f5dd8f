"""What every test shares: reproducible hypothesis runs, and the folder of recorded data."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).resolve().parents[1]


settings.register_profile("deterministic", derandomize=True, deadline=None)
settings.load_profile("deterministic")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder with the recordings of real stages: PIEZOEST_DATA, or ../shared/data beside the checkout."""
    folder = Path(os.environ.get("PIEZOEST_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"no recorded data in {folder}: name their folder in PIEZOEST_DATA")
    return folder
