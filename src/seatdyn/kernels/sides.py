"""The force of a channel on the side of its breaks that a run is on.

Beyond a break a force goes on as its own reflection in the point on the break: twice the force on
the break, less that at the point reflected in it. It is smooth for smooth laws and exact for linear
ones, so that a step may reach over a break and be cut there. Where several breaks lie between, it
is the last of them that counts.
"""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.call import add_forces, call_law
from seatdyn.kernels.columns import (
    ADDRESS,
    BREAKS,
    ELEMENTS,
    IS_JUMP,
    LANES_ADDRESS,
    OFFSET,
    ON_DISPLACEMENT,
    ON_VELOCITY,
    VALUE,
)
from seatdyn.kernels.jit import inlined
from seatdyn.kernels.rows import WIDTH, any_larger, load, spread, store, where_larger

LEAST = np.nextafter(0.0, 1.0)  # of all positive numbers


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
def channel_force(plant, j, d, v, side):
    """Force of channel j at (d, v), which may be beyond its breaks."""
    beyond, excess = -1, 0.0
    for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
        p, q = plant.breaks[r, ON_DISPLACEMENT], plant.breaks[r, ON_VELOCITY]
        g = p * d + q * v - plant.breaks[r, VALUE]
        # a law that jumps may not be asked for its value at the jump
        if side[r] * g < 0.0 or (g == 0.0 and plant.breaks[r, IS_JUMP] == 1):
            beyond, excess = r, g
    if beyond < 0:
        return sum_of_laws(plant, j, d, v)
    p, q = plant.breaks[beyond, ON_DISPLACEMENT], plant.breaks[beyond, ON_VELOCITY]
    d_out, v_out = (excess / p, 0.0) if p != 0.0 else (0.0, excess / q)
    x, w = on_side(plant, j, d - d_out, v - v_out, side)
    twice = 2.0 * sum_of_laws(plant, j, x, w)
    x, w = on_side(plant, j, d - 2.0 * d_out, v - 2.0 * v_out, side)
    return twice - sum_of_laws(plant, j, x, w)


@inlined
def rows_on_side(plant, j, d, v, side):
    """`on_side` of eight points at once."""
    for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
        if plant.breaks[r, IS_JUMP] == 0:
            continue
        sign = float(side[r])
        edge = np.nextafter(plant.breaks[r, VALUE], sign * np.inf)
        if plant.breaks[r, ON_DISPLACEMENT] != 0.0:
            d = where_larger(sign * edge, sign * d, edge, d)
        else:
            v = where_larger(sign * edge, sign * v, edge, v)
    return d, v


@inlined
def rows_of_laws(plant, j, motion, place, forces, at):
    """Put the sums of the forces of channel j at eight points into row `at` of `forces`.

    motion : displacements in row `place`, velocities in the next
    """
    elements, d, v = plant.elements, place * WIDTH, (place + 1) * WIDTH
    store(forces, at, 0.0)
    for e in range(plant.channels[j, ELEMENTS], plant.channels[j + 1, ELEMENTS]):
        address, offset = elements[e, LANES_ADDRESS], elements[e, OFFSET]
        add_forces(
            address, WIDTH, motion, d, v, plant.parameters, offset, forces, at * WIDTH
        )  # fmt: skip


@inlined
def channel_rows(plant, j, motion, side, forces, scratch):
    """Put the forces of channel j at eight points into row j of `forces`; see `channel_force`.

    motion : displacements in row 2j, velocities in row 2j + 1
    scratch : (5, 8) displacements and velocities on a break and reflected in it, forces on it
    """
    d, v, is_beyond = load(motion, 2 * j), load(motion, 2 * j + 1), False
    d_out, v_out, beyond = spread(0.0), spread(0.0), spread(0.0)
    for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
        p, q = side[r] * plant.breaks[r, ON_DISPLACEMENT], side[r] * plant.breaks[r, ON_VELOCITY]
        g = p * d + q * v - side[r] * plant.breaks[r, VALUE]
        limit = LEAST if plant.breaks[r, IS_JUMP] == 1 else 0.0
        if any_larger(limit, g):
            is_beyond = True
            beyond = where_larger(limit, g, 1.0, beyond)
            d_out = where_larger(limit, g, (1.0 / p if p != 0.0 else 0.0) * g, d_out)
            v_out = where_larger(limit, g, (0.0 if p != 0.0 else 1.0 / q) * g, v_out)
    if not is_beyond:
        rows_of_laws(plant, j, motion, 2 * j, forces, j)
        return
    x, w = rows_on_side(plant, j, d - d_out, v - v_out, side)
    store(scratch, 0, x)
    store(scratch, 1, w)
    x, w = rows_on_side(plant, j, d - 2.0 * d_out, v - 2.0 * v_out, side)
    store(scratch, 2, x)
    store(scratch, 3, w)
    rows_of_laws(plant, j, scratch, 0, scratch, 4)
    rows_of_laws(plant, j, scratch, 2, forces, j)
    force = load(forces, j)
    store(forces, j, where_larger(beyond, 0.0, 2.0 * load(scratch, 4) - force, force))
