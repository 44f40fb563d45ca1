"""A row times a matrix, several columns at a time: what a ladder step spends most of its time on.

The compiler does not find the vector instructions by itself, since it must reckon with negative
indices and with arrays that overlap; so they are spelled out.
"""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

CONTRACT = ("contract",)  # a product and a sum may be one instruction
WIDTH = 8  # columns that are summed up side by side; matrices have a multiple of it
TOGETHER = (4, 2, 1)  # such sums at once: a single one waits for its own last addition


@intrinsic
def product(typingctx, known, row, place, matrices, index, result):
    """result = known + row[place : place + rows] @ matrices[index]; no bounds are checked.

    known : (columns,), or None for nothing
    row : (>= place + rows,)
    matrices : (L, rows, columns), columns a multiple of WIDTH
    result : (columns,)
    All are C-contiguous; of `known` and `result` the axes count as one.
    """
    signature = types.void(known, row, types.int64, matrices, types.int64, result)

    def codegen(context, builder, sig, args):
        def pointer(i):
            return context.make_array(sig.args[i])(context, builder, args[i]).data

        table = context.make_array(sig.args[3])(context, builder, args[3])
        _, rows, columns = cgutils.unpack_tuple(builder, table.shape)
        start, end = builder.gep(pointer(1), [args[2]]), pointer(5)
        before = None if sig.args[0] == types.none else pointer(0)
        vector = ir.VectorType(ir.DoubleType(), WIDTH)
        first = builder.gep(table.data, [builder.mul(args[4], builder.mul(rows, columns))])

        def at(pointer, place, block):
            """Pointer to WIDTH numbers; they need not be aligned."""
            place = builder.add(place, ir.Constant(columns.type, WIDTH * block))
            return builder.bitcast(builder.gep(pointer, [place]), vector.as_pointer())

        def sum_up(column, totals):
            for block, total in enumerate(totals):
                value = ir.Constant(vector, [0.0] * WIDTH)
                if before is not None:
                    value = builder.load(at(before, column, block), align=8)
                builder.store(value, total)
            with cgutils.for_range(builder, rows) as loop:
                x = builder.load(builder.gep(start, [loop.index]))
                one = builder.insert_element(
                    ir.Constant(vector, ir.Undefined), x, ir.IntType(32)(0)
                )
                all_x = builder.shuffle_vector(
                    one, one, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
                )
                place = builder.add(builder.mul(loop.index, columns), column)
                for block, total in enumerate(totals):
                    entries = builder.load(at(first, place, block), align=8)
                    change = builder.fmul(all_x, entries, flags=CONTRACT)
                    builder.store(builder.fadd(builder.load(total), change, flags=CONTRACT), total)
            for block, total in enumerate(totals):
                builder.store(builder.load(total), at(end, column, block), align=8)

        begin = columns.type(0)
        for blocks in TOGETHER:
            totals = [cgutils.alloca_once(builder, vector) for _ in range(blocks)]
            size = ir.Constant(columns.type, WIDTH * blocks)
            stop = builder.mul(builder.sdiv(columns, size), size)
            with cgutils.for_range_slice(builder, begin, stop, size, inc=True) as (column, _):
                sum_up(column, totals)
            begin = stop
        return context.get_dummy_value()

    return signature, codegen
