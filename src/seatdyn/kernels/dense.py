"""The solution between the steps: states from polynomials, the rest from the laws."""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.address import address_of
from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import ADDRESS, ELEMENTS, FIRST, OFFSET, SECOND
from seatdyn.kernels.holding import held_element_forces
from seatdyn.kernels.jit import inlined, inner, kernel, takes
from seatdyn.kernels.plant import (
    PLANT,
    accelerations,
    base_motion,
    relative,
    segment_at,
)
from seatdyn.kernels.shapes import INTEGER, INTEGER_TABLE, INTEGERS, TABLE, VECTOR
from seatdyn.kernels.sides import on_side

# numpy's integers, for which functions are not compiled one by one as for those of Python
SINGLE, FIRST_HALF, SECOND_HALF = np.arange(
    3
)  # what a row of the record is: last column of `marks`


SHORT = 1e-5  # s: in a shorter step the displacements are too close to tell of velocities


@inlined
def quintic(h, z0, v0, a0, z1, v1, a1):
    """Coefficients of s = 0 .. 1 over a step: displacement, velocity, acceleration at both ends.

    Of a short step it goes through the velocities and accelerations, from the first displacement.
    """
    m0, m1, k0, k1, rise = h * v0, h * v1, h * h * a0, h * h * a1, z1 - z0
    if h < SHORT:
        third, fourth = m1 - m0 - (2 * k0 + k1) / 3, 0.5 * (m0 - m1) + 0.25 * (k0 + k1)
        return z0, m0, 0.5 * k0, third, fourth, 0.0, 0.0, 0.0, 0.0
    return (
        z0,
        m0,
        0.5 * k0,
        10 * rise - 6 * m0 - 4 * m1 - 1.5 * k0 + 0.5 * k1,
        -15 * rise + 8 * m0 + 7 * m1 + 1.5 * k0 - k1,
        6 * rise - 3 * m0 - 3 * m1 - 0.5 * k0 + 0.5 * k1,
        0.0,
        0.0,
        0.0,
    )


@inlined
def octic(k, z0, v0, a0, zm, vm, am, z1, v1, a1):
    """Coefficients of u = -1 .. 1 over a step of two halves k: the same at -1, 0 and 1.

    It is the quintic through both ends, and what the middle adds: (1 - u^2)^3 (c0 + c1 u + c2 u^2).
    """
    mean, odd = 0.5 * (z0 + z1), 0.5 * (z1 - z0)
    mean1, odd1 = 0.5 * k * (v0 + v1), 0.5 * k * (v1 - v0)
    mean2, odd2 = 0.5 * k * k * (a0 + a1), 0.5 * k * k * (a1 - a0)
    p4, p5 = 0.125 * (mean2 - odd1), 0.125 * (odd2 - 3 * (mean1 - odd))
    p2, p3 = 0.5 * odd1 - 2 * p4, 0.5 * (mean1 - odd) - 2 * p5
    p0, p1 = mean - p2 - p4, odd - p3 - p5
    c0, c1 = zm - p0, k * vm - p1
    c2 = 0.5 * (k * k * am - 2 * p2) + 3 * c0
    return (
        zm,
        k * vm,
        0.5 * k * k * am,
        p3 - 3 * c1,
        p4 + 3 * (c0 - c2),
        p5 + 3 * c1,
        3 * c2 - c0,
        -c1,
        -c2,
    )


@inlined
def value(c, u):
    """A polynomial of degree eight."""
    return c[0] + u * (
        c[1]
        + u * (c[2] + u * (c[3] + u * (c[4] + u * (c[5] + u * (c[6] + u * (c[7] + u * c[8]))))))
    )


@inlined
def slope(c, u):
    """Its derivative."""
    return c[1] + u * (
        2 * c[2]
        + u
        * (
            3 * c[3]
            + u * (4 * c[4] + u * (5 * c[5] + u * (6 * c[6] + u * (7 * c[7] + u * (8 * c[8])))))
        )
    )


@inlined
def bend(c, u):
    """Its second derivative."""
    return 2 * c[2] + u * (
        6 * c[3]
        + u * (12 * c[4] + u * (20 * c[5] + u * (30 * c[6] + u * (42 * c[7] + u * (56 * c[8])))))
    )


@inlined
def in_path(k, path, first, q):
    """Polynomial of node q over two quarters k of a step, from `first` on; see `Work.path`."""
    v, a = path.shape[1] // 3 + q, 2 * path.shape[1] // 3 + q
    start, middle, end = path[first], path[first + 1], path[first + 2]
    return octic(
        k, start[q], start[v], start[a], middle[q], middle[v], middle[a], end[q], end[v], end[a]
    )


@inlined
def motion_at(c, u, k):
    """Displacement, velocity and acceleration by the polynomial of two quarters k."""
    return value(c, u), slope(c, u) / k, bend(c, u) / (k * k)


@inner
def states_within(k, u, middle, path, first, at_u, at_middle):
    """States and accelerations at two places -1 .. 1 of two quarters k of a step."""
    n = path.shape[1] // 3
    for q in range(n):
        c = in_path(k, path, first, q)
        at_u[q], at_u[n + q], at_u[2 * n + q] = motion_at(c, u, k)
        at_middle[q], at_middle[n + q], at_middle[2 * n + q] = motion_at(c, middle, k)


@inner
def relative_within(plant, j, base, k, u, path, first):
    """Displacement, velocity and acceleration across channel j there."""
    a, b = plant.channels[j, FIRST], plant.channels[j, SECOND]
    d0, v0, a0 = motion_at(in_path(k, path, first, a), u, k) if a >= 0 else base
    d1, v1, a1 = motion_at(in_path(k, path, first, b), u, k) if b >= 0 else base
    return d1 - d0, v1 - v0, a1 - a0


@inlined
def in_row(record, i, part, n, q):
    """Polynomial of displacement q in row i of the record, which may be half of a ladder step."""
    h, z, v, a, b = record[i + 1, 0] - record[i, 0], 1 + q, 1 + n + q, 1 + 2 * n + q, 1 + 3 * n + q
    if part == SINGLE or h < SHORT:
        start, end = record[i], record[i + 1]
        return quintic(h, start[z], start[v], start[a], end[z], end[v], start[b])
    first = i - 1 if part == SECOND_HALF else i
    start, middle, end = record[first], record[first + 1], record[first + 2]
    return octic(
        h, start[z], start[v], start[a], middle[z], middle[v], start[b], end[z], end[v], middle[b]
    )


@inlined
def first_of(part, h):
    """Variable of that polynomial where the row begins, h before its end; it ends one later."""
    return -1.0 if part == FIRST_HALF and not h < SHORT else 0.0


@inner
def row_at(record, i, time):
    """Last row of the record that begins no later than `time`; i is a first guess."""
    low, high = 0, record.shape[0] - 2
    if record[i, 0] <= time:
        low = i
        if i == high or time < record[i + 1, 0]:
            return i
    else:
        high = i
    while low < high:
        middle = (low + high + 1) // 2
        if record[middle, 0] <= time:
            low = middle
        else:
            high = middle - 1
    return low


@kernel
def states(record, marks, time):
    """Displacements and velocities (p, 2N) at these times (p,), no more."""
    n, last = (record.shape[1] - 1) // 4, record.shape[0] - 2
    y = np.empty((2 * n, time.size))  # so that what follows in time does so in memory
    begin = i = 0
    while begin < time.size:
        i = row_at(record, i, time[begin])
        start, h = record[i, 0], record[i + 1, 0] - record[i, 0]
        part, rate = marks[i, marks.shape[1] - 1], 1.0 / h
        # the times that follow in the same row
        end = begin + 1
        while end < time.size and start <= time[end] and (time[end] < start + h or i == last):
            end += 1
        here, first = time[begin:end], first_of(part, h)
        for q in range(n):
            c = in_row(record, i, part, n, q)
            z, v = y[q, begin:end], y[n + q, begin:end]
            for p in range(here.size):
                u = (here[p] - start) / h + first
                z[p], v[p] = value(c, u), slope(c, u) * rate
        begin = end
    return y.T


@takes(PLANT, TABLE, INTEGER_TABLE, INTEGERS, VECTOR)
@kernel
def sample(plant, record, marks, index, share):
    """Solution at `share` (0..1) of the steps `index`, on the branch that each step was on.

    Returns times (p,), base motion (3, p), displacements, velocities, accelerations (p, N), element
    forces (p, e), and the element forces at the same displacement and zero velocity (p, e).
    """
    plant = address_of(plant)
    n, m, count = plant.linear.shape[0], plant.gain.shape[0], index.size
    breaks, elements = plant.breaks.shape[0], plant.elements.shape[0]
    z, v, a = np.empty((count, n)), np.empty((count, n)), np.empty((count, n))
    forces, elastic = np.empty((count, elements)), np.empty((count, elements))
    y, force = np.empty(2 * n), np.zeros(m)
    times, bases = np.empty(count), np.empty((3, count))
    for p in range(count):
        i = index[p]
        h = record[i + 1, 0] - record[i, 0]
        part = marks[i, breaks + m]
        for q in range(n):
            c, u = in_row(record, i, part, n, q), share[p] + first_of(part, h)
            y[q], y[n + q] = value(c, u), slope(c, u) * (1.0 / h)
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
