"""Sticking at a jump: a force that jumps takes any value of the jump while the state rests on it.

At a jump at d = b with v = 0 the force is the whole interval between its one-sided values. A
channel is held there while the force that balances it lies inside the interval. The same holds
for a jump at v = 0 (dry friction), where d stays constant. Dry friction in the same channel adds
its own jump to one at d = b: there v = 0, too.
"""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import ADDRESS, ELEMENTS, OFFSET, ON_DISPLACEMENT, VALUE
from seatdyn.kernels.events import beside_jump, leave, one_sided_forces, resting_on
from seatdyn.kernels.jit import allocating, stage, takes
from seatdyn.kernels.plant import AT_PLANT, FREE, accelerations, base_motion, relative
from seatdyn.kernels.shapes import INTEGER, INTEGERS, REAL, VECTOR


@takes(AT_PLANT, REAL, INTEGER, VECTOR, INTEGERS, INTEGERS, VECTOR)
@stage
def held_margin(plant, t, segment, y, side, held, force):
    """Smallest distance of a holding force to the ends of its jump, and its channel."""
    base = base_motion(plant, t, segment)
    worst, channel = np.inf, -1
    for j in range(plant.gain.shape[0]):
        if held[j] >= 0:
            below, above = one_sided_forces(plant, held[j], j, y, base, side)
            margin = min(force[j] - below, above - force[j])
            if margin < worst:
                worst, channel = margin, j
    return worst, channel


@allocating
def try_to_hold(plant, t, segment, y, r, j, side, held, stick_speed, force):
    """Hold channel j at jump r if it is slow and the balancing force lies inside the jump."""
    n = y.size // 2
    base = base_motion(plant, t, segment)
    _, v = relative(plant, j, y, base[0], base[1])
    on_velocity = plant.breaks[r, ON_DISPLACEMENT] == 0.0
    if not on_velocity and abs(v) > stick_speed:
        return
    below, above = one_sided_forces(plant, r, j, y, base, side)
    if above <= below:
        return
    held[j] = r
    accelerations(plant, base, y, side, held, np.empty(n), force)
    if not below <= force[j] <= above:
        held[j] = FREE
        return
    excess = (v - plant.breaks[r, VALUE]) if on_velocity else v
    for i in range(n):
        y[n + i] -= plant.pull[i, j] / plant.gain[j, j] * excess


@allocating
def held_element_forces(plant, j, y, base, side, r, force, result):
    """Forces (e,) of the elements of channel j while it is held at break r with `force` in all.

    Each element that jumps there carries the same share of its jump.
    """
    d, v = resting_on(plant, r, j, y, base)
    d_low, v_low = beside_jump(plant, r, j, d, v, side, -1)
    d_high, v_high = beside_jump(plant, r, j, d, v, side, 1)
    below = jumps = 0.0
    for e in range(plant.channels[j, ELEMENTS], plant.channels[j + 1, ELEMENTS]):
        address, offset = plant.elements[e, ADDRESS], plant.elements[e, OFFSET]
        result[e] = call_law(address, d_low, v_low, plant.parameters, offset)
        below += result[e]
        jumps += call_law(address, d_high, v_high, plant.parameters, offset) - result[e]
    share = (force - below) / jumps if jumps != 0.0 else 0.0
    for e in range(plant.channels[j, ELEMENTS], plant.channels[j + 1, ELEMENTS]):
        address, offset = plant.elements[e, ADDRESS], plant.elements[e, OFFSET]
        above = call_law(address, d_high, v_high, plant.parameters, offset)
        result[e] += share * (above - result[e])


@takes(AT_PLANT, REAL, INTEGER, VECTOR, INTEGER, INTEGERS, INTEGERS, VECTOR)
@stage
def release(plant, t, segment, y, j, side, held, force):
    """Let channel j go to the side that its balancing force points to."""
    base = base_motion(plant, t, segment)
    r = held[j]
    below, above = one_sided_forces(plant, r, j, y, base, side)
    leave(plant, r, j, 1 if force[j] - below > above - force[j] else -1, side)
    held[j] = FREE
