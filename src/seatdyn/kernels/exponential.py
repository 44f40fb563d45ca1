"""One step with the linear part exact: collocation of the channel forces at Lobatto points."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from seatdyn.kernels.jit import allocating_stage, inlined, stage, takes
from seatdyn.kernels.plant import PLANT, channel_force, segment_motion
from seatdyn.kernels.product import multiply
from seatdyn.kernels.shapes import BLOCK, INTEGER, INTEGERS, REAL, STACK, TABLE, VECTOR

LEVELS = 16  # step sizes of the ladder, each twice the one before
NODES = np.array([0.0, 0.5 - np.sqrt(3 / 28), 0.5, 0.5 + np.sqrt(3 / 28), 1.0])
ITERATIONS = 12
FIRST_CHANGE = 0.02  # of the tolerance: small enough to accept without knowing the ratio
ROUNDING = 4e-16


class Ladder(NamedTuple):
    """Propagators for L step sizes, N nodes, m channels.

    A step starts from one row of R numbers: the state (2N); the base motion; the channel forces
    at node 0 (m), at node 1 (m), ..., at node 4. The base motion is either the sine and cosine
    part of each lasting sine (`exact_sines`), or displacement and velocity at the five nodes.
    Each matrix takes the row to what is needed.
    """

    step: np.ndarray  # (L,) s
    exact_sines: bool
    turn: np.ndarray  # (L, 5, k, 2) cosine and sine of the angle of each lasting sine to the nodes
    advance: np.ndarray  # (L, R, >= 6N) to state and acceleration at the middle, and at the end
    known: np.ndarray  # (L, R - 4m, 8m) to motions across channels at node 1: d, v; node 2: ...
    unknown: np.ndarray  # (L, 4m, 8m) the same from the forces at nodes 1-4
    onward: np.ndarray  # (L + 1, 4, 5) forces of a step to those of the next: of 2h, h, h/2 ...
    to_legendre: np.ndarray  # (3, 5) second to fourth Legendre coefficient of nodal values
    response: np.ndarray  # (L, 2, inputs, 2N) |end state| per unit of a constant, and of the third


class Work(NamedTuple):
    """Arrays of a ladder step: what it starts from and gives, and scratch."""

    row: np.ndarray  # (R,)
    base: np.ndarray  # (5, 3) base displacement, velocity, acceleration at the nodes
    result: np.ndarray  # (>= 6N,) state and acceleration at the middle and at the end
    before: np.ndarray  # (5, m) nodal forces of the step before
    tolerance: np.ndarray  # (m,) N
    known: np.ndarray  # (8m,)
    motion: np.ndarray  # (8m,)
    past: np.ndarray  # (4, 4m)
    sizes: np.ndarray  # (2, inputs) of what a constant and a third polynomial stand for


LADDER = types.NamedTuple(
    [VECTOR, types.boolean, STACK, BLOCK, BLOCK, BLOCK, BLOCK, TABLE, STACK], Ladder
)
WORK = types.NamedTuple([VECTOR, TABLE, VECTOR, TABLE, VECTOR, VECTOR, VECTOR, TABLE, TABLE], Work)


@takes(LADDER)
@allocating_stage
def make_work(ladder):
    """Arrays for the steps of a ladder."""
    m = ladder.unknown.shape[1] // 4
    return Work(
        np.zeros(ladder.advance.shape[1]),
        np.zeros((5, 3)),
        np.zeros(ladder.advance.shape[2]),
        np.zeros((5, m)),
        np.zeros(m),
        np.zeros(8 * m),
        np.zeros(8 * m),
        np.zeros((4, 4 * m)),
        np.zeros((2, ladder.response.shape[2])),
    )


@inlined
def place_base(plant, ladder, level, t, segment, work):
    """Write the base motion into the row, and (x, v, a) at nodes 0, 2, 4 into `base`."""
    row, base, sines, turn = work.row, work.base, plant.sines, ladder.turn
    first = 2 * plant.linear.shape[0]
    exact = ladder.exact_sines
    stride = 2 if exact else 1
    for q in range(0, 5, stride):
        base[q, 0] = base[q, 1] = base[q, 2] = 0.0
        if not exact:
            at = t + NODES[q] * ladder.step[level]
            base[q, 0], base[q, 1], base[q, 2] = segment_motion(plant, at, segment)
    for i in range(sines.shape[0]):
        omega, angle = sines[i, 1], sines[i, 1] * t + sines[i, 2]
        sine, cosine = sines[i, 0] * math.sin(angle), sines[i, 0] * math.cos(angle)
        if exact:
            row[first + 2 * i], row[first + 2 * i + 1] = sine, cosine
        for q in range(0, 5, stride):
            c, s = turn[level, q, i, 0], turn[level, q, i, 1]
            x = sine * c + cosine * s
            base[q, 0] += x
            base[q, 1] += omega * (cosine * c - sine * s)
            base[q, 2] -= omega * omega * x
    if not exact:
        for q in range(5):
            row[first + 2 * q], row[first + 2 * q + 1] = base[q, 0], base[q, 1]


@inlined
def guess_forces(plant, ladder, level, level_before, force0, z_tolerance, v_tolerance, work):
    """First guess of the nodal forces in the row, and the changes that count as small."""
    m = force0.size
    row, before = work.row, work.before
    place = row.size - 5 * m
    h = ladder.step[level]
    for j in range(m):
        row[place + j] = force0[j]
        for i in range(1, 5):
            guess = force0[j]
            if level_before >= 0:
                guess = 0.0
                for q in range(5):
                    guess += ladder.onward[level_before - level + 1, i - 1, q] * before[q, j]
            row[place + i * m + j] = guess
        reach = plant.gain[j, j] * h
        work.tolerance[j] = 0.1 * min(2 * z_tolerance / (reach * h), v_tolerance / reach)


@inlined
def collocate(plant, ladder, level, side, work):
    """Iterate the channel forces at nodes 1-4 in the row until they repeat.

    Fixed-point iteration, each new value mixed with the one before so that the last two changes
    cancel best (Anderson 1965, J. ACM 12:547-560, depth one). Returns the number of iterations,
    0 where they do not repeat soon enough.
    """
    row, known, motion, past = work.row, work.known, work.motion, work.past
    m = work.tolerance.size
    first = row.size - 4 * m
    before = np.inf
    for iteration in range(1, ITERATIONS + 1):
        multiply(row[first:], ladder.unknown, level, motion)
        change = up = down = 0.0
        for i in range(4):
            for j in range(m):
                o, q = 2 * m * i + j, m * i + j
                new = channel_force(
                    plant, j, known[o] + motion[o], known[o + m] + motion[o + m], side
                )
                step = new - row[first + q]
                size = step / work.tolerance[j]
                change = max(change, abs(size))
                if iteration > 1:
                    turn = size - past[1, q] / work.tolerance[j]
                    up += size * turn
                    down += turn * turn
                past[2, q], past[3, q] = new, step
        # small, and so is what is still to come if the changes go on falling by the same ratio
        done = change <= FIRST_CHANGE or (change <= 1.0 and 2.0 * change <= before)
        fall = change / before
        if not done and iteration > 2 and change * fall ** (ITERATIONS - iteration) > 1.0:
            return 0
        mix = up / down if down > 0.0 and not done else 0.0
        for q in range(4 * m):
            new = past[2, q]
            row[first + q] = new - mix * (new - past[0, q])
            past[0, q], past[1, q] = new, past[3, q]
        if done:
            return iteration
        before = change
    return 0


@inlined
def truncation(ladder, level, z_tolerance, v_tolerance, work):
    """Error by what the quartics miss of the inputs, over its tolerance.

    The Legendre coefficients of an input fall by about a ratio r each, c5 = r c4 and so on. At the
    Lobatto points the fifth polynomial looks like the third, and the eighth like a constant, which
    has the full effect on the end state: r c4 R3 + r^4 c4 R0. For smooth laws r is small; at a
    corner it is near one. Where c4 is small by chance, r c3 stands for it.
    """
    row, sizes, response, legendre = work.row, work.sizes, ladder.response, ladder.to_legendre
    m, inputs, n2 = work.tolerance.size, response.shape[2], response.shape[3]
    for j in range(inputs):
        # the channel forces stand last in the row; before them the base motion, if it is sampled
        place, stride = (row.size - 5 * m + j, m) if j < m else (n2 + j - m, 2)
        c2 = c3 = c4 = 0.0
        for q in range(5):
            value = row[place + q * stride]
            c2 += legendre[0, q] * value
            c3 += legendre[1, q] * value
            c4 += legendre[2, q] * value
        c2, c3, c4 = max(abs(c2), 1e-300), max(abs(c3), 1e-300), abs(c4)
        r = min(1.0, max(c3 / c2, c4 / c3))
        sizes[1, j] = r * max(c4, r * c3)
        sizes[0, j] = r**3 * sizes[1, j]
    worst = 0.0
    for i in range(n2):
        error = 0.0
        for j in range(inputs):
            error += sizes[0, j] * response[level, 0, j, i] + sizes[1, j] * response[level, 1, j, i]
        worst = max(worst, error / (z_tolerance if i < n2 // 2 else v_tolerance))
    return worst


@inlined
def interpolation_error(h, y0, a0, result, z_tolerance, v_tolerance):
    """Error of the polynomial of degree eight that is kept for the step, over its tolerance.

    With u = -1 .. 1 over the step, it is the quintic through both ends plus what the middle adds,
    (1 - u^2)^3 (c0 + c1 u + c2 u^2). What is left out begins with c3 u^3, c3 about c1 c2/c0.
    """
    n, k = a0.size, 0.5 * h
    c0 = c1 = c2 = 1e-300
    for i in range(n):
        z0, z1, a1 = y0[i], result[3 * n + i], result[5 * n + i]
        v0, v1 = k * y0[n + i], k * result[4 * n + i]
        curved, rising = k * k * (a0[i] + a1), k * k * (a1 - a0[i])
        d0 = result[i] - 0.5 * (z0 + z1) - 0.3125 * (v0 - v1) - 0.0625 * curved
        d1 = k * result[n + i] - 0.9375 * (z1 - z0) + 0.4375 * (v0 + v1) - 0.0625 * rising
        d2 = 0.5 * k * k * result[2 * n + i] + 3 * d0 - 0.375 * (v1 - v0) + 0.125 * curved
        c0, c2 = max(c0, abs(d0)), max(c2, abs(d2))
        c1 = max(c1, abs(d1) - ROUNDING * (abs(z0) + abs(z1)))
    c3 = c1 * min(1.0, c2 / c0)
    # the largest values of u^3 (1 - u^2)^3 and of its slope
    return c3 * max(0.057 / z_tolerance, 0.18 / (k * v_tolerance))


@takes(
    PLANT, LADDER, INTEGER, INTEGER, REAL, INTEGER, VECTOR, VECTOR, VECTOR, INTEGERS, REAL, REAL,
    WORK,
)  # fmt: skip
@stage
def ladder_step(
    plant, ladder, level, level_before, t, segment, y, a0, force0, side, z_tolerance, v_tolerance,
    work,
):  # fmt: skip
    """Try a step of the size of `level`; the outcome stands in `work`.

    `level_before` is that of the ladder step just before, or -1 where its forces say nothing about
    this one. Returns the number of iterations of the forces (0: they did not repeat), the
    truncation error and the interpolation error, both over their tolerance.
    """
    row = work.row
    for i in range(y.size):
        row[i] = y[i]
    place_base(plant, ladder, level, t, segment, work)
    iterations = 1
    if force0.size > 0:
        guess_forces(plant, ladder, level, level_before, force0, z_tolerance, v_tolerance, work)
        multiply(row, ladder.known, level, work.known)
        iterations = collocate(plant, ladder, level, side, work)
        if iterations == 0:
            return 0, np.inf, np.inf
    multiply(row, ladder.advance, level, work.result)
    error = truncation(ladder, level, z_tolerance, v_tolerance, work)
    gap = interpolation_error(ladder.step[level], y, a0, work.result, z_tolerance, v_tolerance)
    return iterations, error, gap


@takes(WORK, VECTOR)
@stage
def keep_forces(work, force0):
    """After an accepted step: its nodal forces for the next guess, its last one as start."""
    m = force0.size
    first = work.row.size - 5 * m
    for j in range(m):
        for q in range(5):
            work.before[q, j] = work.row[first + q * m + j]
    for j in range(m):
        force0[j] = work.before[4, j]
