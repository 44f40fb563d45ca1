"""The force laws, compiled: one function of (d, v) chosen by its number."""

from __future__ import annotations

import math

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from seatdyn.kernels import codes
from seatdyn.kernels.jit import kernel

TANGENT_END = 0.999  # share of the travel where the tangent law goes on along its slope


@intrinsic
def call_user_law(typingctx, address, d, v, parameters):
    """Call the C function at an address with (d, v, pointer to the parameters)."""
    signature = types.float64(types.int64, types.float64, types.float64, types.CPointer(types.float64))

    def codegen(context, builder, _signature, args):
        double = ir.DoubleType()
        function_type = ir.FunctionType(double, [double, double, double.as_pointer()])
        function = builder.inttoptr(args[0], function_type.as_pointer())
        return builder.call(function, args[1:])

    return signature, codegen


@intrinsic
def pointer_at(typingctx, array, index):
    """Pointer to element `index` of a contiguous array."""
    signature = types.CPointer(types.float64)(array, types.int64)

    def codegen(context, builder, sig, args):
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        return builder.gep(data, [args[1]])

    return signature, codegen


@kernel
def table_force(x, p, i):
    """Monotone cubic through the table at p[i:]: count, points, values, slopes."""
    n = int(p[i])
    points, values, slopes = i + 1, i + 1 + n, i + 1 + 2 * n
    if x <= p[points]:
        return p[values] + p[slopes] * (x - p[points])
    if x >= p[points + n - 1]:
        return p[values + n - 1] + p[slopes + n - 1] * (x - p[points + n - 1])
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if p[points + middle] <= x:
            low = middle
        else:
            high = middle
    h = p[points + high] - p[points + low]
    s = (x - p[points + low]) / h
    rise = p[values + high] - p[values + low]
    m0, m1 = h * p[slopes + low], h * p[slopes + high]
    return p[values + low] + s * (m0 + s * (3 * rise - 2 * m0 - m1 + s * (m0 + m1 - 2 * rise)))


@kernel
def tangent_force(d, k, travel):
    """Tangent spring, continued along its slope near the end of the travel."""
    edge = TANGENT_END * travel
    inside = min(max(d, -edge), edge)
    scale = math.pi / (2.0 * travel)
    tangent = math.tan(scale * inside)
    return k * (tangent / scale + (1.0 + tangent * tangent) * (d - inside))


@kernel
def end_stop_force(d, v, k, lower, upper, c):
    """Buffers with stiffness and damping that never pull."""
    if d > upper:
        return max(0.0, k * (d - upper) + c * v)
    if d < lower:
        return min(0.0, k * (d - lower) + c * v)
    return 0.0


@kernel
def law_force(code, d, v, p, i, address):
    """Force of one law with parameters p[i:], N, positive in tension."""
    if code == codes.QUADRATIC:
        return p[i] * abs(v) * v
    if code == codes.COULOMB:
        return (2.0 / math.pi) * p[i] * math.atan(p[i + 1] * v)
    if code == codes.JUMP:
        return p[i] * d if (d > p[i + 2] or d < p[i + 1]) else 0.0
    if code == codes.GAP:
        if d > p[i + 2]:
            return p[i] * (d - p[i + 2])
        return p[i] * (d - p[i + 1]) if d < p[i + 1] else 0.0
    if code == codes.END_STOP:
        return end_stop_force(d, v, p[i], p[i + 1], p[i + 2], p[i + 3])
    if code == codes.TANGENT_POLYNOMIAL:
        polynomial = d * (p[i + 2] + d * (p[i + 3] + d * (p[i + 4] + d * (p[i + 5] + d * p[i + 6]))))
        return tangent_force(d, p[i], p[i + 1]) + polynomial
    if code == codes.POLYNOMIAL_DAMPER:
        return v * (p[i] + d * (p[i + 1] + d * (p[i + 2] + d * (p[i + 3] + d * p[i + 4]))))
    if code == codes.ASYMMETRIC_DAMPER:
        return p[i] * v if v < 0.0 else p[i + 1] * v
    if code == codes.TABLE_SPRING:
        return table_force(d, p, i)
    if code == codes.TABLE_DAMPER:
        return table_force(v, p, i)
    if code == codes.CONSTANT:
        return p[i]
    return call_user_law(address, d, v, pointer_at(p, i))

