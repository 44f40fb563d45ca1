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
