"""Open-loop logs of stages of all families, drawn at random, with what belongs to a healthy one."""

from functools import cache

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo.drawing import draw
from piezoest.bench.zoo.families import FAMILIES

KINDS = ("triangle", "sine", "steps", "walk", "chirp", "raster", "sum-of-sines")


@cache
def zoo_log(seed: int) -> tuple[FloatArray, FloatArray, float, float]:
    """Voltage, displacement, sample rate, and the standard deviation of the sensor's noise."""
    rng = np.random.default_rng([seed, 1])
    gain = float(np.exp(rng.uniform(np.log(0.02), np.log(2.0))))
    families = list(FAMILIES)
    rig = draw(
        seed, family=families[seed % len(families)], reference=KINDS[seed // 2 % len(KINDS)], limits="±100",
        fault="none", gain=gain, amplitude=gain * rng.uniform(40.0, 80.0), sample_rate=1e4,
        frequency=float(rng.uniform(5.0, 20.0)), waves=8.0,
    )  # fmt: skip
    u = np.clip(rig.plain.values / rig.gain, rig.reach.low, rig.reach.high)
    noise = max(rig.around.noise, 0.3 * rig.around.resolution)
    return u, np.asarray(rig.stage().run(u)), rig.sample_rate, noise
