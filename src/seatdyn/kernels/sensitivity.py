"""How the extrema of a balanced motion change with a parameter: the implicit function theorem.

Where R(D, p) = 0 holds, and goes on to hold, T dD/dp + dR/dp = 0 with the tangent T = dR/dD that
Newton's method factorises. What is left of this equation along a first dD/dp is the difference of
two residuals, of the problem with the parameter a little higher and lower, at D +- h dD/dp. It is
solved for until nothing is left, for the tangent does not know how the sawtooths beyond the last
harmonic move with the events. The extrema follow from the same two motions: laws, crossings and
the outputs themselves may depend on the parameter.
"""

from __future__ import annotations

from seatdyn.kernels.balance import evaluate, size_of
from seatdyn.kernels.condensed import (
    BEFORE,
    CHANGE,
    KEPT,
    OVERSAMPLING,
    PAST,
    PRESENT,
    RATE,
    RESIDUAL,
    SERIES,
    copy_events,
    number_of,
    respond,
)
from seatdyn.kernels.jit import kernel
from seatdyn.kernels.orbit import find_extrema
from seatdyn.kernels.tangent import prepare_tangent, solve_tangent

LEFT = 1e-8  # of the equations of the change, by GMRES
SOLVED = 1e-8  # of the change, relative, that the equations may leave
PASSES = 6


@kernel
def sensitivity(problem, work, samples, step, sides, factors, result):
    """Fill result (2, 4, o) with the extrema, see HIGH ..., at a parameter p + step and p - step.

    sides : (problem, work, look) with the parameter higher, then lower; the spaces may share all
        but their responses, and the looks all but their rows
    factors : of the tangent, as returned by the call before for the same motion; 0 for none

    Returns the factors, 0 where the tangent is singular, and whether the motion meets the same
    breaks on either side of p. The series KEPT holds the motion after the first call.
    """
    count, m = samples // OVERSAMPLING, problem.lag.size
    series = work.series
    if factors == 0:
        evaluate(problem, work, count, samples)
        copy_events(work, PRESENT, PAST)
        for k in range(count):
            for j in range(m):
                series[KEPT, k, j] = series[SERIES, k, j]
        factors = prepare_tangent(problem, work, count, samples)
        if factors == 0 and m > 0:
            return 0, False
    for k in range(count):
        for j in range(m):
            series[RATE, k, j] = 0j
    for i in range(PASSES):
        same = True
        for k in range(count):
            for j in range(m):
                series[BEFORE, k, j] = 0j
        for side in range(2):
            sign = 1.0 - 2.0 * side
            there, space, look = sides[side]
            if i == 0:
                for k in range(count):
                    respond(there, space, k)
            copy_events(work, PAST, PRESENT)
            for k in range(count):
                for j in range(m):
                    series[SERIES, k, j] = series[KEPT, k, j] + sign * step * series[RATE, k, j]
            evaluate(there, space, count, samples)
            if number_of(work.events[PRESENT]) > 0:
                evaluate(there, space, count, samples)  # with the sawtooths of these events
            same = same and number_of(work.events[PRESENT]) == number_of(work.events[PAST])
            for k in range(count):
                for j in range(m):
                    series[BEFORE, k, j] += sign * series[RESIDUAL, k, j] / (2.0 * step)
            if i > 0:
                find_extrema(there, space, look, samples)
                for row in range(result.shape[1]):
                    for o in range(result.shape[2]):
                        result[side, row, o] = look.extrema[row, o]
        if i > 0 and size_of(series[BEFORE], count) <= SOLVED * size_of(series[RATE], count):
            break
        copy_events(work, PAST, PRESENT)
        solve_tangent(problem, work, series[BEFORE], count, samples, factors, LEFT)
        for k in range(count):
            for j in range(m):
                series[RATE, k, j] -= series[CHANGE, k, j]
    return factors, same
