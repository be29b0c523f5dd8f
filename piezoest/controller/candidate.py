"""A candidate: what learns (for example, a compiled estimator), its model, and the model's recent error.

The model is simulated along the voltage that was written: its error is that which the stage would have had
if this model had computed the voltage. Estimator and model work in units in which the line has gain one and
the voltage swings from about -1 to 1. The output of a model is z = (x - zero)/unit, a voltage.

The offset that prevents a jump of the voltage when a model begins to drive is what the model *owes*, as z.
While the reference travels it decays to zero: it is paid.
"""

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest.equations import recent_path
from piezoest.equations.turning_points import TURNING_POINTS, remember
from piezoest.estimators.model_writing import NO_MODEL, NOT_CLOSED, TO_BE_PLACED
from piezoest.layout import AMOUNT, FIXED, FLAG, MEASURED, NUMBER, Record, numbers, record

# Memory of a score, in swings; the largest recent miss counts like a root mean square PEAK times smaller.
MEMORY, PEAK = 0.6, 2.5
# The largest misses are kept for BLOCKS blocks of travel, BLOCK swings each. Older misses count no more than
# the largest of them: the model has learnt since.
BLOCKS, BLOCK = 5, 0.2

# Weight and mean square of the misses, the largest recent one; the largest one in each block, the present
# block first; travel in this block; where the model stands, and what it owes.
SCORE = record(
    weight=AMOUNT, square=AMOUNT, peak=AMOUNT, peaks=numbers(BLOCKS, kind=AMOUNT), block=AMOUNT, z=MEASURED,
    owed=NUMBER,
)  # fmt: skip


def layouts(estimator: tuple[Record, Record], inverse: tuple[Record, Record]) -> tuple[Record, Record]:
    """Layouts of state and settings."""
    state = record(
        # The voltage is centre + scale times the model's, and z is shift + scale times where it stands.
        scale=AMOUNT, centre=MEASURED, shift=MEASURED,
        voltage=MEASURED, usable=FLAG, closed=FLAG, score=SCORE,
        path=recent_path.PATH, memory=TURNING_POINTS, inverse=inverse[0], estimator=estimator[0],
    )  # fmt: skip
    settings = record(integrated=FIXED, by_path=FIXED, inverse=inverse[1], estimator=estimator[1])
    return state, settings


@register_jitable
def begin(state: Any, settings: Any, u: Any, centre: Any, scale: Any) -> None:
    """Begin at rest at a voltage; the swing has a centre, and `scale` is half of it."""
    state.scale, state.centre, state.shift = scale, centre, 0.0
    state.voltage = (u - centre) / scale
    recent_path.begin(state.path, state.voltage, 1.0)
    remember(state.memory, state.voltage)
    state.inverse.place(state, settings)


@register_jitable
def _expected(state: Any, settings: Any) -> float:
    """Where the model stands, as z."""
    return state.shift + state.scale * state.inverse.expected(state, settings)


@register_jitable
def shift(state: Any, settings: Any, z: Any) -> None:
    """Let the model stand at z."""
    state.shift += z - _expected(state, settings)


@register_jitable
def advance(state: Any, settings: Any, u: Any) -> None:
    """Let the model follow the voltage that was written."""
    v = (u - state.centre) / state.scale
    recent_path.follow(state.path, v)
    remember(state.memory, v)
    state.inverse.follow(state, settings, np.nan, v)
    state.voltage = v
    state.score.z = _expected(state, settings)


@register_jitable
def learn(state: Any, settings: Any, u: Any, z: Any) -> None:
    """Give the estimator a sample; z is NaN where there is nothing to learn from."""
    v = (u - state.centre) / state.scale
    state.estimator.sample(state.estimator, settings.estimator, v, (z - state.shift) / state.scale)


@register_jitable
def judge(score: Any, miss: Any, bound: Any, swings: Any) -> None:
    """Count a miss, limited to a bound, after a travel of so many swings."""
    miss = min(max(miss, -bound), bound)
    if score.block >= BLOCK:
        _forget_what_was_before(score)
    score.weight = min(score.weight + swings, MEMORY)
    share = min(swings / score.weight, 1.0) if score.weight > 0.0 else 0.0
    score.square += share * (miss * miss - score.square)
    score.peak = max(np.abs(miss), score.peak * (1.0 - share))
    score.block += swings
    score.peaks[0] = max(np.abs(miss), score.peaks[0])


@register_jitable
def _forget_what_was_before(score: Any) -> None:
    """Begin a block, and limit the score to the largest miss in the blocks that remain."""
    largest = 0.0
    for i in range(1, BLOCKS):
        score.peaks[BLOCKS - i] = score.peaks[BLOCKS - 1 - i]
        largest = max(largest, score.peaks[BLOCKS - i])
    score.peaks[0] = score.block = 0.0
    score.square, score.peak = min(score.square, largest * largest), min(score.peak, largest)


@register_jitable
def forget(score: Any) -> None:
    """Forget all misses."""
    score.weight = score.square = score.peak = score.block = 0.0
    for i in range(BLOCKS):
        score.peaks[i] = 0.0


@register_jitable
def missed(score: Any) -> float:
    """The recent misses, as a root mean square."""
    return max(np.sqrt(score.square), score.peak / PEAK)


@register_jitable
def hand_over(state: Any, settings: Any) -> None:
    """Use the estimator's model of now."""
    found = state.estimator.write_model(state.estimator, settings.estimator, settings.inverse)
    if found == NO_MODEL:
        return
    state.closed = 0.0 if found == NOT_CLOSED else 1.0
    if found >= TO_BE_PLACED:
        state.inverse.place(state, settings)
    z = _expected(state, settings)
    if state.usable != 0.0:
        state.score.owed += state.score.z - z
    else:
        # What was missed without a model says nothing about this one.
        forget(state.score)
    state.usable = 1.0
    state.score.z = z


@register_jitable
def voltage(state: Any, settings: Any, z: Any) -> float:
    """Voltage at which the model stands at z."""
    return state.centre + state.scale * state.inverse.wanted(state, settings, (z - state.shift) / state.scale)
