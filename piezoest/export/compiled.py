"""The generated code, compiled and run on this computer."""

import ctypes
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d, number_or_nan
from piezoest.export.generated import CCode, filled
from piezoest.export.ring import Ring

# Without contraction to fused multiply-add the result is the library's to the last bit.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
_NUMBERS = {"double": (ctypes.c_double, np.float64), "float": (ctypes.c_float, np.float32)}


def compiler() -> str:
    """The C compiler: what CC names, or else cc, gcc or clang."""
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and (found := shutil.which(name)):
            return found
    raise ValueError("no C compiler found: install gcc or clang, or name one in the variable CC")


def build_shared(folder: Path, sources: list[str], target: Path, *flags: str) -> None:
    """Compile sources of a folder into a shared library."""
    command = [compiler(), *FLAGS, *flags, "-shared", "-fPIC", "-o", str(target), *sources, "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ValueError(f"the C compiler failed: {' '.join(command)}\n{done.stderr}")


def _load(code: CCode, kind: str) -> tuple[Any, Any, Any]:
    """Library around code of that kind, its numbers in C and in NumPy."""
    if code.kind != kind:
        names = {"controller": "CompiledController", "feedforward": "CompiledFeedforward"}
        raise ValueError(f"code is that of a {code.kind}: use {names[code.kind]}")
    # The loader keeps the library open after its file is gone.
    with tempfile.TemporaryDirectory(prefix="piezoest_", ignore_cleanup_errors=True) as place:
        folder = Path(place)
        code.write(folder)
        loop = filled(f"{kind}_loop.c", name=code.name, real=code.precision)
        (folder / "loop.c").write_text(loop, encoding="utf-8")
        build_shared(folder, [f"{code.name}.c", "loop.c"], folder / "controller.so")
        library = ctypes.CDLL(str(folder / "controller.so"))
    return (library, *_NUMBERS[code.precision])


class CompiledController(Ring):
    """Generated code, compiled by this computer's C compiler, with the methods of `Controller`.

    For checks of the code against the library and against logs from a target. Each object has
    a state of its own.

    Parameters
    ----------
    code : CCode
        What `c` returned.

    Raises
    ------
    ValueError
        If there is no C compiler, or the code is that of an `AdaptiveFeedforward`.
    """

    __slots__ = ("_library", "_pointer", "_real", "code")

    def __init__(self, code: CCode) -> None:
        self.code = code
        self._library, real, self._real = _load(code, "controller")
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


class CompiledFeedforward:
    """Generated code of an `AdaptiveFeedforward`, compiled by this computer's C compiler.

    For checks of the code against the library and against logs from a target; `piezoest.track` takes it as
    ``controller``. Each object has a state of its own.

    Parameters
    ----------
    code : CCode
        What `c` returned.

    Raises
    ------
    ValueError
        If there is no C compiler, or the code is not that of an `AdaptiveFeedforward`.
    """

    __slots__ = ("_library", "code")

    def __init__(self, code: CCode) -> None:
        self.code = code
        self._library, real, _ = _load(code, "feedforward")
        self._library.step.argtypes, self._library.step.restype = (real,), real
        self._library.learn.argtypes = (real, real)
        self._library.anew.argtypes = (real,)
        self._library.resume.argtypes = (real, real)
        self._library.home.argtypes = (real, real, real)
        self.reset()

    def reset(self, voltage: float | None = None) -> None:
        """Return to the state that was exported, or start again.

        Parameters
        ----------
        voltage : float, optional
            Voltage at which the stage rests, to start again [V]. Default: what was exported.

        Raises
        ------
        ValueError
            If the voltage is not within the limits.
        """
        if voltage is None:
            self._library.begin()
        elif not self._library.anew(voltage):
            raise ValueError(f"voltage must lie within the limits, got {voltage:g} V")

    def resume(self, voltage: float, displacement: float) -> None:
        """Continue from rest with what was learnt; see `AdaptiveFeedforward.resume`.

        Parameters
        ----------
        voltage : float
            Voltage at which the stage rests [V].
        displacement : float
            Reading of the sensor there [µm].

        Raises
        ------
        ValueError
            If the voltage is not within the limits, or the displacement is not a number.
        """
        if not self._library.resume(number_or_nan(voltage), number_or_nan(displacement)):
            raise ValueError(
                f"voltage must lie within the limits, and displacement be a number, got {voltage} V and "
                f"{displacement} µm"
            )

    def step(self, r: float | None) -> float:
        """Voltage for the next sample of the reference.

        Parameters
        ----------
        r : float or None
            Reference displacement [µm]; None and NaN hold the last one.

        Returns
        -------
        float
            Voltage [V], within the limits.
        """
        return self._library.step(number_or_nan(r))

    def learn(self, u: float | None, x: float | None) -> None:
        """Learn from the voltage that was written and what was measured then.

        Parameters
        ----------
        u : float or None
            Voltage [V]; None or NaN if it is unknown what was written.
        x : float or None
            Measured displacement [µm]; None or NaN where there is none.
        """
        self._library.learn(number_or_nan(u), number_or_nan(x))

    def home(self, amplitude: float, frequency: float = 1.0, cycles: int = 10) -> None:
        """Begin a sweep that erases what hysteresis remembers; see `AdaptiveFeedforward.home`.

        Parameters
        ----------
        amplitude, frequency : float
            Of the first swing [V]; [Hz].
        cycles : int
            How many.

        Raises
        ------
        ValueError
            If the amplitude has no room, or a number is out of its range.
        """
        if not self._library.home(number_or_nan(amplitude), number_or_nan(frequency), number_or_nan(cycles)):
            raise ValueError(f"no sweep of {amplitude} V at {frequency} Hz within {cycles} cycles can be")

    @property
    def status(self) -> tuple[int, int, int]:
        """Numbers of the stage of the work, the model that drives and the fault, as the header names them."""
        found = (ctypes.c_int * 3)()
        self._library.show(found)
        return found[0], found[1], found[2]
