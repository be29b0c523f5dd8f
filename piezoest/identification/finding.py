"""What is odd about a log, in a sentence."""

from dataclasses import dataclass
from functools import partial
from typing import Literal


@dataclass(frozen=True)
class Finding:
    """Something that is odd about a log.

    Parameters
    ----------
    name : str
        Short, the same for all logs: ``"clockwise"``.
    sentence : str
        What was seen, with figures, and what to do.
    severity : {"doubt", "note"}
        Whether a model of this log is likely to be wrong, or only to be read with this in mind.
    """

    name: str
    sentence: str
    severity: Literal["doubt", "note"]


doubt, note = partial(Finding, severity="doubt"), partial(Finding, severity="note")
