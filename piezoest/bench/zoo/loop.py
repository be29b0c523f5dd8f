"""What the zoo's own hysteresis families share: a line and a loop around it.

x = gain (u + share h) + offset, with h [V] the part that depends on the voltage's past. Each family is one
module: a class that holds its numbers and, beside it, the compiled ``deform`` of one sample.
"""

from dataclasses import dataclass, fields
from typing import Any, ClassVar

from piezoest._checks import FloatArray
from piezoest.layout import FIXED, Kind, Record, record
from piezoest.stage import SimulatedStage


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """Base of the families; to be simulated only, none has an inverse."""

    gain: float = 1.0  # slope of the line [µm/V]
    share: float = 1.0  # of the loop, relative to the line
    offset: float = 0.0  # displacement where both are zero [µm]

    state: ClassVar[dict[str, Kind]] = {}  # what the module's ``deform`` keeps

    def stage_settings(self) -> dict[str, Any]:
        """Numbers by name, see `piezoest.stage.kernel`: all fields but the offset, which the stage adds."""
        return {each.name: getattr(self, each.name) for each in fields(self) if each.name != "offset"}

    def stage_layouts(self, settings: dict[str, Any]) -> tuple[Record, Record]:
        """Layouts of state and settings of the hysteresis in a stage."""
        return record(type(self).__module__, **self.state), record(**dict.fromkeys(settings, FIXED))

    def simulate(self, u: FloatArray) -> FloatArray:
        """Displacement [µm] for a voltage record [V], from rest at 0 V."""
        return SimulatedStage(1.0, self).run(u)
