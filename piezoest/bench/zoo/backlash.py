"""Backlash with a dead zone: a spring, and beside it a drive with play and a place where it does not pull.

x = gain (u + share d(play(u))): d is the play's output less what lies within the dead zone. It wipes out,
and is as far from a smooth loop as a stage gets. Source of the play: M. A. Krasnosel'skii, A. V.
Pokrovskii, Systems with Hysteresis, Springer 1989.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from numba.extending import register_jitable

from piezoest.bench.zoo.loop import Loop
from piezoest.equations.play import play
from piezoest.layout import MEASURED, Kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Backlash(Loop):
    """A play and a dead zone behind it."""

    width: float  # half of the play [V]
    dead: float = 0.0  # half of the dead zone [V]
    place: float = 0.0  # its middle [V]

    state: ClassVar[dict[str, Kind]] = {"y": MEASURED}  # the play's output [V]
    wipes_out: ClassVar[bool] = True

    def stage_settings(self) -> dict[str, Any]:
        """Numbers by name."""
        return {
            "gain": self.gain,
            "share": self.share,
            "width": self.width,
            "dead": self.dead,
            "place": self.place,
            "at_rest": max(-self.place - self.dead, 0.0) + min(-self.place + self.dead, 0.0),
        }


@register_jitable
def deform(own: Any, settings: Any, u: Any) -> Any:
    """Displacement without offset after the next voltage."""
    own.y = play(own.y, u, settings.width)
    v = own.y - settings.place
    pulled = max(v - settings.dead, 0.0) + min(v + settings.dead, 0.0)
    return settings.gain * (u + settings.share * (pulled - settings.at_rest))
