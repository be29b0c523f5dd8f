"""Generated controllers fed with any bits: what they learn and what they put out are numbers."""

import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import piezoest as pz

FloatArray = NDArray[np.float64]

FS = 1000.0
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
LINE = pz.LinearGain(0.15)
PLAYS = pz.PrandtlIshlinskii(
    0.1, [2.0, 9.0], [0.02, 0.01], creep=pz.Creep([0.01], [0.1]),
    bends=[-10.0], bend_weights=[[5e-4, 0.0, 0.0]], sample_rate=FS,
)  # fmt: skip
LIMITS = pz.VoltageLimits(-60.0, 60.0)


def pair(kind: str) -> Any:
    estimators: dict[str, Any] = {
        "rls": lambda: pz.HysteresisRLS(FS, initial_model=START),
        "rls-bare": lambda: pz.HysteresisRLS(FS, initial_model=START, memory=0.4, policies=(), errors=False),
        "rls-continuous": lambda: pz.HysteresisRLS(
            FS, initial_model=START, time_base="continuous", policies=(pz.policies.NormBound(),)
        ),
        "rls-line": lambda: pz.HysteresisRLS(FS, initial_model=LINE, offset=True),
        "ekf": lambda: pz.HysteresisEKF(FS, initial_model=START),
        "ekf-free": lambda: pz.HysteresisEKF(FS, initial_model=START, offset=True, project=False),
        "output-error": lambda: pz.OutputErrorRLS(FS, initial_model=START),
    }
    if kind == "plays":
        return None, pz.InverseCompensator(PLAYS, LIMITS)
    model = LINE if kind.endswith("line") else START
    return estimators[kind](), pz.InverseCompensator(model, LIMITS)


KINDS = ("plays", "rls", "rls-bare", "rls-continuous", "rls-line", "ekf", "ekf-free", "output-error")


def wild(rng: np.random.Generator, count: int, precision: str) -> FloatArray:
    """Any bits of that precision, all sizes, and a wave between them."""
    if precision == "double":
        bits = rng.integers(0, 2**64, count, dtype=np.uint64).view(np.float64)
    else:
        bits = rng.integers(0, 2**32, count, dtype=np.uint32).view(np.float32).astype(np.float64)
    sizes = rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-30.0, 9.0, count)
    wave = 5.0 * np.sin(np.arange(count) / rng.uniform(1.0, 50.0))
    special = rng.choice([0.0, -0.0, np.nan, np.inf, -np.inf, 1e-45, 3e38, 9e8], count)
    kinds = np.stack([bits, sizes, wave, special])
    share = rng.dirichlet(np.full(len(kinds), 0.4))
    return np.asarray(kinds[rng.choice(len(kinds), count, p=share), np.arange(count)])


def feed(kind: str, precision: Any, rounds: int) -> None:
    estimator, compensator = pair(kind)
    made = pz.export.CompiledController(pz.export.c(estimator, compensator, precision=precision))
    rng = np.random.default_rng(0)
    least = 0.9e-3 * (START.c if not kind.endswith("line") else LINE.gain)
    for _ in range(rounds):
        made.reset()
        for _ in range(4):
            count = int(rng.integers(1, 80))
            with np.errstate(all="ignore"):
                u = made.run(wild(rng, count, precision), wild(rng, count, precision))
            assert np.all(np.isfinite(u))
            assert np.all(np.abs(u) <= 60.0)
            parameters = made.parameters
            assert np.all(np.isfinite(parameters)), parameters
            if kind == "plays":
                continue
            slope = parameters[0] if kind.endswith("line") else parameters[2] / parameters[0]
            assert slope >= least, parameters


@pytest.mark.parametrize(
    ("kind", "precision"), list(zip(KINDS, itertools.cycle(("float", "double")), strict=False))
)
def test_any_bits(kind: str, precision: str) -> None:
    feed(kind, precision, 150)
