"""A system as flat arrays, and its accelerations at an instant."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from seatdyn.kernels.address import Address, at
from seatdyn.kernels.columns import FIRST, SECOND
from seatdyn.kernels.jit import allocating, inlined, inner, stage, takes
from seatdyn.kernels.shapes import BASE, INTEGER, INTEGER_TABLE, INTEGERS, REAL, TABLE, VECTOR
from seatdyn.kernels.sides import channel_force

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
