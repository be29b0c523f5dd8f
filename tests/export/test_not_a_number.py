"""Generated controllers fed with any bits: what they learn and what they put out are numbers."""

import itertools
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from tests.wild import wild

FS = 1000.0
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
LINE = pz.LinearGain(0.15)
PLAYS = pz.PrandtlIshlinskii(
    0.1, [2.0, 9.0], [0.02, 0.01], creep=pz.Creep([0.01], [0.1]),
    bends=[-10.0], bend_weights=[[5e-4, 0.0, 0.0]], sample_rate=FS,
)  # fmt: skip
LIMITS = pz.VoltageLimits(-60.0, 60.0)
ESTIMATORS: dict[str, Any] = {
    "plays": lambda: None,
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


@pytest.mark.parametrize(
    ("kind", "precision"), list(zip(ESTIMATORS, itertools.cycle(("float", "double")), strict=False))
)
def test_any_bits(kind: str, precision: Any) -> None:
    model: Any = {"plays": PLAYS, "rls-line": LINE}.get(kind, START)
    compensator = pz.InverseCompensator(model, LIMITS)
    made = pz.export.CompiledController(pz.export.c(ESTIMATORS[kind](), compensator, precision=precision))
    rng, bits = np.random.default_rng(0), np.uint32 if precision == "float" else np.uint64
    for _ in range(150):
        made.reset()
        for count in rng.integers(1, 80, 4).tolist():
            with np.errstate(all="ignore"):
                u = made.run(wild(rng, count, 5.0, bits), wild(rng, count, 5.0, bits))
            assert np.all(np.abs(u) <= 60.0)
            parameters = made.parameters
            assert np.all(np.isfinite(parameters)), parameters
            if kind != "plays":
                slope = parameters[0] if model is LINE else parameters[2] / parameters[0]
                assert slope >= 0.9e-3 * (LINE.gain if model is LINE else START.c), parameters
