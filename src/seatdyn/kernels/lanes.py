"""Arithmetic on the members of an ensemble side by side: one vector register operation a row.

numba's own loops cannot be vectorised here: it has to assume that the arrays overlap.
"""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 16  # members that march together

ROW = ir.VectorType(ir.DoubleType(), LANES)
ALIGNMENT = 8  # bytes: numba promises no more


def _data(context, builder, kind, value):
    return context.make_array(kind)(context, builder, value).data


def _row(builder, data, index):
    """Pointer to row `index` of an array (rows, LANES)."""
    return builder.gep(builder.bitcast(data, ROW.as_pointer()), [index])


def _spread(builder, value):
    """A row with the same value in every lane."""
    empty = ir.Constant(ROW, ir.Undefined)
    one = builder.insert_element(empty, value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), None)
    return builder.shuffle_vector(one, empty, zeros)


def _weighted_sum(context, builder, signature, arguments, start):
    """Store start(place) + sum over k < count of matrix[first + k, column] * source[k]."""
    matrix, first, count, column, source, target = arguments
    weights = context.make_array(signature.args[0])(context, builder, matrix)
    columns = builder.extract_value(weights.shape, 1)
    rows = _data(context, builder, signature.args[4], source)
    place = _row(builder, _data(context, builder, signature.args[5], target), column)
    total = cgutils.alloca_once_value(builder, start(builder, place))
    with cgutils.for_range(builder, count) as loop:
        index = builder.add(builder.mul(builder.add(first, loop.index), columns), column)
        weight = _spread(builder, builder.load(builder.gep(weights.data, [index])))
        row = builder.load(_row(builder, rows, loop.index), align=ALIGNMENT)
        product = builder.fmul(weight, row, flags=("contract",))
        builder.store(builder.fadd(builder.load(total), product, flags=("contract",)), total)
    builder.store(builder.load(total), place, align=ALIGNMENT)
    return context.get_dummy_value()


def _signature(matrix, source, target):
    return types.void(matrix, types.int64, types.int64, types.int64, source, target)


@intrinsic
def add_row(typingctx, matrix, first, count, column, source, target):
    """target[column] += sum over k < count of matrix[first + k, column] * source[k].

    matrix (rows, columns); source, target (rows, LANES); all contiguous.
    """

    def codegen(context, builder, sig, args):
        def start(builder, place):
            return builder.load(place, align=ALIGNMENT)

        return _weighted_sum(context, builder, sig, args, start)

    return _signature(matrix, source, target), codegen


@intrinsic
def set_row(typingctx, matrix, first, count, column, source, target):
    """The same, beginning from zero."""

    def codegen(context, builder, sig, args):
        def start(builder, place):
            return ir.Constant(ROW, [0.0] * LANES)

        return _weighted_sum(context, builder, sig, args, start)

    return _signature(matrix, source, target), codegen


@intrinsic
def gather_row(typingctx, values, index, statistics):
    """Add row `index` of values (s, LANES) to its statistics, (s, 5, LANES).

    They are sum, sum of squares, sum of fourth powers, lowest, highest.
    """
    signature = types.void(values, types.int64, statistics)

    def codegen(context, builder, sig, args):
        value = builder.load(
            _row(builder, _data(context, builder, sig.args[0], args[0]), args[1]), align=ALIGNMENT
        )
        square = builder.fmul(value, value)
        data = _data(context, builder, sig.args[2], args[2])
        first = builder.mul(args[1], ir.Constant(ir.IntType(64), 5))
        for k, term in enumerate((value, square, builder.fmul(square, square))):
            place = _row(builder, data, builder.add(first, ir.Constant(ir.IntType(64), k)))
            builder.store(
                builder.fadd(builder.load(place, align=ALIGNMENT), term), place, align=ALIGNMENT
            )
        for k, order in ((3, "<"), (4, ">")):
            place = _row(builder, data, builder.add(first, ir.Constant(ir.IntType(64), k)))
            present = builder.load(place, align=ALIGNMENT)
            better = builder.fcmp_ordered(order, value, present)
            builder.store(builder.select(better, value, present), place, align=ALIGNMENT)
        return context.get_dummy_value()

    return signature, codegen
