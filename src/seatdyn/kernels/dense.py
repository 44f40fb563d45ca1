"""The solution between the steps: states from quintics, accelerations and forces from the laws."""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import ADDRESS, ELEMENTS, OFFSET
from seatdyn.kernels.holding import held_element_forces
from seatdyn.kernels.jit import inner, kernel
from seatdyn.kernels.plant import (
    FREE,
    accelerations,
    base_motion,
    free_accelerations,
    on_side,
    relative,
    segment_at,
)


@inner
def hermite_state(record, i, s, n, y):
    """State at share s of step i: quintic in the displacements, its derivative as velocity."""
    h = record[i + 1, 0] - record[i, 0]
    for q in range(1, n + 1):
        z0, z1 = record[i, q], record[i + 1, q]
        m0, m1 = h * record[i, n + q], h * record[i + 1, n + q]
        k0, k1 = h * h * record[i, 2 * n + q], h * h * record[i, 3 * n + q]
        rise = z1 - z0
        p3 = 10 * rise - 6 * m0 - 4 * m1 - 1.5 * k0 + 0.5 * k1
        p4 = -15 * rise + 8 * m0 + 7 * m1 + 1.5 * k0 - k1
        p5 = 6 * rise - 3 * m0 - 3 * m1 - 0.5 * k0 + 0.5 * k1
        y[q - 1] = z0 + s * (m0 + s * (0.5 * k0 + s * (p3 + s * (p4 + s * p5))))
        y[n + q - 1] = (m0 + s * (k0 + s * (3 * p3 + s * (4 * p4 + s * 5 * p5)))) / h


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
        hermite_state(record, i, share[p], n, y)
        segment = segment_at(plant, record[i, 0] + 0.5 * h)
        times[p] = record[i, 0] + share[p] * h
        base = base_motion(plant, times[p], segment)
        bases[0, p], bases[1, p], bases[2, p] = base
        side, held = marks[i, :breaks], marks[i, breaks:]
        if np.any(held != FREE):
            accelerations(plant, base, y, side, held, a[p], force)
        else:
            free_accelerations(plant, base, y, side, a[p], force)
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
