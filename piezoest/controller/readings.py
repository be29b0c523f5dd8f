"""Which readings can be believed, and what is wrong where none can.

The voltage and the line that is known say about where a reading must lie. A single one that is far off is a
spike. Where readings do not follow the voltage for longer than the widest hysteresis explains, something
hides the truth: nobody learns from it, and it has a name.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.controller import line as lines
from piezoest.controller import travel as travels
from piezoest.layout import AMOUNT, COUNT, MEASURED, record, whole

# Faults: none; no response; response the wrong way round; far too large or too small; the reading stops at a
# level; the reading's zero has moved.
NONE, NO_RESPONSE, REVERSED, SCALED, SATURATED, MOVED = (float(i) for i in range(6))
# What is noted beside: the stage answers otherwise than the user's gain says; a write may have been lost;
# models shake the stage.
OTHER_GAIN, UNKNOWN, SHAKEN = 6.0, 7.0, 8.0
FAULTS = (
    "",
    "no response",
    "reversed",
    "scaled",
    "saturated",
    "zero moved",
    "gain",
    "unknown voltage",
    "shaken",
)

READINGS = record(
    fault=whole(0.0, 5.0),
    # The last two finite readings, how many came, the voltage's travel since the last one changed.
    before=MEASURED, last=MEASURED, count=COUNT, still=AMOUNT,
    # Mean square of the noise [µm²].
    noise=AMOUNT,
    # Smallest change of the reading: the step of its converter.
    step=AMOUNT,
    # Spikes in a row, all of them; travel in swings that spoke for each fault, and that spoke for none.
    spikes=COUNT, outliers=COUNT,
    weak=AMOUNT, wrong=AMOUNT, large=AMOUNT, stopped=AMOUNT, off=AMOUNT, good=AMOUNT,
    # What the last readings show, whatever they are: points of the last third of a swing.
    recent=lines.POINTS,
)  # fmt: skip

# The recent points, in legs; legs that must have agreed with the line before a fault is named.
RECENT, TRUSTED = 0.3, 3.0
# Slopes, relative to the line's, of no response, of the wrong way round, and of too much; and of a good one.
WEAK, WRONG, LARGE, GOOD = 0.12, -0.3, 3.0, 0.4
# Widest backlash, in swings.
BACKLASH = 0.35
# For so many swings.
WEAK_FOR, WRONG_FOR, LARGE_FOR, STOPPED_FOR, OFF_FOR = 0.35, 0.15, 0.15, 0.04, 0.3
# A zero that has moved is followed after so many swings, if the reference has not moved with it.
HELD_FOR = 24.0
# For so many swings of a line that has not held.
SILENT_FOR = 2.0
# A reading that is the same to the last bit is believed for this travel, in swings.
STANDS_STILL = 5e-3
# ... and for so many before nobody learns any more.
DOUBT = 0.1
# A fault is over after so many good swings; one of range after more.
OVER, OVER_STOPPED = 0.6, 1.6
# Farthest from the line that a reading can be, in swings; spikes in a row that are spikes.
FAR, IN_A_ROW = 1.0, 5.0


@register_jitable
def median(a: Any, b: Any, c: Any) -> float:
    """The middle one of three."""
    return max(min(a, b), min(max(a, b), c))


@register_jitable
def _follow(readings: Any, x: Any, gone: Any) -> float:
    """Take a finite reading; the middle one of the last three."""
    if readings.count == 0.0:
        readings.before = readings.last = x
    readings.count += 1.0
    bend = x - 2.0 * readings.last + readings.before
    share = max(1.0 / readings.count, 2e-3)
    square = min(bend * bend / 6.0, 9.0 * readings.noise + 1e-3 * bend * bend)
    readings.noise += share * (square - readings.noise)
    change = np.abs(x - readings.last)
    if change > 0.0:
        readings.step = min(readings.step, change) if readings.step > 0.0 else change
    readings.still = readings.still + gone if x == readings.last else 0.0
    middle = median(x, readings.last, readings.before)
    readings.before, readings.last = readings.last, x
    return middle


@register_jitable
def _stands_still(readings: Any, line: Any, travel: Any, fraction: Any, steps: Any) -> bool:
    """Whether the reading has not changed by a bit for a fraction of a swing, and for steps of its converter.

    Just after a turn it may: a stage with backlash rests there.
    """
    gain = np.abs(line.gain)
    onward = np.abs(travel.last - travel.turned) > BACKLASH * travel.swing
    return onward and gain * readings.still > max(fraction * gain * travel.swing, steps * readings.step)


@register_jitable
def _evidence(readings: Any, line: Any, travel: Any, off: Any, swings: Any) -> None:
    """Count the travel that speaks for each fault."""
    recent = readings.recent
    clear = np.abs(line.gain) * travel.swing > 30.0 * np.sqrt(readings.noise)
    known = clear and recent.square > (0.05 * travel.swing) ** 2
    trusted = line.agreed >= TRUSTED and known
    answer = np.sqrt(recent.square_x / recent.square) / np.abs(line.gain) if recent.square > 0.0 else 0.0
    slope = lines.slope(recent) / line.gain
    straight = lines.explained(recent) > 0.7
    stopped = line.agreed >= TRUSTED and clear and _stands_still(readings, line, travel, STOPPED_FOR, 4.0)
    # Of a line that has not held yet silence takes longer to be believed.
    share = 1.0 if trusted else WEAK_FOR / SILENT_FOR
    readings.weak = readings.weak + share * swings if known and answer < WEAK else 0.0
    readings.wrong = readings.wrong + swings if trusted and straight and slope < WRONG else 0.0
    readings.large = readings.large + swings if trusted and (straight or off) and answer > LARGE else 0.0
    readings.stopped = 1.0 if stopped else 0.0
    readings.off = readings.off + swings if off else 0.0
    good = known and GOOD < slope < 1.0 / GOOD and not stopped and not off
    readings.good = readings.good + swings if good else (readings.good if slope > GOOD else 0.0)


@register_jitable
def _name(readings: Any) -> float:
    """The fault that the evidence shows; the present one until it is over."""
    if readings.wrong > WRONG_FOR:
        return REVERSED
    if readings.large > LARGE_FOR:
        return SCALED
    if readings.weak > WEAK_FOR:
        if readings.fault == SCALED or readings.fault == NO_RESPONSE:
            return readings.fault
        follows = lines.explained(readings.recent) > 0.8 and readings.still == 0.0
        return SCALED if follows else NO_RESPONSE
    if readings.stopped != 0.0:
        return SATURATED if readings.fault == NONE else readings.fault
    over = OVER_STOPPED if readings.fault == SATURATED else OVER
    return NONE if readings.good > over else readings.fault


@register_jitable
def notice(state: Any, number: Any) -> None:
    """Note a fault, its end, or what else was noticed, for the log."""
    state.noticed += 1.0
    state.notice = number


@register_jitable
def forget(readings: Any) -> None:
    """Forget what spoke for a fault."""
    readings.weak = readings.wrong = readings.large = readings.off = readings.stopped = readings.spikes = 0.0
    readings.good = 0.0
    lines.forget(readings.recent)


@register_jitable
def middle(readings: Any, x: Any) -> float:
    """The middle one of the last three readings."""
    return _follow(readings, x, 0.0)


@register_jitable
def believed(readings: Any, line: Any, travel: Any, memory: Any, u: Any, x: Any, gone: Any) -> float:
    """The reading where it can be believed, NaN where not; `gone` is the voltage's travel since the last.

    `memory` is about how many samples a leg takes.
    """
    if not np.abs(x) < WILDEST:
        return np.nan
    middle = _follow(readings, x, gone)
    swings = travels.in_swings(travel, gone)
    lines.add(readings.recent, u, middle, max(RECENT * memory, 16.0))
    noise = np.sqrt(readings.noise)
    bound = FAR * np.abs(line.gain) * travel.swing + 8.0 * noise
    far = np.abs(x - lines.at(line, u)) > bound
    readings.spikes = readings.spikes + 1.0 if far else 0.0
    off = readings.spikes > IN_A_ROW
    if readings.spikes == IN_A_ROW + 1.0:
        # A jump is no slope.
        lines.forget(readings.recent)
    before = readings.fault
    _evidence(readings, line, travel, off, swings)
    readings.fault = _name(readings)
    if readings.fault != NONE and before == NONE:
        readings.good = 0.0
    if far:
        readings.outliers += 1.0
    still = _stands_still(readings, line, travel, STANDS_STILL, 1.5)
    confirmed = line.agreed >= TRUSTED
    doubtful = readings.fault != NONE or readings.weak > DOUBT or readings.wrong > 0.0
    return np.nan if doubtful or still or (far and (confirmed or not off)) else x
