"""A run: ladder steps with the linear part exact, else Dormand-Prince steps.

Every break of a law is located, and steps end there, at segments of the input and at the end of
the run. A ladder step may reach beyond: laws go on smoothly over a break, so the step is cut
there. Dormand-Prince steps carry held channels; with `use_ladder` false they do the whole run, the
in-house second opinion. A step is kept as its end states and its one-sided accelerations at both
ends; the solution between them is a quintic (`dense`).
"""

from __future__ import annotations

import math

import numpy as np

from seatdyn.kernels import exponential as ex
from seatdyn.kernels.address import address_of, keep
from seatdyn.kernels.columns import BREAKS, IS_JUMP, ON_DISPLACEMENT, ON_VELOCITY, VALUE
from seatdyn.kernels.dense import (
    FIRST_HALF,
    SINGLE,
    element_forces,
    relative_within,
    sample,
    states_within,
)
from seatdyn.kernels.events import (
    NEAR,
    ROUNDING,
    break_tolerance,
    distance,
    find_event,
    meeting,
    sides_of,
)
from seatdyn.kernels.holding import (
    HOLDING_TOLERANCE,
    dip_between,
    held_margin,
    release,
    stay,
    try_to_hold,
)
from seatdyn.kernels.jit import allocating, inlined, inner, kernel, stage, takes
from seatdyn.kernels.plant import (
    AT_PLANT,
    accelerations,
    base_motion,
    is_holding,
    plant_at,
    relative,
    relative_acceleration,
    segment_at,
)
from seatdyn.kernels.rows import copy_ahead
from seatdyn.kernels.runge_kutta import rk_error, rk_step
from seatdyn.kernels.shapes import INTEGER, INTEGER_TABLE, INTEGERS, REAL, TABLE, VECTOR
from seatdyn.kernels.together import Shares

OK, CHATTERING, DIVERGED, STEP_LIMIT, STEP_TOO_SMALL = range(5)
LARGEST = 1e9  # m or m/s: no seat moves that far
REFINEMENTS = 60
FIRST_STEP = 1e-3  # s, of the Dormand-Prince steps; the error control finds the right one
START_LEVEL = ex.LEVELS - 4
PATIENCE = 3  # ladder steps after a refused one before the step is doubled again
FEW_ITERATIONS = 4  # of the channel forces: a doubled step will converge, too
DOUBLE_INTERPOLATION, DOUBLE_TRUNCATION = 1 / 600, 1 / 300  # errors that allow a doubled step
BOLD = 0.2  # error of a step that nothing before it said to be small enough
HOPELESS = 10.0  # truncation error that a step of half the size would not make good
CORRECTIONS, NEARBY = 5, 1e-2  # of the place where a step is cut, half steps
SHORTEST_AFTER_RELEASE = 1e-6  # s
ROUGHEST = 8.0  # rad a quarter of a step: motions that its polynomials may have
MISSED = 100.0  # tolerances: a break that is still so far away is not met


@inner
def copy(source, target):
    """target[:] = source, without the code for shapes that differ."""
    for i in range(source.size):
        target[i] = source[i]


@inlined
def course_at(plant, j, quarter, work):
    """Displacement, velocity and acceleration across channel j at a quarter of a ladder step."""
    state, base = work.path[quarter], work.base
    n2 = 2 * state.size // 3
    d, v = relative(plant, j, state[:n2], base[0, quarter], base[1, quarter])
    return d, v, relative_acceleration(plant, j, state[n2:], base[2, quarter])


@inner
def first_meeting(plant, j, quarter, p, q, value, near, work):
    """Where in 0..4 quarters channel j first goes below p d + q v = value; 5 if nowhere."""
    start = course_at(plant, j, 0, work)
    for part in range(4):
        end = course_at(plant, j, part + 1, work)
        share = meeting(quarter, start, end, p, q, value, near, work.six)
        if share <= 1.0:
            return part + share
        start = end
    return 5.0


@takes(AT_PLANT, REAL, REAL, REAL, REAL, ex.AT_WORK)
@stage
def first_break(plant, quarter, rtol, z_scale, v_scale, work):
    """Earliest break met in a ladder step, in quarters (4: none), its row and channel.

    One that will be met just behind the end counts: the next step would be next to nothing.
    """
    side, reach, row, channel = work.side, 4.0 + NEARBY, -1, -1
    for j in range(work.held.size):
        for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
            p = side[r] * plant.breaks[r, ON_DISPLACEMENT]
            q = side[r] * plant.breaks[r, ON_VELOCITY]
            value = side[r] * plant.breaks[r, VALUE]
            near = NEAR * break_tolerance(plant, r, z_scale, v_scale)
            margin = near + rtol * (abs(p) * z_scale + abs(q) * v_scale)
            d0, v0, _ = course_at(plant, j, 0, work)
            d1, v1, a1 = course_at(plant, j, 4, work)
            g0, g1, fall = p * d0 + q * v0 - value, p * d1 + q * v1 - value, -(p * v1 + q * a1)
            if min(g0, g1) < -near or not ex.keeps_off(j, g0, p, q, value, margin, work):
                place = first_meeting(plant, j, quarter, p, q, value, near, work)
            elif g1 <= near:
                place = 4.0
            else:
                place = 4.0 + g1 / (quarter * fall) if fall > 0.0 else np.inf
            if place < reach:
                reach, row, channel = place, r, j
    return reach if row >= 0 else 4.0, row, channel


@takes(AT_PLANT, REAL, REAL, INTEGER, INTEGER, REAL, INTEGER, INTEGER, REAL, REAL, ex.AT_WORK)
@stage
def cut(plant, t, quarter, segment, first, reach, row, channel, tolerance, v_tolerance, work):
    """End half of a ladder step, from quarter `first` at t on, after `reach` quarters.

    With `row` >= 0 it ends on that break nearby. What the work says of the half becomes that of the
    shorter one, its accelerations those of the polynomial: what keeps it is still the same. Those
    of the laws at the end go to `spare[2]`. Returns the reach, or 0 if the break is not met there,
    or if the forces or accelerations are not those of the laws: what found it was too rough for so
    long a step. A light node on a stiff link is thrown by a displacement that is next to right.
    """
    path, spare, side, held, force = work.path, work.spare, work.side, work.held, work.trial
    n2 = 2 * path.shape[1] // 3
    end, middle, g = spare[0], spare[1], 0.0
    base = base_motion(plant, t + reach * quarter, segment)
    for correction in range(CORRECTIONS if row >= 0 else 0):
        d, v, a = relative_within(plant, channel, base, quarter, reach - 1.0, path, first)
        p, q = plant.breaks[row, ON_DISPLACEMENT], plant.breaks[row, ON_VELOCITY]
        # the polynomial that found the break was less accurate
        g = p * d + q * v - plant.breaks[row, VALUE]
        better = reach - g / ((p * v + q * a) * quarter)
        settled = abs(g) <= tolerance or correction == CORRECTIONS - 1
        if settled or not abs(better - reach) < NEARBY or not 0.0 < better <= 2.0 + NEARBY:
            break
        reach = better
        base = base_motion(plant, t + reach * quarter, segment)
    states_within(quarter, reach - 1.0, 0.5 * reach - 1.0, path, first, end, middle)
    accelerations(plant, base, end[:n2], side, held, spare[2, : n2 // 2], force)
    for i in range(n2 // 2):
        thrown = abs(spare[2, i] - end[n2 + i]) / max(work.rate[i], ROUGHEST / quarter)
        if not thrown <= v_tolerance:
            return 0.0
    if abs(g) > MISSED * tolerance or not ex.keeps_forces(0.25 * (first + reach), work):
        return 0.0
    copy(end, path[first + 2])
    copy(middle, path[first + 1])
    copy(force, work.force)
    return reach


@takes(
    AT_PLANT, REAL, REAL, REAL, INTEGER, VECTOR, TABLE, INTEGERS, INTEGERS, VECTOR, VECTOR, INTEGER,
    INTEGER, REAL,
)  # fmt: skip
@stage
def land(plant, t, trial, high, segment, y, k, side, held, y1, force, row, channel, tolerance):
    """Take a step of about `trial` s, at most `high`, that ends on break `row`.

    With `row` < 0 it ends where a holding force leaves its jump. Returns the size of the step.
    """
    n = y.size // 2
    low, h, g, slope = 0.0, trial, np.inf, 0.0
    for _ in range(REFINEMENTS):
        h = trial
        rk_step(plant, t, h, segment, y, k, side, held, y1, force)
        if row < 0:
            g, _ = held_margin(plant, t + h, segment, y1, side, held, force)
        else:
            base = base_motion(plant, t + h, segment)
            g, slope = distance(plant, row, channel, y1, base, k[6, n:], side)
        if abs(g) <= tolerance or high - low <= 4e-16 * max(abs(t), 1e-3):
            break
        if g > 0.0:
            low = h
        else:
            high = h
        trial = h - g / slope if slope != 0.0 else low
        if not low < trial < high:
            trial = 0.5 * (low + high)
    return h


@takes(AT_PLANT, REAL, INTEGER, VECTOR, INTEGER, INTEGER, INTEGERS, INTEGERS, REAL, VECTOR)
@stage
def pass_break(plant, t, segment, y, row, channel, side, held, stick_speed, force):
    """Go over to the other side of a break, or rest on it."""
    side[row] = -side[row]
    if plant.breaks[row, IS_JUMP] == 1:
        try_to_hold(plant, t, segment, y, row, channel, side, held, stick_speed, force)


@allocating
def grow(old, new):
    """Copy the rows of a record into a longer one."""
    for i in range(old.shape[0]):
        for j in range(old.shape[1]):
            new[i, j] = old[i, j]
    return new


@takes(TABLE, INTEGER_TABLE, INTEGER, REAL, VECTOR, VECTOR, VECTOR, INTEGERS, INTEGERS, INTEGER)
@stage
def save_step(record, marks, i, t, y, a0, a1, side, held, part):
    """Write step i: time, state and acceleration at its start, acceleration at its end, marks."""
    n = a0.size
    record[i, 0] = t
    for q in range(2 * n):
        record[i, 1 + q] = y[q]
    for q in range(n):
        record[i, 1 + 2 * n + q] = a0[q]
        record[i, 1 + 3 * n + q] = a1[q]
    for q in range(side.size):
        marks[i, q] = side[q]
    for q in range(held.size):
        marks[i, side.size + q] = held[q]
    marks[i, side.size + held.size] = part


@takes(TABLE, INTEGER_TABLE, INTEGER, REAL, REAL, INTEGER, REAL, ex.AT_WORK)
@stage
def save_quarters(record, marks, i, t, quarter, last, share, work):
    """Write the quarters of a ladder step from row i on, and return how many they are.

    Those of the half that begins with number `last`, the last one, have `share` in all. What is
    copied too much is written over by the rows that follow; some are always left.
    """
    path, n3, columns, width = work.path, work.path.shape[1], record.shape[1], marks.shape[1]
    n = n3 // 3
    for part in range(last + 2):
        late, begin = max(part - last, 0), (i + part) * columns
        record[i + part, 0] = t + (part - late + 0.5 * share * late) * quarter
        copy_ahead(path, part * n3, record, begin + 1, n3)
        copy_ahead(path, (part + 1) * n3 + 2 * n, record, begin + 1 + n3, n)
        copy_ahead(work.mark, 0, marks, (i + part) * width, width - 1)
        marks[i + part, width - 1] = FIRST_HALF + part % 2
    return last + 2


@kernel
def integrate(
    plant,
    ladder,
    use_ladder,
    t0,
    t1,
    y0,
    side,
    held,
    rtol,
    z_floor,
    v_floor,
    h_max,
    max_steps,
    stick_speed,
    max_rate,
):
    """Run from t0 to t1; plant and ladder are `placed`.

    `side[0] == 0` asks for the sides to be set from the state.

    Returns status, number of events, final side and held, and the record of the steps: a row each
    with time (1), state (2N) and acceleration (N) at its start and acceleration (N) at its end,
    and a last row with the final time and state; and marks, a row each with sides (b) and held
    breaks (m).
    """
    plant, ladder = plant_at(plant), ex.ladder_at(ladder)
    n, m, breaks = plant.linear.shape[0], plant.gain.shape[0], side.size
    capacity = 64 + int(min(2.5 * (t1 - t0) / h_max, 4096.0))  # as a run of few events needs
    record = np.empty((capacity, 1 + 4 * n))
    marks = np.empty((capacity, breaks + m + 1), np.int64)

    arrays = ex.make_work(ladder, y0, side, held)
    work = address_of(arrays)
    start = arrays.path[0]
    y, a0 = start[: 2 * n], start[2 * n :]
    side, held, force0 = arrays.side, arrays.held, arrays.force
    y_end, force, scratch = np.empty(2 * n), np.zeros(m), np.empty(6)
    k = np.empty((7, 2 * n))
    a_rk = k[6, n:]
    t = t0
    segment = segment_at(plant, t)
    if breaks and side[0] == 0:
        # once by value and velocity, once more with the accelerations of these sides
        side[:] = 1
        for _ in range(2):
            base = base_motion(plant, t, segment)
            sides_of(plant, y, base, a0, side)
            accelerations(plant, base, y, side, held, a0, force0)

    segments, sizes = plant.segments, ladder.step
    steps, events, status, flips = np.int64(0), 0, OK, 0
    window, in_window = t, 0
    z_scale, v_scale = z_floor, v_floor
    # a displacement of 1 m moves velocities by its rounding times the fastest rate
    fastest = 0.0
    for i in range(n):
        for q in range(2 * n):
            fastest = max(fastest, abs(plant.linear[i, q]))
        arrays.rate[i] = max(math.sqrt(abs(plant.linear[i, i])), abs(plant.linear[i, n + i]))
    rounding = 1e-15 * math.sqrt(fastest)
    h_rk, last_error = min(h_max, FIRST_STEP), 1.0
    level, patience, expected = START_LEVEL, 0, START_LEVEL
    level_before = np.int64(-1)  # of the ladder step before, if its forces can be extrapolated
    origin = np.int64(-1)  # break and side that this step begins on, if it does
    hopeless = False  # the refused step before would be refused at half its size, too
    rk_until = -np.inf  # Dormand-Prince steps up to here
    fresh = True  # accelerations at the start have to be computed
    released = False  # a channel has just been let go: it begins to move with no acceleration
    while t < t1:
        if segment + 1 < segments.shape[0] and t >= segments[segment + 1, 0]:
            segment += 1
            fresh, level_before = True, -1
        stop = t1
        if segment + 1 < segments.shape[0]:
            stop = min(t1, segments[segment + 1, 0])
        instant = ROUNDING * max(abs(t), 1.0)
        if stop - t <= instant:
            t = stop
            continue
        if steps >= max_steps:
            status = STEP_LIMIT
            break
        if fresh:
            accelerations(plant, base_motion(plant, t, segment), y, side, held, a0, force0)
            fresh = False
        for i in range(n):
            z_scale, v_scale = max(z_scale, abs(y[i])), max(v_scale, abs(y[n + i]))
        if not (z_scale < LARGEST and v_scale < LARGEST):
            status = DIVERGED
            break
        z_tolerance = rtol * z_scale
        v_tolerance = max(rtol * v_scale, rounding * z_scale)
        holding = is_holding(held)
        if steps + 8 >= record.shape[0]:
            longer = 2 * record.shape[0]
            record = grow(record, np.empty((longer, record.shape[1])))
            marks = grow(marks, np.empty((longer, marks.shape[1]), np.int64))

        row, channel, let_go = -1, -1, -1  # the break that ends this step
        at_once = False  # it is met at the very start
        if use_ladder and not holding and t >= rk_until:
            fit = level
            while fit > 0 and sizes[fit - 1] >= stop - t - instant:
                fit -= 1
            quarter = 0.25 * sizes[fit]
            iterations, truncation, gap = ex.ladder_step(
                plant, ladder, fit, level_before, origin, t, segment, z_tolerance, v_tolerance,
                work,
            )  # fmt: skip
            if not max(truncation, gap) <= (BOLD if origin >= 0 and fit > expected else 1.0):
                ex.be_patient(origin, work)
                hopeless = iterations == 0 or truncation > HOPELESS
                level, patience, level_before = fit - 1, PATIENCE, -1
                if level < 0:
                    level, rk_until = 0, t + sizes[0]
                continue
            reach = 4.0  # quarters
            if breaks:
                reach, row, channel = first_break(plant, quarter, rtol, z_scale, v_scale, work)
                if row >= 0 and reach * quarter <= instant:
                    if released and fit > 0:
                        level, level_before = fit - 1, -1  # the step is too long to see it go
                        continue
                    at_once = flips <= 2 * breaks
                    if not at_once:
                        if stay(
                            plant, t, segment, y, row, channel, side, held, arrays.spare[0, :n],
                            force,
                        ):  # fmt: skip
                            fresh, level_before = True, -1
                            continue
                        reach, row = 4.0, -1
            if stop - t < reach * quarter - instant:
                reach, row = (stop - t) / quarter, -1
            if not at_once:
                # the half that the step ends in, and the quarters that it takes of that; the first
                # half goes on a little rather than that the second be next to nothing
                last = 2 if reach > 2.0 + NEARBY else 0
                share = reach - last
                whole = last + share == 4.0
                if not whole:
                    near = break_tolerance(plant, row, z_scale, v_scale) if row >= 0 else 0.0
                    share = cut(
                        plant, t + last * quarter, quarter, segment, last, share, row, channel,
                        near, v_tolerance, work,
                    )  # fmt: skip
                    if share == 0.0 and reach > 4.0:  # the step itself is right
                        share, row, whole = 2.0, -1, True
                    if share == 0.0:
                        ex.be_patient(origin, work)
                        level, patience, level_before = fit - 1, PATIENCE, -1
                        if level < 0:
                            level, rk_until = 0, t + sizes[0]
                        continue
                h = (last + share) * quarter
                if whole:
                    ex.keep_forces(work)
                level_before = np.int64(fit if whole else -1)
                steps += save_quarters(record, marks, steps, t, quarter, last, share, work)
                copy(arrays.path[last + 2], start)
                if not whole:
                    copy(arrays.spare[2, :n], a0)
                t = stop if stop - (t + h) <= instant else t + h
                patience -= 1
                easy = gap < DOUBLE_INTERPOLATION and truncation < DOUBLE_TRUNCATION
                easy = easy and iterations <= FEW_ITERATIONS and patience <= 0
                if hopeless and level > 0:
                    level -= 1  # what stopped the longer step lies in its second half
                elif easy and fit == level and level + 1 < ex.LEVELS:
                    level += 1
                hopeless = False
                if origin >= 0:
                    ex.remember(fit, origin, work)
                    origin = np.int64(-1)
        else:
            level_before, origin = np.int64(-1), np.int64(-1)
            wanted = min(h_rk, h_max)
            h = min(wanted, stop - t)
            if rk_until > t:
                h = min(h, rk_until - t)
            if h < 4e-16 * max(abs(t), 1e-3):
                status = STEP_TOO_SMALL
                break
            for i in range(n):
                k[0, i] = y[n + i]
                k[0, n + i] = a0[i]
            rk_step(plant, t, h, segment, y, k, side, held, y_end, force)
            error = rk_error(k, h, n, z_tolerance, v_tolerance)
            if not error <= 1.0:
                h_rk = h * max(0.2, 0.9 * error**-0.2) if error < np.inf else 0.1 * h
                continue
            factor = 0.9 * max(error, 1e-10) ** -0.14 * last_error**0.04
            last_error = max(error, 1e-4)
            h_rk = max(h * min(5.0, max(0.3, factor)), wanted if h < wanted else 0.0)
            share, row, channel = find_event(
                plant, h, base_motion(plant, t, segment), base_motion(plant, t + h, segment), y,
                y_end, a0, a_rk, side, held, z_scale, v_scale, scratch,
            )  # fmt: skip
            if share == 0.0:
                if released and h > SHORTEST_AFTER_RELEASE:
                    h_rk = 0.5 * h
                    continue
                at_once = flips <= 2 * breaks
                if not at_once:
                    if stay(
                        plant, t, segment, y, row, channel, side, held, arrays.spare[0, :n], force
                    ):
                        fresh = True
                        continue
                    row = -1
            if holding and not at_once:
                margin, channel_off = held_margin(plant, t + h, segment, y_end, side, held, force)
                place = 2.0
                if margin >= 0.0:
                    place = dip_between(
                        plant, t, h, segment, y, a0, y_end, a_rk, margin, side, held, force0,
                        arrays.spare[0], arrays.weight,
                    )  # fmt: skip
                if place < min(share, 1.0):
                    h_rk = place * h  # to look at it from there
                    continue
                if margin < 0.0:
                    row, let_go, share = -1, channel_off, 0.5
            if not at_once:
                if row >= 0 or let_go >= 0:
                    tolerance = HOLDING_TOLERANCE
                    if row >= 0:
                        tolerance = break_tolerance(plant, row, z_scale, v_scale)
                    h = land(
                        plant, t, share * h, h, segment, y, k, side, held, y_end, force,
                        row, channel, tolerance,
                    )  # fmt: skip
                if t + h > t:
                    save_step(record, marks, steps, t, y, a0, a_rk, side, held, SINGLE)
                    steps += 1
                t = stop if stop - (t + h) <= instant else t + h
                copy(y_end, y)
                copy(a_rk, a0)
                copy(force, force0)

        released = let_go >= 0
        if row < 0 and let_go < 0:
            flips = 0
            continue
        events += 1
        # at a kink forces go on as they were
        fresh = at_once or row < 0 or plant.breaks[row, IS_JUMP] == 1
        level_before = np.int64(-1)
        if at_once:
            flips += 1
        else:
            flips, rk_until, patience = 0, -np.inf, 0  # what refused a step lies behind
            in_window += 1
            if t - window > 1.0:
                window, in_window = t, 1
            if in_window > max_rate:
                status = CHATTERING
                break
        if let_go >= 0:
            release(plant, t, segment, y, let_go, side, held, force)
        else:
            pass_break(plant, t, segment, y, row, channel, side, held, stick_speed, force)
            origin = np.int64(2 * row + (1 if side[row] > 0 else 0))
            expected, level = level, ex.bold_level(origin, level, work)
    save_step(record, marks, steps, t, y, a0, a0, side, held, SINGLE)
    keep(arrays)
    return status, events, side, held, record[: steps + 1], marks[: steps + 1]


SHARES = Shares(
    here=(accelerations, base_motion, rk_step, held_margin, stay, release, pass_break, land),
    there=(
        find_event,
        first_break,
        ex.ladder_step,
        ex.keep_forces,
        ex.remember,
        save_step,
        save_quarters,
        rk_error,
        sides_of,
        ex.make_work,
        cut,
    ),
    later=(sample, element_forces),
)
