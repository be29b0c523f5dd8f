"""A displacement on a straight line over the voltage, or over an earlier one: the log of a closed loop."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.coordinates import late
from piezoest.fitting.runs import BoolArray
from piezoest.identification.examined import Examined
from piezoest.identification.finding import Finding, doubt, note
from piezoest.identification.lag import tells_lag

# Deviation from a straight line, relative to the stroke, that no piezo stage keeps to; a doubtful one, if the
# gain is that of a reference in µm, to within the third of these.
STRAIGHT, ALMOST_STRAIGHT, UNITY = 1e-3, 1e-2, 5e-3
# The same of a line over the voltage some samples earlier, as a servo has it: loops of stages leave more.
LATE_STRAIGHT, LATE_ALMOST, LATE_UNITY, LEAST_LAG = 2.5e-3, 8e-3, 2e-2, 2.0
SMALLEST_MOTION = 0.05  # µm
# Lags are tried up to this part of a swing there and back, so many at a time, nearer and nearer to the best.
LONGEST, TRIES, ROUNDS, MOST_SAMPLES = 0.15, 15, 4, 30_000
NOT_PIEZO = "A charge amplifier or a voice coil also shows no loop: then all is well."


class Line(NamedTuple):
    """A straight line over the voltage some samples earlier."""

    gain: float  # µm/V
    lag: float  # samples
    left: float  # standard deviation from it, beside the noise [µm]


def straight(log: Examined) -> Iterator[Finding]:
    """Say where there is no loop."""
    if np.unique(log.u).size <= 2:
        yield note(
            "two values", "The voltage takes only two values: no loop can show; record slopes up and down."
        )
        return
    off, opening, gain, lag = log.off / log.stroke, abs(log.loop.opening), log.gain, 0.0
    at_once = opening < ALMOST_STRAIGHT
    reference = at_once and off < ALMOST_STRAIGHT and abs(gain - 1.0) < UNITY
    plain = at_once and off < STRAIGHT
    if not at_once and not log.stepped and np.isfinite(log.wave):
        gain, lag, left = late_line(log)
        off = left / log.stroke
        # A loop with the shape of an ellipse looks like a lag where all swings are alike.
        told = tells_lag(log.u)
        reference = off < LATE_ALMOST and abs(gain - 1.0) < LATE_UNITY
        plain = told and off < LATE_STRAIGHT and lag >= LEAST_LAG
    behind = f" {lag:.3g} samples earlier" if lag else ""
    if reference:
        yield doubt(
            "reference",
            f"The displacement is {gain:.4f} times the voltage{behind}, to {100 * off:.2g} % of the stroke: "
            "it looks as if the reference in µm was logged in the place of the voltage; log what drives the "
            "amplifier.",
        )
    elif plain and log.moved > SMALLEST_MOTION:
        yield doubt(
            "straight",
            f"The displacement follows the voltage{behind} on a straight line to "
            f"{100 * (off if lag else max(off, opening)):.2g} % of the stroke, where a piezo stage shows a "
            "loop: perhaps a closed loop tracks and its reference was logged; log what drives the amplifier, "
            f"with the servo off. {NOT_PIEZO}",
        )


def late_line(log: Examined) -> Line:
    """Line over the voltage that is so many samples earlier that the line leaves least."""
    low, high = 0.0, LONGEST * log.wave * log.rate
    u, x = log.u[:MOST_SAMPLES], log.level[:MOST_SAMPLES]
    counts = (log.counts & ~log.flaws.unusable)[:MOST_SAMPLES] & (np.arange(u.size) > high)
    best = Line(log.gain, 0.0, np.inf)
    if np.sum(counts) < TRIES:
        return best
    for _ in range(ROUNDS):
        lags = np.linspace(low, high, TRIES)
        best = min((_line(u, x, counts, float(lag)) for lag in lags), key=lambda line: line.left)
        step = float(lags[1] - lags[0])
        low, high = max(best.lag - step, 0.0), best.lag + step
    return best._replace(left=float(np.sqrt(max(best.left**2 - log.noise**2, 0.0))))


def _line(u: FloatArray, x: FloatArray, counts: BoolArray, lag: float) -> Line:
    v, y = late(u, lag)[counts], x[counts]
    gain = float(np.cov(v, y)[0, 1] / np.var(v, ddof=1))
    return Line(gain, lag, float(np.std(y - gain * v)))
