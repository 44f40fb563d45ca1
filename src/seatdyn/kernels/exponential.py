"""One step with the linear part exact: collocation of the channel forces at Lobatto points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from seatdyn.kernels.jit import kernel
from seatdyn.kernels.plant import base_motion, channel_force

LEVELS = 16  # step sizes of the ladder, each twice the one before
NODES = np.array([0.0, 0.5 - np.sqrt(3 / 28), 0.5, 0.5 + np.sqrt(3 / 28), 1.0])
ITERATIONS = 8


class Ladder(NamedTuple):
    """Propagators for L step sizes, 2N states and p = m + 2 inputs: forces, base x and v.

    A step starts from one row [state (2N), inputs at node 0 (p), ..., at node 4 (p)]; each matrix
    takes this row to what is needed.
    """

    step: np.ndarray  # (L,) s
    advance: np.ndarray  # (L, 2, 2N + 5p, 2N) to the middle and the end of the step
    relative: np.ndarray  # (L, 2N + 5p, 8m) to motions across channels at node 1: d, v; node 2: ...
    to_legendre: np.ndarray  # (2, 5) third and fourth Legendre coefficient of nodal values
    response: np.ndarray  # (L, 2, p, 2N) |end state| per unit of these coefficients


@kernel
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


@kernel
def place_base(plant, t, h, segment, row, base):
    """Write the base motion at the nodes into `row`, and (x, v, a) at the nodes into `base`."""
    p = plant.first.size + 2
    first = row.size - 5 * p
    for q in range(5):
        base[q, 0], base[q, 1], base[q, 2] = base_motion(plant, t + NODES[q] * h, segment)
        row[first + q * p + p - 2] = base[q, 0]
        row[first + q * p + p - 1] = base[q, 1]


@kernel
def collocate(plant, matrix, row, base, side, tolerance, known, motion):
    """Iterate the channel forces at nodes 1-4 in `row` until they repeat; False if they do not."""
    m = plant.first.size
    p = m + 2
    n2 = row.size - 5 * p
    for i in range(4):
        for j in range(m):
            start, end = plant.first[j] < 0, plant.second[j] < 0
            for r in range(2):
                o = i * 2 * m + r * m + j
                known[o] = (base[i + 1, r] if end else 0.0) - (base[i + 1, r] if start else 0.0)
    for k in range(row.size):
        if k < n2 + p or (k - n2) % p >= m:
            for o in range(8 * m):
                known[o] += matrix[k, o] * row[k]
    for _ in range(ITERATIONS):
        for o in range(8 * m):
            motion[o] = known[o]
        for q in range(1, 5):
            for j in range(m):
                k = n2 + q * p + j
                for o in range(8 * m):
                    motion[o] += matrix[k, o] * row[k]
        change = 0.0
        for i in range(4):
            for j in range(m):
                o = i * 2 * m + j
                k = n2 + (i + 1) * p + j
                new = channel_force(plant, j, motion[o], motion[o + m], side)
                change = max(change, abs(new - row[k]) / tolerance[j])
                row[k] = new
        if change <= 1.0:
            return True
    return False


@kernel
def carry(matrix, row, result):
    """result = row @ matrix."""
    for i in range(result.size):
        result[i] = 0.0
    for k in range(row.size):
        for i in range(result.size):
            result[i] += row[k] * matrix[k, i]


@kernel
def truncation(ladder, level, row, z_tolerance, v_tolerance):
    """Error by the part of the inputs beyond the quartic, over its tolerance.

    The Legendre coefficients fall about geometrically; the first one left out is estimated from
    the last two kept.
    """
    p, n2 = ladder.response.shape[2], ladder.response.shape[3]
    third = fourth = 0.0
    for i in range(n2):
        total3 = total4 = 0.0
        for j in range(p):
            c3 = c4 = 0.0
            for q in range(5):
                c3 += ladder.to_legendre[0, q] * row[n2 + q * p + j]
                c4 += ladder.to_legendre[1, q] * row[n2 + q * p + j]
            total3 += abs(c3) * ladder.response[level, 0, j, i]
            total4 += abs(c4) * ladder.response[level, 1, j, i]
        tolerance = z_tolerance if i < n2 // 2 else v_tolerance
        third, fourth = max(third, total3 / tolerance), max(fourth, total4 / tolerance)
    return fourth * min(1.0, fourth / max(third, 1e-300))


@kernel
def interpolation_error(h, y0, ym, y1, a0, a1, z_tolerance, v_tolerance):
    """Error of the two quintics kept for the step, from the middle of the one over the whole."""
    worst = 0.0
    n = a0.size
    for i in range(n):
        z0, z1, v0, v1 = y0[i], y1[i], y0[n + i], y1[n + i]
        z = 0.5 * (z0 + z1) + 5 * h / 32 * (v0 - v1) + h * h / 64 * (a0[i] + a1[i])
        v = 1.875 * (z1 - z0) / h - 0.4375 * (v0 + v1) + h / 32 * (a1[i] - a0[i])
        worst = max(worst, abs(ym[i] - z) / 64 / z_tolerance, abs(ym[n + i] - v) / 32 / v_tolerance)
    return worst
