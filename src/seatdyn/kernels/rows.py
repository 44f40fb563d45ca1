"""A number of several members at once: a row, which numba code uses as if it were one number.

`load` and `store` move rows from and to arrays whose last axis is as long as a row; between them
the usual operators work on all members with one instruction. So a kernel is written as for one
member, but for choices, which `where_larger` makes for each member.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from seatdyn.kernels.jit import inlined

WIDTH = 8  # members of a row
NUMBER = ir.DoubleType()
VECTOR = ir.VectorType(NUMBER, WIDTH)
BLOCK = 2**17  # numbers of a piece of `Space`, at least
ALIGNMENT = 8  # bytes: numba promises no more


class Row(types.Type):
    """Type of a row."""

    def __init__(self) -> None:
        """Name it."""
        super().__init__(name="Row")


ROW = Row()


@register_model(Row)
class RowModel(models.PrimitiveModel):  # type: ignore[misc]
    """How it is kept: in one register."""

    def __init__(self, manager: Any, kind: Any) -> None:
        """Tell the type of the register."""
        super().__init__(manager, kind, VECTOR)


def _spread(builder: Any, value: Any) -> Any:
    """A row with the same number for all."""
    if value.type == VECTOR:
        return value
    empty = ir.Constant(VECTOR, ir.Undefined)
    one = builder.insert_element(empty, value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), None)
    return builder.shuffle_vector(one, empty, zeros)


def _binary(function: Any, emit: Callable[[Any, Any, Any], Any]) -> None:
    """Let an operator work on two rows, or a row and a number."""
    pairs = [(ROW, ROW), (ROW, types.float64), (types.float64, ROW)]

    class Cases(ConcreteTemplate):
        cases = [signature(ROW, *pair) for pair in pairs]

    infer_global(function)(Cases)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return emit(builder, _spread(builder, args[0]), _spread(builder, args[1]))

    for pair in pairs:
        lower_builtin(function, *pair)(lower)


CONTRACT = ("contract",)  # a product and a sum may be one instruction
_binary(operator.add, lambda builder, a, b: builder.fadd(a, b, flags=CONTRACT))
_binary(operator.sub, lambda builder, a, b: builder.fsub(a, b, flags=CONTRACT))
_binary(operator.mul, lambda builder, a, b: builder.fmul(a, b, flags=CONTRACT))
_binary(operator.truediv, lambda builder, a, b: builder.fdiv(a, b))


def _place(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> Any:
    if kind.layout != "C":
        raise TypeError(f"{kind} must be contiguous, row by row")
    data = context.make_array(kind)(context, builder, array).data
    return builder.gep(builder.bitcast(data, VECTOR.as_pointer()), [index])


def empty_rows(*shape: int) -> Any:
    """Array not yet filled whose rows do not lie across two lines of the cache."""
    size = math.prod(shape)
    space = np.empty(size + WIDTH)
    start = -(space.ctypes.data // space.itemsize) % WIDTH
    return space[start : start + size].reshape(shape)


def aligned(values: Any) -> Any:
    """Copy of an array of numbers, (..., WIDTH), that is laid out so."""
    result = empty_rows(*values.shape)
    result[...] = values
    return result


class Space:
    """Memory for arrays of rows that is used again: new pages take as long as some kernels."""

    def __init__(self) -> None:
        """Begin with none."""
        self._blocks: list[Any] = []
        self.clear()

    def clear(self) -> None:
        """Let all of it be used again: arrays that were taken before lose their numbers."""
        self._block = self._place = 0

    def take(self, *shape: int) -> Any:
        """Take an array that is not yet filled."""
        size = math.prod(shape)
        while True:
            if self._block == len(self._blocks):
                self._blocks.append(empty_rows(max(size, BLOCK)))
            block, end = self._blocks[self._block], self._place + size
            if end <= block.size:
                taken = block[self._place : end].reshape(shape)
                self._place = -(-end // WIDTH) * WIDTH
                return taken
            self._block, self._place = self._block + 1, 0


@intrinsic
def load(typingctx, array, index):
    """Row `index` of an array of rows; its axes but the last count as one."""

    def codegen(context, builder, sig, args):
        return builder.load(_place(context, builder, sig.args[0], *args), align=ALIGNMENT)

    return ROW(array, types.int64), codegen


@intrinsic
def load_at(typingctx, array, place):
    """Eight numbers of a contiguous array from number `place` on; its axes count as one."""

    def codegen(context, builder, sig, args):
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        pointer = builder.bitcast(builder.gep(data, [args[1]]), VECTOR.as_pointer())
        return builder.load(pointer, align=ALIGNMENT)

    return ROW(array, types.int64), codegen


@intrinsic
def store(typingctx, array, index, value):
    """Put a row, or the same number for all, into an array of rows."""

    def codegen(context, builder, sig, args):
        place = _place(context, builder, sig.args[0], args[0], args[1])
        builder.store(_spread(builder, args[2]), place, align=ALIGNMENT)
        return context.get_dummy_value()

    return types.void(array, types.int64, value), codegen


@intrinsic
def copy_ahead(typingctx, source, at, target, to, count):
    """Copy `count` numbers (or integers) of contiguous arrays, row by row: up to seven too many.

    at, to : where they begin; all axes count as one
    """
    index = types.int64

    def codegen(context, builder, sig, args):
        source, target = (
            builder.bitcast(
                builder.gep(
                    context.make_array(sig.args[i])(context, builder, args[i]).data, [args[i + 1]]
                ),
                NUMBER.as_pointer(),
            )
            for i in (0, 2)
        )
        step = ir.Constant(ir.IntType(64), WIDTH)
        with cgutils.for_range_slice(builder, step.type(0), args[4], step) as (place, _):
            start, end = (
                builder.bitcast(builder.gep(pointer, [place]), VECTOR.as_pointer())
                for pointer in (source, target)
            )
            builder.store(builder.load(start, align=ALIGNMENT), end, align=ALIGNMENT)
        return context.get_dummy_value()

    return types.void(source, index, target, index, index), codegen


@intrinsic
def spread(typingctx, value):
    """A row with the same number for all members."""
    return ROW(types.float64), lambda context, builder, sig, args: _spread(builder, args[0])


@intrinsic
def where_larger(typingctx, a, b, yes, no):
    """For each member `yes` where a > b, else `no`."""

    def codegen(context, builder, sig, args):
        a, b, yes, no = (_spread(builder, value) for value in args)
        return builder.select(builder.fcmp_ordered(">", a, b), yes, no)

    return ROW(a, b, yes, no), codegen


@inlined
def larger_of(a, b):
    """For each member the larger of two."""
    return where_larger(a, b, a, b)


@inlined
def size_of(a):
    """Every member without its sign."""
    return where_larger(a, 0.0, a, -1.0 * a)


@intrinsic
def any_larger(typingctx, a, b):
    """Whether a > b for any member."""

    def codegen(context, builder, sig, args):
        a, b = (_spread(builder, value) for value in args)
        flags = builder.fcmp_ordered(">", a, b)
        packed = builder.bitcast(flags, ir.IntType(WIDTH))
        return builder.icmp_unsigned("!=", packed, ir.Constant(ir.IntType(WIDTH), 0))

    return types.boolean(a, b), codegen


@intrinsic
def root_of(typingctx, a):
    """Square root of a row."""

    def codegen(context, builder, sig, args):
        sqrt = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(VECTOR, [VECTOR]), f"llvm.sqrt.v{WIDTH}f64"
        )
        return builder.call(sqrt, args)

    return ROW(a), codegen


def _folded(builder, row, fold):
    """Fold halves of a row onto each other until one number is left."""
    width = WIDTH // 2
    while width:
        mask = [(i + width) % WIDTH for i in range(WIDTH)]
        kind = ir.VectorType(ir.IntType(32), WIDTH)
        row = fold(row, builder.shuffle_vector(row, row, ir.Constant(kind, mask)))
        width //= 2
    return builder.extract_element(row, ir.Constant(ir.IntType(32), 0))


@intrinsic
def sum_of(typingctx, a):
    """Sum over the members of a row."""

    def codegen(context, builder, sig, args):
        return _folded(builder, args[0], builder.fadd)

    return types.float64(a), codegen


@intrinsic
def largest_of(typingctx, a):
    """Largest member of a row; what is no number may be passed over."""

    def codegen(context, builder, sig, args):
        def larger(one, other):
            return builder.select(builder.fcmp_ordered(">", one, other), one, other)

        return _folded(builder, args[0], larger)

    return types.float64(a), codegen


@intrinsic
def member_of(typingctx, a, i):
    """Member i of a row."""
    return types.float64(a, i), lambda context, builder, sig, args: builder.extract_element(*args)
