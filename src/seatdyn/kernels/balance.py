"""Harmonic balance condensed on the channels: residual, and Newton's method with n samples.

Unknown are the harmonics D_k of the relative motion of the channels. With G_k the relative motion
per channel force and D0_k that of the linear system

    R_k = D_k - D0_k + G_k F_k(D) = 0

where F_k are the harmonics of the forces, found by sampling the motion, evaluating the laws, and
transforming back. Jumps of the forces and of their first two derivatives are located and their
harmonics taken in closed form, so sampling never sees them.
"""

from __future__ import annotations

import math

import numpy as np

from seatdyn.kernels.breaking import find_events, law_force
from seatdyn.kernels.condensed import (
    BEFORE,
    CHANGE,
    CHANNEL,
    CONDENSED,
    CORNER,
    DISPLACEMENT,
    FORCE,
    FOUND,
    JUMP,
    LAW,
    LINE,
    OVERSAMPLING,
    PAST,
    PHASE,
    PRESENT,
    REDUCED,
    RESIDUAL,
    SERIES,
    TAILS,
    VELOCITY,
    WORK,
    across,
    add_sawtooths,
    copy_events,
    number_of,
    reduce_series,
    tail_weights,
)
from seatdyn.kernels.fourier import harmonics, samples_of
from seatdyn.kernels.jit import inner, spliced, stage, takes
from seatdyn.kernels.shapes import INTEGER, REAL
from seatdyn.kernels.tangent import (
    apply_inverse,
    mean_inverse,
    prepare_tangent,
    solve_tangent,
)

CONVERGED, NOT_CONVERGED, TOO_MANY_EVENTS, NOT_FINITE = range(4)
FAST = 0.25  # fall of the residual per step below which a factorised tangent is kept
MOST_ITERATIONS = 40
SMALLEST_STEP = 1.0 / 64.0
STALLED = 1e-6  # residual, relative, at which no further progress is no failure
FORCING = 0.03  # what GMRES may leave of a Newton step
SMALL = 1e-300


@inner
def sample_column(problem, lines, reduced, count, n, events, weights, c, order, target):
    """Samples (n,) of column c of a series less its sawtooths, and of these; order 1: of its rate.

    reduced, weights : see `reduce_series` and `tail_weights`
    """
    w = problem.omega
    for k in range(count):
        lines[LINE, k] = reduced[k, c] * (1j * (k * w)) if order == 1 else reduced[k, c]
    samples_of(lines[LINE], count, n, lines, target)
    for e in range(number_of(events)):
        third, fourth = weights[e, TAILS * c], weights[e, TAILS * c + 1]
        fifth = weights[e, TAILS * c + 2]
        origin = events[e, PHASE] + w * problem.lag[int(events[e, CHANNEL])]
        if order == 0:
            add_sawtooths(target, n, origin, 0.0, 0.0, third, fourth, fifth)
        else:
            add_sawtooths(target, n, origin, 0.0, w * third, w * fourth, w * fifth, 0.0)


@spliced
def break_sizes(events, e, j, m):
    """Jump of the force of channel j at event e, and those of its first two derivatives."""
    jump = events[e, JUMP] if events[e, CHANNEL] == j else 0.0
    return jump, events[e, CORNER + j], events[e, CORNER + m + j]


@inner
def force_harmonics(problem, work, count, n):
    """Fill samples of the forces, less their sawtooths, and the harmonics of the forces."""
    m, events = problem.lag.size, work.events[PRESENT]
    line = work.lines[LINE]
    for j in range(m):
        f = work.samples[LAW, j]
        for i in range(n):
            f[i] = law_force(
                problem, j, work.samples[DISPLACEMENT, j, i], work.samples[VELOCITY, j, i]
            )
        for e in range(number_of(events)):
            jump, corner, bend = break_sizes(events, e, j, m)
            if jump != 0.0 or corner != 0.0 or bend != 0.0:
                add_sawtooths(f, n, events[e, PHASE], -jump, -corner, -bend, 0.0, 0.0)
        harmonics(f, n, work.lines, count, line)
        for e in range(number_of(events)):
            jump, corner, bend = break_sizes(events, e, j, m)
            if jump != 0.0 or corner != 0.0 or bend != 0.0:
                z = complex(math.cos(events[e, PHASE]), -math.sin(events[e, PHASE]))
                power = z
                for k in range(1, count):
                    # 1/(i k), 1/(i k)^2, 1/(i k)^3, over pi
                    part = complex(-corner / k, bend / (float(k) * k) - jump)
                    line[k] += power * part / (math.pi * k)
                    power *= z
        for k in range(count):
            work.series[FORCE, k, j] = line[k]


@inner
def evaluate(problem, work, count, n):
    """Fill motion, events, forces and residual of the present series; False: too many events."""
    m = problem.lag.size
    events, weights = work.events[PRESENT], work.events[PRESENT, :, CORNER + 2 * m :]
    tail_weights(problem, events, problem.gain, problem.later_gain, weights)
    reduced = work.series[REDUCED]
    reduce_series(problem, work.series[SERIES], count, events, weights, reduced)
    for j in range(m):
        for order, place in ((0, DISPLACEMENT), (1, VELOCITY)):
            target = work.samples[place, j]
            sample_column(problem, work.lines, reduced, count, n, events, weights, j, order, target)
    enough = True
    if problem.breaks.shape[0]:
        enough = find_events(problem, work, count, n)
        copy_events(work, FOUND, PRESENT)
    force_harmonics(problem, work, count, n)
    for k in range(count):
        for i in range(m):
            total = work.series[SERIES, k, i] - across(problem, work, k, i, m)
            for j in range(m):
                total += across(problem, work, k, i, j) * work.series[FORCE, k, j]
            work.series[RESIDUAL, k, i] = total if k > 0 else complex(total.real, 0.0)
    return enough


@inner
def size_of(series, count):
    """Norm of a series that weighs displacement and velocity alike."""
    total = 0.0
    for k in range(count):
        for c in range(series.shape[1]):
            x = series[k, c]
            total += (1.0 + k * k) * (x.real * x.real + x.imag * x.imag)
    return math.sqrt(total)


@takes(CONDENSED, WORK, INTEGER, REAL, INTEGER)
@stage
def solve_level(problem, work, n, tolerance, factors):
    """Newton's method with n samples from the present series, which it changes.

    factors : unknowns solved together with the tangent as it was factorised last; 0 for none. A
        tangent of fewer samples serves as well, where it is one of the lowest harmonics.

    The step is made with the factorised tangent while that lets the residual fall fast, else by
    GMRES with the whole tangent. Returns a code, the last residual relative to the motion, the
    evaluations used, and the factors.
    """
    m, count = problem.lag.size, n // OVERSAMPLING
    series = work.series
    norm, damping, scale = np.inf, 1.0, 1.0
    fresh, whole = False, False
    factors = max(factors, 0)
    if factors > 0:
        mean_inverse(problem, work, count)
    code, used = NOT_CONVERGED, MOST_ITERATIONS
    restoring = False
    for iteration in range(MOST_ITERATIONS):
        enough = evaluate(problem, work, count, n)
        scale = size_of(series[SERIES], count) + SMALL
        trial = size_of(series[RESIDUAL], count)
        if restoring and damping < SMALLEST_STEP:
            code, used = CONVERGED if norm <= STALLED * scale else NOT_CONVERGED, iteration + 1
            break
        if not np.isfinite(trial):
            if iteration == 0:
                code, used = NOT_FINITE, 0
                break
            trial = np.inf
        if trial <= tolerance * scale and (iteration > 0 or number_of(work.events[PRESENT]) == 0):
            code, norm, used = CONVERGED if enough else TOO_MANY_EVENTS, trial, iteration + 1
            break
        fall = trial / norm if norm < np.inf else 1.0
        if iteration > 0 and not restoring and fall > 1.0 - 0.1 * damping:
            # refused: back to where the step began
            for k in range(count):
                for j in range(m):
                    series[SERIES, k, j] = series[BEFORE, k, j]
            copy_events(work, PAST, PRESENT)
            restoring = True
            if fresh and whole:
                damping *= 0.5
                restoring = damping < SMALLEST_STEP
                if not restoring:
                    for k in range(count):
                        for j in range(m):
                            series[SERIES, k, j] += damping * series[CHANGE, k, j]
            else:
                whole = whole or fresh
                factors = 0
            continue
        if iteration > 0 and not restoring and fall > FAST:
            whole = whole or (fresh and damping == 1.0)
            factors = 0
        restoring = False
        norm = trial
        fresh = factors == 0 or whole
        if fresh:
            factors = prepare_tangent(problem, work, count, n)
            if factors == 0:
                used = iteration + 1
                break
        if whole:
            solve_tangent(problem, work, series[RESIDUAL], count, n, factors, FORCING)
        else:
            apply_inverse(problem, work, series[RESIDUAL], count, n, factors, series[CHANGE])
        damping = 1.0
        copy_events(work, PRESENT, PAST)
        for k in range(count):
            for j in range(m):
                series[CHANGE, k, j] = -series[CHANGE, k, j]
                series[BEFORE, k, j] = series[SERIES, k, j]
                series[SERIES, k, j] += series[CHANGE, k, j]
    return code, norm / scale, used, factors
