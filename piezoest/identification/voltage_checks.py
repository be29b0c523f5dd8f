"""Whether the voltage of a log drove the stage, in one run: amplifiers that clip, runs that were joined."""

from collections.abc import Iterator

import numpy as np

from piezoest.identification.examined import Examined
from piezoest.identification.finding import Finding, doubt, note

# The range of the voltage is looked at in so many parts. Where an amplifier, a sensor or a stop ends the
# motion, so many parts at an end of it have less than this fraction of the usual slope.
PARTS, LEAST_FLAT, FLAT = 20, 2, 0.2
# The voltage must go over a part so often that noise hardly counts.
WAYS = 2.0
# A step of the voltage is so many times what it moves elsewhere, at least this part of its range, and the
# only one of its kind.
STEP, OF_RANGE, ALIKE, NEAR = 20.0, 0.03, 0.3, 6


def flat_ends(log: Examined) -> Iterator[Finding]:
    """Say where the displacement does not follow the voltage to an end of its range."""
    if not log.related or log.swing == 0.0 or log.stepped or log.flaws.tops:
        return
    du, dx = np.diff(log.late), np.diff(log.level)
    counts = log.counts[1:] & log.counts[:-1]
    place = (log.late[1:] + log.late[:-1]) / 2.0 - np.min(log.late)
    part = np.clip((PARTS * place / log.swing).astype(np.int64), 0, PARTS - 1)[counts]
    way = np.bincount(part, np.abs(du)[counts], PARTS)
    gone = np.bincount(part, (np.sign(du) * dx)[counts], PARTS)
    known = way > WAYS * log.swing / PARTS
    slopes = np.divide(gone, way, out=np.full(PARTS, np.nan), where=known) / log.gain
    usual = float(np.nanmedian(slopes)) if known.any() else 0.0
    if usual <= 0.0:
        return
    for side, ends in (("Above", slopes[::-1]), ("Below", slopes)):
        seen = ends[np.isfinite(ends)]
        flat = int(np.argmin(seen < FLAT * usual)) if seen.size else 0
        if flat >= LEAST_FLAT:
            missing = int(np.argmax(np.isfinite(ends)))
            inside = (missing + flat) * log.swing / PARTS
            limit = float(np.max(log.late) - inside if side == "Above" else np.min(log.late) + inside)
            limit = round(limit / log.swing, 2) * log.swing + 0.0
            yield doubt(
                "flat end",
                f"{side} about {limit:.3g} V the displacement hardly follows the voltage "
                f"({100 * float(np.mean(seen[:flat])) / usual:.0f} % of the usual slope): the amplifier or "
                "the sensor is at its limit, or the stage at a stop; cut the command there.",
            )


def joined(log: Examined) -> Iterator[Finding]:
    """Say where the voltage jumps once, amid motion."""
    step = np.abs(np.diff(log.u))
    if step.size < 10 * NEAR or log.stepped:
        return
    k = int(np.argmax(step))
    usual = float(np.quantile(step, 0.99))
    alike = int(np.sum(step > ALIKE * step[k]))
    if alike > 1 or step[k] < max(STEP * usual, OF_RANGE * log.swing) or not NEAR <= k < step.size - NEAR:
        return
    moving = 0.1 * float(np.median(step))
    sides = (step[k - NEAR : k], step[k + 1 : k + 1 + NEAR])
    if moving > 0.0 and all(np.median(side) > moving for side in sides):
        yield note(
            "voltage jumps",
            f"The voltage jumps by {log.u[k + 1] - log.u[k]:+.3g} V at {float(log.record.time[k + 1]):.6g} "
            f"s, but elsewhere by at most {np.sort(step)[-2]:.2g} V from one sample to the next: if two runs "
            "were joined, or rows are missing there, fit each part alone.",
        )
