"""What tests of controllers share: a stage, its limits, and the loop around both."""

import json
from collections.abc import Callable, Container
from typing import Any, NamedTuple

import numpy as np

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.bench.zoo.duhem import Duhem

LIMITS = pz.VoltageLimits(minimum=-60.0, maximum=60.0)
LOOP = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
# Another law up than down: it drifts to its loop over many periods.
DRIFTING = Duhem(
    gain=0.2, scale=60.0, centre=0.0, rate_up=0.05, rate_down=0.03, top=14.0, bottom=9.0, tilt=0.2, bend=0.1
)


class Run(NamedTuple):
    """Voltage, displacement, and what the controller was doing when it gave the voltage."""

    u: FloatArray
    x: FloatArray
    doing: list[str]


def drive(
    driver: Any,
    stage: Any,
    r: FloatArray,
    read: Callable[[int, float], Any] = lambda _, x: x,
    left_out: Container[int] = (),
    told: Callable[[float], Any] = lambda u: u,
) -> Run:
    """A ring, sample by sample: `read` is the sensor, `learn` is `told` of the voltage, or left out."""
    u, x, doing = np.empty_like(r), np.empty_like(r), []
    for k, r_k in enumerate(r.tolist()):
        doing.append(driver.status.stage)
        u[k] = driver.step(r_k)
        x[k] = stage.step(float(u[k]))
        if k not in left_out:
            driver.learn(told(float(u[k])), read(k, float(x[k])))
    return Run(u, x, doing)


def stands_along(inverse: Any, own: Any, given: Any, u: FloatArray) -> FloatArray:
    """Where a model stands along a voltage, by the functions of its inverse."""
    stands = np.empty_like(u)
    for k, u_k in enumerate(u.tolist()):
        inverse.follow(own, given, np.nan, u_k)
        own.voltage = u_k
        stands[k] = inverse.expected(own, given)
    return stands


def late(samples: int, before: float = 0.0) -> Callable[[int, float], float]:
    """A sensor that reads what was so many samples ago."""
    readings = [before] * samples

    def read(_: int, x: float) -> float:
        readings.append(x)
        return readings[-1 - samples]

    return read


def in_blocks(driver: Any, stage: Any, r: FloatArray, block: int) -> tuple[FloatArray, FloatArray]:
    """Voltage and displacement of a ring, a block at a time."""
    u, x = np.empty_like(r), np.empty_like(r)
    for k in range(0, r.size, block):
        part = slice(k, k + block)
        u[part] = driver.run(r[part])
        x[part] = stage.run(u[part])
        driver.learn(u[part], x[part])
    return u, x


def last_error(r: FloatArray, x: FloatArray, samples: int = 1000) -> float:
    return float(np.abs(r - x)[-samples:].max())


def read_back(driver: Any) -> Any:
    return pz.AdaptiveFeedforward.from_dict(json.loads(json.dumps(driver.to_dict(), allow_nan=False)))
