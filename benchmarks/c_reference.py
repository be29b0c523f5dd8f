"""C to compare with in speed.py: reference/reference.c by hand, and the library's own export."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import piezoest as pz

FloatArray = NDArray[np.float64]

SOURCE = Path(__file__).parent / "reference" / "reference.c"
COMMAND = ("gcc", "-O3", "-march=native", "-shared", "-fPIC")

_LOOP = """#include <stdint.h>
#include "{source}"
void run(int64_t N, const double *u, const double *x, const double *scale, double *theta) {{
    {name}_state state;
    {name}_init(&state);
    for (int64_t k = 0; k < N; k++) {{
        rls_kernel_sample(&state.estimator, u[k], x[k]);
        for (int i = 0; i < {n}; i++) theta[{n} * k + i] = state.estimator.law.theta[i] * scale[i];
    }}
}}
"""


class Reference:
    """The C functions of the reference, on arrays; raises OSError where gcc is absent."""

    def __init__(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            library = Path(folder) / "reference.so"
            subprocess.run([*COMMAND, "-o", str(library), str(SOURCE), "-lm"], check=True)
            self._library = ctypes.CDLL(str(library))

    def _call(self, name: str, *arguments: int | FloatArray) -> None:
        getattr(self._library, name)(
            *(
                ctypes.c_int64(value) if isinstance(value, int) else ctypes.c_void_p(value.ctypes.data)
                for value in arguments
            )
        )

    def rls(self, u: FloatArray, x: FloatArray, settings: FloatArray) -> FloatArray:
        """History of theta."""
        theta = np.empty((u.size, 3))
        self._call("rls", u.size, u, x, settings, theta)
        return theta

    def bank(self, u: FloatArray, x: FloatArray, settings: FloatArray) -> FloatArray:
        """Parameters of every channel at the end."""
        theta = np.empty((u.shape[1], 3))
        self._call("bank", *u.shape, u, x, settings, theta)
        return theta

    def ekf(self, u: FloatArray, x: FloatArray, settings: FloatArray) -> FloatArray:
        """History of the state."""
        states = np.empty((u.size, 4))
        self._call("ekf", u.size, u, x, settings, states)
        return states

    def inverse(self, r: FloatArray, settings: FloatArray) -> FloatArray:
        """Voltages."""
        u = np.empty(r.size)
        self._call("inverse", r.size, r, settings, u)
        return u

    def plays(self, u: FloatArray, x: FloatArray, settings: FloatArray) -> FloatArray:
        """History of the slopes and the level."""
        theta = np.empty((u.size, 14))
        self._call("plays", u.size, u, x, settings, theta)
        return theta

    def bent_plays(self, u: FloatArray, x: FloatArray, settings: FloatArray) -> FloatArray:
        """History of the slopes in each part of the range, of creep and the level."""
        theta = np.empty((u.size, 43))
        self._call("bent_plays", u.size, u, x, settings, theta)
        return theta


class Exported:
    """What `piezoest export c` makes of a `HysteresisRLS`, without the controller round it.

    The C has the estimator's duties but one: it leaves out the standard errors.
    """

    def __init__(self, estimator: pz.HysteresisRLS) -> None:
        limits = pz.VoltageLimits(-100.0, 100.0)
        start = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
        code = pz.export.c(estimator, pz.InverseCompensator(start, limits))
        self._scale = np.ascontiguousarray(estimator.settings["parameter_scale"])
        with tempfile.TemporaryDirectory() as folder:
            _, source = code.write(folder)
            loop = Path(folder) / "loop.c"
            text = _LOOP.format(source=source.name, name=code.name, n=self._scale.size)
            loop.write_text(text, encoding="utf-8")
            library = Path(folder) / "loop.so"
            subprocess.run([*COMMAND, "-o", str(library), str(loop), "-lm"], check=True)
            self._run = ctypes.CDLL(str(library)).run

    def __call__(self, u: FloatArray, x: FloatArray) -> FloatArray:
        """History of theta."""
        theta = np.empty((u.size, self._scale.size))
        pointers = (ctypes.c_void_p(values.ctypes.data) for values in (u, x, self._scale, theta))
        self._run(ctypes.c_int64(u.size), *pointers)
        return theta


def rls_settings(
    sample_rate: float, start: pz.ColemanHodgdon, memory: float, noise: float, cutoff: float, policies: bool
) -> FloatArray:
    """Numbers for `rls` and `bank` that say what `HysteresisRLS` is told."""
    pole = np.exp(-2.0 * np.pi * cutoff / sample_rate)
    unit = 1.0 / (noise * np.sqrt(2.0 * (1.0 - pole) ** 2 / (1.0 + pole)))
    variance = 0.25  # an uncertainty of one half
    bound = 100.0 * 3.0 * variance if policies else 1e300
    zone = 1e-9 if policies else -1.0
    forgetting = np.exp(-1.0 / (memory * sample_rate))
    theta = start.theta
    return np.array([pole, forgetting, bound, zone, *(theta * unit), unit, variance, *theta])


def ekf_settings(sample_rate: float, start: pz.ColemanHodgdon) -> FloatArray:
    """Numbers for `ekf` that say what `HysteresisEKF` is by default."""
    scale = np.array([1.0, start.a, start.b, start.c])
    walk = (0.3 * scale) ** 2 / sample_rate
    spread = np.array([0.5 * start.b / start.a, *(0.5 * scale[1:])]) ** 2
    return np.array([1.5e-3**2, *walk, 0.0, *scale[1:], *spread])
