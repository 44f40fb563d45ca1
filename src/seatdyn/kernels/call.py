"""Calling a force law by the address of its compiled C function."""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


@intrinsic
def call_law(typingctx, address, d, v, parameters, offset):
    """Force F(d, v, p) of the C function at `address`, p beginning at parameters[offset]."""
    signature = types.float64(types.int64, types.float64, types.float64, parameters, types.int64)

    def codegen(context, builder, sig, args):
        double = ir.DoubleType()
        law_type = ir.FunctionType(double, [double, double, double.as_pointer()])
        law = builder.inttoptr(args[0], law_type.as_pointer())
        data = context.make_array(sig.args[3])(context, builder, args[3]).data
        return builder.call(law, [args[1], args[2], builder.gep(data, [args[4]])])

    return signature, codegen


@intrinsic
def add_forces(typingctx, address, count, motion, d, v, parameters, offset, force, at):
    """force[at : at + count] += F of the law for lanes at `address` (see `jit.lanes_law_address`).

    d, v : where the displacements and velocities begin in `motion`; parameters begin at `offset`.
    All places count numbers of contiguous arrays.
    """
    index = types.int64
    signature = types.void(index, index, motion, index, index, parameters, index, force, index)

    def codegen(context, builder, sig, args):
        number, integer = ir.DoubleType().as_pointer(), ir.IntType(64)
        law_type = ir.FunctionType(ir.VoidType(), [integer, number, number, number, number])
        law = builder.inttoptr(args[0], law_type.as_pointer())

        def pointer(array, place):
            data = context.make_array(sig.args[array])(context, builder, args[array]).data
            return builder.gep(data, [args[place]])

        places = pointer(2, 3), pointer(2, 4), pointer(5, 6), pointer(7, 8)
        builder.call(law, [args[1], *places])
        return context.get_dummy_value()

    return signature, codegen
