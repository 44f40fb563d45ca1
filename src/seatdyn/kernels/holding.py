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
from seatdyn.kernels.events import beside_jump, distance, leave, one_sided_forces, resting_on
from seatdyn.kernels.jit import allocating, inlined, inner, stage, takes
from seatdyn.kernels.plant import AT_PLANT, FREE, accelerations, base_motion, relative
from seatdyn.kernels.shapes import INTEGER, INTEGERS, REAL, VECTOR

HOLDING_TOLERANCE = 1e-10  # N: a holding force this near to the end of its jump lets go
NARROW = 1e-6  # of a step: what lets go so soon after its start did so there


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


@inlined
def dip(s0, margin0, s1, margin1, end):
    """Share of a step where the parabola through three margins is lowest and below zero; else 2.

    The margins are at the shares s0 and s1 of the step, and at its end.
    """
    rise = (margin1 - margin0) / (s1 - s0)
    bend = ((end - margin1) / (1.0 - s1) - rise) / (1.0 - s0)
    if not bend > 0.0:
        return 2.0
    place = 0.5 * (s0 + s1 - rise / bend)
    lowest = margin0 + (place - s0) * (rise + bend * (place - s1))
    return place if NARROW < place < 1.0 and lowest < -HOLDING_TOLERANCE else 2.0


@inner
def dip_between(plant, t, h, segment, y, a, y1, a1, end, side, held, force, state, force_there):
    """Share of a step of held channels where they may have let go and come back; 2 if nowhere.

    end : margin at the end of the step; force : channel forces at its start
    state : (3N,) and force_there : (m,) are space
    """
    n = y.size // 2
    for i in range(n):  # the quintic through both ends
        v, v1 = y[n + i], y1[n + i]
        state[i] = 0.5 * (y[i] + y1[i]) + h * (0.15625 * (v - v1) + h / 64 * (a[i] + a1[i]))
        state[n + i] = 1.875 * (y1[i] - y[i]) / h - 0.4375 * (v + v1) + h / 32 * (a1[i] - a[i])
    middle = t + 0.5 * h
    base = base_motion(plant, middle, segment)
    accelerations(plant, base, state[: 2 * n], side, held, state[2 * n :], force_there)
    margin, _ = held_margin(plant, t, segment, y, side, held, force)
    there, _ = held_margin(plant, middle, segment, state[: 2 * n], side, held, force_there)
    return dip(0.0, margin, 0.5, there, end)


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
    # what was let go within the tolerance may come to rest again at once
    if not below - HOLDING_TOLERANCE <= force[j] <= above + HOLDING_TOLERANCE:
        held[j] = FREE
        return
    excess = (v - plant.breaks[r, VALUE]) if on_velocity else v
    for i in range(n):
        y[n + i] -= plant.pull[i, j] / plant.gain[j, j] * excess


@takes(AT_PLANT, REAL, INTEGER, VECTOR, INTEGER, INTEGER, INTEGERS, INTEGERS, VECTOR, VECTOR)
@stage
def stay(plant, t, segment, y, r, j, side, held, acceleration, force):
    """Take the side of break r where the motion stays; returns whether it is another one.

    A motion that is thrown to and fro at a break goes along it, or leaves it hardly at all; but one
    side of a jump may drive it off at once.
    """
    base = base_motion(plant, t, segment)
    best, chosen, before = -np.inf, side[r], side[r]
    for way in (before, -before):
        side[r] = way
        accelerations(plant, base, y, side, held, acceleration, force)
        _, slope = distance(plant, r, j, y, base, acceleration, side)
        if slope > best:
            best, chosen = slope, way
    side[r] = chosen
    return chosen != before


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
