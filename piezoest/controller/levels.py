"""The levels at which readings stand still: the ends of the range of a saturated sensor.

At a level the stage may be anywhere beyond it. A line through such readings would be too flat, the voltage
too high, and so more of the readings at a level. Readings between the levels are right.
"""

from typing import Any

from numba.extending import register_jitable

from piezoest.layout import FLAG, MEASURED, record

# Whether the last change of the reading was a rise; the highest and the lowest reading that stood still, and
# whether there is one; whether the first was found before the line was sure.
LEVELS = record(rose=FLAG, top=MEASURED, bottom=MEASURED, has_top=FLAG, has_bottom=FLAG, early=FLAG)


@register_jitable
def change(levels: Any, before: Any, x: Any) -> None:
    """The reading has changed; where it goes beyond a level, that is none."""
    levels.rose = 1.0 if x > before else 0.0
    if x > levels.top:
        levels.has_top = 0.0
    if x < levels.bottom:
        levels.has_bottom = 0.0


@register_jitable
def stand(levels: Any, x: Any, sure: Any) -> None:
    """The reading stands still; whether the line is sure by now."""
    if not are_known(levels):
        levels.early = 0.0 if sure else 1.0
    if levels.rose != 0.0:
        levels.top, levels.has_top = x, 1.0
    else:
        levels.bottom, levels.has_bottom = x, 1.0


@register_jitable
def are_known(levels: Any) -> bool:
    """Whether there is a level."""
    return levels.has_top != 0.0 or levels.has_bottom != 0.0


@register_jitable
def holds(levels: Any, x: Any) -> bool:
    """Whether a reading is at a level."""
    at_top = levels.has_top != 0.0 and x == levels.top
    return at_top or (levels.has_bottom != 0.0 and x == levels.bottom)
