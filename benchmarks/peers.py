"""What speed.py compares with: C by hand, the library's own C, bare loops over filterpy and padasip."""

import ctypes
import math
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray
from padasip.filters import FilterRLS

import piezoest as pz
from piezoest.equations.coleman_hodgdon import sample_regressor

FloatArray = NDArray[np.float64]

# Told to all that are compared.
SAMPLE_RATE, NOISE, MEMORY, CUTOFF = 50_000.0, 1.5e-3, 0.4, 2500.0
START = pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
FORGETTING = float(np.exp(-1.0 / (MEMORY * SAMPLE_RATE)))
VARIANCE = 1000.0  # of padasip's start

SOURCE = Path(__file__).parent / "reference" / "reference.c"
# Without -ffast-math, as Numba compiles the library; gcc may fuse a product and a sum, Numba does not.
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


def compiled(source: Path) -> ctypes.CDLL:
    """Library made of a C file."""
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "peer.so"
        subprocess.run([*COMMAND, "-o", str(library), str(source), "-lm"], check=True)
        return ctypes.CDLL(str(library))


def call(function: Any, *arguments: int | FloatArray) -> None:
    """Call a C function with numbers and arrays."""
    function(*(ctypes.c_int64(v) if type(v) is int else ctypes.c_void_p(v.ctypes.data) for v in arguments))


class Reference:
    """The C functions of reference/reference.c; each gives what it learnt or computed, sample by sample."""

    def __init__(self) -> None:
        self._library = compiled(SOURCE)

    def run(self, name: str, columns: int, settings: FloatArray, *signals: FloatArray) -> FloatArray:
        """History of a function that gives so many numbers a sample."""
        history = np.empty((signals[0].size, columns))
        call(getattr(self._library, name), signals[0].size, *signals, settings, history)
        return history

    def bank(self, u: FloatArray, x: FloatArray, settings: FloatArray) -> FloatArray:
        """Parameters of every channel at the end."""
        theta = np.empty((u.shape[1], 3))
        call(self._library.bank, *u.shape, u, x, settings, theta)
        return theta


class Exported:
    """What `piezoest export c` makes of a `HysteresisRLS`, without the controller round it."""

    def __init__(self, estimator: pz.HysteresisRLS) -> None:
        code = pz.export.c(estimator, pz.InverseCompensator(START, pz.VoltageLimits(-100.0, 100.0)))
        self._scale = np.ascontiguousarray(estimator.settings["parameter_scale"])
        with tempfile.TemporaryDirectory() as folder:
            _, source = code.write(folder)
            loop = Path(folder) / "loop.c"
            loop.write_text(_LOOP.format(source=source.name, name=code.name, n=self._scale.size))
            self._library = compiled(loop)

    def __call__(self, u: FloatArray, x: FloatArray) -> FloatArray:
        """History of theta."""
        theta = np.empty((u.size, self._scale.size))
        call(self._library.run, u.size, u, x, self._scale, theta)
        return theta


def rls_settings(*, bounded: bool) -> FloatArray:
    """Numbers for `rls` and `bank` that say what `HysteresisRLS` is told."""
    pole = np.exp(-2.0 * np.pi * CUTOFF / SAMPLE_RATE)
    unit = 1.0 / (NOISE * np.sqrt(2.0 * (1.0 - pole) ** 2 / (1.0 + pole)))
    variance = 0.25  # an uncertainty of one half
    bound, zone = (100.0 * 3.0 * variance, 1e-9) if bounded else (1e300, -1.0)
    theta = START.theta
    return np.array([pole, FORGETTING, bound, zone, *(theta * unit), unit, variance, *theta])


def ekf_settings() -> FloatArray:
    """Numbers that say what `HysteresisEKF` is by default: R, Q, the state to start from, its variances."""
    scale = np.array([1.0, START.a, START.b, START.c])
    walk = (0.3 * scale) ** 2 / SAMPLE_RATE
    spread = np.array([0.5 * START.b / START.a, *(0.5 * scale[1:])]) ** 2
    return np.array([NOISE**2, *walk, 0.0, *scale[1:], *spread])


def loop_parameters(s: Any) -> FloatArray:
    """(alpha, beta, gamma) of a filter's state (w_h, a, b, c)."""
    return np.array([s[1], s[3] - s[2], s[1] * s[3]])


# ---------------------------------------------------------------- filterpy, as fast as its interface allows


def _prepared(kalman: Any) -> Any:
    settings = ekf_settings()
    kalman.x, kalman.P = settings[5:9].copy(), np.diag(settings[9:13])
    kalman.Q, kalman.R = np.diag(settings[1:5]), settings[:1].reshape(1, 1).copy()
    return kalman


def filterpy_ekf(u: FloatArray, x: FloatArray) -> FloatArray:
    """Bare loop over filterpy's `ExtendedKalmanFilter`: state at the end."""
    kalman = _prepared(ExtendedKalmanFilter(dim_x=4, dim_z=1))

    def place(w: float) -> None:
        kalman.x[0] = w

    kalman.predict_x = place
    F, Q, H = np.eye(4), kalman.Q, np.array([[1.0, 0.0, 0.0, 0.0]])
    kalman.F = F
    walk, last = Q[0, 0], u[0]

    def jacobian(s: FloatArray) -> FloatArray:
        return H

    def measured(s: FloatArray) -> FloatArray:
        return H @ s

    for voltage, reading in zip(u.tolist(), x.tolist(), strict=True):
        du, last = voltage - last, voltage
        w, a, b, _ = kalman.x.tolist()
        distance = abs(du)
        travel = a * distance
        decay = -math.expm1(-travel) / travel if travel else 1.0
        kept = 1.0 - travel * decay
        slope = (kept - decay) / travel if travel else -0.5
        F[0, 0] = kept
        pull = travel * w + b * du
        F[0, 1] = -distance * (slope * pull + decay * w)
        F[0, 2] = -decay * du
        P = kalman.P
        Q[0, 0] = walk + (P[1, 1] * P[0, 0] + P[0, 1] ** 2) * distance / abs(a)
        kalman.predict(w - decay * pull)
        H[0, 3] = voltage
        kalman.update(reading, jacobian, measured)
    return np.asarray(kalman.x)


def filterpy_ukf(u: FloatArray, x: FloatArray) -> FloatArray:
    """Bare loop over filterpy's `UnscentedKalmanFilter`: state at the end."""

    def advance(s: FloatArray, dt: float, du: float) -> FloatArray:
        w, a, b, _ = s.tolist()
        travel = a * abs(du)
        decay = -math.expm1(-travel) / travel if travel else 1.0
        s[0] = w - decay * (travel * w + b * du)
        return s

    def measured(s: FloatArray, voltage: float) -> FloatArray:
        return np.array([s[0] + voltage * s[3]])

    points = MerweScaledSigmaPoints(4, alpha=0.1, beta=2.0, kappa=-1.0)
    kalman = _prepared(UnscentedKalmanFilter(4, 1, 1.0, measured, advance, points))
    walk, last = kalman.Q[0, 0], u[0]
    for voltage, reading in zip(u.tolist(), x.tolist(), strict=True):
        du, last = voltage - last, voltage
        P = kalman.P
        kalman.Q[0, 0] = walk + (P[1, 1] * P[0, 0] + P[0, 1] ** 2) * abs(du) / abs(kalman.x[1])
        kalman.predict(du=du)
        kalman.update(reading, voltage=voltage)
    return np.asarray(kalman.x)


# ---------------------------------------------------------------- padasip


def regression(u: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Output and regressors of (18)-(20), unfiltered."""
    rise, moment, travel = sample_regressor(u[:-1], u[1:])
    return np.diff(x), np.column_stack([-0.5 * (x[1:] + x[:-1]) * travel, rise, moment])


def padasip_rls(z: FloatArray, phi: FloatArray) -> FloatArray:
    """Bare loop over padasip's `FilterRLS`: parameters at the end."""
    learner = FilterRLS(3, mu=FORGETTING, eps=1.0 / VARIANCE, w="zeros")
    for output, regressor in zip(z.tolist(), phi, strict=True):
        learner.adapt(output, regressor)
    return np.asarray(learner.w)
