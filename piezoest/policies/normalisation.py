"""The normalised gain of the continuous law."""

from dataclasses import dataclass

from piezoest.policies.base import Conditions, Policy


@dataclass(frozen=True, slots=True)
class Normalisation(Policy):
    """Normalisation m² = 1 + phi' P phi of the continuous law (A7); without it m² = 1.

    The discrete law has it by construction: its gain P phi/(R + phi' P phi) is the normalised one.
    """

    def law(self, at: Conditions) -> dict[str, float]:
        """Whether the law's gain is normalised."""
        return {"normalised": 1.0}
