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

import numpy as np

from seatdyn.kernels.address import address_of
from seatdyn.kernels.columns import IS_JUMP, ON_DISPLACEMENT, VALUE
from seatdyn.kernels.events import (
    ROUNDING,
    break_tolerance,
    distance,
    find_event,
    one_sided_forces,
    sides_of,
)
from seatdyn.kernels.holding import HOLDING_TOLERANCE, dip, held_margin, release
from seatdyn.kernels.integrate import (
    CHATTERING,
    DIVERGED,
    FIRST_STEP,
    LARGEST,
    OK,
    REFINEMENTS,
    STEP_LIMIT,
    STEP_TOO_SMALL,
    copy,
    grow,
    save_step,
)
from seatdyn.kernels.jit import inlined, inner, kernel
from seatdyn.kernels.late import accelerate, change_states, fill_node, place_node
from seatdyn.kernels.memory import find_segments
from seatdyn.kernels.past import (
    AT_ONCE,
    guess_states,
    in_row,
    make_nodes,
    make_own,
    states_in_row,
    write_states,
)
from seatdyn.kernels.plant import FREE, base_motion, is_holding, relative, segment_at
from seatdyn.kernels.runge_kutta import A, C, E

SMOOTHEST = 5  # a jump of a higher derivative of the displacements does no harm
JUMP, KINK = 2, 3  # derivative of the displacements that jumps where a law jumps, has a kink
REPEATS = 12  # of a step that is its own past
WORTH_REPEATING = 1.5  # delays: a step that is no longer is cut to the delay instead
AGREED = 0.1  # of the tolerance: error left by them


# Displacements are integrals of velocities, so that accelerations are all that the stages keep:
# z = z0 + h (c v0 + h (A A) a), and the same with the weights of the error.
AA, EA = A @ A[:6], E @ A


# Inlined twice: to hand over fifty arrays costs as much as two stages.
@inlined
def late_step(
    plant, memory, late, record, marks, steps, continued, t, h, segment, y, a, side, held, holding,
    y1, nodes, own, z_tolerance, v_tolerance,
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
        ratio = 0.0
        if continued:
            ratio = h / (t - record[steps - 1, 0])
            in_row(record, steps - 1, 1.0 + ratio, late.seen, n, nodes.y)
        for i in range(n):
            now[1 + i], now[1 + n + i] = nodes.y[i], nodes.y[n + 1 + i]
            record[steps, 1 + 3 * n + i] = 2 * (nodes.y[n + 1 + i] - y[n + i]) / h - a[0, i]
        guess_states(record, steps, h, n, own, ratio)
    for s in range(1, 6):  # the last two stages are at the same instant
        place_node(plant, memory, late, s, t + C[s] * h, segment, nodes)
    first, before, agrees = 1, 1.0, alone
    for _ in range(REPEATS):
        for s in range(first, 7):
            if s < 6:
                fill_node(
                    plant, memory, late, record, marks, steps, s, t + C[s] * h, C[s] < 0.5, nodes,
                    own,
                )  # fmt: skip
            for i in range(n):
                rise = gain = 0.0
                for q in range(s):
                    rise += AA[s, q] * a[q, i]
                    gain += A[s, q] * a[q, i]
                y1[i] = y[i] + h * (C[s] * y[n + i] + h * rise)
                y1[n + i] = y[n + i] + h * gain
            for i in range(own.now.size):
                gain = 0.0
                for q in range(s):
                    gain += A[s, q] * own.rate[q, i]
                own.next[i] = own.now[i] + h * gain
            accelerate(plant, memory, late, min(s, 5), y1, own.next, side, held, holding, nodes)
            change_states(
                plant, memory, min(s, 5), y1, own.next, side, held, nodes, own.rate[s]
            )  # fmt: skip
            for i in range(n):
                a[s, i] = nodes.a[i]
        worst = write_states(record, steps, h, n, own)
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
    return agrees, step_error(h, a, own, z_tolerance, v_tolerance)


@inlined
def step_error(h, a, own, z_tolerance, v_tolerance):
    """Largest estimated error of the step over its tolerance."""
    error = 0.0
    for i in range(a.shape[1]):
        rise, gain = 0.0, E[6] * a[6, i]
        for q in range(6):
            rise += EA[q] * a[q, i]
            gain += E[q] * a[q, i]
        error = max(error, abs(h * h * rise) / z_tolerance, abs(h * gain) / v_tolerance)
    for i in range(own.now.size):
        gain = 0.0
        for q in range(7):
            gain += E[q] * own.rate[q, i]
        error = max(error, abs(h * gain) / own.tolerance[i])
    return error


@inner
def begin(plant, memory, late, record, marks, steps, t, segment, y, side, held, nodes, own):
    """Accelerations `nodes.a` and rates at the start of a step, all one-sided from there on."""
    find_segments(memory, t + ROUNDING * max(abs(t), 1.0), nodes.active)
    place_node(plant, memory, late, 0, t, segment, nodes)
    fill_node(plant, memory, late, record, marks, steps, 0, t, True, nodes, own)
    accelerate(plant, memory, late, 0, y, own.now, side, held, is_holding(held), nodes)
    change_states(plant, memory, 0, y, own.now, side, held, nodes, own.rate[0])


@inner
def try_to_rest(plant, memory, late, y, x, r, j, side, held, stick_speed, nodes):
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
    accelerate(plant, memory, late, 0, y, x, side, held, True, nodes)
    if not below - HOLDING_TOLERANCE <= nodes.force[0, j] <= above + HOLDING_TOLERANCE:
        held[j] = FREE
        return
    excess = (v - plant.breaks[r, VALUE]) if on_velocity else v
    for i in range(n):
        y[n + i] -= plant.pull[i, j] / plant.gain[j, j] * excess


@inner
def stay_late(plant, memory, late, y, x, r, j, side, held, nodes):
    """Take the side of break r where the motion stays, as `stay`; node 0 is at this instant."""
    base = (nodes.base[0, 0], nodes.base[0, 1], nodes.base[0, 2])
    best, chosen, before = -np.inf, side[r], side[r]
    for way in (before, -before):
        side[r] = way
        accelerate(plant, memory, late, 0, y, x, side, held, is_holding(held), nodes)
        _, slope = distance(plant, r, j, y, base, nodes.a, side)
        if slope > best:
            best, chosen = slope, way
    side[r] = chosen
    return chosen != before


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
    memory,
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
    x_scale,
    h_max,
    max_steps,
    stick_speed,
    max_rate,
):
    """Run to t1 from the last row of `record`, whose rows before are the past.

    times, orders : where the past will break the smoothness of the motion, and which derivative
    of the displacements jumps there. `side[0] == 0` asks for the sides to be set from the state.
    x_scale : (q,) sizes of the states; updated in place as they grow

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
    nodes, own = make_nodes(plant, late.delay.size, memory.push.shape[1]), make_own(x_scale.size)
    first_own = plant.gain.shape[0] - memory.nodes.shape[0]  # of the channels
    states_in_row(record, first, 0.0, n, own.now)
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
            begin(plant, memory, late, record, marks, steps, t, segment, y, side, held, nodes, own)

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
            begin(plant, memory, late, record, marks, steps, t, segment, y, side, held, nodes, own)
            copy(nodes.a, a0)
            fresh, continued = False, False
        for i in range(n):
            z_scale, v_scale = max(z_scale, abs(y[i])), max(v_scale, abs(y[n + i]))
        if not (z_scale < LARGEST and v_scale < LARGEST):
            status = DIVERGED
            break
        z_tolerance = rtol * z_scale
        v_tolerance = max(rtol * v_scale, rounding * z_scale)
        for i in range(x_scale.size):
            x_scale[i] = max(x_scale[i], abs(own.now[i]))
            own.tolerance[i] = rtol * x_scale[i]
        h = min(wanted, h_max)
        if shortest < h < WORTH_REPEATING * shortest:
            h = shortest
        h = min(h, stop - t)
        if h < 4e-16 * max(abs(t), 1e-3):
            status = STEP_TOO_SMALL
            break

        agrees, error = late_step(
            plant, memory, late, record, marks, steps, continued, t, h, segment, y, a, side, held,
            holding, y1, nodes, own, z_tolerance, v_tolerance,
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
                if stay_late(
                    plant, memory, late, y, own.now, place, channel, side, held, nodes
                ):  # fmt: skip
                    fresh = True
                    continue
                share = 2.0
            else:
                flips += 1
        let_go = -1
        if holding and share > 0.0:
            margin, let_go = held_margin(plant, t + h, segment, y1, side, held, nodes.force[5])
            early, _ = held_margin(plant, t, segment, y, side, held, nodes.force[1])
            late_on, _ = held_margin(plant, t, segment, y, side, held, nodes.force[3])
            lowest = dip(C[1], early, C[3], late_on, margin)
            if margin >= 0.0 and lowest < min(share, 1.0):
                wanted = lowest * h  # to look at it from there
                continue
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
                    plant, memory, late, record, marks, steps, continued, t, h, segment, y, a, side,
                    held, holding, y1, nodes, own, z_tolerance, v_tolerance,
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
            copy(own.next, own.now)
            copy(own.rate[6], own.rate[0])
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
            # states change at another rate from here on, but they go on
            order = JUMP if plant.breaks[place, IS_JUMP] == 1 and channel < first_own else KINK
            if late.group[channel] != AT_ONCE:
                pending = note(times, orders, pending, t + late.delay[late.group[channel]], order)
                continue  # the motion itself does not break here
            if order == JUMP:
                begin(
                    plant, memory, late, record, marks, steps, t, segment, y, side, held, nodes, own
                )
                try_to_rest(
                    plant, memory, late, y, own.now, place, channel, side, held, stick_speed, nodes
                )
        for g in range(late.delay.size):
            pending = note(times, orders, pending, t + late.delay[g], order + 1)
    save_step(record, marks, steps, t, y, a0, a0, side, held, segment)
    guess_states(record, steps, 0.0, n, own, 0.0)
    return (
        status, events, side, held, record[: steps + 1].copy(), marks[: steps + 1].copy(),
        times[:pending].copy(), orders[:pending].copy(),
    )  # fmt: skip
