"""What every test shares: reproducible hypothesis runs, stored machine code, the folder of recorded data."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from piezoest import machine_code

ROOT = Path(__file__).resolve().parents[1]


settings.register_profile("deterministic", derandomize=True, deadline=None)
settings.load_profile("deterministic")


# A controller takes a minute to compile: the first file does it, and those that need it come last, so that no
# other process compiles it as well.
FIRST, LAST = "tests/test_package.py", ("tests/bench/", "tests/controller/", "tests/docs/", "tests/test_")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put files in order; of a test marked `slow_but_first` the cases but the first are slow."""
    items.sort(key=lambda item: (not item.nodeid.startswith(FIRST), item.nodeid.startswith(LAST)))
    seen = set()
    for item in items:
        if item.get_closest_marker("slow_but_first"):
            name = item.nodeid.partition("[")[0]
            if name in seen:
                item.add_marker("slow")
            seen.add(name)


@pytest.fixture(autouse=True, scope="module")
def _own_sources_end_with_their_file() -> Iterator[None]:
    """A model in a test file is a source of what is compiled after it: not in the files that come next."""
    noted = set(machine_code._noted)
    yield
    machine_code._noted.intersection_update(noted)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder with the recordings of real stages: PIEZOEST_DATA, or ../shared/data beside the checkout."""
    folder = Path(os.environ.get("PIEZOEST_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"no recorded data in {folder}: name their folder in PIEZOEST_DATA")
    return folder
