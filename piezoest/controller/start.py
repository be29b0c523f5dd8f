"""The start: the gain of an unknown stage, from its answers to small ways of the voltage.

The first readings, at rest, show where the stage stands; one of them may be wrong. Then the voltage goes two
per cent of its range and rests until the readings rest too, or only go to and fro, as with hum. The gain is
that between two rests, where neither delay nor lag counts. If the answer is not above noise and steps of the
converter, the way is doubled. If it is clear but not sure, or slower than the voltage, a way twice as long
checks it. If the two gains differ, as with backlash, the way is doubled again. A gain that the user knows is
not sought. In a block that is planned before its readings come, the second way follows the first one after a
while.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import WILDEST
from piezoest.controller.readings import median
from piezoest.layout import AMOUNT, COUNT, FIXED, FLAG, MEASURED, NUMBER, numbers, record, whole

# At rest; the voltage goes a way; it rests there; the gain is known; no answer.
REST, GO, WAIT, DONE, SILENT = (float(i) for i in range(5))
FIRST = 5

START = record(
    stage=whole(0.0, 4.0),
    # Voltage planned, and at the beginning; the present way, from where and to where, and its signed length,
    # zero where it only leads back; number of ways that were answered.
    voltage=MEASURED, origin=MEASURED, from_u=MEASURED, target=MEASURED, way=NUMBER, ways=COUNT,
    # Samples in this stage; reading at the first and at the last rest, its noise.
    samples=COUNT, zero=MEASURED, from_x=MEASURED, noise=AMOUNT,
    # Sums over a window of readings, scatter around its trend; means of the last three windows, mean of the
    # last two; windows so far; the last two readings; smallest change of a reading: the converter's step.
    sum=NUMBER, ramp=NUMBER, squares=AMOUNT, summed=COUNT, scatter=AMOUNT,
    mean=MEASURED, mean_before=MEASURED, oldest_mean=MEASURED, now=MEASURED, windows=COUNT,
    before=MEASURED, last=MEASURED, step=AMOUNT,
    # Where the means of the windows turned last, and how often at this rest; windows before the answer came.
    turned=MEASURED, turns=COUNT, waited=COUNT,
    # Largest change between two windows [µm]; fastest change of the voltage that a slow stage follows [V],
    # zero for a fast stage; both per sample.
    change=AMOUNT, fastest=AMOUNT,
    # To check a known gain: sums of the ways and of the answers; answer at the last look, samples before the
    # next one. How late the stage answers [samples].
    gone=NUMBER, answered=NUMBER, largest=AMOUNT, look=AMOUNT, lag=AMOUNT,
    # Gain of the last way [µm/V], of the one before; the gain grows with this power of the way; tries without
    # an answer, whether one of them went all the way; samples in a row without a reading, or with another
    # voltage than planned; the first readings.
    gain=NUMBER, gain_before=NUMBER, growth=AMOUNT, tries=AMOUNT, tried=FLAG, stuck=COUNT,
    first=numbers(FIRST, kind=MEASURED),
    # Whether the gain is the user's and not confirmed yet; readings in a row for it, all readings against it.
    given=FLAG, agreed=COUNT, doubted=COUNT,
    # Samples of a block after the first, while it is planned before its readings come; whether the user told
    # the reading at rest; shortest first way, zero for the usual one [V].
    ahead=COUNT, told=FLAG, least=AMOUNT,
    # What was left of the way to the reference at the sample before [V].
    left=NUMBER,
)  # fmt: skip
# First and longest way [V], samples of a way, of a window; the user's gain, zero for none.
SETTINGS = record(way=FIXED, longest=FIXED, ramp=FIXED, window=FIXED, gain=FIXED)

# A clear answer exceeds so many times the noise at rest, the scatter within a window, and the step of the
# converter (fewer on the longest way); two answers are alike within this factor.
CLEAR, SCATTERS, STEPS, FEW_STEPS, ALIKE = 6.0, 3.0, 10.0, 4.0, 1.6
# An answer so many times as clear is sure without a check, if it rested within so many windows (hum rests
# only for a moment) and the last two are this close together (a slow amplifier still moves). On the very
# first way the answer may begin late, by so many windows; later on it may be a sensor that had failed.
SURE, AT_ONCE, CLOSE = 3.0, 4.0, 0.02
# The voltage written is the planned one within this fraction of a way. If it is not, or without readings, the
# start gives up after so many windows.
FOLLOWS, STUCK = 0.125, 240.0
# The next way is so many times as long: a stage that slews is later on it.
LONGER = 2.0
# At rest the means of two windows, of a slow stage of three, differ by less than STILL times the answer. Not
# more than MOST_WINDOWS are needed, and without an answer not less than LATE: it may be late. A stage is slow
# below SLOW times the mean speed of the voltage, whose highest speed is 1.5 times that. A stage that moves
# with more than SLEWS times its highest speed slews, and may take MOST_SLEWING windows.
STILL, MOST_WINDOWS, LATE, SLOW = 0.04, 30.0, 4.0, 0.75
SLEWS, MOST_SLEWING = 0.7, 400.0
# The way back goes too far by this part of the way, so that no hysteresis is left: one half for small loops,
# whose branches are parabolas (Rayleigh).
OVERSHOOT = 0.5
# Windows before a try is repeated, twice as many after every two tries; at most so many doublings. Eleven are
# hardly ever whole periods of hum, which would look the same at each try. A dead sensor mostly stays dead: a
# repeated try ends at the first way if that has no answer. One in so many goes on, each time by one more way.
PAUSE, LONGEST_PAUSE, ONE_IN = 11.0, 8.0, 8
# In a block that is planned before its readings come, the second way begins after so many windows: else a
# whole block would be lost.
BLIND = 8.0


@register_jitable
def begin(start: Any, u: Any) -> None:
    """Begin at rest at a voltage."""
    start.voltage = start.origin = u
    start.stage = REST
    start.samples = start.ways = start.tries = start.tried = 0.0


@register_jitable
def farthest(start: Any) -> float:
    """How far the last way has led from where all began."""
    return max(np.abs(start.target - start.origin), np.abs(start.from_u - start.origin))


@register_jitable
def _empty(start: Any) -> None:
    """Begin a window."""
    start.sum = start.ramp = start.squares = start.summed = 0.0


@register_jitable
def _go_to(start: Any, u: Any, target: Any) -> None:
    """Begin a way."""
    start.stage, start.samples = GO, 0.0
    start.from_u, start.target = u, target
    start.change = 0.0
    _empty(start)
    start.mean = start.mean_before = start.oldest_mean = start.from_x


@register_jitable
def _go(start: Any, settings: Any, u: Any) -> None:
    """Begin the next way; in the other direction if there is no room ahead."""
    ahead = u + start.way
    if not settings.minimum <= ahead <= settings.maximum:
        start.way = -start.way
    _go_to(start, u, min(max(u + start.way, settings.minimum), settings.maximum))


@register_jitable
def _go_back(start: Any, u: Any, target: Any) -> None:
    """Begin a way whose answer does not count."""
    start.way = 0.0
    _go_to(start, u, target)


@register_jitable
def begin_again(start: Any, settings: Any, u: Any, x: Any) -> None:
    """Go from where the stage is to a rest voltage near 0 V, but not at a limit, and start there again."""
    rest = min(max(0.0, settings.minimum + settings.start.way), settings.maximum - settings.start.way)
    begin(start, rest)
    start.voltage, start.from_x, start.tries = u, x, 0.5
    _go_back(start, u, rest)


@register_jitable
def rest_at(start: Any, settings: Any, u: Any, x: Any, gain: Any) -> None:
    """The stage rests, and the reading is x: go the first way, or none if the gain is known and not zero."""
    start.from_x = start.zero = start.now = x
    way = _first(start, settings)
    start.way = way if settings.maximum - u >= u - settings.minimum else -way
    _go(start, settings, u)
    if gain != 0.0:
        start.stage, start.gain = DONE, gain
        start.voltage = start.origin = u
        start.gone = start.answered = start.largest = start.look = start.agreed = start.doubted = 0.0


@register_jitable
def _settle_rest(start: Any, settings: Any, u: Any) -> None:
    """The stage stands at the middle one of the first readings; the others show the noise."""
    first = start.first
    for i in range(1, FIRST):
        value, j = first[i], i
        while j > 0 and first[j - 1] > value:
            first[j] = first[j - 1]
            j -= 1
        first[j] = value
    # The farthest one may be wrong and does not count.
    start.noise = 0.6 * min(first[FIRST - 1] - first[1], first[FIRST - 2] - first[0])
    rest_at(start, settings, u, first[FIRST // 2], start.given * settings.start.gain)


@register_jitable
def blind(settings: Any) -> float:
    """Samples of a way and of the rest after it, in a block that is planned before its readings come."""
    return settings.start.ramp + BLIND * settings.start.window


@register_jitable
def smooth(from_u: Any, target: Any, share: Any) -> float:
    """The voltage after a share of a way that begins and ends slowly."""
    share = min(share, 1.0)
    return from_u + share * share * (3.0 - 2.0 * share) * (target - from_u)


@register_jitable
def _listen(start: Any) -> None:
    """Begin to wait for an answer."""
    start.windows = start.turns = start.waited = 0.0


@register_jitable
def _move(start: Any, settings: Any) -> None:
    """The next voltage of a way."""
    start.samples += 1.0
    # A way back from afar takes longer.
    longer = max(1.0, np.abs(start.target - start.from_u) / settings.start.longest)
    share = start.samples / (longer * settings.start.ramp)
    start.voltage = smooth(start.from_u, start.target, share)
    if share >= 1.0:
        start.stage, start.voltage = WAIT, start.target
        _listen(start)


@register_jitable
def _fills_window(start: Any, settings: Any, x: Any) -> bool:
    """Whether a window is full; `start.now` is then where the stage stands."""
    off = x - start.from_x
    start.summed += 1.0
    start.sum += off
    start.ramp += start.summed * off
    start.squares += off * off
    count = start.summed
    if count < settings.start.window:
        return False
    mean = start.sum / count
    # A trend is no noise: the stage still moves.
    along = start.ramp / count - 0.5 * (count + 1.0) * mean
    trend = along * along * 12.0 / (count * count - 1.0)
    start.scatter = np.sqrt(max(0.0, start.squares / count - mean * mean - trend))
    start.oldest_mean, start.mean_before, start.mean = start.mean_before, start.mean, start.from_x + mean
    start.now = 0.5 * (start.mean_before + start.mean)
    start.change = max(start.change, np.abs(start.mean - start.mean_before) / count)
    start.windows += 1.0
    if np.abs(start.mean - start.from_x) <= _clear(start, STEPS):
        start.waited = start.windows
    _empty(start)
    return True


@register_jitable
def _rests(start: Any, settings: Any) -> bool:
    """Whether the stage has come to rest."""
    # With ringing or noise the means differ by chance.
    chance = 3.0 * start.scatter * np.sqrt(2.0 / settings.start.window) + 0.5 * start.noise
    most = STILL * np.abs(start.now - start.from_x) + chance
    # A slow stage may still move, hidden by chance for one window.
    slow = start.change * settings.start.ramp < SLOW * np.abs(start.now - start.from_x)
    moves = np.abs(start.mean - start.mean_before)
    still = moves < most and (not slow or np.abs(start.mean - start.oldest_mean) < most)
    # A stage that slews keeps its speed until it is there.
    slews = moves > max(SLEWS * settings.start.window * start.change, chance)
    enough = MOST_SLEWING if slews else MOST_WINDOWS
    least = 1.0 if np.abs(start.now - start.from_x) > _clear(start, STEPS) else LATE
    return start.windows > least and ((still and not slews) or start.windows >= enough)


@register_jitable
def _swings(start: Any) -> bool:
    """Whether the readings only go to and fro, as with hum: the stage then stands in the middle."""
    before = start.turned
    if (start.mean_before - start.oldest_mean) * (start.mean - start.mean_before) >= 0.0:
        return False
    start.turned = start.mean_before
    start.turns += 1.0
    middle = 0.5 * (before + start.turned)
    # A stage that answers late may not have moved yet, or not much.
    answer = np.abs(middle - start.from_x)
    enough = 2.0 if answer > np.abs(start.turned - before) else 3.0
    late = start.windows <= LATE and answer < SURE * _clear(start, STEPS)
    if start.turns < enough or late:
        return False
    start.now = start.mean = middle
    return True


@register_jitable
def _clear(start: Any, steps: Any) -> float:
    """What an answer must exceed to be one: noise, scatter and steps of the converter."""
    return max(CLEAR * start.noise, steps * start.step, SCATTERS * start.scatter)


@register_jitable
def _first(start: Any, settings: Any) -> float:
    """Length of the first way [V]."""
    return min(max(settings.start.way, start.least), settings.start.longest)


@register_jitable
def _is_first(start: Any, settings: Any) -> bool:
    """Whether the present way is a first one: no longer one, and no way back."""
    return 0.0 < np.abs(start.way) <= _first(start, settings)


@register_jitable
def _late(start: Any, settings: Any) -> float:
    """Windows by which an answer may be late and sure."""
    return min(start.waited, AT_ONCE) if start.tries == 0.0 and _is_first(start, settings) else 0.0


@register_jitable
def _go_on(start: Any, settings: Any, u: Any) -> None:
    """Begin the next way, which is longer."""
    start.way = np.sign(start.way) * min(LONGER * np.abs(start.way), settings.start.longest)
    _go(start, settings, u)


@register_jitable
def _judge(start: Any, settings: Any, u: Any) -> None:
    """Judge the answer: done if two are alike, else another way, twice as long."""
    answer = start.now - start.from_x
    start.gain_before, start.gain = start.gain, answer / (u - start.from_u) if u != start.from_u else 0.0
    # A sensor that has not changed at all on all ways is tested again by the shortest one only.
    dead = start.step == 0.0 and start.tries >= 1.0
    longest = np.abs(start.way) >= settings.start.longest or dead
    far = LONGER * np.abs(start.way) > _first(start, settings) * LONGER ** (start.tries / ONE_IN)
    enough = far or int(start.tries) % ONE_IN != 0
    bound = _clear(start, FEW_STEPS if longest else STEPS)
    clear = u != start.from_u and np.abs(answer) > bound
    at_once = start.windows - _late(start, settings) <= AT_ONCE
    rests = at_once and np.abs(start.mean - start.now) < CLOSE * np.abs(answer)
    # An answer slower than the voltage may not be complete yet: a slow amplifier, or a lag.
    change = start.change / np.abs(start.gain) if start.gain != 0.0 else 0.0
    start.fastest = change if change < SLOW * np.abs(u - start.from_u) / settings.start.ramp else 0.0
    sure = rests and np.abs(answer) > SURE * bound and start.told == 0.0 and start.fastest == 0.0
    alike = sure or (start.ways > 0.0 and 1.0 / ALIKE < start.gain / start.gain_before < ALIKE)
    start.from_x = start.now
    if start.way == 0.0:
        if start.target == start.origin:
            start.stage, start.samples = SILENT, 0.0
        else:
            _go_back(start, u, start.origin)
        return
    if clear and (alike or longest):
        start.stage = DONE
        return
    if longest or (start.tried != 0.0 and enough and not clear):
        # Back to the beginning: the stage is not to rest at a limit.
        start.ways, start.tried = 0.0, 1.0
        start.tries += 1.0
        beyond = start.origin - OVERSHOOT * (u - start.origin)
        _go_back(start, u, min(max(beyond, settings.minimum), settings.maximum))
        return
    start.ways += clear
    _go_on(start, settings, u)


@register_jitable
def _wait(start: Any, settings: Any, u: Any, known: Any, middle: Any) -> None:
    """Rest after a way until the stage rests; in a block that is being planned, for a while."""
    beyond = (u - start.target) * np.sign(start.way)
    if start.ahead != 0.0:
        start.samples += 1.0
        if start.tried == 0.0 and _is_first(start, settings) and start.samples >= blind(settings):
            _go_on(start, settings, u)
    elif known and 0.0 < beyond <= LONGER * np.abs(start.way):
        # The next way of a block began before the stage rested: both are one.
        start.voltage = start.target = u
        start.way = u - start.from_u
        start.stuck = 0.0
        _listen(start)
        _empty(start)
    elif (
        start.stuck == 0.0
        and _fills_window(start, settings, middle)
        and (_rests(start, settings) or _swings(start))
    ):
        _judge(start, settings, u)


@register_jitable
def learn(start: Any, settings: Any, u: Any, x: Any) -> None:
    """Take the reading at a voltage, NaN for none, and choose the next voltage."""
    known, middle = np.abs(x) < WILDEST, x
    if known:
        change, middle = np.abs(x - start.last), median(x, start.last, start.before)
        start.before, start.last = start.last, x
        if change > 0.0 and start.samples + start.windows > 1.0:
            start.step = min(start.step, change) if start.step > 0.0 else change
    if start.stage < DONE:
        # In a block that was planned at rest the voltage does not follow yet; if it never does, it is frozen.
        follows = np.abs(u - start.voltage) <= FOLLOWS * np.abs(start.target - start.from_u)
        fine = known if start.stage == REST else follows and (known or start.stage == GO)
        start.stuck = 0.0 if fine else start.stuck + 1.0
        if start.stuck > STUCK * settings.start.window:
            start.stage, start.samples, start.stuck = SILENT, 0.0, 0.0
            start.tries += 1.0
    if start.stage == GO:
        if start.stuck == 0.0:
            if known:
                _fills_window(start, settings, middle)
            _move(start, settings)
    elif start.stage == REST and start.ahead != 0.0:
        # Planned before the readings come: the first way begins after as many samples as they will take.
        start.samples += 1.0
        if start.samples >= FIRST:
            rest_at(start, settings, u, 0.0, start.given * settings.start.gain)
    elif start.stage == REST and known:
        start.first[int(start.samples)] = x
        start.samples += 1.0
        if start.samples >= FIRST:
            _settle_rest(start, settings, u)
    elif start.stage == WAIT:
        _wait(start, settings, u, known, middle)
    elif start.stage == SILENT:
        start.samples += 1.0
        # Less and less often, because it moves the stage for nothing.
        if start.samples >= PAUSE * settings.start.window * 2.0 ** min(0.5 * start.tries, LONGEST_PAUSE):
            start.stage, start.samples, start.way = REST, 0.0, settings.start.way
