"""A run with forces that act late: Dormand-Prince steps over a dense record of the past.

A delayed force at t needs the state at t - tau. Each step is kept with its states and
accelerations at both ends; the quintic between them is one order better than the step, so that the
order of the method is kept wherever t - tau falls. What breaks the smoothness of the motion at T (a
law that jumps, a corner of the base motion, the start) breaks it again at T + tau, one order
weaker: steps end there too, until it no longer matters (Bellen and Zennaro, Numerical Methods for
Delay Differential Equations, 2003, chapters 2 and 4). Where tau is shorter than a step, the step
itself is the past that it needs: it is repeated until it agrees with itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from seatdyn.kernels.address import address_of
from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import ADDRESS, ELEMENTS, IS_JUMP, OFFSET, ON_DISPLACEMENT, VALUE
from seatdyn.kernels.events import (
    ROUNDING,
    break_tolerance,
    distance,
    find_event,
    one_sided_forces,
    sides_of,
)
from seatdyn.kernels.holding import held_element_forces, held_margin, release
from seatdyn.kernels.integrate import (
    CHATTERING,
    DIVERGED,
    FIRST_STEP,
    HOLDING_TOLERANCE,
    LARGEST,
    OK,
    REFINEMENTS,
    STEP_LIMIT,
    STEP_TOO_SMALL,
    copy,
    grow,
    save_step,
)
from seatdyn.kernels.jit import allocating, inlined, inner, kernel
from seatdyn.kernels.plant import (
    FREE,
    base_motion,
    channel_force,
    hold,
    is_holding,
    on_side,
    relative,
    segment_at,
    segment_motion,
    sum_of_laws,
)
from seatdyn.kernels.runge_kutta import A, C, E

AT_ONCE = -1  # group of a channel without delay
SMOOTHEST = 5  # a jump of a higher derivative of the displacements does no harm
JUMP, KINK = 2, 3  # derivative of the displacements that jumps where a law jumps, has a kink
REPEATS = 12  # of a step that is its own past
WORTH_REPEATING = 1.5  # delays: a step that is no longer is cut to the delay instead
AGREED = 0.1  # of the tolerance: error left by them


# Displacements are integrals of velocities, so that accelerations are all that the stages keep:
# z = z0 + h (c v0 + h (A A) a), and the same with the weights of the error.
AA, EA = A @ A[:6], E @ A


class Late(NamedTuple):
    """What acts late: G delays, their linear forces, and which channels have which."""

    delay: np.ndarray  # (G,) s
    begin: np.ndarray  # (G+1,) int: where the linear forces of each delay begin in the next two
    where: np.ndarray  # (k, 2) int: node that a force accelerates, place in `Nodes.y`
    gain: np.ndarray  # (k,) acceleration per unit of what stands there
    seen: np.ndarray  # int: nodes whose past matters
    turn: np.ndarray  # (G, s, 2) cosine and sine of what each lasting sine turns by in a delay
    group: np.ndarray  # (m,) int: index of the channel's delay, or AT_ONCE
    still: int  # rows of the record in which the base stands still (before the start)
    place: float  # its displacement there, m


class Nodes(NamedTuple):
    """What drives the masses at the instants of a step's stages: the base, and the past."""

    base: np.ndarray  # (7, 3) displacement, velocity, acceleration
    sines: np.ndarray  # (s, 2) lasting sines of the base and their cosines, at the last instant
    drive: np.ndarray  # (7, N) accelerations by the base and all delayed forces
    force: np.ndarray  # (7, m) of the channels; those that act at once are set by the stage
    y: np.ndarray  # (2N+2,) a motion of the past, the base as the last node
    side: np.ndarray  # (b,) int, and the branches it was on
    a: np.ndarray  # (N,)
    row: np.ndarray  # (G,) row of the record that the start of a step looks back into


@allocating
def make_nodes(plant, delays):
    """Scratch for a run."""
    n, m = plant.linear.shape[0], plant.gain.shape[0]
    return Nodes(
        np.empty((7, 3)), np.empty((plant.sines.shape[0], 2)), np.empty((7, n)), np.zeros((7, m)),
        np.empty(2 * n + 2), np.ones(plant.breaks.shape[0], np.int64), np.zeros(n),
        np.zeros(delays, np.int64),
    )  # fmt: skip


@inlined
def base_now(plant, t, segment, sines):
    """Base displacement, velocity and acceleration, and the lasting sines among them."""
    x, v, a = segment_motion(plant, t, segment)
    for i in range(sines.shape[0]):
        omega, angle = plant.sines[i, 1], plant.sines[i, 1] * t + plant.sines[i, 2]
        sine, cosine = plant.sines[i, 0] * math.sin(angle), plant.sines[i, 0] * math.cos(angle)
        sines[i, 0], sines[i, 1] = sine, cosine
        x += sine
        v += omega * cosine
        a -= omega * omega * sine
    return x, v, a


@inlined
def base_then(plant, turn, t, segment, sines):
    """Base displacement and velocity at the past time t, its lasting sines turned back from now."""
    x, v, _ = segment_motion(plant, t, segment)
    for i in range(sines.shape[0]):
        x += sines[i, 0] * turn[i, 0] - sines[i, 1] * turn[i, 1]
        v += plant.sines[i, 1] * (sines[i, 1] * turn[i, 0] + sines[i, 0] * turn[i, 1])
    return x, v


@inlined
def in_row(record, row, share, nodes, n, y):
    """Motion of the `nodes` at a share of a row of the record, by its quintic."""
    start, end = record[row], record[row + 1]
    h = end[0] - start[0]
    turns = 1.0 / h
    for i in range(nodes.size):
        q = nodes[i]
        rise, m0, m1 = end[1 + q] - start[1 + q], h * start[1 + n + q], h * end[1 + n + q]
        k0, k1 = h * h * start[1 + 2 * n + q], h * h * start[1 + 3 * n + q]
        p3 = 10 * rise - 6 * m0 - 4 * m1 - 1.5 * k0 + 0.5 * k1
        p4 = -15 * rise + 8 * m0 + 7 * m1 + 1.5 * k0 - k1
        p5 = 6 * rise - 3 * m0 - 3 * m1 - 0.5 * k0 + 0.5 * k1
        s = share
        y[q] = start[1 + q] + s * (m0 + s * (0.5 * k0 + s * (p3 + s * (p4 + s * p5))))
        y[n + 1 + q] = turns * (m0 + s * (k0 + s * (3 * p3 + s * (4 * p4 + s * (5 * p5)))))


@inlined
def look_back(plant, late, record, marks, row, last, g, t, forwards, seen, nodes):
    """Motion `nodes.y` of the nodes `seen` one delay g before now, at t; returns its row.

    The row is looked for from `row` to `last`. At the edge of two rows the later one is taken if
    `forwards`, else the earlier. The lasting sines of the base are known for now.
    """
    n = nodes.a.size
    slack = ROUNDING * max(abs(t), 1.0)
    edge = t + slack if forwards else t - slack
    while row < last and record[row + 1, 0] <= edge:
        row += 1
    begin = record[row, 0]
    in_row(record, row, (t - begin) / (record[row + 1, 0] - begin), seen, n, nodes.y)
    if row < late.still:
        nodes.y[n], nodes.y[2 * n + 1] = late.place, 0.0
    else:
        segment = marks[row, marks.shape[1] - 1]
        x0, v0 = base_then(plant, late.turn[g], t, segment, nodes.sines)
        nodes.y[n], nodes.y[2 * n + 1] = x0, v0
    return row


@inlined
def fill_node(plant, late, record, marks, last, s, t, forwards, segment, nodes):
    """Set node s: base motion and delayed forces at t, with `last` the last row of the record."""
    n, m = nodes.a.size, nodes.force.shape[1]
    x0, v0, a0 = base_now(plant, t, segment, nodes.sines)
    nodes.base[s, 0], nodes.base[s, 1], nodes.base[s, 2] = x0, v0, a0
    for i in range(n):
        nodes.drive[s, i] = plant.linear[i, 2 * n] * x0 + plant.linear[i, 2 * n + 1] * v0
    for g in range(late.delay.size):
        row = look_back(
            plant, late, record, marks, nodes.row[g], last, g, t - late.delay[g], forwards,
            late.seen, nodes,
        )  # fmt: skip
        for r in range(late.begin[g], late.begin[g + 1]):
            nodes.drive[s, late.where[r, 0]] += late.gain[r] * nodes.y[late.where[r, 1]]
        for r in range(nodes.side.size):
            nodes.side[r] = marks[row, r]
        for j in range(m):
            if late.group[j] == g:
                d, v = relative(plant, j, nodes.y, nodes.y[n], nodes.y[2 * n + 1])
                force = 0.0
                if row < late.still:  # at rest it is on no side of a jump with the velocity
                    force = sum_of_laws(plant, j, d, v)
                else:
                    force = channel_force(plant, j, d, v, nodes.side)
                nodes.force[s, j] = force
                for i in range(n):
                    nodes.drive[s, i] -= plant.pull[i, j] * force


@inlined
def accelerate(plant, late, s, y, side, held, holding, nodes):
    """Accelerations `nodes.a` and channel forces `nodes.force[s]` at state y and node s."""
    n, m = nodes.a.size, nodes.force.shape[1]
    for i in range(n):
        total = nodes.drive[s, i]
        for k in range(2 * n):
            total += plant.linear[i, k] * y[k]
        nodes.a[i] = total
    for j in range(m):
        if late.group[j] != AT_ONCE or held[j] >= 0:
            continue
        d, v = relative(plant, j, y, nodes.base[s, 0], nodes.base[s, 1])
        force = channel_force(plant, j, d, v, side)
        nodes.force[s, j] = force
        for i in range(n):
            nodes.a[i] -= plant.pull[i, j] * force
    if holding:
        hold(plant, held, nodes.base[s, 2], nodes.a, nodes.force[s])


@inner
def late_step(
    plant, late, record, marks, steps, continued, t, h, segment, y, a, side, held, holding, y1,
    nodes, z_tolerance, v_tolerance,
):  # fmt: skip
    """One Dormand-Prince step; fills the accelerations a (7, N) after the first, and y1.

    Returns whether the step agrees with itself, and its error over the tolerance. Where a delay is
    shorter than the step, the step is part of the past that it needs: begun as a parabola, or as
    the `continued` step before, it is repeated.
    """
    n = y.size // 2
    now = record[steps + 1]  # the end of this row of the record
    shortest = late.delay.min()
    alone = shortest >= h
    save_step(record, marks, steps, t, y, a[0], a[0], side, held, segment)
    now[0] = t + h
    if not alone:
        for i in range(n):
            nodes.y[i] = y[i] + h * (y[n + i] + 0.5 * h * a[0, i])
            nodes.y[n + 1 + i] = y[n + i] + h * a[0, i]
        if continued:
            before = t - record[steps - 1, 0]
            in_row(record, steps - 1, 1.0 + h / before, late.seen, n, nodes.y)
        for i in range(n):
            now[1 + i], now[1 + n + i] = nodes.y[i], nodes.y[n + 1 + i]
            record[steps, 1 + 3 * n + i] = 2 * (nodes.y[n + 1 + i] - y[n + i]) / h - a[0, i]
    first, before, agrees = 1, 1.0, alone
    for _ in range(REPEATS):
        for s in range(first, 7):
            if s < 6:  # the last two stages are at the same instant
                fill_node(
                    plant, late, record, marks, steps, s, t + C[s] * h, C[s] < 0.5, segment, nodes
                )
            for i in range(n):
                rise = gain = 0.0
                for q in range(s):
                    rise += AA[s, q] * a[q, i]
                    gain += A[s, q] * a[q, i]
                y1[i] = y[i] + h * (C[s] * y[n + i] + h * rise)
                y1[n + i] = y[n + i] + h * gain
            accelerate(plant, late, min(s, 5), y1, side, held, holding, nodes)
            for i in range(n):
                a[s, i] = nodes.a[i]
        worst = 0.0
        for r in range(late.seen.size):
            i = late.seen[r]
            change = max(
                abs(y1[n + i] - now[1 + n + i]), h * abs(a[6, i] - record[steps, 1 + 3 * n + i])
            )
            worst = max(worst, abs(y1[i] - now[1 + i]) / z_tolerance, change / v_tolerance)
        for i in range(n):
            now[1 + i], now[1 + n + i] = y1[i], y1[n + i]
            record[steps, 1 + 3 * n + i] = a[6, i]
        # what is left, from how fast the repeats converge
        shrinks = min(worst / before, 0.9)
        agrees = alone or worst * shrinks <= AGREED * (1.0 - shrinks)
        if agrees or not worst < np.inf:
            break
        before = worst
        while C[first] * h <= shortest:
            first += 1
    error = 0.0
    for i in range(n):
        rise, gain = 0.0, E[6] * a[6, i]
        for q in range(6):
            rise += EA[q] * a[q, i]
            gain += E[q] * a[q, i]
        error = max(error, abs(h * h * rise) / z_tolerance, abs(h * gain) / v_tolerance)
    return agrees, error


@inner
def begin(plant, late, record, marks, steps, t, segment, y, side, held, nodes):
    """Accelerations `nodes.a` at the start of a step, all one-sided from there on."""
    fill_node(plant, late, record, marks, steps, 0, t, True, segment, nodes)
    accelerate(plant, late, 0, y, side, held, is_holding(held), nodes)


@inner
def try_to_rest(plant, late, y, r, j, side, held, stick_speed, nodes):
    """Hold channel j at jump r if it is slow and the balancing force lies inside the jump.

    Node 0 is at this instant.
    """
    n = y.size // 2
    base = (nodes.base[0, 0], nodes.base[0, 1], nodes.base[0, 2])
    _, v = relative(plant, j, y, base[0], base[1])
    on_velocity = plant.breaks[r, ON_DISPLACEMENT] == 0.0
    if not on_velocity and abs(v) > stick_speed:
        return
    below, above = one_sided_forces(plant, r, j, y, base, side)
    if above <= below:
        return
    held[j] = r
    accelerate(plant, late, 0, y, side, held, True, nodes)
    if not below <= nodes.force[0, j] <= above:
        held[j] = FREE
        return
    excess = (v - plant.breaks[r, VALUE]) if on_velocity else v
    for i in range(n):
        y[n + i] -= plant.pull[i, j] / plant.gain[j, j] * excess


@inner
def note(times, orders, count, t, order):
    """Insert a future break in order of time, if it is rough enough; returns their number.

    What is already there at that time keeps the rougher order.
    """
    if order > SMOOTHEST:
        return count
    near = 4 * ROUNDING * max(abs(t), 1.0)
    place = count
    while place > 0 and times[place - 1] > t + near:
        place -= 1
    if place > 0 and times[place - 1] >= t - near:
        orders[place - 1] = min(orders[place - 1], order)
        return count
    for i in range(count, place, -1):
        times[i], orders[i] = times[i - 1], orders[i - 1]
    times[place], orders[place] = t, order
    return count + 1


@kernel
def integrate_late(
    plant,
    late,
    t1,
    record,
    marks,
    side,
    held,
    times,
    orders,
    rtol,
    z_floor,
    v_floor,
    h_max,
    max_steps,
    stick_speed,
    max_rate,
):
    """Run to t1 from the last row of `record`, whose rows before are the past.

    times, orders : where the past will break the smoothness of the motion, and which derivative
    of the displacements jumps there. `side[0] == 0` asks for the sides to be set from the state.

    Returns status, number of events, final side and held, record and marks of past and run (as
    `integrate`), and the breaks to come.
    """
    plant = address_of(plant)
    n = plant.linear.shape[0]
    first = record.shape[0] - 1
    record = grow(record, np.empty((2 * record.shape[0] + 256, record.shape[1])))
    marks = grow(marks, np.zeros((record.shape[0], marks.shape[1]), np.int64))
    y = record[first, 1 : 2 * n + 1].copy()
    y1, a = np.empty(2 * n), np.zeros((7, n))
    a0, a1 = a[0], a[6]
    nodes = make_nodes(plant, late.delay.size)
    rows, scratch = nodes.row, np.empty(6)
    side, held = side.copy(), held.copy()
    pending = times.size
    capacity = 2 * pending + 64
    times = np.append(times, np.empty(capacity))
    orders = np.append(orders, np.zeros(capacity, np.int64))
    t = record[first, 0]
    segment = segment_at(plant, t)
    steps = first
    if side.size and side[0] == 0:
        side[:] = 1
        for _ in range(2):
            sides_of(plant, y, base_motion(plant, t, segment), nodes.a, side)
            begin(plant, late, record, marks, steps, t, segment, y, side, held, nodes)

    events, status, flips = 0, OK, 0
    window, in_window = t, 0
    z_scale, v_scale = z_floor, v_floor
    shortest = late.delay.min()
    rounding = 1e-15 * np.sqrt(np.abs(plant.linear[:, : 2 * n]).max())
    wanted, last_error = min(h_max, FIRST_STEP), 1.0
    fresh = True  # accelerations at the start have to be computed
    continued = False  # the step before goes on smoothly
    while t < t1:
        slack = ROUNDING * max(abs(t), 1.0)
        if segment + 1 < plant.segments.shape[0] and t >= plant.segments[segment + 1, 0]:
            segment += 1
            fresh = True
        if pending > 0 and times[0] <= t + slack:
            # the past breaks here; what follows is one order smoother, one delay later
            here, order = times[0], orders[0]
            pending -= 1
            for i in range(pending):
                times[i], orders[i] = times[i + 1], orders[i + 1]
            for g in range(late.delay.size):
                pending = note(times, orders, pending, here + late.delay[g], order + 1)
            fresh = True
            continue
        stop = t1
        if segment + 1 < plant.segments.shape[0]:
            stop = min(stop, plant.segments[segment + 1, 0])
        if pending > 0:
            stop = min(stop, times[0])
        if stop - t <= slack:
            t = stop
            continue
        if steps - first >= max_steps:
            status = STEP_LIMIT
            break
        if steps + 3 >= record.shape[0]:
            longer = 2 * record.shape[0]
            record = grow(record, np.empty((longer, record.shape[1])))
            marks = grow(marks, np.zeros((longer, marks.shape[1]), np.int64))
        if pending + 8 * (late.delay.size + 1) >= times.size:
            times = np.append(times, np.empty(times.size))
            orders = np.append(orders, np.zeros(orders.size, np.int64))
        for g in range(late.delay.size):
            # never past the row that the start of the step looks into
            past = t - late.delay[g]
            while rows[g] < steps and record[rows[g] + 1, 0] <= past - slack:
                rows[g] += 1
        holding = is_holding(held)
        if fresh:
            begin(plant, late, record, marks, steps, t, segment, y, side, held, nodes)
            copy(nodes.a, a0)
            fresh, continued = False, False
        for i in range(n):
            z_scale, v_scale = max(z_scale, abs(y[i])), max(v_scale, abs(y[n + i]))
        if not (z_scale < LARGEST and v_scale < LARGEST):
            status = DIVERGED
            break
        z_tolerance = rtol * z_scale
        v_tolerance = max(rtol * v_scale, rounding * z_scale)
        h = min(wanted, h_max)
        if shortest < h < WORTH_REPEATING * shortest:
            h = shortest
        h = min(h, stop - t)
        if h < 4e-16 * max(abs(t), 1e-3):
            status = STEP_TOO_SMALL
            break

        agrees, error = late_step(
            plant, late, record, marks, steps, continued, t, h, segment, y, a, side, held, holding,
            y1, nodes, z_tolerance, v_tolerance,
        )  # fmt: skip
        if not agrees or not error <= 1.0:
            wanted = h * max(0.2, 0.9 * error**-0.2) if 1.0 < error < np.inf else 0.3 * h
            continue
        factor = 0.9 * max(error, 1e-10) ** -0.14 * last_error**0.04
        last_error = max(error, 1e-4)
        wanted = max(h * min(5.0, max(0.3, factor)), wanted if h < wanted else 0.0)

        share, place, channel = find_event(
            plant, h, (nodes.base[0, 0], nodes.base[0, 1], nodes.base[0, 2]),
            (nodes.base[5, 0], nodes.base[5, 1], nodes.base[5, 2]), y, y1, a0, a1, side, held,
            z_scale, v_scale, scratch,
        )  # fmt: skip
        if share == 0.0:
            if flips > 2 * side.size:
                share = 2.0  # going along a break: either branch gives the same motion
            else:
                flips += 1
        let_go = -1
        if holding and share > 0.0:
            margin, let_go = held_margin(plant, t + h, segment, y1, side, held, nodes.force[5])
            if margin < 0.0:
                place, share = -1, 0.5
            else:
                let_go = -1
        if 0.0 < share <= 1.0:
            low, high, trial = 0.0, h, share * h
            tolerance = HOLDING_TOLERANCE
            if place >= 0:
                tolerance = break_tolerance(plant, place, z_scale, v_scale)
            for _ in range(REFINEMENTS):
                h = trial
                late_step(
                    plant, late, record, marks, steps, continued, t, h, segment, y, a, side, held,
                    holding, y1, nodes, z_tolerance, v_tolerance,
                )  # fmt: skip
                slope = 0.0
                if place < 0:
                    gap, _ = held_margin(plant, t + h, segment, y1, side, held, nodes.force[5])
                else:
                    base = (nodes.base[5, 0], nodes.base[5, 1], nodes.base[5, 2])
                    gap, slope = distance(plant, place, channel, y1, base, a1, side)
                if abs(gap) <= tolerance or high - low <= 4e-16 * max(abs(t), 1e-3):
                    break
                if gap > 0.0:
                    low = h
                else:
                    high = h
                trial = h - gap / slope if slope != 0.0 else low
                if not low < trial < high:
                    trial = 0.5 * (low + high)
        if share > 0.0 and t + h > t:
            save_step(record, marks, steps, t, y, a0, a1, side, held, segment)
            steps += 1
            t = stop if stop - (t + h) <= slack else t + h
            copy(y1, y)
            copy(a1, a0)
            for i in range(3):
                nodes.base[0, i] = nodes.base[5, i]
            continued = True
        if share > 1.0:
            flips = 0
            continue
        fresh = True
        events += 1
        if share > 0.0:
            flips = 0
            in_window += 1
            if t - window > 1.0:
                window, in_window = t, 1
            if in_window > max_rate:
                status = CHATTERING
                break
        order = JUMP
        if let_go >= 0:
            release(plant, t, segment, y, let_go, side, held, nodes.force[5])
        else:
            side[place] = -side[place]
            order = JUMP if plant.breaks[place, IS_JUMP] == 1 else KINK
            if late.group[channel] != AT_ONCE:
                pending = note(times, orders, pending, t + late.delay[late.group[channel]], order)
                continue  # the motion itself does not break here
            if order == JUMP:
                begin(plant, late, record, marks, steps, t, segment, y, side, held, nodes)
                try_to_rest(plant, late, y, place, channel, side, held, stick_speed, nodes)
        for g in range(late.delay.size):
            pending = note(times, orders, pending, t + late.delay[g], order + 1)
    save_step(record, marks, steps, t, y, a0, a0, side, held, segment)
    return (
        status, events, side, held, record[: steps + 1].copy(), marks[: steps + 1].copy(),
        times[:pending].copy(), orders[:pending].copy(),
    )  # fmt: skip


@kernel
def sample_late(plant, late, record, marks, index, share):
    """Solution at `share` (0..1) of the rows `index`, and what the delayed forces saw then.

    Returns an array for the present and each delay, (1+G, ...): times (p,), base motion (3, p),
    displacements and velocities (p, N), forces of the elements as commanded then (p, e), and these
    at zero velocity (p, e); and the accelerations (p, N) of the present.
    """
    plant = address_of(plant)
    n, m, count = plant.linear.shape[0], plant.gain.shape[0], index.size
    views, breaks, elements = 1 + late.delay.size, plant.breaks.shape[0], plant.elements.shape[0]
    times, bases = np.empty((views, count)), np.empty((views, 3, count))
    z, v = np.empty((views, count, n)), np.empty((views, count, n))
    forces, elastic = np.empty((views, count, elements)), np.empty((views, count, elements))
    a, everything = np.empty((count, n)), np.arange(n)
    nodes, last = make_nodes(plant, late.delay.size), record.shape[0] - 2
    y, x = np.empty(2 * n), nodes.y
    for p in range(count):
        i = index[p]
        h = record[i + 1, 0] - record[i, 0]
        t, forwards = record[i, 0] + share[p] * h, share[p] < 0.5
        for g in range(late.delay.size):
            found = np.searchsorted(record[:, 0], t - late.delay[g] - 2 * h)
            nodes.row[g] = max(found - 2, 0)
        segment = marks[i, breaks + m]
        side, held = marks[i, :breaks], marks[i, breaks : breaks + m]
        fill_node(plant, late, record, marks, last, 0, t, forwards, segment, nodes)
        in_row(record, i, share[p], everything, n, x)
        for q in range(n):
            y[q], y[n + q] = x[q], x[n + 1 + q]
        accelerate(plant, late, 0, y, side, held, is_holding(held), nodes)
        for q in range(n):
            a[p, q] = nodes.a[q]
        for w in range(views):
            row, a0 = i, 0.0
            times[w, p] = t
            if w == 0:
                x[n], x[2 * n + 1], a0 = nodes.base[0, 0], nodes.base[0, 1], nodes.base[0, 2]
            else:
                times[w, p] = t - late.delay[w - 1]
                row = look_back(
                    plant, late, record, marks, nodes.row[w - 1], last, w - 1, times[w, p],
                    forwards, everything, nodes,
                )  # fmt: skip
            bases[w, 0, p], bases[w, 1, p], bases[w, 2, p] = x[n], x[2 * n + 1], a0
            for q in range(n):
                z[w, p, q], v[w, p, q] = x[q], x[n + 1 + q]
            for j in range(m):
                d, speed = relative(plant, j, x, x[n], x[2 * n + 1])
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
    return times, bases, z, v, forces, elastic, a
