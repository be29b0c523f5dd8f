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


@register_jitable
def _pulled(v: Any, dead: Any) -> Any:
    """What lies outside of the dead zone."""
    return max(v - dead, 0.0) + min(v + dead, 0.0)


@register_jitable
def deform(own: Any, settings: Any, u: Any) -> Any:
    """Displacement without offset after the next voltage; zero at rest."""
    own.y = play(own.y, u, settings.width)
    pulled = _pulled(own.y - settings.place, settings.dead) - _pulled(-settings.place, settings.dead)
    return settings.gain * (u + settings.share * pulled)
