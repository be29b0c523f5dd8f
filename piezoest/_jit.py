"""How functions become compiled loops, and where their machine code is kept.

Numba's own cache knows a function by the file that it stands in, its name, and a number that counts the
functions of a process. That is not enough here. An equation is inlined into loops of other files, which would
go on with the old one after an edit. And two functions with one name, made in closures and kept by different
processes, share a symbol: loaded together, one runs the other's code. So

- what is compiled and kept stands at module level (`compiled` refuses anything else), takes no function as a
  value, and is compiled anew for constants that are handed to it (`specialised`);
- its machine code is kept with a digest of all sources that compiled functions are made of (`sources`), and
  is taken from the disk only if that, Numba, the processor and the options are the same.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import math
import pickle
import re
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import numba
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils, config
from numba.core.caching import CompileResultCacheImpl, _Cache
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature
from numba.core.typeinfer import register_dispatcher
from numba.extending import intrinsic, overload
from numba.misc.appdirs import user_cache_dir
from numba.np import arrayobj

from piezoest._files import replacing

# For `njit` of loops over given arrays: references to arrays are not counted, nor in what is called.
# Each view of an array costs two atomic operations else, more than the arithmetic. Such functions make
# no arrays of their own. A division by zero gives infinity, as in NumPy and C, and is not asked about.
UNCOUNTED: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}

# Signatures that estimators share, behind the constants they are specialised for: one sample (state, config,
# u, x); the model as known now (state, config, terms, model); records (state, config, u, x, every, scale,
# theta, s, y, S, P), of which every `every`-th sample goes into the histories that have room.
STEP_TYPES = "void(f8[::1], f8[::1], f8, f8)"
PROPOSE_TYPES = "void(f8[::1], f8[::1], f8[::1], f8[::1])"
RUN_TYPES = (
    "void(f8[::1], f8[::1], f8[::1], f8[::1], i8, f8[::1],"
    " f8[:, ::1], f8[:, ::1], f8[::1], f8[::1], f8[:, ::1])"
)

# Untyped: they have options that their classes do not show to a type checker.
_intrinsic: Any = intrinsic
_config: Any = config

Function = TypeVar("Function", bound=Callable[..., Any])


def unrolled(function: Function) -> Function:
    """Register a function for compiled loops, compiled anew for each whole number that is a constant.

    As `numba.extending.register_jitable`, which returns the function itself too; but where a caller
    passes a literal size, such as 3, the size is known at compile time: loops over it are unrolled,
    and nothing is left of the indices. Each of them is put in its caller's place.
    """

    @overload(function, jit_options={"forceinline": True}, strict=False, prefer_literal=True)
    def _same(*args: Any, **kwargs: Any) -> Any:
        return function

    return function


# ---------------------------------------------------------------- what is compiled


def compiled(signature: str | None = None, **options: Any) -> Any:
    """As `numba.njit` with these options, with the machine code kept on the disk.

    Parameters
    ----------
    signature : str, optional
        Compile, or load, for these types at once; else when it is first called, or by `specialised`.
    **options
        Of `numba.njit`.

    Raises
    ------
    TypeError
        If the function is made within another: two such functions can have one name.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        if "<locals>" in function.__qualname__:
            raise TypeError(f"{function.__qualname__} must stand at module level to be compiled and kept")
        dispatcher: Any = njit(**options)(function)
        if _config.DISABLE_JIT:
            return dispatcher
        dispatcher._cache = _MachineCode(function, options)
        if signature is not None:
            with register_dispatcher(dispatcher):
                dispatcher.compile(signature)
            dispatcher.disable_compile()
        return dispatcher

    return decorate


def specialised(function: Any, signature: str, *constants: int | None) -> Any:
    """`function` compiled for whole numbers and None as its first arguments, with these filled in.

    Arrays of such lengths are made at compile time, and branches on ``is None`` are decided before anything
    is compiled. What is returned takes just the types of `signature`, unchecked, which is fast.
    """
    parse: Any = normalize_signature
    literal: Any = types.literal
    arguments, _ = parse(signature)
    if _config.DISABLE_JIT:
        return functools.partial(function, *constants)
    known = [types.none if constant is None else literal(constant) for constant in constants]
    entry = function.compile((*known, *arguments))
    return functools.partial(entry, *constants)


class OnDemand(dict[Any, Any]):
    """Compiled functions by their constants, each made by a function of these when it is first asked for."""

    def __init__(self, make: Callable[..., Any]) -> None:
        super().__init__()
        self._make = make
        self.__doc__ = make.__doc__

    def __missing__(self, constants: tuple[Any, ...]) -> Any:
        function = self[constants] = self._make(*constants)
        return function


# ---------------------------------------------------------------- where it is kept

_PACKAGE = Path(__file__).resolve().parent
# A file with functions for compiled loops, and what a file imports from this package.
_COMPILES = re.compile(r"^@(?:register_jitable|unrolled|compiled|intrinsic|_intrinsic|njit)\b", re.MULTILINE)
_IMPORTS = re.compile(r"^from (piezoest[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def _file_of(module: str) -> Path | None:
    place = _PACKAGE.parent.joinpath(*module.split("."))
    for path in (place.with_suffix(".py"), place / "__init__.py"):
        if path.is_file():
            return path
    return None


def _constants_of(text: str) -> set[Path]:
    """Files that a source takes modules or constants from, by its imports at the left margin."""
    found = set()
    for module, names in _IMPORTS.findall(text):
        for name in re.findall(r"\w+(?: as \w+)?", names.strip("()")):
            first = name.split()[0]
            path = _file_of(f"{module}.{first}") or (_file_of(module) if first.isupper() else None)
            if path is not None:
                found.add(path)
    return found


@functools.cache
def sources() -> tuple[Path, ...]:
    """Files that compiled functions are made of: those with any, and those they take constants from."""
    texts = {path: path.read_text(encoding="utf-8") for path in _PACKAGE.rglob("*.py")}
    found = {path for path, text in texts.items() if _COMPILES.search(text)}
    new = found
    while new:
        new = set().union(*(_constants_of(texts[path]) for path in new)) - found
        found = found | new
    return tuple(sorted(found))


@functools.cache
def digest() -> str:
    """Fingerprint of `sources`: machine code made of other ones is never run."""
    found = hashlib.sha256()
    for path in sources():
        found.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


@functools.cache
def folder() -> Path | None:
    """Folder of machine code: Numba's if one is named, the package's own, or the user's; None without any."""
    name = f"piezoest-{hashlib.sha256(str(_PACKAGE).encode()).hexdigest()[:12]}"
    users: Any = user_cache_dir
    places = [_PACKAGE / "__pycache__", Path(users("numba", appauthor=False)) / name]
    named: str = _config.CACHE_DIR
    if named:
        places.insert(0, Path(named) / name)
    for place in places:
        try:
            place.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=place):
                return place
        except OSError:
            continue
    warnings.warn(
        "no folder for compiled code can be written, each start compiles anew: name one in NUMBA_CACHE_DIR",
        RuntimeWarning,
        stacklevel=2,
    )
    return None


@functools.cache
def _own_source(path: str) -> str:
    """Fingerprint of a file outside the package that has compiled functions of its own."""
    return "" if Path(path) in sources() else hashlib.sha256(Path(path).read_bytes()).hexdigest()


class _MachineCode(_Cache):
    """Machine code of one function in one file for each signature, which says what it was made of.

    A file begins with the fingerprint of what it was made of and what it holds, so that one made of other
    sources, by another Numba or for another processor, and one that is damaged, are all compiled anew.
    """

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._function = function
        self._made_with = (numba.__version__, llvmlite.__version__, sys.version, sorted(options.items()))

    def _place(self, signature: Any) -> Path | None:
        place = folder()
        kind = hashlib.sha256(str(signature).encode()).hexdigest()[:16]
        return None if place is None else place / f"{self._name}-{kind}.nbc"

    def _fingerprint(self, signature: Any, codegen: Any, code: bytes) -> bytes:
        own = _own_source(inspect.getfile(self._function))
        made_of = (digest(), own, self._made_with, codegen.magic_tuple(), str(signature))
        return hashlib.sha256(repr(made_of).encode() + code).digest()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Function for a signature from the disk; None if it is not there, or not of these sources."""
        target_context.refresh()
        place = self._place(sig)
        try:
            kept = b"" if place is None else place.read_bytes()
        except OSError:
            return None
        size = hashlib.sha256().digest_size
        if kept[:size] != self._fingerprint(sig, target_context.codegen(), kept[size:]):
            return None
        rebuild: Any = CompileResultCacheImpl.rebuild
        return rebuild(self, target_context, pickle.loads(kept[size:]))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a function; where the disk is full, the next start compiles anew."""
        place = self._place(sig)
        if place is None or data.library.has_dynamic_globals:
            return
        serialise: Any = dumps
        code: bytes = serialise(data._reduce())
        with contextlib.suppress(OSError), replacing(place) as beside:
            beside.write_bytes(self._fingerprint(sig, data.codegen, code) + code)

    @property
    def cache_path(self) -> str:
        """Folder of the files."""
        return str(folder())

    def enable(self) -> None:
        """Do nothing: it always is."""

    def disable(self) -> None:
        """Do nothing: it always is."""

    def flush(self) -> None:
        """Do nothing: files that no longer fit are written over."""


# ---------------------------------------------------------------- arrays and vectors in compiled loops


def _on_the_stack(context: Any, builder: Any, kind: Any, shape: tuple[int, ...]) -> Any:
    """Lower an array of float64 without an owner, rows after one another."""
    number = context.get_value_type(types.float64)
    whole = ir.ArrayType(number, math.prod(shape))
    place = cgutils.alloca_once(builder, whole)  # type: ignore[no-untyped-call]
    array = context.make_array(kind)(context, builder)
    steps = [8 * math.prod(shape[i + 1 :]) for i in range(len(shape))]
    lengths, strides, (size,) = (
        [context.get_constant(types.intp, value) for value in values] for values in (shape, steps, (8,))
    )
    data = builder.bitcast(place, ir.PointerType(number))
    arrayobj.populate_array(array, data, lengths, strides, size, None)  # type: ignore[no-untyped-call]
    return array._getvalue()


@_intrinsic(prefer_literal=True)
def local(typingctx: Any, size: Any) -> Any:
    """Array of `size` numbers, a constant, on the stack of a compiled loop; not to be handed out of it.

    Nobody else can see it, so that the compiler keeps in registers what is indexed by constants.
    """
    if not isinstance(size, types.IntegerLiteral):
        return None
    array = types.Array(types.float64, 1, "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _on_the_stack(context, builder, array, (size.literal_value,))

    return array(size), generate


@_intrinsic(prefer_literal=True)
def local_rows(typingctx: Any, rows: Any, columns: Any) -> Any:
    """As `local`, of shape (rows, columns)."""
    if not (isinstance(rows, types.IntegerLiteral) and isinstance(columns, types.IntegerLiteral)):
        return None
    array = types.Array(types.float64, 2, "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _on_the_stack(context, builder, array, (rows.literal_value, columns.literal_value))

    return array(rows, columns), generate


@_intrinsic
def read_ahead(typingctx: Any, row: Any) -> Any:
    """Ask for the row of an array before it is needed; the processor does not wait for it.

    It does so by itself where samples follow one another, but not from row to row.
    """
    if row.layout != "C":
        return None

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        array = context.make_array(row)(context, builder, values[0])
        byte, number = ir.IntType(8), ir.IntType(32)
        to = ir.PointerType(byte)
        take = ir.FunctionType(ir.VoidType(), [to, number, number, number])
        prefetch = builder.module.declare_intrinsic("llvm.prefetch", (to,), take)
        how = (number(0), number(3), number(1))  # to read, to keep, data
        start = builder.bitcast(array.data, to)
        shape = cgutils.unpack_tuple(builder, array.shape, 1)  # type: ignore[no-untyped-call]
        size = builder.mul(shape[0], array.itemsize)
        # A row that begins within a line of the cache has one line more than its size says: its last byte's.
        last = builder.sub(size, size.type(1))
        with cgutils.for_range_slice(builder, size.type(0), size, size.type(64)) as (offset, _):
            builder.call(prefetch, [builder.gep(start, [offset]), *how])
        builder.call(prefetch, [builder.gep(start, [last]), *how])
        return context.get_dummy_value()

    return types.none(row), generate


@_intrinsic(prefer_literal=True)
def in_lanes(typingctx: Any, body: Any, count: Any, arguments: Any) -> Any:
    """Call ``body(lane, *arguments)`` for lanes 0 to `count` - 1, which know nothing of each other.

    LLVM is told to make vector instructions of it, two times eight lanes in a turn: its own estimate
    takes every branch for one that is rarely gone, and would leave it.
    """
    takes = typingctx.resolve_function_type(body, (types.intp, *arguments), {})

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        call = context.get_function(body, takes)
        rest = [builder.extract_value(values[2], i) for i in range(len(arguments))]
        zero, one = (context.get_constant(types.intp, number) for number in (0, 1))
        before = builder.basic_block
        loop, after = builder.append_basic_block("lanes"), builder.append_basic_block("lanes.end")
        builder.branch(loop)
        builder.position_at_end(loop)
        lane = builder.phi(zero.type)
        lane.add_incoming(zero, before)
        call(builder, (lane, *rest))
        following = builder.add(lane, one, flags=("nuw", "nsw"))
        lane.add_incoming(following, builder.basic_block)
        jump = builder.cbranch(builder.icmp_signed("<", following, values[1]), loop, after)
        module = builder.module
        hints = [
            module.add_metadata(
                [ir.MetaDataString(module, f"llvm.loop.{name}"), ir.Constant(ir.IntType(32), value)]
            )
            for name, value in (("vectorize.width", 8), ("interleave.count", 2))
        ]
        identity = module.add_metadata(hints)
        identity.operands = (identity, *hints)  # LLVM knows a loop's hints by their naming themselves
        jump.set_metadata("llvm.loop", identity)
        builder.position_at_end(after)
        return context.get_dummy_value()

    return types.none(body, count, arguments), generate
