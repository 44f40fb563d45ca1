"""One step with the linear part exact: collocation of the channel forces at Lobatto points."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from seatdyn.kernels.address import Address
from seatdyn.kernels.jit import allocating_stage, inlined, stage, takes
from seatdyn.kernels.plant import AT_PLANT, channel_force, segment_motion
from seatdyn.kernels.product import add_product
from seatdyn.kernels.shapes import BLOCK, INTEGER, INTEGERS, REAL, STACK, TABLE, VECTOR

LEVELS = 16  # step sizes of the ladder, each twice the one before
NODES = np.array([0.0, 0.5 - np.sqrt(3 / 28), 0.5, 0.5 + np.sqrt(3 / 28), 1.0])
ITERATIONS = 12
SMALL_CHANGE = 0.1  # of the tolerance, the effect of a change of the forces that is small
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
    """Where a run is and what it carries from step to step, and scratch of a ladder step."""

    path: np.ndarray  # (3, 3N) state and acceleration at the start of a step, its middle, its end
    result: np.ndarray  # (>= 6N,) the same memory from the middle on
    force: np.ndarray  # (m,) channel forces at the start
    side: np.ndarray  # (b,) of every break
    held: np.ndarray  # (m,) break that a channel rests on
    row: np.ndarray  # (R,)
    base: np.ndarray  # (5, 3) base displacement, velocity, acceleration at the nodes
    before: np.ndarray  # (5, m) nodal forces of the step before
    weight: np.ndarray  # (4m,) 1/N, one over the change of a nodal force that is small
    known: np.ndarray  # (8m,)
    motion: np.ndarray  # (8m,)
    past: np.ndarray  # (3, 4m)
    sizes: np.ndarray  # (2, inputs) of what a constant and a third polynomial stand for
    spare: np.ndarray  # (2, 3N) two more states and accelerations
    six: np.ndarray  # (6,)


LADDER = types.NamedTuple(
    [VECTOR, types.boolean, STACK, BLOCK, BLOCK, BLOCK, BLOCK, TABLE, STACK], Ladder
)
WORK = types.NamedTuple(
    [
        TABLE, VECTOR, VECTOR, INTEGERS, INTEGERS, VECTOR, TABLE, TABLE, VECTOR, VECTOR, VECTOR,
        TABLE, TABLE, TABLE, VECTOR,
    ],
    Work,
)  # fmt: skip
AT_LADDER, AT_WORK = Address(LADDER), Address(WORK)


@takes(AT_LADDER, VECTOR, INTEGERS, INTEGERS)
@allocating_stage
def make_work(ladder, y, side, held):
    """Arrays for a run from state y that takes the steps of a ladder."""
    m, n3, columns = held.size, 3 * y.size // 2, ladder.advance.shape[2]
    path = np.zeros(n3 + columns)
    path[: y.size] = y
    return Work(
        path[: 3 * n3].reshape(3, n3),
        path[n3:],
        np.zeros(m),
        side.copy(),
        held.copy(),
        np.zeros(ladder.advance.shape[1]),
        np.zeros((5, 3)),
        np.zeros((5, m)),
        np.zeros(4 * m),
        np.zeros(8 * m),
        np.zeros(8 * m),
        np.zeros((3, 4 * m)),
        np.zeros((2, ladder.response.shape[2])),
        np.zeros((2, n3)),
        np.zeros(6),
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
def guess_forces(plant, ladder, level, level_before, z_tolerance, v_tolerance, work):
    """First guess of the nodal forces in the row, and the changes that count as small."""
    row, force0, before, weight = work.row, work.force, work.before, work.weight
    m = force0.size
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
        small = SMALL_CHANGE * min(2 * z_tolerance / h, v_tolerance)
        for i in range(4):
            weight[i * m + j] = plant.gain[j, j] * h / small


@inlined
def collocate(plant, ladder, level, work):
    """Iterate the channel forces at nodes 1-4 in the row until they repeat.

    Fixed-point iteration, each new value mixed with the one before so that the last two changes
    cancel best (Anderson 1965, J. ACM 12:547-560, depth one). Returns the number of iterations,
    0 where they do not repeat soon enough.
    """
    known, motion, side, weight = work.known, work.motion, work.side, work.weight
    m = work.force.size
    force = work.row[work.row.size - 4 * m :]
    new, new_before, sizes = work.past[0], work.past[1], work.past[2]
    before = np.inf
    for iteration in range(1, ITERATIONS + 1):
        for q in range(motion.size):
            motion[q] = known[q]
        add_product(force, ladder.unknown, level, motion)
        for i in range(4):
            for j in range(m):
                o = 2 * m * i + j
                new[m * i + j] = channel_force(plant, j, motion[o], motion[o + m], side)
        change = up = down = 0.0
        for q in range(force.size):
            size = weight[q] * (new[q] - force[q])
            turn = size - sizes[q]
            up += size * turn
            down += turn * turn
            change = max(change, abs(size))
            sizes[q] = size
        # small, and so is what is still to come if the changes go on falling by the same ratio
        done = change <= FIRST_CHANGE or (change <= 1.0 and 2.0 * change <= before)
        if not done and iteration > 2:
            fall = change / before
            if change * fall ** (ITERATIONS - iteration) > 1.0:
                return 0
        mix = up / down if iteration > 1 and down > 0.0 and not done else 0.0
        for q in range(force.size):
            force[q] = new[q] - mix * (new[q] - new_before[q])
            new_before[q] = new[q]
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
    m, inputs, n2 = work.force.size, response.shape[2], response.shape[3]
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
    worst, per_z, per_v = 0.0, 1.0 / z_tolerance, 1.0 / v_tolerance
    for i in range(n2):
        error = 0.0
        for j in range(inputs):
            error += sizes[0, j] * response[level, 0, j, i] + sizes[1, j] * response[level, 1, j, i]
        worst = max(worst, error * (per_z if i < n2 // 2 else per_v))
    return worst


@inlined
def interpolation_error(h, path, z_tolerance, v_tolerance):
    """Error of the polynomial of degree eight that is kept for the step, over its tolerance.

    With u = -1 .. 1 over the step, it is the quintic through both ends plus what the middle adds,
    (1 - u^2)^3 (c0 + c1 u + c2 u^2). What is left out begins with c3 u^3, c3 about c1 c2/c0.
    """
    n, k = path.shape[1] // 3, 0.5 * h
    start, middle, end = path[0], path[1], path[2]
    c0 = c1 = c2 = 1e-300
    for i in range(n):
        z0, v0, a0 = start[i], k * start[n + i], k * k * start[2 * n + i]
        z1, v1, a1 = end[i], k * end[n + i], k * k * end[2 * n + i]
        d0 = middle[i] - 0.5 * (z0 + z1) - 0.3125 * (v0 - v1) - 0.0625 * (a0 + a1)
        d1 = k * middle[n + i] - 0.9375 * (z1 - z0) + 0.4375 * (v0 + v1) - 0.0625 * (a1 - a0)
        d2 = 0.5 * k * k * middle[2 * n + i] + 3 * d0 - 0.375 * (v1 - v0) + 0.125 * (a0 + a1)
        c0, c2 = max(c0, abs(d0)), max(c2, abs(d2))
        c1 = max(c1, abs(d1) - ROUNDING * (abs(z0) + abs(z1)))
    c3 = c1 * min(1.0, c2 / c0)
    # the largest values of u^3 (1 - u^2)^3 and of its slope
    return c3 * max(0.057 / z_tolerance, 0.18 / (k * v_tolerance))


@takes(AT_PLANT, AT_LADDER, INTEGER, INTEGER, REAL, INTEGER, REAL, REAL, AT_WORK)
@stage
def ladder_step(plant, ladder, level, level_before, t, segment, z_tolerance, v_tolerance, work):
    """Try a step of the size of `level`; the outcome stands in `work`.

    `level_before` is that of the ladder step just before, or -1 where its forces say nothing about
    this one. Returns the number of iterations of the forces (0: they did not repeat), the
    truncation error and the interpolation error, both over their tolerance.
    """
    row, path, known, result = work.row, work.path, work.known, work.result
    for i in range(2 * path.shape[1] // 3):
        row[i] = path[0, i]
    place_base(plant, ladder, level, t, segment, work)
    iterations = 1
    if work.force.size > 0:
        guess_forces(plant, ladder, level, level_before, z_tolerance, v_tolerance, work)
        for q in range(known.size):
            known[q] = 0.0
        add_product(row, ladder.known, level, known)
        iterations = collocate(plant, ladder, level, work)
        if iterations == 0:
            return 0, np.inf, np.inf
    for q in range(result.size):
        result[q] = 0.0
    add_product(row, ladder.advance, level, result)
    error = truncation(ladder, level, z_tolerance, v_tolerance, work)
    gap = interpolation_error(ladder.step[level], path, z_tolerance, v_tolerance)
    return iterations, error, gap


@takes(AT_WORK)
@stage
def keep_forces(work):
    """After an accepted step: its nodal forces for the next guess, its last one as start."""
    before, row = work.before, work.row
    m = work.force.size
    first = row.size - 5 * m
    for q in range(5):
        for j in range(m):
            before[q, j] = row[first + q * m + j]
    for j in range(m):
        work.force[j] = before[4, j]
