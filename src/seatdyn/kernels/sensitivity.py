"""How the extrema of a balanced motion change with a parameter: the implicit function theorem.

Where R(D, p) = 0 holds, and goes on to hold, dD/dp = -T^-1 dR/dp with the tangent T = dR/dD that
Newton's method has factorised. dR/dp at the motion that stays is the difference of two residuals,
of the problem with the parameter a little higher and lower. The extrema then follow along the
solution, by the difference of both problems at D +- h dD/dp: laws, crossings and the outputs
themselves may depend on the parameter.
"""

from __future__ import annotations

from seatdyn.kernels.balance import evaluate
from seatdyn.kernels.condensed import (
    BEFORE,
    CHANGE,
    KEPT,
    OVERSAMPLING,
    PAST,
    PRESENT,
    RESIDUAL,
    SERIES,
    copy_events,
    number_of,
    respond,
)
from seatdyn.kernels.jit import kernel
from seatdyn.kernels.orbit import find_extrema
from seatdyn.kernels.tangent import prepare_tangent, solve_tangent

LEFT = 1e-10  # of the equations of the change, by GMRES


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
        if factors == 0:
            return 0, False
    for k in range(count):
        for j in range(m):
            series[BEFORE, k, j] = 0j
    same = True
    # first the residuals of the motion that stays, then the extrema of the one that changes
    for stage in range(2):
        for side in range(2):
            sign = 1.0 - 2.0 * side
            there, space, look = sides[side]
            if stage == 0:
                for k in range(count):
                    respond(there, space, k)
            copy_events(work, PAST, PRESENT)
            for k in range(count):
                for j in range(m):
                    series[SERIES, k, j] = series[KEPT, k, j]
                    if stage == 1:
                        series[SERIES, k, j] -= sign * step * series[CHANGE, k, j]
            evaluate(there, space, count, samples)
            same = same and number_of(work.events[PRESENT]) == number_of(work.events[PAST])
            if stage == 0:
                for k in range(count):
                    for j in range(m):
                        series[BEFORE, k, j] += sign * series[RESIDUAL, k, j] / (2.0 * step)
            else:
                find_extrema(there, space, look, samples)
                for row in range(result.shape[1]):
                    for o in range(result.shape[2]):
                        result[side, row, o] = look.extrema[row, o]
        if stage == 0:
            copy_events(work, PAST, PRESENT)
            solve_tangent(problem, work, series[BEFORE], count, samples, factors, LEFT)
    return factors, same
