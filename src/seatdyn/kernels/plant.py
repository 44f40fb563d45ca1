"""A system as flat arrays, and its accelerations at an instant."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from seatdyn.kernels.address import Address, at
from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import (
    ADDRESS,
    BREAKS,
    ELEMENTS,
    FIRST,
    IS_JUMP,
    OFFSET,
    ON_DISPLACEMENT,
    ON_VELOCITY,
    SECOND,
    VALUE,
)
from seatdyn.kernels.jit import allocating, inlined, inner, stage, takes
from seatdyn.kernels.shapes import BASE, INTEGER, INTEGER_TABLE, INTEGERS, REAL, TABLE, VECTOR

FREE = -1  # a channel that is not held at a jump


class Plant(NamedTuple):
    """N free nodes, m channels, e elements, b breaks, k input segments.

    A break is a line displacement*d + velocity*v = value of one channel where a law jumps or has
    a kink. A run keeps for each break the `side` (+1 or -1) that the state is on, and evaluates
    laws on that side only, so that no step ever mixes two branches.
    """

    linear: np.ndarray  # (N, 2N+2) accelerations per displacement, velocity, base x and v
    pull: np.ndarray  # (N, m) acceleration lost per unit force of a channel
    gain: np.ndarray  # (m, m) relative acceleration of channel i lost per unit force of channel j
    channels: np.ndarray  # (m+1, 4) int: nodes (-1 is the base), begin of its elements and breaks
    elements: np.ndarray  # (e, 3) int: address of its law, begin of its parameters, see `columns`
    parameters: np.ndarray
    breaks: np.ndarray  # (b, 4) displacement, velocity, value, 1 where a law jumps and 0 for a kink
    segments: np.ndarray  # (k, 10) start, polynomial (6), sine: amplitude, omega, phase
    sines: np.ndarray  # (n, 3)


PLANT = types.NamedTuple(
    [TABLE, TABLE, TABLE, INTEGER_TABLE, INTEGER_TABLE, VECTOR, TABLE, TABLE, TABLE], Plant
)
AT_PLANT = Address(PLANT)
plant_at = at(AT_PLANT)


@inlined
def segment_motion(plant, t, k):
    """Displacement, velocity and acceleration of segment k of the base motion."""
    p = plant.segments
    tau = t - p[k, 0]
    x = p[k, 1] + tau * (
        p[k, 2] + tau * (p[k, 3] + tau * (p[k, 4] + tau * (p[k, 5] + tau * p[k, 6])))
    )
    v = p[k, 2] + tau * (
        2 * p[k, 3] + tau * (3 * p[k, 4] + tau * (4 * p[k, 5] + tau * 5 * p[k, 6]))
    )
    a = 2 * p[k, 3] + tau * (6 * p[k, 4] + tau * (12 * p[k, 5] + tau * 20 * p[k, 6]))
    if p[k, 7] != 0.0:
        omega, angle = p[k, 8], p[k, 8] * tau + p[k, 9]
        sine = p[k, 7] * math.sin(angle)
        x += sine
        v += p[k, 7] * omega * math.cos(angle)
        a -= omega * omega * sine
    return x, v, a


@takes(AT_PLANT, REAL, INTEGER)
@stage
def base_motion(plant, t, segment):
    """Base displacement, velocity and acceleration."""
    x, v, a = segment_motion(plant, t, segment)
    lasting = plant.sines
    for i in range(lasting.shape[0]):
        omega, angle = lasting[i, 1], lasting[i, 1] * t + lasting[i, 2]
        sine = lasting[i, 0] * math.sin(angle)
        x += sine
        v += lasting[i, 0] * omega * math.cos(angle)
        a -= omega * omega * sine
    return x, v, a


@inner
def segment_at(plant, t):
    """Index of the input segment at time t."""
    k = plant.segments.shape[0] - 1
    while k > 0 and plant.segments[k, 0] > t:
        k -= 1
    return k


@inlined
def relative(plant, j, y, x0, v0):
    """Displacement and velocity across channel j."""
    n = y.size // 2
    a, b = plant.channels[j, FIRST], plant.channels[j, SECOND]
    d = (y[b] if b >= 0 else x0) - (y[a] if a >= 0 else x0)
    v = (y[n + b] if b >= 0 else v0) - (y[n + a] if a >= 0 else v0)
    return d, v


@inlined
def relative_acceleration(plant, j, acceleration, a0):
    """Second derivative of the displacement across channel j."""
    a, b = plant.channels[j, FIRST], plant.channels[j, SECOND]
    return (acceleration[b] if b >= 0 else a0) - (acceleration[a] if a >= 0 else a0)


@inlined
def on_side(plant, j, d, v, side):
    """Move (d, v) of channel j to the side of its jumps that the run is on, by one rounding."""
    for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
        if plant.breaks[r, IS_JUMP] == 0:
            continue
        edge = np.nextafter(plant.breaks[r, VALUE], side[r] * np.inf)
        if plant.breaks[r, ON_DISPLACEMENT] != 0.0:
            d = max(d, edge) if side[r] > 0 else min(d, edge)
        else:
            v = max(v, edge) if side[r] > 0 else min(v, edge)
    return d, v


@inlined
def sum_of_laws(plant, j, d, v):
    """Sum of the forces of the elements of channel j."""
    elements, parameters = plant.elements, plant.parameters
    first, total = plant.channels[j, ELEMENTS], 0.0
    for e in range(first, plant.channels[j + 1, ELEMENTS]):
        force = call_law(elements[e, ADDRESS], d, v, parameters, elements[e, OFFSET])
        total = force if e == first else total + force  # most channels have one: nothing to add
    return total


@inlined
def reflection(plant, j, d, v, side):
    """What a force beyond a break is, as (b, s, d, v): b + s F(d, v), F the sum of the laws.

    On the run's side of all breaks it is F at the point itself, b = 0 and s = 1. Beyond a break it
    is twice the force on the break, less F at the point reflected in it.
    """
    beyond, excess = -1, 0.0
    for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
        p, q = plant.breaks[r, ON_DISPLACEMENT], plant.breaks[r, ON_VELOCITY]
        g = p * d + q * v - plant.breaks[r, VALUE]
        # a law that jumps may not be asked for its value at the jump
        if side[r] * g < 0.0 or (g == 0.0 and plant.breaks[r, IS_JUMP] == 1):
            beyond, excess = r, g
    if beyond < 0:
        return 0.0, 1.0, d, v
    p, q = plant.breaks[beyond, ON_DISPLACEMENT], plant.breaks[beyond, ON_VELOCITY]
    d_out, v_out = (excess / p, 0.0) if p != 0.0 else (0.0, excess / q)
    x, w = on_side(plant, j, d - d_out, v - v_out, side)
    twice = 2.0 * sum_of_laws(plant, j, x, w)
    x, w = on_side(plant, j, d - 2.0 * d_out, v - 2.0 * v_out, side)
    return twice, -1.0, x, w


@inlined
def channel_force(plant, j, d, v, side):
    """Force of channel j on the side of its breaks that the run is on.

    Beyond a break it goes on as its own reflection in the point on the break, which is smooth for
    smooth laws and exact for linear ones: a step may then reach over a break and be cut there.
    """
    twice, sign, d, v = reflection(plant, j, d, v, side)
    return twice + sign * sum_of_laws(plant, j, d, v)


@inner
def solve_small(matrix, rhs):
    """Gauss elimination with pivoting, in place; for the few channels that stick at once."""
    n = rhs.size
    for i in range(n):
        p = i
        for k in range(i + 1, n):
            if abs(matrix[k, i]) > abs(matrix[p, i]):
                p = k
        for c in range(n):
            matrix[i, c], matrix[p, c] = matrix[p, c], matrix[i, c]
        rhs[i], rhs[p] = rhs[p], rhs[i]
        for k in range(i + 1, n):
            f = matrix[k, i] / matrix[i, i]
            for c in range(i, n):
                matrix[k, c] -= f * matrix[i, c]
            rhs[k] -= f * rhs[i]
    for i in range(n - 1, -1, -1):
        for c in range(i + 1, n):
            rhs[i] -= matrix[i, c] * rhs[c]
        rhs[i] /= matrix[i, i]


@allocating
def hold(plant, held, a0, acceleration, force):
    """Forces that keep the held channels where they are (zero relative acceleration)."""
    m = held.size
    matrix, rhs = np.zeros((m, m)), np.zeros(m)
    for i in range(m):
        matrix[i, i] = 1.0
        if held[i] >= 0:
            rhs[i] = relative_acceleration(plant, i, acceleration, a0)
            for k in range(m):
                if held[k] >= 0:
                    matrix[i, k] = plant.gain[i, k]
    solve_small(matrix, rhs)
    for i in range(m):
        if held[i] >= 0:
            force[i] = rhs[i]
            for n in range(acceleration.size):
                acceleration[n] -= plant.pull[n, i] * rhs[i]


@inner
def is_holding(held):
    """Whether some channel rests on a jump."""
    for j in range(held.size):
        if held[j] >= 0:
            return True
    return False


@inner
def free_accelerations(plant, base, y, side, acceleration, force):
    """Fill the accelerations (N,) and channel forces (m,) at state y = [z, z'], nothing held.

    base : base displacement, velocity, acceleration
    """
    n, m = acceleration.size, force.size
    linear = plant.linear
    for i in range(n):
        total = linear[i, 2 * n] * base[0] + linear[i, 2 * n + 1] * base[1]
        for k in range(2 * n):
            total += linear[i, k] * y[k]
        acceleration[i] = total
    for j in range(m):
        d, v = relative(plant, j, y, base[0], base[1])
        force[j] = channel_force(plant, j, d, v, side)
        for i in range(n):
            acceleration[i] -= plant.pull[i, j] * force[j]


@takes(AT_PLANT, BASE, VECTOR, INTEGERS, INTEGERS, VECTOR, VECTOR)
@stage
def accelerations(plant, base, y, side, held, acceleration, force):
    """The same with the channels that are held at a jump kept where they are."""
    free_accelerations(plant, base, y, side, acceleration, force)
    if is_holding(held):
        for j in range(force.size):
            if held[j] >= 0:
                for i in range(acceleration.size):
                    acceleration[i] += plant.pull[i, j] * force[j]
        hold(plant, held, base[2], acceleration, force)
