"""A run: ladder steps with the linear part exact where they fit, else Dormand-Prince steps.

Every break of a law is located, and steps end there, at segments of the input and at the end of
the run. Dormand-Prince steps land on breaks and carry held channels; with `use_ladder` false they
do the whole run, the in-house second opinion. A step is kept as its end states and its one-sided
accelerations at both ends; the solution between them is a quintic (`dense`).
"""

from __future__ import annotations

import math

import numpy as np

from seatdyn.kernels import exponential as ex
from seatdyn.kernels.columns import IS_JUMP
from seatdyn.kernels.events import (
    ROUNDING,
    break_tolerance,
    distance,
    far_from_breaks,
    find_event,
    sides_of,
)
from seatdyn.kernels.holding import held_margin, release, try_to_hold
from seatdyn.kernels.jit import allocating, inlined, inner, kernel
from seatdyn.kernels.plant import accelerations, base_motion, segment_at
from seatdyn.kernels.runge_kutta import rk_error, rk_step

OK, CHATTERING, DIVERGED, STEP_LIMIT, STEP_TOO_SMALL = range(5)
LARGEST = 1e9  # m or m/s: no seat moves that far
REFINEMENTS = 60
HOLDING_TOLERANCE = 1e-10  # N: a holding force this near to the end of its jump lets go
FIRST_STEP = 1e-3  # s, of the Dormand-Prince steps; the error control finds the right one
LANDING_SHARE = 0.02  # of the tolerance: a landing is no less accurate than ladder steps are
LANDING = 5e-3  # s, the same for the steps that land on a break
START_LEVEL = ex.LEVELS - 4
PATIENCE = 3  # ladder steps after a refused one before the step is doubled again
FEW_ITERATIONS = 4  # of the channel forces: a doubled step will converge, too
DOUBLE_INTERPOLATION, DOUBLE_TRUNCATION = 1 / 100, 1 / 300  # errors that allow a doubled step
APPROACH = 0.95  # share of the way to a break that a ladder step may take
OVERSHOOT = 1.1  # a landing step reaches a little beyond the break that it is to find


@inner
def land(
    plant, t, trial, high, segment, y, k, side, held, holding, y1, force, row, channel, tolerance
):
    """Take a step of about `trial` s, at most `high`, that ends on break `row`.

    With `row` < 0 it ends where a holding force leaves its jump. Returns the size of the step and
    the distance left to the break.
    """
    n = y.size // 2
    low, h, g, slope = 0.0, trial, np.inf, 0.0
    for _ in range(REFINEMENTS):
        h = trial
        rk_step(plant, t, h, segment, y, k, side, held, holding, y1, force)
        if row < 0:
            g, _ = held_margin(plant, t + h, segment, y1, side, held, force)
        else:
            base = base_motion(plant, t + h, segment)
            g, slope, _ = distance(plant, row, channel, y1, base, k[6, n:], side)
        if abs(g) <= tolerance or high - low <= 4e-16 * max(abs(t), 1e-3):
            break
        if g > 0.0:
            low = h
        else:
            high = h
        trial = h - g / slope if slope != 0.0 else low
        if not low < trial < high:
            trial = 0.5 * (low + high)
    return h, abs(g)


@inner
def pass_break(plant, t, segment, y, row, channel, side, held, stick_speed, force):
    """Go over to the other side of a break, or rest on it."""
    side[row] = -side[row]
    if plant.breaks[row, IS_JUMP] == 1:
        try_to_hold(plant, t, segment, y, row, channel, side, held, stick_speed, force)


@inner
def is_holding(held):
    """Whether some channel rests on a jump."""
    for j in range(held.size):
        if held[j] >= 0:
            return True
    return False


@inner
def copy(source, target):
    """target[:] = source, without the code for shapes that differ."""
    for i in range(source.size):
        target[i] = source[i]


@allocating
def grow(old, new):
    """Copy the rows of a record into a longer one."""
    for i in range(old.shape[0]):
        for j in range(old.shape[1]):
            new[i, j] = old[i, j]
    return new


@inlined
def save_step(record, marks, i, t, y, a0, a1, side, held):
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
    """Run from t0 to t1. `side[0] == 0` asks for the sides to be set from the state.

    Returns status, number of events, final side and held, and the record of the steps: a row each
    with time (1), state (2N) and acceleration (N) at its start and acceleration (N) at its end,
    and a last row with the final time and state; and marks, a row each with sides (b) and held
    breaks (m).
    """
    n, m = plant.linear.shape[0], plant.gain.shape[0]
    capacity = 256
    record = np.empty((capacity, 1 + 4 * n))
    marks = np.empty((capacity, side.size + m), np.int64)

    y, a0 = y0.copy(), np.zeros(n)
    work = ex.make_work(n, m)
    base, result = work.base, work.result
    ym, am, y1, a1 = result[: 2 * n], result[2 * n : 3 * n], result[3 * n : 5 * n], result[5 * n :]
    k, force, force0 = np.empty((7, 2 * n)), np.zeros(m), np.zeros(m)
    side, held = side.copy(), held.copy()
    t = t0
    segment = segment_at(plant, t)
    if side.size and side[0] == 0:
        # once by value and velocity, once more with the accelerations of these sides
        side[:] = 1
        for _ in range(2):
            start = base_motion(plant, t, segment)
            sides_of(plant, y, start, a0, side)
            accelerations(plant, start, y, side, held, a0, force0)

    steps, events, status, flips = np.int64(0), 0, OK, 0
    window, in_window = t, 0
    z_scale, v_scale = z_floor, v_floor
    # a displacement of 1 m moves velocities by its rounding times the fastest rate
    rounding = 1e-15 * math.sqrt(np.abs(plant.linear[:, : 2 * n]).max())
    h_rk, last_error = min(h_max, FIRST_STEP), 1.0
    level, patience = START_LEVEL, 0
    h_before = 0.0  # size of the ladder step before, if its forces can be extrapolated
    longest_landing = LANDING  # step that the error control has let reach a break
    ahead, ahead_row, ahead_channel = np.inf, -1, -1  # time of a break seen ahead, and which
    rk_until = -np.inf  # Dormand-Prince steps up to here, to land on a break
    fresh = True  # accelerations at the start have to be computed
    while t < t1:
        if segment + 1 < plant.segments.shape[0] and t >= plant.segments[segment + 1, 0]:
            segment += 1
            fresh, h_before = True, 0.0
        stop = t1
        if segment + 1 < plant.segments.shape[0]:
            stop = min(t1, plant.segments[segment + 1, 0])
        if stop - t <= ROUNDING * max(abs(t), 1.0):
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
        if steps + 3 >= record.shape[0]:
            longer = 2 * record.shape[0]
            record = grow(record, np.empty((longer, record.shape[1])))
            marks = grow(marks, np.empty((longer, marks.shape[1]), np.int64))

        fit = level
        room = stop - t + ROUNDING * max(abs(t), 1.0)
        goal = 0.0  # time to a break that can be landed on
        if ahead < np.inf:
            if ahead - t <= longest_landing:
                goal = ahead - t
            room = min(room, APPROACH * (ahead - t))
        while fit >= 0 and ladder.step[fit] > room:
            fit -= 1
        if use_ladder and not holding and fit >= 0 and t >= rk_until and goal == 0.0:
            h = ladder.step[fit]
            iterations, truncation, gap = ex.ladder_step(
                plant, ladder, fit, t, segment, y, a0, force0, h_before, side, z_tolerance,
                v_tolerance, work,
            )  # fmt: skip
            start = (base[0, 0], base[0, 1], base[0, 2])
            middle = (base[2, 0], base[2, 1], base[2, 2])
            end = (base[4, 0], base[4, 1], base[4, 2])
            share, place, channel, reach = 2.0, -1, -1, 0.0
            if iterations > 0 and not far_from_breaks(
                plant, start, middle, end, y, ym, y1, a0, am, a1, side, z_scale, v_scale
            ):
                for half in range(2):
                    y_half, a_half, y_next, a_next = (
                        (y, a0, ym, am) if half == 0 else (ym, am, y1, a1)
                    )
                    share, place, channel = find_event(
                        plant, 0.5 * h, start if half == 0 else middle,
                        middle if half == 0 else end, y_half, y_next, a_half, a_next, side, held,
                        z_scale, v_scale,
                    )  # fmt: skip
                    if share <= 1.0:
                        reach = 0.5 * h * (half + share)
                        break
            if share <= 1.0:
                # even if the step is not accurate: beyond the break it was on the wrong branch
                h_before = 0.0
                ahead, ahead_row, ahead_channel = t + reach, place, channel
                if reach <= ROUNDING * max(abs(t), 1.0):
                    ahead, rk_until = np.inf, t + ladder.step[0]  # on the break already
                continue
            if not max(truncation, gap) <= 1.0:
                level, patience = fit - 1, PATIENCE
                h_before = 0.0
                if level < 0:
                    level, rk_until = 0, t + h
                continue
            save_step(record, marks, steps, t, y, a0, am, side, held)
            save_step(record, marks, steps + 1, t + 0.5 * h, ym, am, a1, side, held)
            steps += 2
            t = stop if stop - (t + h) <= ROUNDING * max(abs(t), 1.0) else t + h
            copy(y1, y)
            copy(a1, a0)
            ex.keep_forces(work, force0)
            h_before = h
            flips = 0
            patience -= 1
            easy = gap < DOUBLE_INTERPOLATION and truncation < DOUBLE_TRUNCATION
            easy = easy and iterations <= FEW_ITERATIONS and patience <= 0
            if easy and fit == level and level + 1 < ex.LEVELS:
                level += 1
            continue

        # a Dormand-Prince step, or one that lands on the break
        h_before = 0.0
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
        let_go = -1
        if goal > 0.0:
            place, channel, share = ahead_row, ahead_channel, goal / h
            high = min(OVERSHOOT * goal + ladder.step[0], stop - t)
        else:
            rk_step(plant, t, h, segment, y, k, side, held, holding, y1, force)
            error = rk_error(k, h, n, z_tolerance, v_tolerance)
            if not error <= 1.0:
                h_rk = h * max(0.2, 0.9 * error**-0.2) if error < np.inf else 0.1 * h
                continue
            factor = 0.9 * max(error, 1e-10) ** -0.14 * last_error**0.04
            last_error = max(error, 1e-4)
            h_rk = max(h * min(5.0, max(0.3, factor)), wanted if h < wanted else 0.0)
            end = base_motion(plant, t + h, segment)
            share, place, channel = find_event(
                plant, h, base_motion(plant, t, segment), end, y, y1, a0, k[6, n:], side, held,
                z_scale, v_scale,
            )  # fmt: skip
            high = h
            if share == 0.0:
                if flips > 2 * side.size:
                    share = 2.0  # going along a break: either branch gives the same motion
                else:
                    flips += 1
                    events += 1
                    pass_break(plant, t, segment, y, place, channel, side, held, stick_speed, force)
                    fresh = True
                    continue
            if holding:
                margin, let_go = held_margin(plant, t + h, segment, y1, side, held, force)
                if margin < 0.0:
                    place, share = -1, 0.5
                else:
                    let_go = -1
        flips = 0
        if share <= 1.0 or goal > 0.0:
            reach = HOLDING_TOLERANCE
            if place >= 0:
                reach = break_tolerance(plant, place, z_scale, v_scale)
            h, missed = land(
                plant, t, share * h, high, segment, y, k, side, held, holding, y1, force, place,
                channel, reach,
            )  # fmt: skip
            share = 1.0
        if goal > 0.0:
            error = rk_error(k, h, n, LANDING_SHARE * z_tolerance, LANDING_SHARE * v_tolerance)
            if missed > 4 * reach or not error <= 1.0:
                # nothing there after all, or too far for one step: walk there, or come nearer
                longest_landing = 0.7 * h
                ahead = np.inf
                if missed > 4 * reach or longest_landing < ladder.step[0]:
                    rk_until = t + high
                continue
            longest_landing = max(longest_landing, h * min(2.0, 0.8 * max(error, 1e-10) ** -0.2))

        if t + h > t:
            save_step(record, marks, steps, t, y, a0, k[6, n:], side, held)
            steps += 1
        t = stop if stop - (t + h) <= ROUNDING * max(abs(t), 1.0) else t + h
        copy(y1, y)
        copy(k[6, n:], a0)
        copy(force, force0)
        if share <= 1.0:
            fresh = True
            rk_until, ahead = -np.inf, np.inf
            events += 1
            in_window += 1
            if t - window > 1.0:
                window, in_window = t, 1
            if in_window > max_rate:
                status = CHATTERING
                break
            if let_go >= 0:
                release(plant, t, segment, y, let_go, side, held, force)
            else:
                pass_break(plant, t, segment, y, place, channel, side, held, stick_speed, force)
    save_step(record, marks, steps, t, y, a0, a0, side, held)
    return status, events, side, held, record[: steps + 1].copy(), marks[: steps + 1].copy()
