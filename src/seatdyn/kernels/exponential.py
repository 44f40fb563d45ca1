"""One step with the linear part exact: collocation of the channel forces at Lobatto points.

The forces of a channel at the points behind the first fill a register, so that products and laws
work on all of them at once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from seatdyn.kernels.address import Address, at
from seatdyn.kernels.jit import allocating_stage, inlined, inner, stage, takes
from seatdyn.kernels.plant import AT_PLANT, relative, segment_motion
from seatdyn.kernels.product import product
from seatdyn.kernels.rows import (
    WIDTH,
    any_larger,
    larger_of,
    largest_of,
    load,
    load_at,
    member_of,
    size_of,
    spread,
    store,
    sum_of,
    where_larger,
)
from seatdyn.kernels.shapes import (
    BLOCK,
    INTEGER,
    INTEGER_TABLE,
    INTEGERS,
    REAL,
    STACK,
    TABLE,
    VECTOR,
)
from seatdyn.kernels.sides import channel_force, channel_rows

LEVELS = 17  # step sizes of the ladder, each twice the one before
LATER = WIDTH  # Lobatto points of a step behind its start
POINTS = LATER + 1
NODES = 0.5 + 0.5 * np.array(
    [-1.0, *np.sort(np.polynomial.legendre.Legendre.basis(LATER).deriv().roots()), 1.0]
)
# where the base motion is known: at the quarters and at the other points
PLACES = np.array([0.0, 0.25, 0.5, 0.75, 1.0, *NODES[1:4], *NODES[5:8]])
PLACE_OF = np.array([0, 5, 6, 7, 2, 8, 9, 10, 4])  # the points
BLOCKS = -(-PLACES.size // WIDTH)
OTHERS = NODES - NODES[:, None] + np.eye(POINTS)
LAGRANGE = 1.0 / np.prod(OTHERS, axis=0)  # one over the product of the ways from the other points
MEMBERS = np.arange(WIDTH, dtype=float)
BERNSTEIN = np.array(
    [[math.comb(LATER, i) * x**i * (1 - x) ** (LATER - i) for i in range(POINTS)] for x in NODES]
)
# (9, 8) from values at the points to the coefficients between both ends, the last of them twice
TO_BERNSTEIN = np.ascontiguousarray(np.linalg.inv(BERNSTEIN).T[:, [*range(1, LATER), LATER - 1]])
ITERATIONS = 12
SMALL_CHANGE = 0.1  # of the tolerance, the effect of a change of the forces that is small
FIRST_CHANGE = 0.02  # of the tolerance: small enough to accept without knowing the ratio
BY_CHANCE = 0.1  # of the larger of two Legendre coefficients: the other is this small by chance
ROUNDING = 4e-16
UNKNOWN = -1  # level of what says nothing about the forces to come


class Ladder(NamedTuple):
    """Propagators for L step sizes, m channels.

    A step starts from one row of R numbers: the state (2N); the base motion; the channel forces
    at the start (m); those of the first channel at the later points (8), of the second, ... The
    base motion is either the sine and cosine part of each lasting sine (`exact_sines`), or
    displacement and velocity at all points. Each matrix takes the row to what is needed.
    """

    step: np.ndarray  # (L,) s
    exact_sines: bool
    turn: np.ndarray  # (L, k, 2, 16) cosines and sines of the angle of a lasting sine to PLACES
    # (L, R, >= 12N) to state and acceleration at 1/4, 1/2, 3/4 and the end; the accelerations at
    # 1/4 and 3/4, which are no points of the step, without the channel forces
    advance: np.ndarray
    known: np.ndarray  # (L, R - 8m, 16m) to d at the later points, v there; of the next channel ...
    unknown: np.ndarray  # (L, 8m, 16m) the same from the forces at the later points
    onward: np.ndarray  # (L + 1, 9, 8) forces of a step to those of the next: of 2h, h, h/2 ...
    to_legendre: np.ndarray  # (9, 8) from values at the points to the last six coefficients
    response: np.ndarray  # (L, 2, inputs, >= 2N) |end state| by a constant, and by the eighth


class Work(NamedTuple):
    """Where a run is and what it carries from step to step, and scratch of a ladder step."""

    path: np.ndarray  # (5, 3N) state and acceleration at the start of a step and its quarters
    result: np.ndarray  # (>= 12N,) the same memory from the first quarter on
    force: np.ndarray  # (m,) channel forces at the start
    mark: np.ndarray  # (b + m,) and some spare: the next two, as the marks of a step keep them
    side: np.ndarray  # (b,) of every break
    held: np.ndarray  # (m,) break that a channel rests on
    row: np.ndarray  # (R,)
    later: np.ndarray  # (m, 8) the same memory as the end of the row: forces at the later points
    base: np.ndarray  # (3, 16) base displacement, velocity, acceleration at PLACES
    before: np.ndarray  # (m, 9) forces at the points of the step before
    memory: np.ndarray  # (2b m, 8) later forces of the last steps that began on a break
    memory_level: np.ndarray  # (2b,) the levels of those steps
    refused: np.ndarray  # (2, 2b) steps from there to wait since one was refused, and those left
    weight: np.ndarray  # (m,) 1/N, one over the change of a force that is small
    known: np.ndarray  # (2m, 8)
    motion: np.ndarray  # (2m, 8) d and v across the channels at the later points
    past: np.ndarray  # (3m, 8) new forces, those of the iteration before, change over what is small
    beyond: np.ndarray  # (5, 8) scratch of `sides.channel_rows`
    sizes: np.ndarray  # (2, inputs) of what a constant and an eighth polynomial stand for
    spare: np.ndarray  # (3, 3N) three more states and accelerations
    trial: np.ndarray  # (m,) forces at the end of a step that is cut
    six: np.ndarray  # (6,)
    rate: np.ndarray  # (N,) 1/s, of each node on its own links


LADDER = types.NamedTuple(
    [VECTOR, types.boolean, STACK, BLOCK, BLOCK, BLOCK, BLOCK, TABLE, STACK], Ladder
)
WORK = types.NamedTuple(
    [
        TABLE, VECTOR, VECTOR, INTEGERS, INTEGERS, INTEGERS, VECTOR, TABLE, TABLE, TABLE, TABLE,
        INTEGERS, INTEGER_TABLE, VECTOR, TABLE, TABLE, TABLE, TABLE, TABLE, TABLE, VECTOR, VECTOR,
        VECTOR,
    ],
    Work,
)  # fmt: skip
AT_LADDER, AT_WORK = Address(LADDER), Address(WORK)
ladder_at = at(AT_LADDER)


@takes(AT_LADDER, VECTOR, INTEGERS, INTEGERS)
@allocating_stage
def make_work(ladder, y, side, held):
    """Arrays for a run from state y that takes the steps of a ladder."""
    m, n3, columns = held.size, 3 * y.size // 2, ladder.advance.shape[2]
    path, row = np.zeros(n3 + columns + WIDTH), np.zeros(ladder.advance.shape[1])
    path[: y.size] = y
    mark = np.zeros(side.size + m + WIDTH, np.int64)
    mark[: side.size], mark[side.size : side.size + m] = side, held
    return Work(
        path[: 5 * n3].reshape(5, n3),
        path[n3 : n3 + columns],
        np.zeros(m),
        mark,
        mark[: side.size],
        mark[side.size : side.size + m],
        row,
        row[row.size - LATER * m :].reshape(m, LATER),
        np.zeros((3, BLOCKS * WIDTH)),
        np.zeros((m, POINTS)),
        np.zeros((2 * side.size * m, LATER)),
        np.full(2 * side.size, UNKNOWN),
        np.zeros((2, 2 * side.size), np.int64),
        np.zeros(m),
        np.zeros((2 * m, LATER)),
        np.zeros((2 * m, LATER)),
        np.zeros((3 * m, LATER)),
        np.zeros((5, LATER)),
        np.zeros((2, ladder.response.shape[2])),
        np.zeros((3, n3)),
        np.zeros(m),
        np.zeros(6),
        np.zeros(n3 // 3),
    )


@inlined
def place_base(plant, ladder, level, t, segment, work):
    """Write the base motion into the row, and (x, v, a) where they are needed into `base`."""
    row, base, sines, turn = work.row, work.base, plant.sines, ladder.turn
    first, exact = 2 * plant.linear.shape[0], ladder.exact_sines
    # rows of eight places: the quarters are in the first one, and sines ask for no more
    blocks = (1 if work.force.size > 0 else 0) if exact else BLOCKS
    for block in range(blocks):
        for quantity in range(3):
            store(base, BLOCKS * quantity + block, 0.0)
    if not exact:
        for q in range(PLACES.size):
            at = t + PLACES[q] * ladder.step[level]
            base[0, q], base[1, q], base[2, q] = segment_motion(plant, at, segment)
    for i in range(sines.shape[0]):
        omega, angle = sines[i, 1], sines[i, 1] * t + sines[i, 2]
        sine, cosine = sines[i, 0] * math.sin(angle), sines[i, 0] * math.cos(angle)
        if exact:
            row[first + 2 * i], row[first + 2 * i + 1] = sine, cosine
        for block in range(blocks):
            place = 2 * BLOCKS * (level * sines.shape[0] + i) + block
            c, s = load(turn, place), load(turn, place + BLOCKS)
            x, v = sine * c + cosine * s, omega * (cosine * c - sine * s)
            store(base, block, load(base, block) + x)
            store(base, BLOCKS + block, load(base, BLOCKS + block) + v)
            store(base, 2 * BLOCKS + block, load(base, 2 * BLOCKS + block) - omega * omega * x)
    if not exact:
        for q in range(POINTS):
            row[first + 2 * q] = base[0, PLACE_OF[q]]
            row[first + 2 * q + 1] = base[1, PLACE_OF[q]]


@inlined
def guess_forces(plant, ladder, level, level_before, origin, z_tolerance, v_tolerance, work):
    """First guess of the later forces, and the changes that count as small."""
    row, force0, before, later = work.row, work.force, work.before, work.later
    m, h = force0.size, ladder.step[level]
    place = row.size - POINTS * m
    small = SMALL_CHANGE * min(2 * z_tolerance / h, v_tolerance)
    remembered = origin >= 0 and work.memory_level[origin] == level
    for j in range(m):
        row[place + j] = force0[j]
        work.weight[j] = plant.gain[j, j] * h / small
        guess = spread(force0[j])
        if level_before >= 0:
            guess = spread(0.0)
            first = (level_before - level + 1) * POINTS
            for q in range(POINTS):
                guess = guess + before[j, q] * load(ladder.onward, first + q)
        elif remembered:
            guess = load(work.memory, origin * m + j)
        store(later, j, guess)


@inlined
def collocate(plant, ladder, level, work):
    """Iterate the channel forces at the later points until they repeat.

    Fixed-point iteration, each new value mixed with the one before so that the last two changes
    cancel best (Anderson 1965, J. ACM 12:547-560, depth one). Returns the number of iterations,
    0 where they do not repeat soon enough.
    """
    row, known, motion, past, later = work.row, work.known, work.motion, work.past, work.later
    m = work.force.size
    place = row.size - LATER * m
    before = np.inf
    for iteration in range(1, ITERATIONS + 1):
        product(known, row, place, ladder.unknown, level, motion)
        squares, up, down = spread(0.0), spread(0.0), spread(0.0)
        for j in range(m):
            channel_rows(plant, j, motion, work.side, past, work.beyond)
            size = work.weight[j] * (load(past, j) - load(later, j))
            turn = size - load(past, 2 * m + j)
            up = up + size * turn
            down = down + turn * turn
            squares = where_larger(size * size, squares, size * size, squares)
            store(past, 2 * m + j, size)
        # small, and so is what is still to come if the changes go on falling by the same ratio
        square = largest_of(squares)
        if square <= FIRST_CHANGE**2 or (square <= 1.0 and 4.0 * square <= before**2):
            for j in range(m):
                store(later, j, load(past, j))
            return iteration
        change = math.sqrt(square)
        if iteration > 2 and change * (change / before) ** (ITERATIONS - iteration) > 1.0:
            return 0
        bottom = sum_of(down) if iteration > 1 else 0.0
        mix = sum_of(up) / bottom if bottom > 0.0 else 0.0
        for j in range(m):
            new = load(past, j)
            store(later, j, new - mix * (new - load(past, m + j)))
            store(past, m + j, new)
        before = change
    return 0


@inlined
def truncation(ladder, level, z_tolerance, v_tolerance, work):
    """Error by what the polynomials through the points miss of the inputs, over its tolerance.

    The Legendre coefficients of an input fall by about a ratio r each; r^2 is the largest ratio of
    c5, c6 to c3, c4, since odd or even ones may be missing, of c7 to c5 and of c8 to c6: where a
    curvature jumps these last ones hardly fall any more. c is c8, or what one of the three before
    makes expect. At the Lobatto points the ninth polynomial looks like the seventh, and the
    sixteenth like a constant, which has the full effect on the end state: r c R7 + r^8 c R0. For
    smooth laws r is small; at a corner it is near one.
    """
    row, sizes, response = work.row, work.sizes, ladder.response
    m, inputs, n2 = work.force.size, response.shape[2], 2 * work.path.shape[1] // 3
    for j in range(inputs):
        # the channel forces stand last in the row; before them the base motion, if it is sampled
        start = work.force[j] if j < m else row[n2 + j - m]
        place, stride = (row.size - LATER * (m - j), 1) if j < m else (n2 + j - m + 2, 2)
        total = start * load(ladder.to_legendre, 0)
        for q in range(LATER):
            total = total + row[place + stride * q] * load(ladder.to_legendre, 1 + q)
        c5, c6 = abs(member_of(total, 2)), abs(member_of(total, 3))
        c7, c8 = abs(member_of(total, 4)), abs(member_of(total, 5))
        first = max(abs(member_of(total, 0)), abs(member_of(total, 1)), 1e-300)
        second = max(c5, c6, 1e-300)
        odd, even = c7 / max(c5, BY_CHANCE * second), c8 / max(c6, BY_CHANCE * second)
        r = math.sqrt(min(1.0, max(second / first, odd, even)))
        last = max(c8, r * c7, r**2 * c6, r**3 * c5)
        sizes[1, j] = r * last
        sizes[0, j] = r**8 * last
    n, columns = n2 // 2, response.shape[3]
    worst, per_z, per_v = spread(0.0), spread(1.0 / z_tolerance), spread(1.0 / v_tolerance)
    for i in range(0, n2, WIDTH):
        error = spread(0.0)
        for j in range(inputs):
            place = (2 * level * inputs + j) * columns + i
            error = error + sizes[0, j] * load_at(response, place)
            error = error + sizes[1, j] * load_at(response, place + inputs * columns)
        error = error * where_larger(float(n - i), load(MEMBERS, 0), per_z, per_v)
        worst = larger_of(error, worst)
    return largest_of(worst)


@inlined
def add_forces_between(plant, work):
    """Complete accelerations at 1/4 and 3/4 by the laws; the polynomials are less accurate."""
    path, n = work.path, work.path.shape[1] // 3
    for quarter in range(1, 4, 2):
        state, base = path[quarter], work.base
        for j in range(work.force.size):
            d, v = relative(plant, j, state[: 2 * n], base[0, quarter], base[1, quarter])
            force = channel_force(plant, j, d, v, work.side)
            for i in range(n):
                state[2 * n + i] -= plant.pull[i, j] * force


@inlined
def interpolation_error(h, path, first, z_tolerance, v_tolerance):
    """Error of the polynomial of degree eight kept for half of a step, over its tolerance.

    With u = -1 .. 1 over the half, it is the quintic through both ends plus what the middle adds,
    (1 - u^2)^3 (c0 + c1 u + c2 u^2). What is left out begins with c3 u^3, c3 about c1 c2/c0.
    """
    n, k = path.shape[1] // 3, 0.25 * h
    start, middle, end = 3 * n * first, 3 * n * (first + 1), 3 * n * (first + 2)
    most0 = most1 = most2 = spread(1e-300)
    for i in range(0, n, WIDTH):
        z0, v0 = load_at(path, start + i), k * load_at(path, start + n + i)
        z1, v1 = load_at(path, end + i), k * load_at(path, end + n + i)
        a0, a1 = k * k * load_at(path, start + 2 * n + i), k * k * load_at(path, end + 2 * n + i)
        zm, vm = load_at(path, middle + i), k * load_at(path, middle + n + i)
        am = k * k * load_at(path, middle + 2 * n + i)
        d0 = zm - 0.5 * (z0 + z1) - 0.3125 * (v0 - v1) - 0.0625 * (a0 + a1)
        d1 = vm - 0.9375 * (z1 - z0) + 0.4375 * (v0 + v1) - 0.0625 * (a1 - a0)
        d2 = 0.5 * am + 3.0 * d0 - 0.375 * (v1 - v0) + 0.125 * (a0 + a1)
        rounding = ROUNDING * (size_of(z0) + size_of(z1))
        # members behind the last node are other numbers
        nodes, members = spread(float(n - i)), load(MEMBERS, 0)
        most0 = where_larger(nodes, members, larger_of(most0, size_of(d0)), most0)
        most1 = where_larger(nodes, members, larger_of(most1, size_of(d1) - rounding), most1)
        most2 = where_larger(nodes, members, larger_of(most2, size_of(d2)), most2)
    c0, c1, c2 = largest_of(most0), largest_of(most1), largest_of(most2)
    c3 = c1 * min(1.0, c2 / c0)
    # the largest values of u^3 (1 - u^2)^3 and of its slope
    return c3 * max(0.057 / z_tolerance, 0.18 / (k * v_tolerance))


@takes(AT_PLANT, AT_LADDER, INTEGER, INTEGER, INTEGER, REAL, INTEGER, REAL, REAL, AT_WORK)
@stage
def ladder_step(
    plant, ladder, level, level_before, origin, t, segment, z_tolerance, v_tolerance, work
):
    """Try a step of the size of `level`; the outcome stands in `work`.

    `level_before` is that of the ladder step just before, or -1 where its forces say nothing about
    this one; `origin` the place in the memory of a step that begins on a break, or -1. Returns the
    number of iterations of the forces (0: they did not repeat), the truncation error and the
    interpolation error, both over their tolerance.
    """
    row, path, known, result = work.row, work.path, work.known, work.result
    for i in range(2 * path.shape[1] // 3):
        row[i] = path[0, i]
    place_base(plant, ladder, level, t, segment, work)
    iterations = 1
    if work.force.size > 0:
        guess_forces(plant, ladder, level, level_before, origin, z_tolerance, v_tolerance, work)
        product(None, row, 0, ladder.known, level, known)
        iterations = collocate(plant, ladder, level, work)
        if iterations == 0:
            return 0, np.inf, np.inf
    product(None, row, 0, ladder.advance, level, result)
    add_forces_between(plant, work)
    total = 0.0
    for i in range(2 * path.shape[1] // 3):
        total += path[4, i]
    if not abs(total) < np.inf:  # a law gave no number
        return 0, np.inf, np.inf
    error = truncation(ladder, level, z_tolerance, v_tolerance, work)
    gap = 0.0
    for first in range(0, 4, 2):
        gap = max(
            gap, interpolation_error(ladder.step[level], path, first, z_tolerance, v_tolerance)
        )
    return iterations, error, gap


@inlined
def keeps_off(j, start, p, q, value, margin, work):
    """Whether p d + q v - value of channel j, `start` at first, stays above a margin in a step.

    The polynomial through the points does if its Bernstein coefficients do; that at the end does
    not count.
    """
    motion, total = work.motion, start * load(TO_BERNSTEIN, 0)
    for k in range(LATER):
        g = p * motion[2 * j, k] + q * motion[2 * j + 1, k] - value
        total = total + g * load(TO_BERNSTEIN, 1 + k)
    return not any_larger(margin, total)


@takes(INTEGER, INTEGER, AT_WORK)
@stage
def remember(level, origin, work):
    """Keep the forces of a step that began on a break: a periodic motion comes back to it."""
    m = work.force.size
    for j in range(m):
        store(work.memory, origin * m + j, load(work.later, j))
    work.memory_level[origin] = level


@inlined
def bold_level(origin, level, work):
    """Level of a step that begins on a break: one more than the last from there, or `level`.

    After refused steps from there it is no more than the last for a while.
    """
    last = work.memory_level[origin]
    if work.refused[1, origin] > 0:
        work.refused[1, origin] -= 1
        return max(level, last)
    return max(level, min(last + 1, LEVELS - 1))


@inlined
def be_patient(origin, work):
    """After a refused step from a break: wait twice as often as before the next longer one."""
    if origin >= 0:
        work.refused[0, origin] = 2 * work.refused[0, origin] + 1
        work.refused[1, origin] = work.refused[0, origin]


@inner
def keeps_forces(place, work):
    """Whether the polynomials of the forces at `place` (0..1) of a step are the laws in `trial`.

    Beyond a break laws go on by reflection, which is another law where several breaks meet. A step
    that is cut before its first point behind the start has seen nothing else.
    """
    force, later = work.force, work.later
    for j in range(force.size):
        missing = work.trial[j]
        for q in range(POINTS):
            share = LAGRANGE[q]
            for p in range(POINTS):
                if p != q:
                    share *= place - NODES[p]
            missing -= share * (force[j] if q == 0 else later[j, q - 1])
        if not SMALL_CHANGE * place * work.weight[j] * abs(missing) <= 1.0:
            return False
    return True


@takes(AT_WORK)
@stage
def keep_forces(work):
    """After an accepted step: its forces for the next guess, its last ones as start."""
    before, later, force = work.before, work.later, work.force
    for j in range(force.size):
        before[j, 0] = force[j]
        for q in range(LATER):
            before[j, 1 + q] = later[j, q]
        force[j] = later[j, LATER - 1]
