"""Harmonic balance from coarse to fine: as many harmonics as the error estimate asks for.

Each level has twice the samples and harmonics of the one before and starts from it. What the
extrema of the outputs change from one level to the next is the measure of the error. Where Newton's
method fails on the coarsest levels, the motion is continued in the strength of the channel forces
from the linear one, and then in the level of the excitation from a small one.
"""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.balance import CONVERGED, solve_level
from seatdyn.kernels.condensed import (
    CORNER,
    FORCE,
    KEPT,
    LAW,
    LEVEL,
    MOST_EVENTS,
    OVERSAMPLING,
    PRESENT,
    REDUCED,
    SERIES,
    STRENGTH,
    across,
    reduce_series,
    respond,
    tail_weights,
)
from seatdyn.kernels.floquet import monodromy
from seatdyn.kernels.jit import inner, kernel
from seatdyn.kernels.orbit import HIGH, HIGH_BEFORE, LOW, LOW_BEFORE, find_extrema, states
from seatdyn.kernels.together import Shares

NOT_ACCURATE = 4  # the finest level allowed does not meet the tolerance
NEWTON_SHARE, SMALLEST_RESIDUAL = 0.01, 1e-13  # of the tolerance; what Newton's method may leave
PATIENCE = 3  # levels that may fail
SLOWING = 6.0  # the error is the last change times so much of its ratio to the one before
LEAST_GAIN, MOST_GAIN = 0.25, 1.0  # but not less, nor more
# of the change before: a faster fall is not believed; of steep laws and with delays, whose changes
# fall less regularly
SUDDEN, SUDDEN_STEEP = 1.0 / 64.0, 1.0 / 8.0
UNRESOLVED = 0.5  # of the range of a force, between two samples
STRIDE, SMALLEST_STRIDE = 0.0625, 1e-3  # of a continuation from 0 to 1
NOTHING = -1  # is being continued
NONE = np.int64(0)  # numpy's, see NO_BREAK
ROUNDING, NOISE = 1e-13, 1e-9


@inner
def start_linear(problem, work, count):
    """Fill responses, and the motion without channel forces as first guess."""
    m = problem.lag.size
    for k in range(count):
        respond(problem, work, k)
    work.events[PRESENT, MOST_EVENTS, 0] = 0.0
    for k in range(count):
        for i in range(m):
            value = across(problem, work, k, i, m)
            work.series[SERIES, k, i] = value if k > 0 else complex(value.real, 0.0)


@inner
def refine_motion(problem, work, old, new):
    """Fill responses and first guess (sawtooths) of the harmonics old .. new-1."""
    m, events = problem.lag.size, work.events[PRESENT]
    for k in range(old, new):
        respond(problem, work, k)
        for i in range(m):
            work.series[SERIES, k, i] = 0j
    weights = events[:, CORNER + 2 * m :]
    tail_weights(problem, events, problem.gain, problem.later_gain, weights)
    reduce_series(problem, work.series[SERIES], new, events, weights, work.series[REDUCED])
    for k in range(old, new):
        for i in range(m):
            work.series[SERIES, k, i] = -work.series[REDUCED, k, i]


@inner
def take_kept(work, count, factor):
    """Take the motion kept as guess, times a factor."""
    for k in range(count):
        for i in range(work.series.shape[2]):
            work.series[SERIES, k, i] = work.series[KEPT, k, i] * factor


@inner
def keep_motion(work, count):
    """Keep the present motion."""
    for k in range(count):
        for i in range(work.series.shape[2]):
            work.series[KEPT, k, i] = work.series[SERIES, k, i]


@kernel
def ascend(problem, work, look, tolerance, first, most, guessed):
    """Solve from `first` samples up to `most`, from the present series where `guessed` (first/4).

    Returns code, error estimate, samples and evaluations. The extrema are in `look`.
    """
    newton = max(NEWTON_SHARE * tolerance, SMALLEST_RESIDUAL)
    n, used, failures, comparable, factors = first, 0, 0, False, NONE
    change, change_before, regular = np.inf, np.inf, True
    for j in range(problem.lag.size):
        regular = regular and problem.lag[j] == 0.0
    regular = regular and problem.delays.size == 0
    # a continuation in the strength of the forces, or in the level, has come this far
    which, reached, target, stride = NOTHING, 0.0, 1.0, STRIDE
    while True:
        count = n // OVERSAMPLING
        if which != NOTHING or failures > 0:
            factors = NONE
        if which != NOTHING:
            target = min(1.0, reached + stride)
            problem.scale[which] = target
            start_linear(problem, work, count)
            if reached > 0.0:
                take_kept(work, count, target / reached if which == LEVEL else 1.0)
        elif n > first:
            refine_motion(problem, work, count // 2, count)
        else:
            start_linear(problem, work, count)
            if guessed:
                take_kept(work, count, 1.0)
        code, left, spent, factors = solve_level(problem, work, n, newton, factors)
        used += spent
        regular = regular and factors >= 0
        if which != NOTHING:
            if code == CONVERGED:
                reached, stride = target, 2.0 * stride
                keep_motion(work, count)
            else:
                stride *= 0.25
            if reached == 1.0:
                which = NOTHING
            elif stride >= SMALLEST_STRIDE:
                continue
            elif which == STRENGTH:
                problem.scale[STRENGTH] = 1.0
                which, reached, stride = LEVEL, 0.0, STRIDE
                continue
            else:
                problem.scale[LEVEL] = 1.0
                return code, np.inf, n, used
        elif code != CONVERGED:
            failures += 1
            if failures == PATIENCE and not guessed:
                which = STRENGTH
                continue
        if code == CONVERGED and is_resolved(work, n):
            find_extrema(problem, work, look, n)
            if comparable:
                change_before, change = change, change_of(look.extrema)
                estimate = estimate_of(change, change_before, regular, left)
                if estimate <= tolerance:
                    return CONVERGED, estimate, n, used
            for o in range(look.extrema.shape[1]):
                look.extrema[HIGH_BEFORE, o] = look.extrema[HIGH, o]
                look.extrema[LOW_BEFORE, o] = look.extrema[LOW, o]
            comparable = True
        else:
            # a coarse level that is not solved is only a guess for the next one
            change, comparable = np.inf, False
        if 2 * n > most:
            estimate = estimate_of(change, change_before, regular, left)
            return NOT_ACCURATE if code == CONVERGED else code, estimate, n, used
        n *= 2


@inner
def change_of(extrema):
    """Largest change of an extremum relative to the amplitude of its output."""
    change = 0.0
    for o in range(extrema.shape[1]):
        high, low = extrema[HIGH, o], extrema[LOW, o]
        moved = abs(high - extrema[HIGH_BEFORE, o])
        moved = max(moved, abs(low - extrema[LOW_BEFORE, o]))
        if moved > ROUNDING * max(abs(high), abs(low)):
            change = max(change, 2.0 * moved / (high - low) if high > low else np.inf)
    return change


@inner
def is_resolved(work, n):
    """Whether no force, its jumps taken out, changes by half its range between two samples."""
    for j in range(work.series.shape[2]):
        f, noise = work.samples[LAW, j], 0.0
        for k in range(n // OVERSAMPLING):
            noise = max(noise, NOISE * abs(work.series[FORCE, k, j]))
        low, high, leap = f[n - 1], f[n - 1], 0.0
        for i in range(n):
            low, high = min(low, f[i]), max(high, f[i])
            leap = max(leap, abs(f[i] - f[i - 1 if i > 0 else n - 1]))
        if leap > UNRESOLVED * (high - low) + noise:
            return False
    return True


@inner
def estimate_of(change, change_before, regular, left):
    """Error of the finer of two levels from the changes of the last two, and what Newton left."""
    if not change_before < np.inf:
        return change + 4.0 * left + ROUNDING
    ratio = change / change_before if change_before > 0.0 else 1.0
    gain = min(max(SLOWING * ratio, LEAST_GAIN), MOST_GAIN) if regular else MOST_GAIN
    sudden = SUDDEN if regular else SUDDEN_STEEP
    return max(change * gain, sudden * change_before) + 4.0 * left + ROUNDING


SHARES = Shares(here=(solve_level,), there=(find_extrema,), later=(monodromy, states))
