"""How functions become parts of compiled loops."""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.sigutils import normalize_signature
from numba.core.types import FunctionType
from numba.extending import intrinsic, overload
from numba.np import arrayobj

# For `njit` of loops over given arrays: references to arrays are not counted, nor in what is called.
# Each view of an array costs two atomic operations else, more than the arithmetic. Such functions make
# no arrays of their own. A division by zero gives infinity, as in NumPy and C, and is not asked about.
UNCOUNTED: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}

# Signatures that estimators share: one sample (state, config, u, x); the model as known now (state, config,
# terms, model); records (state, config, u, x, every, scale, theta, s, y, S, P), of which every `every`-th
# sample goes into the histories that have room.
STEP_TYPES = "void(f8[::1], f8[::1], f8, f8)"
PROPOSE_TYPES = "void(f8[::1], f8[::1], f8[::1], f8[::1])"
RUN_TYPES = (
    "void(f8[::1], f8[::1], f8[::1], f8[::1], i8, f8[::1],"
    " f8[:, ::1], f8[:, ::1], f8[::1], f8[::1], f8[:, ::1])"
)

# Untyped: it takes options that its class does not show to a type checker.
_intrinsic: Any = intrinsic

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


def taking(functions: tuple[str, ...], types: str) -> Any:
    """Signature `types` with compiled functions of the signatures `functions` as its first arguments.

    What is handed over like this is called where it is, and not compiled anew in its caller.
    """
    parse: Any = normalize_signature
    first = [FunctionType(result(*takes)) for takes, result in map(parse, functions)]
    takes, result = parse(types)
    return result(*first, *takes)


@functools.cache
def version() -> int:
    """Number that changes with the source of what loops are compiled from.

    Numba's cache on the disk goes by the file that a loop stands in, and by the constants it refers to:
    a loop made elsewhere than its kernel refers to this one.
    """
    root = Path(__file__).parent
    found = hashlib.sha256()
    for pattern in ("_*.py", "equations/*.py", "estimators/*.py"):
        for path in sorted(root.glob(pattern)):
            found.update(path.read_bytes())
    return int.from_bytes(found.digest()[:7], "big") + 1


class Family(dict[Any, Any]):
    """Compiled functions by what they are compiled for, each compiled or loaded when first asked for."""

    def __init__(self, make: Callable[..., Any]) -> None:
        super().__init__()
        self._make = make
        self.__doc__ = make.__doc__

    def __missing__(self, key: tuple[int, ...]) -> Any:
        function = self[key] = self._make(*key)
        return function


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
