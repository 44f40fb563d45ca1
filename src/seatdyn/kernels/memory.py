"""A system with states beside its motion, as arrays, and the rates of all of them at an instant."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from seatdyn.kernels.columns import BREAKS, FIRST, SECOND
from seatdyn.kernels.jit import inner
from seatdyn.kernels.plant import (
    FREE,
    base_motion,
    hold,
    is_holding,
    relative,
)
from seatdyn.kernels.sides import channel_force

HELD = 2  # side of a jump that the state rests on
FORCE, RATE, PARAMETERS, STATES = range(4)  # columns of `laws`


class Memory(NamedTuple):
    """Elements with states, their breaks and those of the plant, and forces on nodes.

    N nodes, e elements, q states, l forces. A break is a line p d + q v = value; those of the plant
    come first, in its order.
    """

    nodes: np.ndarray  # (e, 2) int: first and second node, -1 for the base
    laws: np.ndarray  # (e+1, 4) int: addresses of force and rate, begin of parameters and states
    parameters: np.ndarray
    pull: np.ndarray  # (N, e) acceleration lost per unit force of an element
    edges: np.ndarray  # (b, 5) first, second node, p, q, value
    push: np.ndarray  # (N, l) acceleration per unit outside force
    pushed: np.ndarray  # (l,) int: the node that each acts on
    waves: np.ndarray  # (k, 11) force, start, polynomial (6), sine: amplitude, omega, phase
    sines: np.ndarray  # (n, 4) force, amplitude, omega, phase


class Space(NamedTuple):
    """Scratch of a run."""

    motion: np.ndarray  # (2N,)
    acceleration: np.ndarray  # (N,)
    force: np.ndarray  # (m,) of the channels
    k: np.ndarray  # (7, 2N+q) rates at the stages
    active: np.ndarray  # (l,) int: the segment of each outside force
    held: np.ndarray  # (m,) int: the jump that each channel rests on, or FREE


@intrinsic
def call_memory_force(typingctx, address, d, v, y, state, parameters, offset):
    """Force of the C function at `address`, states from y[state], parameters from [offset]."""
    real, whole = types.float64, types.int64
    signature = real(whole, real, real, y, whole, parameters, whole)

    def codegen(context, builder, sig, args):
        double, pointer = ir.DoubleType(), ir.DoubleType().as_pointer()
        law = builder.inttoptr(
            args[0], ir.FunctionType(double, [double, double, pointer, pointer]).as_pointer()
        )
        states = context.make_array(sig.args[3])(context, builder, args[3]).data
        data = context.make_array(sig.args[5])(context, builder, args[5]).data
        return builder.call(
            law, [args[1], args[2], builder.gep(states, [args[4]]), builder.gep(data, [args[6]])]
        )

    return signature, codegen


@intrinsic
def call_memory_rate(typingctx, address, d, v, w, a, y, state, parameters, offset, out):
    """Rates of the C function at `address`, written to out[state] and what follows."""
    real, whole = types.float64, types.int64
    signature = types.void(whole, real, real, real, real, y, whole, parameters, whole, out)

    def codegen(context, builder, sig, args):
        double, pointer = ir.DoubleType(), ir.DoubleType().as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [double] * 4 + [pointer] * 3)
        law = builder.inttoptr(args[0], kind.as_pointer())
        states = context.make_array(sig.args[5])(context, builder, args[5]).data
        data = context.make_array(sig.args[7])(context, builder, args[7]).data
        rates = context.make_array(sig.args[9])(context, builder, args[9]).data
        builder.call(
            law,
            [
                *args[1:5],
                builder.gep(states, [args[6]]),
                builder.gep(data, [args[8]]),
                builder.gep(rates, [args[6]]),
            ],
        )
        return context.get_dummy_value()

    return signature, codegen


@inner
def outside_force(memory, t, number, row):
    """Outside force `number` at time t, N, on its segment `row`."""
    total = 0.0
    for i in range(memory.sines.shape[0]):
        if memory.sines[i, 0] == number:
            angle = memory.sines[i, 2] * t + memory.sines[i, 3]
            total += memory.sines[i, 1] * math.sin(angle)
    p = memory.waves
    tau = t - p[row, 1]
    polynomial = 0.0
    for power in range(7, 1, -1):
        polynomial = polynomial * tau + p[row, power]
    return total + polynomial + p[row, 8] * math.sin(p[row, 9] * tau + p[row, 10])


@inner
def find_segments(memory, t, active):
    """Segment of every outside force at time t."""
    for row in range(memory.waves.shape[0]):
        if memory.waves[row, 1] <= t:
            active[int(memory.waves[row, 0])] = row


@inner
def across(first, second, y, n, base):
    """Displacement, velocity across two nodes, and absolute velocity of the second."""
    d = (y[second] if second >= 0 else base[0]) - (y[first] if first >= 0 else base[0])
    w = y[n + second] if second >= 0 else base[1]
    return d, w - (y[n + first] if first >= 0 else base[1]), w


@inner
def stands(plant, held, first, second):
    """Whether a channel between these nodes is held: its speed is zero, but for rounding."""
    for j in range(held.size):
        if held[j] >= 0:
            a, b = plant.channels[j, FIRST], plant.channels[j, SECOND]
            if (a == first and b == second) or (a == second and b == first):
                return True
    return False


@inner
def rates(plant, memory, t, segment, y, side, space, out):
    """Fill the rates (2N+q,) of the state y = [z, z', states] at time t."""
    n = space.acceleration.size
    acceleration, held = space.acceleration, space.held
    base = base_motion(plant, t, segment)
    for i in range(2 * n):
        space.motion[i] = y[i]
    for i in range(n):
        total = plant.linear[i, 2 * n] * base[0] + plant.linear[i, 2 * n + 1] * base[1]
        for q in range(2 * n):
            total += plant.linear[i, q] * y[q]
        acceleration[i] = total
    for j in range(held.size):
        held[j] = FREE
        for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
            if side[r] == HELD:
                held[j] = r
        if held[j] == FREE:
            d, v = relative(plant, j, space.motion, base[0], base[1])
            space.force[j] = channel_force(plant, j, d, v, side)
            for i in range(n):
                acceleration[i] -= plant.pull[i, j] * space.force[j]
    for e in range(memory.nodes.shape[0]):
        d, v, _ = across(memory.nodes[e, 0], memory.nodes[e, 1], y, n, base)
        force = call_memory_force(
            memory.laws[e, FORCE], d, v, y, 2 * n + memory.laws[e, STATES],
            memory.parameters, memory.laws[e, PARAMETERS],
        )  # fmt: skip
        for i in range(n):
            acceleration[i] -= memory.pull[i, e] * force
    for f in range(memory.push.shape[1]):
        force = outside_force(memory, t, f, space.active[f])
        for i in range(n):
            acceleration[i] += memory.push[i, f] * force
    if is_holding(held):
        hold(plant, held, base[2], acceleration, space.force)
    for i in range(n):
        out[i] = y[n + i]
        out[n + i] = acceleration[i]
    for e in range(memory.nodes.shape[0]):
        second = memory.nodes[e, 1]
        d, v, w = across(memory.nodes[e, 0], second, y, n, base)
        if stands(plant, held, memory.nodes[e, 0], second):
            v = 0.0  # control laws switch with its sign
        a = acceleration[second] if second >= 0 else base[2]
        call_memory_rate(
            memory.laws[e, RATE], d, v, w, a, y, 2 * n + memory.laws[e, STATES],
            memory.parameters, memory.laws[e, PARAMETERS], out,
        )  # fmt: skip
