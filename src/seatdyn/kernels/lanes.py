"""Arithmetic on the members of an ensemble side by side: a row is one number of every member.

numba's own loops cannot be vectorised here: it has to assume that the arrays overlap. Here the
rows are vectors to the compiler, and products keep their sums in registers: four columns at once,
because one sum alone would wait for its own last addition.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 16  # members that march together

ROW = ir.VectorType(ir.DoubleType(), LANES)
INDEX = ir.IntType(64)
ALIGNMENT = 8  # bytes: numba promises no more
TOGETHER = (4, 2, 1)  # sums that are kept in registers at once; the rest of the columns follows
MOMENTS = 3  # kept of an output that is watched: sum of fourth powers, lowest, highest


def _array(context, kind, builder, value):
    if kind.layout != "C":
        raise TypeError(f"{kind} must be contiguous, row by row")
    return context.make_array(kind)(context, builder, value)


def _length(builder, array, axis=0):
    return builder.extract_value(array.shape, axis)


def _row(builder, array, index):
    """Pointer to row `index` of an array of rows."""
    return builder.gep(builder.bitcast(array.data, ROW.as_pointer()), [index])


def _load(builder, array, index):
    return builder.load(_row(builder, array, index), align=ALIGNMENT)


def _store(builder, value, array, index):
    builder.store(value, _row(builder, array, index), align=ALIGNMENT)


def _spread(builder, value):
    """A row with the same value in every lane."""
    empty = ir.Constant(ROW, ir.Undefined)
    one = builder.insert_element(empty, value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), None)
    return builder.shuffle_vector(one, empty, zeros)


def _add_product(builder, total, first, second):
    """total + first * second, in one instruction where the processor has it."""
    return builder.fadd(
        total, builder.fmul(first, second, flags=("contract",)), flags=("contract",)
    )


def _summed(builder, count, width, terms: Callable[[Any], Iterable[Any]]) -> list[Any]:
    """Sums over k < count of `width` products of two rows, as terms(k) lists them."""
    totals = [cgutils.alloca_once(builder, ROW) for _ in range(width)]
    for total in totals:
        builder.store(ir.Constant(ROW, [0.0] * LANES), total)
    with cgutils.for_range(builder, count) as loop:
        for total, (first, second) in zip(totals, terms(loop.index), strict=True):
            builder.store(_add_product(builder, builder.load(total), first, second), total)
    return [builder.load(total) for total in totals]


def _in_blocks(builder, count, body: Callable[[Any, int], None]) -> None:
    """Call body(column, width) for all columns < count, several together."""
    begin = ir.Constant(INDEX, 0)
    for width in TOGETHER:
        step = ir.Constant(INDEX, width)
        end = builder.mul(builder.sdiv(count, step), step)
        with cgutils.for_range_slice(builder, begin, end, step, inc=True) as (column, _):
            body(column, width)
        begin = end


@intrinsic
def multiply(typingctx, matrix, first, count, source, at, target, to):
    """target[to:] = matrix[first : first + count].T @ source[at : at + count].

    matrix (rows, columns); source, target (rows, LANES); contiguous. Slices would count references.
    """
    index = types.int64
    signature = types.void(matrix, index, index, source, index, target, index)

    def codegen(context, builder, sig, args):
        weights, rows, sums = (_array(context, sig.args[i], builder, args[i]) for i in (0, 3, 5))
        _, first, count, _, at, _, to = args
        columns = _length(builder, weights, 1)

        def body(column, width):
            def terms(k):
                row = _load(builder, rows, builder.add(at, k))
                place = builder.add(builder.mul(builder.add(first, k), columns), column)
                for c in range(width):
                    index = builder.add(place, ir.Constant(INDEX, c))
                    weight = builder.load(builder.gep(weights.data, [index]))
                    yield _spread(builder, weight), row

            place = builder.add(to, column)
            for c, total in enumerate(_summed(builder, count, width, terms)):
                _store(builder, total, sums, builder.add(place, ir.Constant(INDEX, c)))

        _in_blocks(builder, columns, body)
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def gather_products(typingctx, table, stride, times, gram):
    """Add products of rows with each other, and the rows, over some `times` of a table.

    table : rows; those of one time begin `stride` after those of the time before
    gram : (K, K + 1, LANES) of the first K rows: [i, j] for j <= i sums products, [i, K] rows
    """
    index = types.int64
    signature = types.void(table, index, index, gram)

    def codegen(context, builder, sig, args):
        rows = _array(context, sig.args[0], builder, args[0])
        sums = _array(context, sig.args[3], builder, args[3])
        stride, times, count = args[1], args[2], _length(builder, sums)
        one = ir.Constant(INDEX, 1)
        with cgutils.for_range(builder, count) as loop:
            i = loop.index
            begin = builder.mul(i, builder.add(count, one))

            def add(column, totals):
                for c, total in enumerate(totals):
                    place = builder.add(begin, builder.add(column, ir.Constant(INDEX, c)))
                    _store(builder, builder.fadd(_load(builder, sums, place), total), sums, place)

            def body(column, width):
                def terms(time):
                    place = builder.mul(time, stride)
                    row = _load(builder, rows, builder.add(place, i))
                    place = builder.add(place, column)
                    for c in range(width):
                        other = builder.add(place, ir.Constant(INDEX, c))
                        yield _load(builder, rows, other), row

                add(column, _summed(builder, times, width, terms))

            def alone(time):
                row = _load(builder, rows, builder.add(builder.mul(time, stride), i))
                return [(row, ir.Constant(ROW, [1.0] * LANES))]

            _in_blocks(builder, builder.add(i, one), body)
            add(count, _summed(builder, times, 1, alone))
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def gather_extremes(typingctx, table, times, extremes):
    """Add some `times` of a table (times * s, LANES) to what is kept of each row.

    extremes : (s, 3, LANES) sum of fourth powers, lowest, highest
    """
    signature = types.void(table, types.int64, extremes)

    def codegen(context, builder, sig, args):
        rows = _array(context, sig.args[0], builder, args[0])
        kept = _array(context, sig.args[2], builder, args[2])
        count = _length(builder, kept)
        with cgutils.for_range(builder, count) as loop:
            begin = builder.mul(loop.index, ir.Constant(INDEX, MOMENTS))
            places = [builder.add(begin, ir.Constant(INDEX, k)) for k in range(MOMENTS)]
            fourth, lowest, highest = (
                cgutils.alloca_once_value(builder, _load(builder, kept, place)) for place in places
            )
            with cgutils.for_range(builder, args[1]) as time:
                place = builder.add(builder.mul(time.index, count), loop.index)
                value = _load(builder, rows, place)
                square = builder.fmul(value, value)
                total = _add_product(builder, builder.load(fourth), square, square)
                builder.store(total, fourth)
                for order, best in (("<", lowest), (">", highest)):
                    present = builder.load(best)
                    better = builder.fcmp_ordered(order, value, present)
                    builder.store(builder.select(better, value, present), best)
            for place, result in zip(places, (fourth, lowest, highest), strict=True):
                _store(builder, builder.load(result), kept, place)
        return context.get_dummy_value()

    return signature, codegen
