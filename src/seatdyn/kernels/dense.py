"""The solution between the steps: states from quintics, accelerations and forces from the laws."""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import ADDRESS, ELEMENTS, OFFSET
from seatdyn.kernels.holding import held_element_forces
from seatdyn.kernels.jit import inner, kernel, takes
from seatdyn.kernels.plant import (
    PLANT,
    accelerations,
    base_motion,
    on_side,
    relative,
    segment_at,
)
from seatdyn.kernels.shapes import INTEGER, INTEGER_TABLE, INTEGERS, TABLE, VECTOR

# numpy's integers, for which functions are not compiled one by one as for those of Python
SINGLE, FIRST_HALF, SECOND_HALF = np.arange(
    3
)  # what a row of the record is: last column of `marks`


@inner
def state_between(h, s, y0, a0, y1, a1, y):
    """State at share s of a step: quintic in the displacements, its derivative as velocity."""
    n = a0.size
    for q in range(n):
        z0, z1 = y0[q], y1[q]
        m0, m1 = h * y0[n + q], h * y1[n + q]
        k0, k1 = h * h * a0[q], h * h * a1[q]
        rise = z1 - z0
        p3 = 10 * rise - 6 * m0 - 4 * m1 - 1.5 * k0 + 0.5 * k1
        p4 = -15 * rise + 8 * m0 + 7 * m1 + 1.5 * k0 - k1
        p5 = 6 * rise - 3 * m0 - 3 * m1 - 0.5 * k0 + 0.5 * k1
        y[q] = z0 + s * (m0 + s * (0.5 * k0 + s * (p3 + s * (p4 + s * p5))))
        y[n + q] = (m0 + s * (k0 + s * (3 * p3 + s * (4 * p4 + s * 5 * p5)))) / h


@inner
def state_within(k, u, y0, a0, ym, am, y1, a1, y):
    """State at u = -1 .. 1 of a step of two halves k from what it has at -1, 0 and 1.

    The displacements are of degree eight: the quintic through both ends, and what the middle adds.
    """
    n = a0.size
    bell = 1.0 - u * u
    for q in range(n):
        mean, odd = 0.5 * (y0[q] + y1[q]), 0.5 * (y1[q] - y0[q])
        odd1, mean1 = 0.5 * k * (y1[n + q] - y0[n + q]), 0.5 * k * (y0[n + q] + y1[n + q])
        mean2, odd2 = 0.5 * k * k * (a0[q] + a1[q]), 0.5 * k * k * (a1[q] - a0[q])
        p4, p5 = 0.125 * (mean2 - odd1), 0.125 * (odd2 - 3 * (mean1 - odd))
        p2, p3 = 0.5 * odd1 - 2 * p4, 0.5 * (mean1 - odd) - 2 * p5
        p0, p1 = mean - p2 - p4, odd - p3 - p5
        c0, c1 = ym[q] - p0, k * ym[n + q] - p1
        c2 = 0.5 * (k * k * am[q] - 2 * p2) + 3 * c0
        c, slope = c0 + u * (c1 + u * c2), c1 + 2 * u * c2
        y[q] = p0 + u * (p1 + u * (p2 + u * (p3 + u * (p4 + u * p5)))) + bell**3 * c
        rate = p1 + u * (2 * p2 + u * (3 * p3 + u * (4 * p4 + u * 5 * p5)))
        y[n + q] = (rate + bell * bell * (bell * slope - 6 * u * c)) / k


@inner
def solution(record, i, part, share, n, y):
    """State at a share of row i of the record, which may be half of a ladder step."""
    h = record[i + 1, 0] - record[i, 0]
    first = i - 1 if part == SECOND_HALF else i
    start, middle = record[first], record[first + 1]
    if part == SINGLE:
        state_between(
            h, share, start[1 : 2 * n + 1], start[2 * n + 1 : 3 * n + 1], middle[1 : 2 * n + 1],
            start[3 * n + 1 :], y,
        )  # fmt: skip
    else:
        state_within(
            h, share if part == SECOND_HALF else share - 1.0, start[1 : 2 * n + 1],
            start[2 * n + 1 : 3 * n + 1], middle[1 : 2 * n + 1], start[3 * n + 1 :],
            record[first + 2, 1 : 2 * n + 1], middle[3 * n + 1 :], y,
        )  # fmt: skip


@kernel
def states(record, marks, index, share):
    """Displacements and velocities (p, 2N) at `share` (0..1) of the steps `index`, no more."""
    n = (record.shape[1] - 1) // 4
    y = np.empty((index.size, 2 * n))
    for p in range(index.size):
        i = index[p]
        solution(record, i, marks[i, marks.shape[1] - 1], share[p], n, y[p])
    return y


@takes(PLANT, TABLE, INTEGER_TABLE, INTEGERS, VECTOR)
@kernel
def sample(plant, record, marks, index, share):
    """Solution at `share` (0..1) of the steps `index`, on the branch that each step was on.

    Returns times (p,), base motion (3, p), displacements, velocities, accelerations (p, N), element
    forces (p, e), and the element forces at the same displacement and zero velocity (p, e).
    """
    n, m, count = plant.linear.shape[0], plant.gain.shape[0], index.size
    breaks, elements = plant.breaks.shape[0], plant.elements.shape[0]
    z, v, a = np.empty((count, n)), np.empty((count, n)), np.empty((count, n))
    forces, elastic = np.empty((count, elements)), np.empty((count, elements))
    y, force = np.empty(2 * n), np.zeros(m)
    times, bases = np.empty(count), np.empty((3, count))
    for p in range(count):
        i = index[p]
        h = record[i + 1, 0] - record[i, 0]
        solution(record, i, marks[i, breaks + m], share[p], n, y)
        segment = segment_at(plant, record[i, 0] + 0.5 * h)
        times[p] = record[i, 0] + share[p] * h
        base = base_motion(plant, times[p], segment)
        bases[0, p], bases[1, p], bases[2, p] = base
        side, held = marks[i, :breaks], marks[i, breaks : breaks + m]
        accelerations(plant, base, y, side, held, a[p], force)
        for q in range(n):
            z[p, q], v[p, q] = y[q], y[n + q]
        for j in range(m):
            d, speed = relative(plant, j, y, base[0], base[1])
            d, speed = on_side(plant, j, d, speed, side)
            for e in range(plant.channels[j, ELEMENTS], plant.channels[j + 1, ELEMENTS]):
                address, offset = plant.elements[e, ADDRESS], plant.elements[e, OFFSET]
                forces[p, e] = call_law(address, d, speed, plant.parameters, offset)
                elastic[p, e] = call_law(address, d, 0.0, plant.parameters, offset)
            if held[j] >= 0:
                held_element_forces(plant, j, y, base, side, held[j], force[j], forces[p])
                for e in range(plant.channels[j, ELEMENTS], plant.channels[j + 1, ELEMENTS]):
                    elastic[p, e] = forces[p, e]
    return times, bases, z, v, a, forces, elastic


@takes(PLANT, INTEGER, VECTOR, VECTOR)
@kernel
def element_forces(plant, j, d, v):
    """Forces (p, e) of the elements of channel j at displacements d and velocities v (p,)."""
    begin, end = plant.channels[j, ELEMENTS], plant.channels[j + 1, ELEMENTS]
    result = np.empty((d.size, end - begin))
    for e in range(begin, end):
        address, offset = plant.elements[e, ADDRESS], plant.elements[e, OFFSET]
        for p in range(d.size):
            result[p, e - begin] = call_law(address, d[p], v[p], plant.parameters, offset)
    return result
