"""Which readings can be believed, and which fault explains the others.

The line shows about where a reading must be. A single one that is far off is a spike. If the readings do not
follow the voltage for longer than the widest hysteresis explains, there is a fault, and nothing is learnt.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.controller import levels as level
from piezoest.controller import line as lines
from piezoest.controller import travel as travels
from piezoest.controller.faults import MOVED, NO_RESPONSE, NONE, REVERSED, SATURATED, SCALED
from piezoest.layout import AMOUNT, COUNT, DISTANCE, MEASURED, NUMBER, record, whole

READINGS = record(
    fault=whole(NONE, MOVED),
    # The last two finite readings, their number; the voltage that the last one answers; how far the voltage
    # has gone since the reading changed: now, and farthest; where readings stand still.
    before=MEASURED, last=MEASURED, count=COUNT, voltage=MEASURED, gone=NUMBER, still=AMOUNT,
    levels=level.LEVELS,
    # Distance from the line of the last two readings and of the last one that was not alone; number of
    # readings alone in a row; mean square of the change of the distance [µm²].
    beside_before=NUMBER, beside_last=NUMBER, beside_kept=NUMBER, alone=COUNT, changes=AMOUNT,
    # Mean square of the noise [µm²]; smallest change of the reading: the step of its converter.
    noise=AMOUNT, step=AMOUNT,
    # The widest recent swing of the voltage, the largest recent number of legs that agreed with the line.
    swing=DISTANCE, sure=AMOUNT,
    # Spikes in a row; travel in swings that is evidence of each fault, and of none.
    spikes=COUNT, weak=AMOUNT, wrong=AMOUNT, large=AMOUNT, off=AMOUNT, good=AMOUNT,
    # Points of the last third of a leg, believed or not.
    recent=lines.POINTS,
)  # fmt: skip

# The recent points, in legs; legs that must have agreed with the line before a fault is named.
RECENT, TRUSTED = 0.3, 3.0
# Before so many legs the way to the reference has shown more than the legs.
EARLY = 8.0
# Slopes relative to the line: no response; the wrong direction; too large, and too large even if the line is
# not sure; good.
WEAK, WRONG, LARGE, HUGE, GOOD = 0.12, -0.3, 3.0, 30.0, 0.4
# Share of the readings' mean square that a line explains where the points show a slope; where they show its
# sign.
STRAIGHT, SIGNED = 0.7, 0.4
# A leg so many times as long as the longest recent one is new ground.
OUTGROWN = 3.0
# Widest backlash, in swings.
BACKLASH = 0.35
# The widest swing is multiplied by KEPT at each turn: in the small loops of a walk or of steps the stage is
# as far from the line as in the wide loop around them. So is the number of legs that agreed, at most ENOUGH:
# wrong readings do not agree with the line either.
KEPT, ENOUGH = 0.9, 6.0
# Most evidence of one sample, in swings; most for a reading that stands still: it may be late by some
# samples, or oscillate.
MOST, MOST_STILL = 0.03, 0.01
# Swings of evidence that make a fault; the same for a line that is not sure.
WEAK_FOR, WRONG_FOR, LARGE_FOR, STOPPED_FOR = 0.35, 0.15, 0.15, 0.06
SILENT_FOR, REFUTED_FOR = 2.0, 2.0
# Swings for which a reading that does not change at all is believed, and one with a weak answer.
STANDS_STILL, DOUBT = 5e-3, 0.1
# A fault is over after so many good swings; readings that stood still after more.
OVER, OVER_STOPPED = 0.6, 1.6
# Farthest distance from the line, in swings of the last legs and in the widest recent swing: half a loop, and
# what the slope of a minor loop adds. More spikes in a row than this are no spikes.
FAR, FAR_WITHIN, IN_A_ROW = 1.0, 0.4, 5.0
# A reading is alone that is farther from the line than those before it, by this fraction of a swing and by so
# many times the usual change; if the line has seen so many legs.
ALONE, UNUSUAL, SEEN = 0.05, 6.0, 2.0
# After so many readings, one adds at most so many times the mean square to the noise.
FIRST_NOISE, MOST_NOISE = 20.0, 4.0


@register_jitable
def median(a: Any, b: Any, c: Any) -> float:
    """The middle one of three."""
    return max(min(a, b), min(max(a, b), c))


@register_jitable
def _mean_square(readings: Any, before: Any, square: Any) -> float:
    """A mean of squares with the next one; rare wrong readings count little."""
    if readings.count > FIRST_NOISE:
        square = min(square, MOST_NOISE * before + readings.step * readings.step)
    return before + max(1.0 / readings.count, 2e-3) * (square - before)


@register_jitable
def _counted(so_far: Any, swings: Any, speaks: Any) -> float:
    """The travel (or the count) for which something was true without a break."""
    return so_far + swings if speaks else 0.0


@register_jitable
def _follow(readings: Any, x: Any, gone: Any) -> float:
    """Take a finite reading; the middle one of the last three. `gone`: how far the voltage went meanwhile."""
    if readings.count == 0.0:
        readings.before = readings.last = x
    readings.count += 1.0
    bend = x - 2.0 * readings.last + readings.before
    readings.noise = _mean_square(readings, readings.noise, bend * bend / 6.0)
    change = np.abs(x - readings.last)
    if change > 0.0:
        readings.step = min(readings.step, change) if readings.step > 0.0 else change
    if x != readings.last:
        level.change(readings.levels, readings.last, x)
        readings.gone = readings.still = 0.0
    else:
        # Not the whole travel: the noise of a reference that rests leads nowhere.
        most = MOST_STILL * readings.swing
        readings.gone += min(max(gone, -most), most)
        readings.still = max(readings.still, np.abs(readings.gone))
    middle = median(x, readings.last, readings.before)
    readings.before, readings.last = readings.last, x
    return middle


@register_jitable
def _size_up(readings: Any, line: Any, travel: Any) -> None:
    """The widest recent swing, and how sure the line was."""
    if travel.turns == 0.0:
        readings.swing = readings.sure = 0.0
    kept = KEPT if travel.turned_now != 0.0 else 1.0
    readings.swing = max(travel.swing, kept * readings.swing)
    readings.sure = max(min(line.agreed, ENOUGH), kept * readings.sure)
    if np.abs((travel.last - travel.turned) * line.gain) > OUTGROWN * line.longest:
        # Much shorter legs say little about such a wide one.
        readings.sure = line.agreed = 0.0


@register_jitable
def _stands_still(readings: Any, line: Any, travel: Any, fraction: Any, steps: Any) -> bool:
    """Whether the reading has not changed for a fraction of a swing, and for steps of its converter."""
    gain = np.abs(line.gain)
    # Just after a turn it may stand still: a stage with backlash rests there.
    onward = np.abs(travel.last - travel.turned) > BACKLASH * readings.swing
    return onward and gain * readings.still > max(fraction * gain * readings.swing, steps * readings.step)


@register_jitable
def is_sure(readings: Any) -> bool:
    """Whether enough legs have agreed with the line to doubt readings that do not."""
    return readings.sure >= TRUSTED


@register_jitable
def _evidence(readings: Any, line: Any, travel: Any, off: Any, swings: Any) -> bool:
    """Count the travel that is evidence of each fault; whether the readings stand still."""
    recent = readings.recent
    sure = is_sure(readings)
    moved = recent.square > (0.05 * readings.swing) ** 2
    clear = np.abs(line.gain) * readings.swing > 30.0 * np.sqrt(readings.noise)
    known = clear and moved
    answer = lines.spread(recent) / np.abs(line.gain)
    # Small legs are flat. The way to the reference was wider, and its slope is not too large.
    steep = max(np.abs(line.first_gain / line.gain), 1.0) if line.legs < EARLY else 1.0
    slope, explained = lines.slope(recent) / line.gain, lines.explained(recent)
    stopped = sure and clear and _stands_still(readings, line, travel, STOPPED_FOR, 4.0)
    straight = explained > STRAIGHT
    # If the line is not sure, no response takes longer to be believed: readings that follow the voltage may
    # be right, and the line wrong.
    share = 1.0 if sure else WEAK_FOR / SILENT_FOR
    weakest = WEAK if sure or not straight else (1.0 / HUGE if line.legs >= TRUSTED else 0.0)
    if known:
        readings.weak = _counted(readings.weak, share * swings, answer < weakest)
    # A line that is not sure may also be far too steep, so that the stage hardly answers.
    opposite = slope < WRONG or (not sure and straight and slope < -1.0 / HUGE)
    wrong = known and explained > SIGNED and opposite
    share = 1.0 if sure else WRONG_FOR / REFUTED_FOR
    readings.wrong = _counted(readings.wrong, share * swings, wrong)
    # Readings that are far too large look like noise.
    plain = straight or (sure and clear and off)
    large = (answer > LARGE * steep if sure else slope > HUGE and line.legs >= TRUSTED) and moved and plain
    readings.large = _counted(readings.large, swings, large)
    lowest = GOOD if sure else WEAK
    highest = 1.0 / GOOD if sure else HUGE
    good = known and lowest < slope < highest and not stopped and not (off and sure)
    readings.good = readings.good + swings if good else (readings.good if slope > lowest else 0.0)
    return stopped


@register_jitable
def go_the_wrong_way(readings: Any) -> bool:
    """Whether readings go the wrong way for long: they are wrong, or a line that is not sure."""
    return readings.wrong > WRONG_FOR


@register_jitable
def _name(readings: Any, stopped: Any) -> float:
    """The fault that the evidence shows; the present one lasts until it is over."""
    if go_the_wrong_way(readings) and is_sure(readings):
        return REVERSED
    if readings.large > LARGE_FOR:
        return SCALED
    if readings.weak > WEAK_FOR:
        if readings.fault == SCALED or readings.fault == NO_RESPONSE:
            return readings.fault
        stands = readings.still > STOPPED_FOR * readings.swing
        follows = lines.explained(readings.recent) > STRAIGHT and not stands
        return SCALED if follows else NO_RESPONSE
    if stopped:
        return SATURATED if readings.fault == NONE else readings.fault
    over = OVER_STOPPED if readings.fault == SATURATED else OVER
    return NONE if readings.good > over else readings.fault


@register_jitable
def forget(readings: Any) -> None:
    """Forget all evidence."""
    readings.weak = readings.wrong = readings.large = 0.0
    readings.off = readings.spikes = readings.good = 0.0
    lines.forget(readings.recent)


@register_jitable
def middle(readings: Any, x: Any) -> float:
    """The middle one of the last three readings."""
    return _follow(readings, x, 0.0)


@register_jitable
def _is_alone(readings: Any, line: Any, beside: Any) -> bool:
    """Whether the distance from the line differs much from that of the last good reading, or the last two."""
    change = beside - readings.beside_last
    apart = max(np.abs(change), np.abs(beside - readings.beside_before))
    near = max(UNUSUAL * np.sqrt(readings.changes), ALONE * np.abs(line.gain) * readings.swing)
    fits = np.abs(beside - readings.beside_kept) < near or apart < near
    readings.alone = 0.0 if fits else readings.alone + 1.0
    # Not if many in a row do: they are true. Nor while the line itself still moves.
    alone = 0.0 < readings.alone <= IN_A_ROW and line.legs >= SEEN
    readings.changes = _mean_square(readings, readings.changes, change * change)
    readings.beside_before, readings.beside_last = readings.beside_last, beside
    if not alone:
        readings.beside_kept = beside
    return alone


@register_jitable
def _is_right_between(readings: Any) -> bool:
    """Whether the sensor saturates, and is right between its levels."""
    return readings.fault == SATURATED and level.are_known(readings.levels)


@register_jitable
def hide_the_line(readings: Any) -> bool:
    """Whether a fault hides what the line is; a sensor that has always saturated shows a part of it."""
    partly = _is_right_between(readings) and readings.levels.early != 0.0
    return readings.fault != NONE and not partly


@register_jitable
def _is_doubtful(readings: Any, x: Any) -> bool:
    """Whether a fault, or what may become one, explains a reading."""
    fault = readings.fault != NONE and not _is_right_between(readings)
    wrong = readings.wrong > 0.0 and is_sure(readings)
    return fault or readings.weak > DOUBT or wrong or level.holds(readings.levels, x)


@register_jitable
def believed(
    readings: Any, line: Any, travel: Any, memory: Any, answered: Any, u: Any, x: Any, gone: Any, wanted: Any
) -> float:
    """The reading if it can be believed, else NaN; `gone` is the travel of the voltage since the last one.

    `memory`: about how many samples a leg takes. `answered`: the voltage that a late reading answers; with
    the present one, late readings would look reversed. `wanted`: `gone`, at a limit the travel that the
    reference wants.
    """
    if not np.abs(x) < WILDEST:
        return np.nan
    _size_up(readings, line, travel)
    # Late readings still change, or stand still, where the present voltage rests.
    middle = _follow(readings, x, answered - readings.voltage)
    readings.voltage = answered
    unit = readings.swing if readings.swing > 0.0 else np.inf
    swings = min(gone / unit, MOST)
    lines.add(readings.recent, answered, middle, max(RECENT * memory, 16.0))
    noise = np.sqrt(readings.noise)
    farthest = max(FAR * travel.swing, FAR_WITHIN * max(readings.swing, travels.widest(travel)))
    bound = np.abs(line.gain) * farthest + 8.0 * noise
    beside = x - lines.at(line, u)
    far = np.abs(beside) > bound
    alone = _is_alone(readings, line, beside)
    readings.spikes = _counted(readings.spikes, 1.0, far)
    off = readings.spikes > IN_A_ROW
    if readings.spikes == IN_A_ROW + 1.0:
        # A jump is no slope.
        lines.forget(readings.recent)
    readings.off = _counted(readings.off, min(wanted / unit, MOST), off)
    before = readings.fault
    stopped = _evidence(readings, line, travel, off, swings)
    readings.fault = _name(readings, stopped)
    if readings.fault != NONE and before == NONE:
        readings.good = 0.0
    if _stands_still(readings, line, travel, STANDS_STILL, 1.5):
        level.stand(readings.levels, x, is_sure(readings))
    doubtful = alone or _is_doubtful(readings, x) or (far and (is_sure(readings) or not off))
    return np.nan if doubtful else x
