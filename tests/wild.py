"""Numbers that no stage gives."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

SPECIAL = np.array([0.0, -0.0, 5e-324, -5e-324, 1e-310, 1e-160, 1e-45, -1e-20, 1.0, -33.0, 1e8, -9e8, 1e9,
                    3e38, 1e155, -1e308, np.nan, np.inf, -np.inf])  # fmt: skip


def wild(rng: Any, count: int, wave: float = 33.0, bits: Any = np.uint64) -> NDArray[np.float64]:
    """Any bits of a float of that size, all sizes a stage takes, special ones, and a wave between them."""
    kind = {np.uint64: np.float64, np.uint32: np.float32}[bits]
    any_bits = rng.integers(0, np.iinfo(bits).max, count, dtype=bits, endpoint=True).view(kind)
    sizes = rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-30.0, 9.0, count)
    sine = wave * np.sin(np.arange(count) / rng.uniform(1.0, 50.0))
    special, same = rng.choice(SPECIAL, count), np.full(count, rng.choice(SPECIAL))
    with np.errstate(invalid="ignore"):
        kinds = np.stack([any_bits.astype(np.float64), sizes, special, sine, same])
    share = rng.dirichlet(np.full(len(kinds), 0.4))
    return np.asarray(kinds[rng.choice(len(kinds), count, p=share), np.arange(count)])
