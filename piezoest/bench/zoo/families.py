"""Hysteresis families, drawn so that the loop over the whole reach has a given width and slope.

Width is the largest opening of the loop between the limits of the voltage, at one voltage, over its stroke.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo.backlash import Backlash
from piezoest.bench.zoo.bouc_wen import BoucWen
from piezoest.bench.zoo.duhem import Duhem
from piezoest.bench.zoo.relays import Relays
from piezoest.models import ColemanHodgdon, PrandtlIshlinskii, Preisach
from piezoest.stage import PaperStage

# Least slope anywhere of the loop, relative to the mean slope: what is less has no inverse to speak of.
STEEP = 0.04
TRIES = 200
POINTS = 401
PLAYS = 24


@dataclass(frozen=True, slots=True)
class Reach:
    """Limits of the voltage [V]."""

    low: float  # [V]
    high: float  # [V]

    @property
    def middle(self) -> float:
        """[V]."""
        return 0.5 * (self.low + self.high)

    @property
    def half(self) -> float:
        """Half of the range [V]."""
        return 0.5 * (self.high - self.low)

    def cycle(self) -> FloatArray:
        """Voltage from rest to the upper limit, and down and up twice: the last two swings are the loop."""
        up = np.linspace(self.low, self.high, POINTS)
        start = np.linspace(0.0, self.high, POINTS)
        return np.concatenate((start, up[::-1], up, up[::-1], up))


Make = Callable[..., Any]  # make(gain=, share=) is a model


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw evenly in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _bouc_wen(rng: Any, reach: Reach) -> Make:
    return partial(
        BoucWen,
        width=reach.half * rng.uniform(0.3, 0.9),
        power=float(rng.choice([1.0, 1.5, 2.0])),
        fullness=rng.uniform(-0.2, 0.9),
    )


def _duhem(rng: Any, reach: Reach) -> Make:
    size = 0.2 * reach.half
    return partial(
        Duhem,
        scale=reach.half,
        centre=reach.middle,
        rate_up=rng.uniform(0.8, 4.0) / reach.half,
        rate_down=rng.uniform(0.8, 4.0) / reach.half,
        top=size * rng.uniform(0.6, 1.4),
        bottom=size * rng.uniform(0.6, 1.4),
        tilt=rng.uniform(-0.3, 0.3),
        bend=rng.uniform(-0.2, 0.2),
    )


def _backlash(rng: Any, reach: Reach) -> Make:
    return partial(
        Backlash,
        width=reach.half * rng.uniform(0.1, 0.4),
        dead=reach.half * rng.uniform(0.0, 0.06),
        place=reach.middle + reach.half * rng.uniform(-0.4, 0.4),
    )


def _relays(rng: Any, reach: Reach) -> Make:
    margin = 0.03 * reach.half
    return partial(
        Relays,
        low=reach.low - margin,
        high=reach.high + margin,
        half_width=reach.half * rng.uniform(0.0, 0.3),
        half_width_spread=reach.half * rng.uniform(0.1, 0.3),
        place=reach.middle + reach.half * rng.uniform(-0.3, 0.3),
        place_spread=reach.half * rng.uniform(0.25, 0.6),
    )


def _paper(rng: Any, reach: Reach) -> Make:
    model: Any = PaperStage().hysteresis
    thresholds = reach.half / rng.uniform(40.0, 100.0) * model.thresholds
    weights = model.weights / model.gain
    return lambda gain, share: PrandtlIshlinskii(gain, thresholds, gain * share * weights)


def _preisach(rng: Any, reach: Reach) -> Make:
    thresholds = reach.half * rng.uniform(0.5, 0.9) * (np.arange(PLAYS) + 0.5) / PLAYS
    weights = np.exp(-thresholds / (reach.half * rng.uniform(0.15, 0.4)))
    centre = reach.middle + reach.half * rng.uniform(-0.3, 0.3)
    width = reach.half * rng.uniform(0.4, 1.0)
    return lambda gain, share: Preisach(
        gain, thresholds, gain * share * weights / weights.sum(), centre, width
    )


def _coleman_hodgdon(rng: Any, reach: Reach) -> Make:
    a = rng.uniform(0.8, 4.0) / reach.half
    return lambda gain, share: ColemanHodgdon.from_loop(a, max(share, 1e-9) * gain, gain)


# `preisach` is a sum of plays under a bell: of the play estimators' own family, and no independent witness;
# so are `paper` and `coleman-hodgdon` of theirs. The others are nobody's.
FAMILIES: dict[str, Callable[[Any, Reach], Make]] = {
    "bouc-wen": _bouc_wen, "duhem": _duhem, "backlash": _backlash, "relays": _relays, "paper": _paper,
    "preisach": _preisach, "coleman-hodgdon": _coleman_hodgdon,
}  # fmt: skip


def draw_family(family: str, rng: np.random.Generator, reach: Reach, *, width: float, gain: float) -> Any:
    """Draw a model of a family: its loop's width, relative to the stroke, and mean slope [µm/V] are given."""
    if family not in FAMILIES:
        raise ValueError(f"family must be one of {', '.join(FAMILIES)}, got {family!r}")
    u = reach.cycle()
    for _ in range(TRIES):
        make = FAMILIES[family](rng, reach)
        line, loop = (make(gain=1.0, share=share).simulate(u) for share in (0.0, 1.0))
        h = loop - line
        # Falling branch over the rising one that follows, at its widest; the cycle comes back on its grid.
        opening = float(np.max(h[-2 * POINTS : -POINTS][::-1] - h[-POINTS:]))
        stroke, range_h = np.ptp(line[-POINTS:]), h[-1] - h[-POINTS]
        if opening <= width * range_h:
            continue
        share = width * stroke / (opening - width * range_h)
        x = line + share * h
        slope = (x[-1] - x[-POINTS]) / (u[-1] - u[-POINTS])
        du, dx = np.diff(u), np.diff(x)
        moved = du != 0.0
        if np.all(dx[moved] / du[moved] > STEEP * slope):
            return make(gain=gain / slope, share=share)
    raise ValueError(f"no {family} with a loop of {100.0 * width:.1f} % of its stroke was found")
