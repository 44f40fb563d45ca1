"""Stability of a balanced motion: the monodromy matrix of small deviations over one period.

    x'' = A_z x + A_v x' - sum_j pull_j (dF_j/dd d_j + dF_j/dv v_j)

is integrated along the motion by Runge-Kutta steps between the events. Where a force jumps by J at
p d + q v = value, the deviation (x, x') jumps too, by the saltation matrix

    I - (0, pull_j J) (p B_j, q B_j) / (p v + q a-)

with B_j the incidence of the channel and a- its acceleration just before.
"""

from __future__ import annotations

import math

import numpy as np

from seatdyn.kernels.breaking import STEP, beside, distance_at, law_slope
from seatdyn.kernels.columns import (
    BREAKS,
    FIRST,
    IS_JUMP,
    ON_DISPLACEMENT,
    ON_VELOCITY,
    SECOND,
)
from seatdyn.kernels.condensed import (
    CHANNEL,
    CONDENSED,
    CORNER,
    DISPLACEMENT,
    JUMP,
    NO_BREAK,
    OVERSAMPLING,
    PHASE,
    PRESENT,
    REDUCED,
    ROW,
    SERIES,
    VELOCITY,
    WORK,
    number_of,
    reduce_series,
    state_at,
    tail_weights,
)
from seatdyn.kernels.jit import inner, kernel, spliced, takes
from seatdyn.kernels.shapes import BLOCK, INTEGER

STEPS = 256  # per period, at least; a step ends on every second sample or oftener
STIFFNESS_SHARE = 0.4  # of the fastest rate of the deviations that a step may take


NEAR = 4.0  # differences away from a kink
ON_SAMPLE = 1e-6  # of the distance of two


@inner
def channel_slopes(problem, work, count, theta, row, side, slopes):
    """Fill dF/dd and dF/dv, and below the sizes of d and v as given: (4, m), at a phase.

    With row >= 0 the phase is on that break, and its side is meant.
    """
    m, samples = problem.lag.size, count * OVERSAMPLING
    place = theta * samples / (2.0 * math.pi)
    nearest = int(place + 0.5)
    for j in range(m):
        if row < 0 and abs(place - nearest) < ON_SAMPLE:
            d = work.samples[DISPLACEMENT, j, nearest % samples]
            v = work.samples[VELOCITY, j, nearest % samples]
        else:
            d, v, _ = state_at(
                problem, work.series[REDUCED], count, work.events[PRESENT],
                work.events[PRESENT, :, CORNER + 2 * m :], j, theta,
            )  # fmt: skip
        dd, dv = STEP * slopes[2, j], STEP * slopes[3, j]
        if problem.channels[j, BREAKS] <= row < problem.channels[j + 1, BREAKS]:
            if problem.breaks[row, IS_JUMP] != 0.0:
                d, v = beside(problem, row, d, v, side)
            elif problem.breaks[row, ON_DISPLACEMENT] != 0.0:
                d += side * math.copysign(NEAR * dd, problem.breaks[row, ON_DISPLACEMENT])
            else:
                v += side * math.copysign(NEAR * dv, problem.breaks[row, ON_VELOCITY])
        slopes[0, j] = law_slope(problem, j, d, v, dd, 0.0)
        slopes[1, j] = law_slope(problem, j, d, v, 0.0, dv)


@inner
def deviate(problem, slopes, x, dx):
    """Time derivative of deviations x (2N, c)."""
    n, m = problem.pull.shape
    for c in range(x.shape[1]):
        for i in range(n):
            dx[i, c] = x[n + i, c]
            total = 0.0
            for k in range(2 * n):
                total += problem.linear[i, k] * x[k, c]
            dx[n + i, c] = total
        for j in range(m):
            a, b = problem.channels[j, FIRST], problem.channels[j, SECOND]
            d, v = 0.0, 0.0
            if b >= 0:
                d, v = x[b, c], x[n + b, c]
            if a >= 0:
                d, v = d - x[a, c], v - x[n + a, c]
            force = slopes[0, j] * d + slopes[1, j] * v
            for i in range(n):
                dx[n + i, c] -= problem.pull[i, j] * force


@spliced
def add(x, factor, k, y):
    """y = x + factor k."""
    for i in range(x.shape[0]):
        for c in range(x.shape[1]):
            y[i, c] = x[i, c] + factor * k[i, c]


@inner
def runge_kutta(problem, slopes, h, space):
    """One step of the classical method of space[0]; slopes (3, ., m) at start, middle and end."""
    x, y = space[0], space[5]
    deviate(problem, slopes[0], x, space[1])
    add(x, 0.5 * h, space[1], y)
    deviate(problem, slopes[1], y, space[2])
    add(x, 0.5 * h, space[2], y)
    deviate(problem, slopes[1], y, space[3])
    add(x, h, space[3], y)
    deviate(problem, slopes[2], y, space[4])
    for k, weight in ((1, 1.0), (2, 2.0), (3, 2.0), (4, 1.0)):
        add(x, weight * h / 6.0, space[k], x)


@inner
def linear_rate(problem):
    """Upper bound of the fastest rate of the linear part, 1/s."""
    n, rate = problem.pull.shape[0], 1e-300
    for i in range(n):
        by_velocity, by_displacement = 0.0, 0.0
        for c in range(n):
            by_displacement += abs(problem.linear[i, c])
            by_velocity += abs(problem.linear[i, n + c])
        rate = max(rate, by_velocity, math.sqrt(by_displacement))
    return rate


@inner
def fastest_rate(problem, slopes, rate):
    """Estimate of the fastest rate of the deviations, 1/s; that of the linear part is `rate`."""
    for j in range(problem.lag.size):
        gain = problem.gain[j, j]
        rate = max(rate, abs(gain * slopes[1, j]), math.sqrt(abs(gain * slopes[0, j])))
    return rate


@inner
def saltation(problem, event, rate, x):
    """Apply the jump of the deviations at an event; rate is p v + q a- in time."""
    n = problem.pull.shape[0]
    j, r = int(event[CHANNEL]), int(event[ROW])
    p, q = problem.breaks[r, ON_DISPLACEMENT], problem.breaks[r, ON_VELOCITY]
    a, b = problem.channels[j, FIRST], problem.channels[j, SECOND]
    for c in range(x.shape[1]):
        met = 0.0
        if b >= 0:
            met += p * x[b, c] + q * x[n + b, c]
        if a >= 0:
            met -= p * x[a, c] + q * x[n + a, c]
        for i in range(n):
            x[n + i, c] -= problem.pull[i, j] * event[JUMP] * met / rate


@inner
def next_event(events, theta):
    """Number of the first event after a phase in 0 .. 2 pi, and its phase; -1 and 2 pi if none."""
    best, place = 2.0 * math.pi, -1
    for e in range(number_of(events)):
        phase = events[e, PHASE] % (2.0 * math.pi)
        if theta < phase < best:
            best, place = phase, e
    return place, best


@takes(CONDENSED, WORK, INTEGER, INTEGER, BLOCK, BLOCK)
@kernel
def monodromy(problem, work, samples, refinement, space, slopes):
    """Fill space[0], (2N, 2N), with the monodromy matrix.

    Returns the smallest rate at which a jump is crossed, relative to the largest velocity; negative
    where the motion would not go on over it.

    refinement : factor on the number of steps
    space : (6, 2N, 2N); slopes : (3, 4, m)
    """
    m, count = problem.lag.size, samples // OVERSAMPLING
    events = work.events[PRESENT]
    weights = events[:, CORNER + 2 * m :]
    tail_weights(problem, events, problem.gain, problem.later_gain, weights)
    reduce_series(problem, work.series[SERIES], count, events, weights, work.series[REDUCED])
    for s in range(3):
        for j in range(m):
            slopes[s, 2, j], slopes[s, 3, j] = 0.0, 0.0
            for i in range(samples):
                for q in range(2):
                    size = abs(work.samples[(DISPLACEMENT, VELOCITY)[q], j, i])
                    slopes[s, 2 + q, j] = max(slopes[s, 2 + q, j], size)
    x = space[0]
    for i in range(x.shape[0]):
        for c in range(x.shape[0]):
            x[i, c] = 1.0 if i == c else 0.0
    share, slow = STIFFNESS_SHARE * problem.omega / refinement, linear_rate(problem)
    slowest, theta, row, side = np.inf, 0.0, NO_BREAK, 1.0
    grid = 2.0 * math.pi / (max(STEPS, samples // 2) * refinement)
    while theta < 2.0 * math.pi:
        e, stop = next_event(events, theta)
        next_row, rate = NO_BREAK, 0.0
        if e >= 0:
            j, next_row = int(events[e, CHANNEL]), int(events[e, ROW])
            q = problem.breaks[next_row, ON_VELOCITY]
            rate = distance_at(problem, work, count, next_row, j, stop)[1] * problem.omega
            leap = q * problem.gain[j, j] * events[e, JUMP]
            ahead = math.copysign(1.0, rate)
            rate += 0.5 * leap
            if events[e, JUMP] != 0.0:
                scale = abs(problem.breaks[next_row, ON_DISPLACEMENT]) + abs(q) * problem.omega
                scale *= slopes[0, 3, j]
                slowest = min(slowest, min(rate * ahead, (rate - leap) * ahead) / scale)
        next_side = -math.copysign(1.0, rate)
        channel_slopes(problem, work, count, theta, row, side, slopes[0])
        while theta < stop:
            h = grid * (math.floor(theta / grid + ON_SAMPLE) + 1.0) - theta
            h = min(h, share / fastest_rate(problem, slopes[0], slow))
            last, end = False, stop
            for _ in range(8):
                last = last or theta + 1.0001 * h >= stop
                h = stop - theta if last else h
                end = stop if last else theta + h
                channel_slopes(
                    problem, work, count, end, next_row if last else NO_BREAK, next_side, slopes[2]
                )
                channel_slopes(problem, work, count, 0.5 * (theta + end), NO_BREAK, 1.0, slopes[1])
                worst = fastest_rate(problem, slopes[1], fastest_rate(problem, slopes[2], slow))
                if worst * h <= 2.0 * share:
                    break
                h, last = share / worst, False
            runge_kutta(problem, slopes, h / problem.omega, space)
            theta = end
            for j in range(m):
                slopes[0, 0, j], slopes[0, 1, j] = slopes[2, 0, j], slopes[2, 1, j]
        row, side = next_row, -next_side
        if e >= 0 and events[e, JUMP] != 0.0:
            saltation(problem, events[e], rate, x)
    return slowest
