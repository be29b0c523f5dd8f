"""The generated code, compiled and run on this computer."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d
from piezoest.export.c_code import CCode, filled
from piezoest.export.ring import Ring

# Without contraction to fused multiply-add the result is the library's to the last bit.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")


def compiler() -> str:
    """The C compiler: what CC names, or else cc, gcc or clang.

    Raises
    ------
    ValueError
        If there is none.
    """
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and (found := shutil.which(name)):
            return found
    raise ValueError("no C compiler found: install gcc or clang, or name one in the variable CC")


def build_shared(folder: Path, sources: list[str], target: Path, *flags: str) -> None:
    """Compile sources of a folder into a shared library.

    Raises
    ------
    ValueError
        If there is no compiler, or it refuses the sources.
    """
    command = [compiler(), *FLAGS, *flags, "-shared", "-fPIC", "-o", str(target), *sources, "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ValueError(f"the C compiler failed: {' '.join(command)}\n{done.stderr}")


class CompiledController(Ring):
    """Generated code, compiled by this computer's C compiler, with the face of `Controller`.

    For checks of the code against the library and against logs from a target. Each object has
    a state of its own.

    Parameters
    ----------
    code : CCode
        What `c` returned.

    Raises
    ------
    ValueError
        If there is no C compiler.
    """

    __slots__ = ("_library", "_pointer", "_real", "code")

    def __init__(self, code: CCode) -> None:
        self.code = code
        # The loader keeps the library open after its file is gone.
        with tempfile.TemporaryDirectory(prefix="piezoest_", ignore_cleanup_errors=True) as place:
            folder = Path(place)
            code.write(folder)
            loop = filled("loop.c", name=code.name, real=code.precision)
            (folder / "loop.c").write_text(loop, encoding="utf-8")
            build_shared(folder, [f"{code.name}.c", "loop.c"], folder / "controller.so")
            self._library = ctypes.CDLL(str(folder / "controller.so"))
        double = code.precision == "double"
        real = ctypes.c_double if double else ctypes.c_float
        self._real = np.float64 if double else np.float32
        self._pointer = ctypes.POINTER(real)
        self._library.one.argtypes = (real, real, self._pointer)
        self._library.limit.argtypes = (real, real)
        self._library.many.argtypes = (ctypes.c_size_t, *[self._pointer] * 3)
        self.reset()

    def reset(self) -> None:
        """Return to the state that was exported."""
        self._library.begin()
        self._frozen = False

    def _hold(self) -> None:
        self._library.hold(int(self._frozen))

    @property
    def parameters(self) -> FloatArray:
        """Model in use, shape (4,): alpha, beta, gamma, offset, or gain, 0, 0, offset; settable."""
        values = np.zeros(4, self._real)
        self._library.get(self._at(values))
        return values.astype(np.float64)

    @parameters.setter
    def parameters(self, parameters: Any) -> None:
        values = array_1d("parameters", parameters, allow_nan=True, minimum_length=4).astype(self._real)
        if not self._library.set(self._at(values)):
            raise ValueError(f"parameters {values.tolist()} belong to no model that has an inverse")

    def set_limits(self, minimum: float, maximum: float) -> None:
        """Set the limits of the voltage.

        Parameters
        ----------
        minimum, maximum : float
            [V].

        Raises
        ------
        ValueError
            If minimum is not below maximum.
        """
        if not self._library.limit(minimum, maximum):
            raise ValueError(f"minimum must be below maximum, got {minimum:g} V and {maximum:g} V")

    def step(self, r: float | None, x: float | None) -> float:
        """One turn; see `Controller.step`.

        Parameters
        ----------
        r, x : float or None
            Next sample of the reference, displacement after the previous voltage [µm].

        Returns
        -------
        float
            Voltage [V].
        """
        u = np.zeros(1, self._real)
        self._library.one(np.nan if r is None else r, np.nan if x is None else x, self._at(u))
        return float(u[0])

    def _run(self, r: FloatArray, x: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):
            r, x = r.astype(self._real), x.astype(self._real)
        u = np.empty(r.size, self._real)
        self._library.many(r.size, self._at(r), self._at(x), self._at(u))
        return u.astype(np.float64)

    def _at(self, values: Any) -> Any:
        return values.ctypes.data_as(self._pointer)

    def copy(self) -> Self:
        """Return another one, in the state that was exported."""
        return type(self)(self.code)
