"""Without a C compiler there is nothing to compare."""

import pytest

from piezoest.export.compiled import compiler


@pytest.fixture(autouse=True, scope="session")
def _compiler() -> None:
    try:
        compiler()
    except ValueError as absent:
        pytest.skip(str(absent))
