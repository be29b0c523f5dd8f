"""How functions on named numbers become machine code.

`compiled` makes a loop or a step that Python calls; `inlined` and `numba.extending.register_jitable` mark
the functions that it is made of. All are ordinary Python functions. Numbers that they keep come as records:

    @compiled
    def step(state: Record, settings: Record, u: float, x: float) -> None:
        state.law.P[0, 0] += settings.growth

    step_one = step.of(STATE, SETTINGS)              # layouts of `piezoest.layout`
    step_one(state, settings, 1.0, 0.5)              # structured arrays of them

One machine code serves one set of layouts, see `piezoest.compiled_records`. It is looked up by `of`, once;
the function that comes back goes by just these arguments, unchecked, which is fast.
"""

import functools
import inspect
import re
from collections.abc import Callable
from typing import Annotated, Any, TypeVar

from numba import njit, types
from numba.core import config
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.extending import register_jitable

from piezoest import layout as named
from piezoest import linking
from piezoest._checks import FloatArray
from piezoest.compiled_records import like as like
from piezoest.compiled_records import local as local
from piezoest.compiled_records import local_rows as local_rows
from piezoest.compiled_records import nth as nth
from piezoest.compiled_records import record_type
from piezoest.machine_code import MachineCode

# Arguments of compiled functions, by their annotation or its name; whatever else is a record.
Vector = Annotated[FloatArray, 1]
Matrix = Annotated[FloatArray, 2]
Cube = Annotated[FloatArray, 3]
Record = Any
_KINDS: dict[str, tuple[Any, Any]] = {
    "float": (float, types.float64),
    "int": (int, types.intp),
    "Vector": (Vector, types.Array(types.float64, 1, "C")),
    "Matrix": (Matrix, types.Array(types.float64, 2, "C")),
    "Cube": (Cube, types.Array(types.float64, 3, "C")),
}
_ARGUMENTS: dict[Any, Any] = {key: kind for name, (of, kind) in _KINDS.items() for key in (name, of)}

# References to arrays are not counted: each view of one costs two atomic operations else, more than the
# arithmetic. Such functions make no arrays of their own. A division by zero gives infinity, as in NumPy, C.
_OPTIONS: dict[str, Any] = {"_nrt": False, "error_model": "numpy", "nogil": True}

# Untyped: it has options that its class does not show to a type checker.
_config: Any = config

Function = TypeVar("Function", bound=Callable[..., Any])


def inlined(function: Function) -> Function:
    """Put a function into its caller's place in compiled code; in Python it is as it was."""
    return register_jitable(forceinline=True)(function)


def _cause(message: str) -> str:
    """The innermost reason, with its place, of a message of Numba, which nests those of all callers."""
    plain = re.sub(r"\x1b\[\d*m", "", message)
    found = re.search(r'([^\n]+)\n\s*\n\s*File "([^"]+)", line (\d+):', plain)
    if found is None:
        return plain
    reason, file, line = found.groups()
    hint = (
        " (None, for it is absent from the layout: ask `is None` first)"
        if re.search(r"\bnone\b", reason)
        else ""
    )
    return f"{reason.strip()}{hint}, {file}, line {line}"


def is_marked(function: Any) -> bool:
    """Whether compiled code can call a function: whether `inlined` or `register_jitable` marks it."""
    context: Any = cpu_target.typing_context
    context.refresh()
    try:
        return context.resolve_value_type(function) is not None
    except ValueError:
        return False


class Compiled:
    """A function that is compiled for the layouts of its records, see `compiled`."""

    def __init__(self, function: Callable[..., Any]) -> None:
        if "<locals>" in function.__qualname__:
            raise TypeError(f"{function.__qualname__} must stand at module level to be compiled and kept")
        self.function = function
        self.__name__, self.__doc__, self.__module__ = (
            function.__name__,
            function.__doc__,
            function.__module__,
        )
        self._arguments = [
            _ARGUMENTS.get(parameter.annotation)
            for parameter in inspect.signature(function).parameters.values()
        ]
        self._entries: dict[tuple[named.Record, ...], Any] = {}
        self.dispatcher: Any = njit(**_OPTIONS)(function)
        self.dispatcher._cache = MachineCode(function, _OPTIONS)

    def of(self, *layouts: named.Record) -> Callable[..., Any]:
        """Return the machine code for records of these layouts, in the order of the arguments."""
        entry = self._entries.get(layouts)
        if entry is None:
            entry = self._entries[layouts] = self._made(layouts)
        return entry

    def _made(self, layouts: tuple[named.Record, ...]) -> Any:
        records = iter(layouts)
        if self._arguments.count(None) != len(layouts):
            raise TypeError(
                f"{self.__name__} has {self._arguments.count(None)} records, got {len(layouts)} layouts"
            )
        if _config.DISABLE_JIT:
            return functools.partial(self._as_python, layouts)
        kinds = [record_type(next(records)) if kind is None else kind for kind in self._arguments]
        try:
            with linking.whole():
                return self.dispatcher.compile(tuple(kinds))
        except TypingError as error:
            error.add_note(f"{self.__name__} is not compiled: {_cause(str(error))}")
            raise

    def _as_python(self, layouts: tuple[named.Record, ...], *arguments: Any) -> Any:
        records = iter(layouts)
        pairs = zip(self._arguments, arguments, strict=True)
        return self.function(
            *(named.Named(value, next(records)) if kind is None else value for kind, value in pairs)
        )

    def __call__(self, *arguments: Any) -> Any:
        """Call a function that has no records."""
        return self.of()(*arguments)

    def __reduce__(self) -> Any:
        return self.__name__  # found in its module


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function of numbers, arrays and records, with the machine code kept on the disk.

    Its annotations say what its arguments are: ``float``, ``int``, `Vector`, `Matrix`, `Cube`; else a record.
    It stands at module level: two such functions within others can have one name.
    """
    return Compiled(function)
