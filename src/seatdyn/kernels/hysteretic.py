"""A run of a system whose elements have states of their own, or on which outside forces act.

Dormand-Prince 5(4) steps carry the motion and the states together. Steps end where a law breaks,
at segments of the input and of the forces, and at the end of the run; where a force jumps the state
may rest on the jump. The solution inside a step is one shorter step from its start, so that nothing
but the states at the ends is kept.
"""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.address import address_of
from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import (
    ADDRESS,
    BREAKS,
    ELEMENTS,
    IS_JUMP,
    OFFSET,
    ON_DISPLACEMENT,
)
from seatdyn.kernels.events import leave, one_sided_forces
from seatdyn.kernels.holding import HOLDING_TOLERANCE, dip, held_element_forces
from seatdyn.kernels.jit import allocating, inner, kernel
from seatdyn.kernels.memory import (
    FORCE,
    HELD,
    PARAMETERS,
    STATES,
    Space,
    across,
    call_memory_force,
    find_segments,
    outside_force,
    rates,
)
from seatdyn.kernels.plant import (
    FREE,
    base_motion,
    relative,
    segment_at,
)
from seatdyn.kernels.runge_kutta import A, C, E
from seatdyn.kernels.sides import on_side

OK, CHATTERING, DIVERGED, STEP_LIMIT, STEP_TOO_SMALL = range(5)  # as in `integrate`
LARGEST = 1e9  # m, m/s: no seat moves that far
FIRST_STEP = 1e-4  # s
SHORTEST = 4e-16  # of the time: rounding
ON_BREAK = 1e-12  # of the motion: being on a break
PROBES = 12  # points of a step at which a crossing is looked for
REFINEMENTS = 60
FIRST, SECOND, ON_D, ON_V, VALUE = range(5)  # columns of `edges`


@inner
def step(plant, memory, t, h, segment, y, side, space, y1):
    """One step from y to y1; the first row of space.k is set, the others are filled."""
    k = space.k
    for s in range(1, 7):
        for i in range(y.size):
            total = 0.0
            for q in range(s):
                total += A[s, q] * k[q, i]
            y1[i] = y[i] + h * total
        rates(plant, memory, t + C[s] * h, segment, y1, side, space, k[s])


@inner
def error_of(h, k, tolerance):
    """Largest estimated error over its tolerance."""
    worst = 0.0
    for i in range(k.shape[1]):
        total = 0.0
        for s in range(7):
            total += E[s] * k[s, i]
        ratio = abs(h * total) / tolerance[i]
        if not ratio <= worst:  # a nan counts as the worst
            worst = ratio
    return worst


@inner
def distance(plant, memory, r, t, segment, y, rate, n, side):
    """Distance to break r, positive on our side, and its rate."""
    edges = memory.edges
    base = base_motion(plant, t, segment)
    first, second = int(edges[r, FIRST]), int(edges[r, SECOND])
    d, v, _ = across(first, second, y, n, base)
    a = rate[n + second] if second >= 0 else base[2]
    a -= rate[n + first] if first >= 0 else base[2]
    p, q, s = edges[r, ON_D], edges[r, ON_V], side[r]
    return s * (p * d + q * v - edges[r, VALUE]), s * (p * v + q * a)


@inner
def first_zero(h, g0, s0, g1, s1, tolerance):
    """Share of the step at which the cubic through the ends first falls below zero, or 2.

    0 where it leaves at once; the cubic is looked at in a few points.
    """
    m0, m1, rise = h * s0, h * s1, g1 - g0
    if g0 <= tolerance and s0 <= 0.0:
        return 0.0 if g1 < -tolerance else 2.0
    before = 0.0
    inside = g0 > tolerance
    for i in range(1, PROBES + 1):
        s = i / PROBES
        g = g0 + s * (m0 + s * (3 * rise - 2 * m0 - m1 + s * (m0 + m1 - 2 * rise)))
        if g < -tolerance and inside:
            for _ in range(REFINEMENTS):
                middle = 0.5 * (before + s)
                x = middle
                g = g0 + x * (m0 + x * (3 * rise - 2 * m0 - m1 + x * (m0 + m1 - 2 * rise)))
                if g > 0.0:
                    before = middle
                else:
                    s = middle
            return s
        if g > tolerance:
            inside, before = True, s
    return 2.0 if g1 >= -tolerance else 0.5 / PROBES


@inner
def first_break(plant, memory, t, h, segment, y, y1, k, n, side, tolerance):
    """Break that is met first in a step and the share of the step, 2 for none."""
    best, row = 2.0, -1
    for r in range(side.size):
        if side[r] == HELD:
            continue
        g0, s0 = distance(plant, memory, r, t, segment, y, k[0], n, side)
        g1, s1 = distance(plant, memory, r, t + h, segment, y1, k[6], n, side)
        if g1 >= 0.0 and not s0 < 0.0 < s1:
            continue
        share = first_zero(h, g0, s0, g1, s1, tolerance[r])
        if share < best:
            best, row = share, r
    return best, row


@inner
def land(plant, memory, t, h, segment, y, side, space, y1, row, share, tolerance):
    """Take the shorter step that ends on break `row`; returns its size.

    Near enough is refined once more: what is left feeds a state that bounces about a jump.
    """
    n = space.acceleration.size
    low, high = 0.0, h
    trial, near = share * h, False
    for _ in range(REFINEMENTS):
        step(plant, memory, t, trial, segment, y, side, space, y1)
        g, slope = distance(plant, memory, row, t + trial, segment, y1, space.k[6], n, side)
        if near or g == 0.0 or high - low <= SHORTEST * max(abs(t), 1e-3):
            break
        near = abs(g) <= tolerance
        if g > 0.0:
            low = trial
        else:
            high = trial
        following = trial - g / slope if slope != 0.0 else low
        if not low < following < high:
            following = 0.5 * (low + high)
        trial = following
    return trial


@inner
def margin_of(plant, t, segment, space, side, j):
    """How far the force that holds channel j is inside its jump, N, and the side it points to."""
    base = base_motion(plant, t, segment)
    below, above = one_sided_forces(plant, space.held[j], j, space.motion, base, side)
    force = space.force[j]
    return min(force - below, above - force), 1 if force - below > above - force else -1


@inner
def loosest(plant, t, segment, space, side):
    """The held jump that is next to let go, its margin and the side it goes to; -1 for none."""
    row, worst, way = -1, np.inf, 1
    for j in range(space.held.size):
        if space.held[j] >= 0:
            inside, there = margin_of(plant, t, segment, space, side, j)
            if inside < worst:
                row, worst, way = space.held[j], inside, there
    return row, worst, way


@inner
def dip_in(plant, memory, t, h, segment, y, y1, end, side, space):
    """Share of a step of held channels where they may have let go and come back; 2 if nowhere."""
    k, state = space.k, space.k[2]
    for i in range(y.size):  # the cubic through both ends
        state[i] = 0.5 * (y[i] + y1[i]) + 0.125 * h * (k[0, i] - k[6, i])
    rates(plant, memory, t + 0.5 * h, segment, state, side, space, k[3])
    _, there, _ = loosest(plant, t + 0.5 * h, segment, space, side)
    rates(plant, memory, t, segment, y, side, space, k[3])
    _, margin, _ = loosest(plant, t, segment, space, side)
    return dip(0.0, margin, 0.5, there, end)


@inner
def channel_of(plant, row):
    """The channel that a break belongs to."""
    channel = 0
    while plant.channels[channel + 1, BREAKS] <= row:
        channel += 1
    return channel


@inner
def rest_or_pass(plant, memory, t, segment, y, side, space, row, slow):
    """Rest on the break just met, if it is a jump that can balance the forces; else go over it."""
    before = side[row]
    side[row] = -before
    if row >= plant.breaks.shape[0] or plant.breaks[row, IS_JUMP] == 0:
        return
    n = space.acceleration.size
    base = base_motion(plant, t, segment)
    channel = channel_of(plant, row)
    for i in range(2 * n):
        space.motion[i] = y[i]
    _, v = relative(plant, channel, space.motion, base[0], base[1])
    on_velocity = plant.breaks[row, ON_DISPLACEMENT] == 0.0
    if not on_velocity and abs(v) > slow:
        return
    below, above = one_sided_forces(plant, row, channel, space.motion, base, side)
    if above <= below:
        return
    side[row] = HELD
    rates(plant, memory, t, segment, y, side, space, space.k[0])
    inside, _ = margin_of(plant, t, segment, space, side, channel)
    if inside < -HOLDING_TOLERANCE:
        side[row] = -before
        return
    for i in range(n):
        y[n + i] -= plant.pull[i, channel] / plant.gain[channel, channel] * v


@inner
def land_on_release(plant, memory, t, h, segment, y, side, space, y1):
    """Take the shorter step after which a holding force leaves its jump; returns its size."""
    low, high, trial = 0.0, h, 0.5 * h
    for _ in range(REFINEMENTS):
        trial = 0.5 * (low + high)
        step(plant, memory, t, trial, segment, y, side, space, y1)
        _, inside, _ = loosest(plant, t + trial, segment, space, side)
        if abs(inside) <= HOLDING_TOLERANCE or high - low <= SHORTEST * max(abs(t), 1e-3):
            break
        if inside > 0.0:
            low = trial
        else:
            high = trial
    return trial


@inner
def sides_of(plant, memory, t, segment, y, side, space):
    """Sides of the state: by value; on a jump at rest if that balances; else by rate."""
    n, k = space.acceleration.size, space.k
    for r in range(side.size):
        if side[r] == 0:
            side[r] = 1
            g, _ = distance(plant, memory, r, t, segment, y, k[6], n, side)
            side[r] = 1 if g > 0.0 or (g == 0.0 and memory.edges[r, VALUE] < 0.0) else -1
            if g == 0.0:
                rest_or_pass(plant, memory, t, segment, y, side, space, r, 0.0)
                if side[r] != HELD:
                    rates(plant, memory, t, segment, y, side, space, k[0])
                    _, slope = distance(plant, memory, r, t, segment, y, k[0], n, side)
                    side[r] = side[r] if slope >= 0.0 else -side[r]


@kernel
def integrate(
    plant, memory, t0, t1, y0, start_side, stops, rtol, scale, h_max, max_steps, slow, max_rate
):
    """Integrate from t0 to t1.

    scale : (2N+q,) sizes that errors are relative to; updated in place as the motion grows
    stops : times that no step may reach over
    slow : speed in m/s below which a jump with the displacement may hold

    Returns status, events, sides at the end, a row of [t, state] and of sides per step, last the
    end.
    """
    plant = address_of(plant)
    size, n = y0.size, plant.linear.shape[0]
    space = Space(
        np.empty(2 * n), np.empty(n), np.zeros(plant.gain.shape[0]), np.empty((7, size)),
        np.zeros(memory.push.shape[1], dtype=np.int64),
        np.full(plant.gain.shape[0], FREE, dtype=np.int64),
    )  # fmt: skip
    k, y, y1, side = space.k, y0.copy(), np.empty(size), start_side.copy()
    tolerance, on_break = np.empty(size), np.empty(side.size)
    record, marks = np.empty((256, size + 1)), np.empty((256, side.size), dtype=np.int64)
    t, h, steps, events, flips, status = t0, FIRST_STEP, 0, 0, 0, OK
    window, in_window = t0, 0
    next_stop, fresh = 0, True
    segment = segment_at(plant, t)
    last_error = 1.0
    while t < t1:
        if steps >= max_steps:
            status = STEP_LIMIT
            break
        while next_stop < stops.size and stops[next_stop] <= t:
            next_stop += 1
            fresh = True
        stop = min(t1, stops[next_stop]) if next_stop < stops.size else t1
        if fresh:
            segment = segment_at(plant, t)
            find_segments(memory, t, space.active)
            for i in range(size):
                k[6, i] = 0.0
            sides_of(plant, memory, t, segment, y, side, space)
            rates(plant, memory, t, segment, y, side, space, k[0])
            fresh = False
        for i in range(size):
            scale[i] = max(scale[i], abs(y[i]))
        largest = 0.0
        for i in range(2 * n):
            largest = max(largest, abs(y[i]))
        if not largest < LARGEST:
            status = DIVERGED
            break
        for i in range(size):  # one size for all displacements, one for all velocities
            own = scale[i]
            if i < 2 * n:
                begin = 0 if i < n else n
                for j in range(begin, begin + n):
                    own = max(own, scale[j])
            tolerance[i] = rtol * own
        for r in range(side.size):
            p, q = memory.edges[r, ON_D], memory.edges[r, ON_V]
            motion = abs(p) * tolerance[0] + abs(q) * tolerance[n]
            on_break[r] = ON_BREAK * (motion / rtol + abs(memory.edges[r, VALUE]))

        wanted = min(h, h_max)
        h = min(wanted, stop - t)
        if h < SHORTEST * max(abs(t), 1e-3):
            status = STEP_TOO_SMALL
            break
        step(plant, memory, t, h, segment, y, side, space, y1)
        error = error_of(h, k, tolerance)
        if not error <= 1.0:
            h *= max(0.2, 0.9 * error**-0.2) if error < np.inf else 0.1
            continue
        share, row = first_break(
            plant, memory, t, h, segment, y, y1, k, n, side, on_break
        )  # fmt: skip
        if share == 0.0:
            flips += 1
            if flips > 2 * side.size + 2:
                status = CHATTERING
                break
            rest_or_pass(plant, memory, t, segment, y, side, space, row, slow)
            rates(plant, memory, t, segment, y, side, space, k[0])
            continue
        taken = h
        if row >= 0:
            taken = land(
                plant, memory, t, h, segment, y, side, space, y1, row, share, on_break[row]
            )  # fmt: skip
        let_go, inside, way = loosest(plant, t + taken, segment, space, side)
        if let_go >= 0 and inside >= 0.0:
            place = dip_in(plant, memory, t, taken, segment, y, y1, inside, side, space)
            if place < 1.0:
                h = place * taken  # to look at it from there
                continue
        if let_go >= 0 and inside < 0.0:
            taken = land_on_release(plant, memory, t, taken, segment, y, side, space, y1)
            let_go, inside, way = loosest(plant, t + taken, segment, space, side)
            row = -1
        else:
            let_go = -1
        factor = 0.9 * max(error, 1e-10) ** -0.14 * last_error**0.04
        last_error = max(error, 1e-4)
        h = max(h * min(5.0, max(0.3, factor)), wanted if h < wanted else 0.0)
        if t + taken > t:
            if steps + 1 >= record.shape[0]:
                record = grown(record, np.empty((2 * record.shape[0], size + 1)))
                marks = grown(marks, np.empty((2 * marks.shape[0], side.size), dtype=np.int64))
            save(record, marks, steps, t, y, side)
            steps += 1
            if row < 0:
                flips = 0
        t = stop if stop - (t + taken) <= 1e-13 * max(abs(t), 1.0) else t + taken
        for i in range(size):
            y[i] = y1[i]
            k[0, i] = k[6, i]
        if row >= 0 or let_go >= 0:
            if row >= 0:
                rest_or_pass(plant, memory, t, segment, y, side, space, row, slow)
            else:
                leave(plant, let_go, channel_of(plant, let_go), way, side)
            events += 1
            in_window += 1
            if t - window > 1.0:
                window, in_window = t, 1
            if in_window > max_rate:
                status = CHATTERING
                break
            rates(plant, memory, t, segment, y, side, space, k[0])
    save(record, marks, steps, t, y, side)
    return status, events, side, record[: steps + 1].copy(), marks[: steps + 1].copy()


@allocating
def grown(old, new):
    """Copy the rows of a record into a longer one."""
    for i in range(old.shape[0]):
        for j in range(old.shape[1]):
            new[i, j] = old[i, j]
    return new


@inner
def save(record, marks, i, t, y, side):
    """Write row i."""
    record[i, 0] = t
    for q in range(y.size):
        record[i, 1 + q] = y[q]
    for q in range(side.size):
        marks[i, q] = side[q]


@kernel
def sample(plant, memory, record, marks, index, share):
    """Solution at `share` (0..1) of the steps `index`, each on the branch that it was on.

    Returns times (p,), base motion (3, p), displacements, velocities, accelerations (p, N), forces
    of the plant's elements and of those with states (p, e), the forces of the former at zero
    velocity and zeros for the latter (p, e), states (p, q), outside forces (p, l).
    """
    plant = address_of(plant)
    count, size, n = index.size, record.shape[1] - 1, plant.linear.shape[0]
    elements, own = plant.elements.shape[0], memory.nodes.shape[0]
    space = Space(
        np.empty(2 * n), np.empty(n), np.zeros(plant.gain.shape[0]), np.empty((7, size)),
        np.zeros(memory.push.shape[1], dtype=np.int64),
        np.full(plant.gain.shape[0], FREE, dtype=np.int64),
    )  # fmt: skip
    times, bases = np.empty(count), np.empty((3, count))
    z, v, a = np.empty((count, n)), np.empty((count, n)), np.empty((count, n))
    forces, elastic = np.zeros((count, elements + own)), np.zeros((count, elements + own))
    states, outside = np.empty((count, size - 2 * n)), np.empty((count, memory.push.shape[1]))
    y, y1 = np.empty(size), np.empty(size)
    side = np.empty(marks.shape[1], dtype=np.int64)
    for p in range(count):
        i = index[p]
        t, h = record[i, 0], share[p] * (record[i + 1, 0] - record[i, 0])
        for q in range(size):
            y[q] = record[i, 1 + q]
        for r in range(side.size):
            side[r] = marks[i, r]
        segment = segment_at(plant, t + 0.5 * (record[i + 1, 0] - t))
        find_segments(memory, t + 0.5 * (record[i + 1, 0] - t), space.active)
        if share[p] == 0.0:
            for q in range(size):
                y1[q] = y[q]
        elif share[p] == 1.0:
            for q in range(size):
                y1[q] = record[i + 1, 1 + q]
        else:
            rates(plant, memory, t, segment, y, side, space, space.k[0])
            step(plant, memory, t, h, segment, y, side, space, y1)
        rates(plant, memory, t + h, segment, y1, side, space, space.k[0])
        times[p] = t + h
        base = base_motion(plant, t + h, segment)
        bases[0, p], bases[1, p], bases[2, p] = base
        for q in range(n):
            z[p, q], v[p, q], a[p, q] = y1[q], y1[n + q], space.k[0, n + q]
        for q in range(size - 2 * n):
            states[p, q] = y1[2 * n + q]
        for j in range(plant.gain.shape[0]):
            if space.held[j] >= 0:
                held_element_forces(
                    plant, j, space.motion, base, side, space.held[j], space.force[j], forces[p]
                )
                for e in range(plant.channels[j, ELEMENTS], plant.channels[j + 1, ELEMENTS]):
                    elastic[p, e] = forces[p, e]
                continue
            d, speed = relative(plant, j, space.motion, base[0], base[1])
            d, speed = on_side(plant, j, d, speed, side)
            for e in range(plant.channels[j, ELEMENTS], plant.channels[j + 1, ELEMENTS]):
                address, offset = plant.elements[e, ADDRESS], plant.elements[e, OFFSET]
                forces[p, e] = call_law(address, d, speed, plant.parameters, offset)
                elastic[p, e] = call_law(address, d, 0.0, plant.parameters, offset)
        for e in range(own):
            d, speed, _ = across(memory.nodes[e, 0], memory.nodes[e, 1], y1, n, base)
            forces[p, elements + e] = call_memory_force(
                memory.laws[e, FORCE], d, speed, y1, 2 * n + memory.laws[e, STATES],
                memory.parameters, memory.laws[e, PARAMETERS],
            )  # fmt: skip
        for f in range(memory.push.shape[1]):
            outside[p, f] = outside_force(memory, t + h, f, space.active[f])
    return times, bases, z, v, a, forces, elastic, states, outside
