"""Warnings of a campaign's runs, which are in its table and not on the screen."""

import contextlib
import logging
from collections.abc import Iterator


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep what piezoest logs from the screen, where Python puts warnings that nobody has asked for."""
    log, nobody = logging.getLogger("piezoest"), logging.NullHandler()
    log.addHandler(nobody)
    try:
        yield
    finally:
        log.removeHandler(nobody)
