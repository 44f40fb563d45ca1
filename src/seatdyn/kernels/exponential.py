"""One step with the linear part exact: collocation of the channel forces at Lobatto points."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from seatdyn.kernels.columns import FIRST, SECOND
from seatdyn.kernels.jit import allocating, inlined, inner
from seatdyn.kernels.plant import channel_force, segment_motion

LEVELS = 16  # step sizes of the ladder, each twice the one before
NODES = np.array([0.0, 0.5 - np.sqrt(3 / 28), 0.5, 0.5 + np.sqrt(3 / 28), 1.0])
ITERATIONS = 12
FIRST_CHANGE = 0.02  # of the tolerance: small enough to accept without knowing the ratio
ROUNDING = 4e-16


class Ladder(NamedTuple):
    """Propagators for L step sizes, 2N states and p = m + 2 inputs: forces, base x and v.

    A step starts from one row [state (2N), inputs at node 0 (p), ..., at node 4 (p)]; each matrix
    takes this row to what is needed.
    """

    step: np.ndarray  # (L,) s
    turn: np.ndarray  # (L, 5, n, 2) cosine and sine of the angle of each lasting sine to the nodes
    advance: np.ndarray  # (L, 2N + 5p, 6N) to state and acceleration at the middle, and at the end
    relative: np.ndarray  # (L, 2N + 5p, 8m) to motions across channels at node 1: d, v; node 2: ...
    to_legendre: np.ndarray  # (3, 5) second to fourth Legendre coefficient of nodal values
    response: np.ndarray  # (L, 2, p, 2N) |end state| per unit of a constant, and of the third


class Work(NamedTuple):
    """Arrays of a ladder step: what it starts from and gives, and scratch."""

    row: np.ndarray  # (2N + 5p,) state and nodal inputs
    base: np.ndarray  # (5, 3) base displacement, velocity, acceleration at the nodes
    result: np.ndarray  # (6N,) state and acceleration at the middle and at the end
    before: np.ndarray  # (5, m) nodal forces of the step before
    weights: np.ndarray  # (5, 5) that extrapolate them
    ratio: np.ndarray  # (1,) of the step sizes that the weights are for
    tolerance: np.ndarray  # (m,) N
    known: np.ndarray  # (8m,)
    motion: np.ndarray  # (8m,)
    past: np.ndarray  # (4, 4m)
    effect: np.ndarray  # (2N,)


@allocating
def make_work(n, m):
    """Arrays for N = n free nodes and m channels."""
    return Work(
        np.zeros(2 * n + 5 * (m + 2)),
        np.zeros((5, 3)),
        np.zeros(6 * n),
        np.zeros((5, m)),
        np.zeros((5, 5)),
        np.zeros(1),
        np.zeros(m),
        np.zeros(8 * m),
        np.zeros(8 * m),
        np.zeros((4, 4 * m)),
        np.zeros(2 * n),
    )


@inlined
def prediction(ratio, weights):
    """Weights (5, 5) that carry a quartic over one step to the nodes of the next, h2/h1 = ratio."""
    for i in range(5):
        x = 1.0 + ratio * NODES[i]
        for q in range(5):
            weight = 1.0
            for p in range(5):
                if p != q:
                    weight *= (x - NODES[p]) / (NODES[q] - NODES[p])
            weights[i, q] = weight


@inlined
def place_base(plant, turn, t, h, segment, row, base):
    """Write the base motion at the nodes into `row`, and (x, v, a) at the nodes into `base`."""
    p = plant.gain.shape[0] + 2
    first = row.size - 5 * p
    lasting = plant.sines
    for q in range(5):
        base[q, 0], base[q, 1], base[q, 2] = segment_motion(plant, t + NODES[q] * h, segment)
    for i in range(lasting.shape[0]):
        omega, angle = lasting[i, 1], lasting[i, 1] * t + lasting[i, 2]
        sine, cosine = lasting[i, 0] * math.sin(angle), lasting[i, 0] * math.cos(angle)
        for q in range(5):
            x = sine * turn[q, i, 0] + cosine * turn[q, i, 1]
            base[q, 0] += x
            base[q, 1] += omega * (cosine * turn[q, i, 0] - sine * turn[q, i, 1])
            base[q, 2] -= omega * omega * x
    for q in range(5):
        row[first + q * p + p - 2] = base[q, 0]
        row[first + q * p + p - 1] = base[q, 1]


@inlined
def collocate(plant, matrix, row, base, side, tolerance, known, motion, past):
    """Iterate the channel forces at nodes 1-4 in `row` until they repeat.

    Fixed-point iteration, each new value mixed with the one before so that the last two changes
    cancel best (Anderson 1965, J. ACM 12:547-560, depth one). `known`, `motion` (8m,) and `past`
    (4, 4m) are scratch. Returns the number of iterations, 0 where they do not repeat soon enough.
    """
    m = plant.gain.shape[0]
    p = m + 2
    n2 = row.size - 5 * p
    for i in range(4):
        for j in range(m):
            start, end = plant.channels[j, FIRST] < 0, plant.channels[j, SECOND] < 0
            for r in range(2):
                o = i * 2 * m + r * m + j
                known[o] = (base[i + 1, r] if end else 0.0) - (base[i + 1, r] if start else 0.0)
    for k in range(row.size):
        if k < n2 + p or (k - n2) % p >= m:
            for o in range(8 * m):
                known[o] += matrix[k, o] * row[k]
    before = np.inf
    for iteration in range(1, ITERATIONS + 1):
        for o in range(8 * m):
            motion[o] = known[o]
        for q in range(1, 5):
            for j in range(m):
                k = n2 + q * p + j
                for o in range(8 * m):
                    motion[o] += matrix[k, o] * row[k]
        change = up = down = 0.0
        for i in range(4):
            for j in range(m):
                o = i * 2 * m + j
                q = i * m + j
                new = channel_force(plant, j, motion[o], motion[o + m], side)
                step = new - row[n2 + (i + 1) * p + j]
                change = max(change, abs(step) / tolerance[j])
                if iteration > 1:
                    turn = (step - past[1, q]) / tolerance[j]
                    up += step / tolerance[j] * turn
                    down += turn * turn
                past[2, q], past[3, q] = new, step
        # small, and so is what is still to come if the changes go on falling by the same ratio
        done = change <= FIRST_CHANGE or (change <= 1.0 and 2.0 * change <= before)
        fall = change / before
        if not done and iteration > 2 and change * fall ** (ITERATIONS - iteration) > 1.0:
            return 0
        mix = up / down if down > 0.0 and not done else 0.0
        for i in range(4):
            for j in range(m):
                q = i * m + j
                new = past[2, q]
                row[n2 + (i + 1) * p + j] = new - mix * (new - past[0, q])
                past[0, q], past[1, q] = new, past[3, q]
        if done:
            return iteration
        before = change
    return 0


@inlined
def carry(matrix, row, result):
    """result = row @ matrix."""
    for i in range(result.size):
        result[i] = 0.0
    for k in range(row.size):
        for i in range(result.size):
            result[i] += row[k] * matrix[k, i]


@inlined
def truncation(ladder, level, row, worst_of, z_tolerance, v_tolerance):
    """Error by what the quartics miss of the inputs, over its tolerance; `worst_of` is scratch.

    The Legendre coefficients of an input fall by about a ratio r each, c5 = r c4 and so on. At the
    Lobatto points the fifth polynomial looks like the third, and the eighth like a constant, which
    has the full effect on the end state: r c4 R3 + r^4 c4 R0. For smooth laws r is small; at a
    corner it is near one. Where c4 is small by chance, r c3 stands for it.
    """
    p, n2 = ladder.response.shape[2], ladder.response.shape[3]
    for i in range(n2):
        worst_of[i] = 0.0
    for j in range(p):
        c2 = c3 = c4 = 0.0
        for q in range(5):
            value = row[n2 + q * p + j]
            c2 += ladder.to_legendre[0, q] * value
            c3 += ladder.to_legendre[1, q] * value
            c4 += ladder.to_legendre[2, q] * value
        c2, c3, c4 = max(abs(c2), 1e-300), max(abs(c3), 1e-300), abs(c4)
        r = min(1.0, max(c3 / c2, c4 / c3))
        last = max(c4, r * c3)
        for i in range(n2):
            worst_of[i] += last * (
                r * ladder.response[level, 1, j, i] + r**4 * ladder.response[level, 0, j, i]
            )
    worst = 0.0
    for i in range(n2):
        worst = max(worst, worst_of[i] / (z_tolerance if i < n2 // 2 else v_tolerance))
    return worst


@inlined
def interpolation_error(h, y0, ym, y1, a0, a1, z_tolerance, v_tolerance):
    """Error of the two quintics kept for the step, from the middle of the one over the whole."""
    worst = 0.0
    n = a0.size
    noise = ROUNDING * 1.875 / h  # of the velocity, per unit of displacement
    for i in range(n):
        z0, z1, v0, v1 = y0[i], y1[i], y0[n + i], y1[n + i]
        z = 0.5 * (z0 + z1) + 5 * h / 32 * (v0 - v1) + h * h / 64 * (a0[i] + a1[i])
        v = 1.875 * (z1 - z0) / h - 0.4375 * (v0 + v1) + h / 32 * (a1[i] - a0[i])
        rate_error = max(0.0, abs(ym[n + i] - v) - noise * (abs(z0) + abs(z1)))
        worst = max(worst, abs(ym[i] - z) / 64 / z_tolerance, rate_error / 32 / v_tolerance)
    return worst


@inlined
def guess_forces(plant, h, h_before, force0, z_tolerance, v_tolerance, work):
    """First guess of the nodal forces in the row, and the changes that count as small."""
    m = force0.size
    inputs = m + 2
    if h_before > 0.0 and h / h_before != work.ratio[0]:
        work.ratio[0] = h / h_before
        prediction(work.ratio[0], work.weights)
    for j in range(m):
        place = work.row.size - 5 * inputs + j
        work.row[place] = force0[j]
        for i in range(1, 5):
            guess = force0[j]
            if h_before > 0.0:
                guess = 0.0
                for q in range(5):
                    guess += work.weights[i, q] * work.before[q, j]
            work.row[place + i * inputs] = guess
        reach = plant.gain[j, j] * h
        work.tolerance[j] = 0.1 * min(2 * z_tolerance / (reach * h), v_tolerance / reach)


@inlined
def ladder_step(
    plant, ladder, level, t, segment, y, a0, force0, h_before, side, z_tolerance, v_tolerance, work
):
    """Try a step of the size of `level`; the outcome stands in `work`.

    `h_before` is the size of the ladder step just before, or 0 where its forces say nothing about
    this one. Returns the number of iterations of the forces (0: they did not repeat), the
    truncation error and the interpolation error, both over their tolerance.
    """
    h, n = ladder.step[level], a0.size
    row, result = work.row, work.result
    for i in range(2 * n):
        row[i] = y[i]
    place_base(plant, ladder.turn[level], t, h, segment, row, work.base)
    iterations = 1
    if force0.size > 0:
        guess_forces(plant, h, h_before, force0, z_tolerance, v_tolerance, work)
        iterations = collocate(
            plant, ladder.relative[level], row, work.base, side, work.tolerance, work.known,
            work.motion, work.past,
        )  # fmt: skip
        if iterations == 0:
            return 0, np.inf, np.inf
    carry(ladder.advance[level], row, result)
    error = truncation(ladder, level, row, work.effect, z_tolerance, v_tolerance)
    ym, y1, a1 = result[: 2 * n], result[3 * n : 5 * n], result[5 * n :]
    gap = interpolation_error(h, y, ym, y1, a0, a1, z_tolerance, v_tolerance)
    return iterations, error, gap


@inner
def keep_forces(work, force0):
    """After an accepted step: its nodal forces for the next guess, its last one as start."""
    m = force0.size
    first = work.row.size - 5 * (m + 2)
    for q in range(5):
        for j in range(m):
            work.before[q, j] = work.row[first + q * (m + 2) + j]
    for j in range(m):
        force0[j] = work.before[4, j]
