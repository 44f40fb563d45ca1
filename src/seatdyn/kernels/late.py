"""The forces of a delayed system at an instant, and its solution between the steps."""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.address import address_of
from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import ADDRESS, ELEMENTS, FIRST, OFFSET, SECOND
from seatdyn.kernels.holding import held_element_forces
from seatdyn.kernels.integrate import copy
from seatdyn.kernels.jit import inlined, kernel
from seatdyn.kernels.memory import (
    FORCE,
    PARAMETERS,
    RATE,
    STATES,
    call_memory_force,
    call_memory_rate,
    find_segments,
    outside_force,
    stands,
)
from seatdyn.kernels.past import (
    AT_ONCE,
    base_now,
    in_row,
    look_back,
    make_nodes,
    make_own,
    states_in_row,
)
from seatdyn.kernels.plant import (
    hold,
    is_holding,
    relative,
)
from seatdyn.kernels.sides import channel_force, on_side, sum_of_laws


@inlined
def memory_force(memory, e, d, v, x):
    """Force of element e with states."""
    return call_memory_force(
        memory.laws[e, FORCE], d, v, x, memory.laws[e, STATES], memory.parameters,
        memory.laws[e, PARAMETERS],
    )  # fmt: skip


@inlined
def place_node(plant, memory, late, s, t, segment, nodes):
    """Set what drives node s at t: base motion and outside forces."""
    n = nodes.a.size
    x0, v0, a0 = base_now(plant, late, t, segment, nodes.sines[s])
    nodes.base[s, 0], nodes.base[s, 1], nodes.base[s, 2] = x0, v0, a0
    for i in range(n):
        nodes.prompt[s, i] = plant.linear[i, 2 * n] * x0 + plant.linear[i, 2 * n + 1] * v0
    for f in range(nodes.active.size):
        force = outside_force(memory, t, f, nodes.active[f])
        for i in range(n):
            nodes.prompt[s, i] += memory.push[i, f] * force


@inlined
def fill_node(plant, memory, late, record, marks, last, s, t, forwards, nodes, own):
    """Add the delayed forces at the placed node s, time t; `last` row of the record."""
    n, m = nodes.a.size, nodes.force.shape[1]
    first = m - memory.nodes.shape[0]
    for i in range(n):
        nodes.drive[i] = nodes.prompt[s, i]
    for g in range(late.delay.size):
        row = look_back(
            plant, late, record, marks, nodes.row[g], last, s, g, t - late.delay[g], forwards,
            late.seen, nodes, own,
        )  # fmt: skip
        for r in range(late.begin[g], late.begin[g + 1]):
            nodes.drive[late.where[r, 0]] += late.gain[r] * nodes.y[late.where[r, 1]]
        for r in range(nodes.side.size):
            nodes.side[r] = marks[row, r]
        for j in range(m):
            if late.group[j] == g:
                d, v = relative(plant, j, nodes.y, nodes.y[n], nodes.y[2 * n + 1])
                force = 0.0
                if j >= first:
                    force = memory_force(memory, j - first, d, v, own.then)
                elif row < late.still:  # at rest it is on no side of a jump with the velocity
                    force = sum_of_laws(plant, j, d, v)
                else:
                    force = channel_force(plant, j, d, v, nodes.side)
                nodes.force[s, j] = force
                for i in range(n):
                    nodes.drive[i] -= plant.pull[i, j] * force


@inlined
def accelerate(plant, memory, late, s, y, x, side, held, holding, nodes):
    """Accelerations `nodes.a` and channel forces `nodes.force[s]` at motion y, states x, node s.

    The node is the one that was filled last.
    """
    n, m = nodes.a.size, nodes.force.shape[1]
    first = m - memory.nodes.shape[0]
    for i in range(n):
        total, damped = nodes.drive[i], 0.0  # two sums at a time take half as long as one
        for k in range(n):
            total += plant.linear[i, k] * y[k]
            damped += plant.linear[i, n + k] * y[n + k]
        nodes.a[i] = total + damped
    for j in range(m):
        if late.group[j] != AT_ONCE or held[j] >= 0:
            continue
        d, v = relative(plant, j, y, nodes.base[s, 0], nodes.base[s, 1])
        force = 0.0
        if j >= first:
            force = memory_force(memory, j - first, d, v, x)
        else:
            force = channel_force(plant, j, d, v, side)
        nodes.force[s, j] = force
        for i in range(n):
            nodes.a[i] -= plant.pull[i, j] * force
    if holding:
        hold(plant, held, nodes.base[s, 2], nodes.a, nodes.force[s])


@inlined
def change_states(plant, memory, s, y, x, side, held, nodes, rate):
    """Rates (q,) of the states x at motion y and node s, whose accelerations are `nodes.a`.

    They are those of the side of its breaks that the run is on.
    """
    n, first = nodes.a.size, held.size - memory.nodes.shape[0]
    for e in range(memory.nodes.shape[0]):
        j = first + e
        d, v = relative(plant, j, y, nodes.base[s, 0], nodes.base[s, 1])
        if stands(plant, held, plant.channels[j, FIRST], plant.channels[j, SECOND]):
            v = 0.0  # control laws switch with its sign
        else:
            d, v = on_side(plant, j, d, v, side)
        second = plant.channels[j, SECOND]
        w = y[n + second] if second >= 0 else nodes.base[s, 1]
        a = nodes.a[second] if second >= 0 else nodes.base[s, 2]
        call_memory_rate(
            memory.laws[e, RATE], d, v, w, a, x, memory.laws[e, STATES], memory.parameters,
            memory.laws[e, PARAMETERS], rate,
        )  # fmt: skip


@kernel
def sample_late(plant, memory, late, record, marks, index, share):
    """Solution at `share` (0..1) of the rows `index`, and what the delayed forces saw then.

    Returns an array for the present and each delay, (1+G, ...): times (p,), base motion (3, p),
    displacements and velocities (p, N), forces of the elements as commanded then (p, e), those with
    states last, the forces of the others at zero velocity (p, e), states (p, q); and of the present
    the accelerations (p, N) and the outside forces (p, l).
    """
    plant = address_of(plant)
    n, m, count = plant.linear.shape[0], plant.gain.shape[0], index.size
    views, breaks, elements = 1 + late.delay.size, plant.breaks.shape[0], plant.elements.shape[0]
    with_states = memory.nodes.shape[0]
    states = (record.shape[1] - 1 - 4 * n) // 5
    times, bases = np.empty((views, count)), np.empty((views, 3, count))
    z, v = np.empty((views, count, n)), np.empty((views, count, n))
    forces = np.zeros((views, count, elements + with_states))
    elastic, x = np.zeros_like(forces), np.empty((views, count, states))
    a, outside = np.empty((count, n)), np.empty((count, memory.push.shape[1]))
    nodes, own = make_nodes(plant, late.delay.size, memory.push.shape[1]), make_own(states)
    everything, last = np.arange(n), record.shape[0] - 2
    y, motion = np.empty(2 * n), nodes.y
    for p in range(count):
        i = index[p]
        h = record[i + 1, 0] - record[i, 0]
        t, forwards = record[i, 0] + share[p] * h, share[p] < 0.5
        for g in range(late.delay.size):
            found = np.searchsorted(record[:, 0], t - late.delay[g] - 2 * h)
            nodes.row[g] = max(found - 2, 0)
        segment = marks[i, breaks + m]
        side, held = marks[i, :breaks], marks[i, breaks : breaks + m]
        find_segments(memory, record[i, 0] + 0.5 * h, nodes.active)
        place_node(plant, memory, late, 0, t, segment, nodes)
        fill_node(plant, memory, late, record, marks, last, 0, t, forwards, nodes, own)
        in_row(record, i, share[p], everything, n, motion)
        for q in range(n):
            y[q], y[n + q] = motion[q], motion[n + 1 + q]
        states_in_row(record, i, share[p], n, own.now)
        accelerate(plant, memory, late, 0, y, own.now, side, held, is_holding(held), nodes)
        for q in range(n):
            a[p, q] = nodes.a[q]
        for f in range(nodes.active.size):
            outside[p, f] = outside_force(memory, t, f, nodes.active[f])
        for w in range(views):
            row, a0 = i, 0.0
            times[w, p] = t
            if w == 0:
                motion[n], motion[2 * n + 1] = nodes.base[0, 0], nodes.base[0, 1]
                a0 = nodes.base[0, 2]
                copy(own.now, own.then)
            else:
                times[w, p] = t - late.delay[w - 1]
                row = look_back(
                    plant, late, record, marks, nodes.row[w - 1], last, 0, w - 1, times[w, p],
                    forwards, everything, nodes, own,
                )  # fmt: skip
            bases[w, 0, p], bases[w, 1, p], bases[w, 2, p] = motion[n], motion[2 * n + 1], a0
            for q in range(n):
                z[w, p, q], v[w, p, q] = motion[q], motion[n + 1 + q]
            for q in range(states):
                x[w, p, q] = own.then[q]
            for j in range(m):
                d, speed = relative(plant, j, motion, motion[n], motion[2 * n + 1])
                if j >= m - with_states:
                    e = j - m + with_states
                    forces[w, p, elements + e] = memory_force(memory, e, d, speed, own.then)
                    continue
                if row >= late.still:
                    d, speed = on_side(plant, j, d, speed, marks[row, :breaks])
                begin, end = plant.channels[j, ELEMENTS], plant.channels[j + 1, ELEMENTS]
                for e in range(begin, end):
                    address, offset = plant.elements[e, ADDRESS], plant.elements[e, OFFSET]
                    forces[w, p, e] = call_law(address, d, speed, plant.parameters, offset)
                    elastic[w, p, e] = call_law(address, d, 0.0, plant.parameters, offset)
                if w == 0 and held[j] >= 0:
                    base = (nodes.base[0, 0], nodes.base[0, 1], nodes.base[0, 2])
                    held_element_forces(
                        plant, j, y, base, side, held[j], nodes.force[0, j], forces[w, p]
                    )
                    for e in range(begin, end):
                        elastic[w, p, e] = forces[w, p, e]
    return times, bases, z, v, forces, elastic, x, a, outside
