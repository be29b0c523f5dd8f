"""Records and their arrays in compiled functions: all that leans on Numba's inside.

A record is a pointer to float64 numbers. Its type, made from the layout, knows where each field stands:
reading a field is one load from a constant place, a nested record is the same pointer further on, an array
(`Numbers`) is a pointer whose shape is in its type, so that ``range(len(theta))`` has constant ends and
nothing is counted or checked at run time. A field that is not in the layout does not compile; one that is
absent is None, and what is behind ``if state.level is not None:`` is left out (`AbsentFields`). A `Length` is
read from the record itself: places behind such arrays are computed, and one machine code serves all lengths.

Numba learns of each type how it is passed (a data model), what an operation on it gives (a template), and
the LLVM instructions of that operation (a lowering).
"""

import functools
import hashlib
import importlib
import math
import operator
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core import ir as numba_ir
from numba.core.consts import ConstantInference
from numba.core.datamodel import register_default
from numba.core.datamodel.models import PrimitiveModel
from numba.core.errors import NumbaTypeError
from numba.core.imputils import lower_getattr_generic, lower_setattr_generic
from numba.core.ir_utils import get_definition, guard
from numba.core.rewrites import Rewrite, register_rewrite
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    make_intrinsic_template,
    signature,
)
from numba.extending import NativeValue, lower_builtin, type_callable, unbox

from piezoest import layout as named
from piezoest.machine_code import note_source

Function = TypeVar("Function", bound=Callable[..., Any])


class Numbers(types.Type):
    """Array within a record: its shape in whole numbers, or names of the fields that hold them."""

    mutable = True

    def __init__(self, shape: tuple[int | str, ...]) -> None:
        self.shape = shape
        self.unknown = sum(isinstance(size, str) for size in shape)
        super().__init__(name=f"numbers{shape}")


class Fields(types.Type):
    """Record: a pointer, and where its fields stand."""

    mutable = True

    def __init__(self, fields: tuple[tuple[str, Any], ...], functions: str) -> None:
        self.fields, self.functions = dict(fields), functions
        words = ", ".join([functions, *(f"{name}: {kind.name}" for name, kind in fields)])
        super().__init__(name=f"record_{hashlib.sha256(words.encode()).hexdigest()[:16]}")


_known: dict[named.Record, Fields] = {}


def record_type(layout: named.Record) -> Fields:
    """Numba's type of a layout; those that differ in lengths alone share it."""
    if layout not in _known:
        fields = tuple((name, _field_type(field)) for name, field in layout.fields)
        if layout.functions:
            note_source(importlib.import_module(layout.functions))
        _known[layout] = Fields(fields, layout.functions)
    return _known[layout]


def _field_type(field: named.Field) -> Any:
    if isinstance(field, named.Record):
        return record_type(field)
    if field == named.ABSENT:
        return types.none
    if isinstance(field, named.Numbers):
        return Numbers(tuple(n.name if isinstance(n, named.Length) else n for n in field.shape))
    return types.float64


_NUMBER, _WHOLE = ir.DoubleType(), ir.IntType(64)
_POINTER = ir.PointerType(_NUMBER)


@register_default(Fields)
class FieldsModel(PrimitiveModel):
    """Passed around as a pointer."""

    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _POINTER)


@register_default(Numbers)
class NumbersModel(PrimitiveModel):
    """Passed around as a pointer, with the sizes that are not in its type."""

    def __init__(self, dmm: Any, fe_type: Any) -> None:
        sizes = [_WHOLE] * fe_type.unknown
        super().__init__(dmm, fe_type, ir.LiteralStructType([_POINTER, *sizes]) if sizes else _POINTER)


@unbox(Fields)
def _from_python(kind: Any, array: Any, c: Any) -> Any:
    """Pointer to the numbers of a NumPy array: its object begins with a head and this pointer."""
    place = c.builder.bitcast(array, ir.PointerType(_POINTER))
    data = c.builder.gep(place, [_WHOLE(object.__basicsize__ // 8)])
    return NativeValue(c.builder.load(data))


# ---------------------------------------------------------------- where a field stands


def _length(builder: Any, kind: Fields, record: Any, name: str) -> Any:
    """Value of a length, from its field; lengths stand first."""
    place = builder.gep(record, [_WHOLE(list(kind.fields).index(name))], inbounds=True)
    return builder.fptosi(builder.load(place), _WHOLE)


def _sizes(builder: Any, kind: Fields, record: Any, array: Numbers) -> list[Any]:
    return [
        _length(builder, kind, record, size) if isinstance(size, str) else _WHOLE(size)
        for size in array.shape
    ]


def _known_size(kind: Any) -> int | None:
    """Numbers that a field takes; None if that is not in its type."""
    if isinstance(kind, Numbers):
        return None if kind.unknown else math.prod(kind.shape)
    if isinstance(kind, Fields):
        inner = [_known_size(each) for each in kind.fields.values()]
        return None if None in inner else sum(inner)
    return 0 if kind is types.none else 1


def _place(builder: Any, kind: Fields, record: Any, name: str | None) -> Any:
    """Pointer to a field; to the end of the record for None."""
    known, computed = 0, None
    for field, inner in kind.fields.items():
        if field == name:
            break
        size = _known_size(inner)
        if size is not None:
            known += size
            continue
        start = _at(builder, record, known, computed)
        if isinstance(inner, Numbers):
            run_time = functools.reduce(builder.mul, _sizes(builder, kind, record, inner))
        else:
            end = _place(builder, inner, start, None)
            run_time = _numbers_between(builder, start, end)
        computed = run_time if computed is None else builder.add(computed, run_time)
    return _at(builder, record, known, computed)


def _numbers_between(builder: Any, start: Any, end: Any) -> Any:
    """How many numbers there are between two pointers."""
    apart = builder.sub(builder.ptrtoint(end, _WHOLE), builder.ptrtoint(start, _WHOLE))
    return builder.sdiv(apart, _WHOLE(8))


def _at(builder: Any, pointer: Any, known: int, computed: Any) -> Any:
    steps = _WHOLE(known) if computed is None else builder.add(computed, _WHOLE(known))
    return builder.gep(pointer, [steps], inbounds=True)


@infer_getattr
class FieldsAttribute(AttributeTemplate):
    """``state.name``, a field or a function; an unknown name is an error of compilation."""

    key = Fields

    def generic_resolve(self, record: Any, name: str) -> Any:
        """Type of a field."""
        if name in record.fields:
            return record.fields[name]
        function = named.function_of(record.functions, name)
        return None if function is None else self.context.resolve_value_type(function)


@lower_getattr_generic(Fields)
def _get_field(context: Any, builder: Any, kind: Any, record: Any, name: str) -> Any:
    field = kind.fields.get(name, types.none)
    if field is types.none:  # nothing, or a function
        return context.get_dummy_value()
    place = _place(builder, kind, record, name)
    if isinstance(field, Fields):
        return place
    if not isinstance(field, Numbers):
        return builder.load(place)
    if not field.unknown:
        return place
    sizes = [_length(builder, kind, record, size) for size in field.shape if isinstance(size, str)]
    return cgutils.pack_struct(builder, [place, *sizes])


@lower_setattr_generic(Fields)
def _set_field(context: Any, builder: Any, sig: Any, arguments: Any, name: str) -> None:
    kind, _ = sig.args
    if kind.fields[name] is not types.float64:
        raise NumbaTypeError(f"{name} cannot be assigned whole: assign its numbers one by one")
    builder.store(arguments[1], _place(builder, kind, arguments[0], name))


@register_rewrite("before-inference")
class AbsentFields(Rewrite):
    """Answer ``field is None`` by the layout, before Numba looks which branches are not taken.

    The field may have a name, which is assigned nothing else. Of arguments Numba itself knows the answer.
    """

    def __init__(self, state: Any = None) -> None:
        self._kinds = state.args

    def match(self, func_ir: Any, block: Any, typemap: Any, calltypes: Any) -> bool:
        """Find the questions of a block."""
        self._function, self._block = func_ir, block
        self._asked = [
            each
            for each in block.find_insts(numba_ir.Assign)
            if getattr(each.value, "op", "") == "binop" and each.value.fn in (operator.is_, operator.is_not)
            if self._kind(guard(get_definition, func_ir, each.value.lhs)) is not None
        ]
        return bool(self._asked)

    def _kind(self, value: Any) -> Any:
        """Type of a field of a record that is an argument, or within one; None if it is something else."""
        if getattr(value, "op", "") != "getattr":
            return None
        owner = guard(get_definition, self._function, value.value)
        kind = self._kinds[owner.index] if isinstance(owner, numba_ir.Arg) else self._kind(owner)
        return kind.fields.get(value.attr) if isinstance(kind, Fields) else None

    def apply(self) -> Any:
        """Write the answers into the block."""
        for each in self._asked:
            is_absent = self._kind(get_definition(self._function, each.value.lhs)) is types.none
            answer = numba_ir.Const(is_absent == (each.value.fn is operator.is_), each.loc)
            definitions = self._function._definitions[each.target.name]
            definitions[definitions.index(each.value)] = each.value = answer
        self._function._consts = ConstantInference(self._function)
        return self._block


# ---------------------------------------------------------------- arrays within a record


def _pointer_and_sizes(builder: Any, kind: Numbers, value: Any) -> tuple[Any, list[Any]]:
    if not kind.unknown:
        return value, [_WHOLE(size) for size in kind.shape]
    pointer, *sizes = cgutils.unpack_tuple(builder, value, 1 + kind.unknown)
    unknown = iter(sizes)
    return pointer, [next(unknown) if isinstance(size, str) else _WHOLE(size) for size in kind.shape]


@type_callable(len)
def _type_of_len(context: Any) -> Any:
    return lambda numbers: types.intp if isinstance(numbers, Numbers) else None


@lower_builtin(len, Numbers)
def _len(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _pointer_and_sizes(builder, sig.args[0], args[0])[1][0]


def _fits(kind: Any, index: Any) -> bool:
    if isinstance(kind, Numbers) and isinstance(index, types.Integer):
        return len(kind.shape) == 1
    return isinstance(kind, Numbers) and isinstance(index, types.BaseTuple) and len(index) == len(kind.shape)


@type_callable(operator.getitem)
def _type_of_getitem(context: Any) -> Any:
    return lambda numbers, index: types.float64 if _fits(numbers, index) else None


@infer_global(operator.setitem)
class NumbersSet(AbstractTemplate):
    """``P[i, j] = value``."""

    def generic(self, args: Any, kws: Any) -> Any:
        """Signature: what is assigned becomes a float64."""
        return signature(types.none, args[0], args[1], types.float64) if _fits(args[0], args[1]) else None


def _element(context: Any, builder: Any, kind: Any, value: Any, index_type: Any, index: Any) -> Any:
    pointer, sizes = _pointer_and_sizes(builder, kind, value)
    indices, kinds = [index], [index_type]
    if isinstance(index_type, types.BaseTuple):
        indices, kinds = cgutils.unpack_tuple(builder, index), [*index_type]
    indices = [context.cast(builder, i, of, types.intp) for i, of in zip(indices, kinds, strict=True)]
    place = indices[0]
    for size, i in zip(sizes[1:], indices[1:], strict=True):
        place = builder.add(builder.mul(place, size, flags=("nsw",)), i, flags=("nsw",))
    return builder.gep(pointer, [place], inbounds=True)


@lower_builtin(operator.getitem, Numbers, types.Any)
def _get_item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.load(_element(context, builder, sig.args[0], args[0], sig.args[1], args[1]))


@lower_builtin(operator.setitem, Numbers, types.Any, types.Any)
def _set_item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    builder.store(args[2], _element(context, builder, sig.args[0], args[0], sig.args[1], args[1]))
    return context.get_dummy_value()


# ---------------------------------------------------------------- room on the stack, and one of many records


def _room(builder: Any, size: int) -> Any:
    place = cgutils.alloca_once(builder, ir.ArrayType(_NUMBER, size))
    return builder.bitcast(place, _POINTER)


def in_the_caller(generator: Callable[..., Any]) -> Callable[[Function], Function]:
    """Compile calls of a function by a generator of LLVM code, in the function that calls it.

    Room on the stack is that of the function that asks for it: in one put into its caller it would end early.
    """

    def decorate(function: Function) -> Function:
        template = make_intrinsic_template(function, generator, generator.__name__, prefer_literal=True)
        infer_global(function, types.Function(template))
        return function

    return decorate


def _room_for(shape: Any, *arguments: Any) -> Any:
    """Signature and code of what makes room for an array of constant shape."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _room(builder, math.prod(shape))

    return Numbers(shape)(*arguments), generate


def _like(typingctx: Any, numbers: Any) -> Any:
    return _room_for(numbers.shape, numbers) if isinstance(numbers, Numbers) and not numbers.unknown else None


def _local(typingctx: Any, size: Any) -> Any:
    return _room_for((size.literal_value,), size) if isinstance(size, types.IntegerLiteral) else None


def _local_rows(typingctx: Any, rows: Any, columns: Any) -> Any:
    sizes = [size.literal_value for size in (rows, columns) if isinstance(size, types.IntegerLiteral)]
    return _room_for(tuple(sizes), rows, columns) if len(sizes) == 2 else None


@in_the_caller(_like)
def like(numbers: Any) -> Any:
    """Room for as many numbers, for the time of a call: their values are not set."""
    return np.empty_like(numbers)


@in_the_caller(_local)
def local(size: int) -> Any:
    """Room for `size` numbers, a constant, for the time of a call: their values are not set."""
    return np.empty(size)


@in_the_caller(_local_rows)
def local_rows(rows: int, columns: int) -> Any:
    """Room for rows of numbers, of constant sizes, for the time of a call."""
    return np.empty((rows, columns))


def _nth(typingctx: Any, records: Any, i: Any) -> Any:
    if not isinstance(records, Fields):
        return None

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        end = _place(builder, records, args[0], None)
        size = _numbers_between(builder, args[0], end)
        return builder.gep(args[0], [builder.mul(size, args[1])], inbounds=True)

    return records(records, types.intp), generate


@in_the_caller(_nth)
def nth(records: Any, i: int) -> Any:
    """One of many records, of a structured array with one axis."""
    return records[i]
