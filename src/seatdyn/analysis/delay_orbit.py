"""Periodic motion of a system with delayed forces, and its Floquet multipliers.

What goes on from one period to the next is no longer a state but a piece of history: the present
state, and the past of what the delayed forces see. It is known here by its values in Chebyshev
points, and the period map of these values, by differences, is the monodromy operator: compact, so
that its largest eigenvalues converge (Engelborghs and Doedel, Numer. Math. 91 (2002) 627). It
serves twice. Its eigenvalues tell whether a motion is stable, and Newton's method with it removes
what decays slowly; but the history itself is never rounded to those points, only its corrections
are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.approach import JITTER, Approach, most_multiplier, sharper
from seatdyn.analysis.delay_past import POWERS, Past
from seatdyn.analysis.delay_time import START, LateProblem, LateRun, LateState
from seatdyn.analysis.run import SHARE_OF_INPUT, Run, Samples
from seatdyn.analysis.steady import Orbit
from seatdyn.errors import Status
from seatdyn.kernels.columns import BREAKS, FIRST, ON_DISPLACEMENT, ON_VELOCITY, SECOND, VALUE
from seatdyn.kernels.plant import FREE

Array = NDArray[np.float64]
DEGREE = 8  # of the polynomials that corrections of the past are made of
# Relative, for the monodromy operator by central differences, with even and adaptive steps.
PERTURBATION, COARSE = 1e-5, 1e-4
ROWS = 32  # of the past that are changed, at least
LOOSE, FINER = 1e-2, 2.0  # tolerance of its runs, and how much shorter their steps are
RESOLVED = 1e-6  # relative error of such a run; beyond it the runs are adaptive, and sharper
PIECES, BESIDE = 128, 1e-10  # of the past of a known motion; s beside a break
HALVINGS = 40  # of the time between two of them, on the way to a break
QUARTERS = np.linspace(0.0, 1.0, POWERS)  # shares of a row
THROUGH = np.linalg.inv(np.vander(QUARTERS, increasing=True))  # coefficients from values there
CLOSE = 1e-2  # relative change per period below which the operator is worked out
FEWEST, SELDOM = 3, 64  # periods before it is, and after which it is anyway
FALLS = 0.3  # a corrected period must change the history less than this share of the one before


class History:
    """The piece of history that a period starts from, as numbers.

    First the motion and the states of elements now, then displacements and velocities of the nodes
    that delayed forces see, and states of elements that act late, point by point.
    """

    def __init__(self, problem: LateProblem) -> None:
        """Find what the delayed forces see."""
        self.nodes, self.states = problem.late.seen, problem.late_states
        self.n, self.span = problem.system.linear.size, problem.longest_delay
        self.size = 2 * self.n + problem.state_scale.size  # of motion and states now
        # those that are needed of the past, too
        self.seen = np.concatenate([self.nodes, self.n + self.nodes, 2 * self.n + self.states])
        self.points = np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)  # now first
        to_series = np.linalg.inv(np.polynomial.chebyshev.chebvander(self.points, DEGREE))
        self._to_series = to_series

    def values(self, past: Past) -> Array:
        """The numbers of a history."""
        times = past.now + 0.5 * self.span * (self.points[1:] - 1.0)
        z, v, _ = past.at(times)
        before = np.hstack([z, v, past.states_at(times)])
        motion, states = past.record[-1, 1 : 2 * self.n + 1], past.quartics()[-1, :, 0]
        return np.concatenate([motion, states, before[:, self.seen].ravel()])

    def changed(self, problem: LateProblem, state: LateState, change: Array) -> LateState:
        """A state whose history differs by these numbers, smoothly in between."""
        assert state.past is not None
        past, n, nodes = state.past, self.n, self.nodes
        now, before = change[: self.size], change[self.size :].reshape(DEGREE, -1)
        series = self._to_series @ np.vstack([now[self.seen], before])
        new = replace(past, record=past.record.copy())
        record, quartics, k = new.record, new.quartics(), nodes.size
        x = 1.0 + 2.0 * (record[:, 0] - past.now) / self.span  # the past is cut to its span
        cheb = np.polynomial.chebyshev
        value = cheb.chebval(x, series).T
        rate = cheb.chebval(x, cheb.chebder(series)).T * (2.0 / self.span)
        record[:, 1 + nodes] += value[:, :k]
        record[:, 1 + n + nodes] += value[:, k : 2 * k]
        record[:, 1 + 2 * n + nodes] += rate[:, k : 2 * k]
        record[:-1, 1 + 3 * n + nodes] += rate[1:, k : 2 * k]
        # cubics between the changes of the states
        begin, rise = value[:, 2 * k :], np.diff(value[:, 2 * k :], axis=0)
        slope = rate[:, 2 * k :] * np.diff(record[:, 0], append=past.now)[:, None]
        end = rate[1:, 2 * k :] * np.diff(record[:, 0])[:, None]
        quartics[:, self.states, 0] += begin
        quartics[:, self.states, 1] += slope
        quartics[:-1, self.states, 2] += 3 * rise - 2 * slope[:-1] - end
        quartics[:-1, self.states, 3] += slope[:-1] + end - 2 * rise
        record[-1, 1 : 2 * n + 1] = past.record[-1, 1 : 2 * n + 1] + now[: 2 * n]
        quartics[-1, :, 0] = past.quartics()[-1, :, 0] + now[2 * n :]
        fresh = problem.start(record[-1, 1 : 2 * n + 1])
        return LateState(fresh.y, fresh.side, fresh.held, new)

    def led(self, problem: LateProblem, state: LateState, change: Array) -> LateState:
        """The same for a state that stays held where it is."""
        led = self.changed(problem, state, change)
        return replace(led, side=state.side, held=state.held) if state.is_held else led


def periods_together(problem: LateProblem, period: float) -> int:
    """Number of periods that a history takes up at most."""
    return max(1, math.ceil(problem.longest_delay / period))


def find_late_orbit(
    problem: LateProblem,
    period: float,
    tolerance: float,
    max_periods: int,
    *,
    linear: bool,
    start: LateState | None = None,
) -> Orbit:
    """Integrate from rest, or from `start`, until the motion repeats itself.

    Newton's method helps; what dry friction holds when a period begins is led to its end instead.

    linear : the laws are linear or constant, so that one correction is exact
    """
    history = History(problem)
    # the map must reach back into itself only: as many periods as the delay is long
    together = periods_together(problem, period)
    length = together * period
    state = problem.rest(np.zeros(2 * history.n)) if start is None else start
    assert state.past is not None
    values = history.values(state.past)
    operator: Array | None = None
    approach = Approach()
    before, wait, helped = np.inf, FEWEST, True
    uncorrected = (state, values)  # where a correction that did harm goes back to
    for count in range(together, max_periods + 1, together):
        run = problem.run(0.0, length, state)
        if run.status is not Status.OK:
            lost = run.status is Status.DIVERGED
            status = Status.NO_PERIODIC_RESPONSE if lost else run.status
            return Orbit(status, period, periods=count)
        end = run.end
        assert isinstance(end, LateState)
        assert end.past is not None
        new = history.values(end.past)
        scales = late_scales(problem, history, run)
        residual = new - values
        approach.see(np.abs(residual) / scales, run)
        change = approach.changes[-1]
        if operator is None and approach.is_over(tolerance):
            known = monodromy(problem, history, end, length, scales, run.steps)
            multipliers = multipliers_of(known, together)
            helpless = end.is_held or approach.was_led
            if helpless or abs(multipliers[0]) < 1.0:
                return Orbit(
                    Status.CONVERGED,
                    period,
                    problem.run(0.0, period, end),
                    error=max(approach.error, change),
                    multiplier=approach.rate,
                    multipliers=multipliers,
                    periods=count,
                )
            helped = False  # it is left to leave this orbit
            approach.forget()
        if operator is not None:
            approach.forget()
            identity = np.eye(values.size)
            slow = operator @ np.linalg.solve(identity - operator, residual)
            left = float(np.max(np.abs(slow) / scales))
            if change <= tolerance and left <= tolerance:
                if not linear:  # the operator was that of a motion nearby
                    operator = monodromy(problem, history, end, length, scales, run.steps)
                multipliers = multipliers_of(operator, together)
                if abs(multipliers[0]) < most_multiplier(run):
                    return Orbit(
                        Status.CONVERGED,
                        period,
                        problem.run(0.0, period, end),
                        error=max(change, left),
                        multiplier=float(abs(multipliers[0])),
                        multipliers=multipliers,
                        periods=count,
                    )
                operator, helped = None, False  # it is left to leave this orbit
            else:
                if FALLS * before < change < JITTER:
                    problem = sharper(problem)  # what is left may be what the steps leave
                if end.is_held or change > max(FALLS * before, 10 * tolerance):
                    operator, before, wait = None, np.inf, count + 4 * FEWEST
                    state, values = uncorrected
                    continue
                uncorrected = (end, new)
                end = history.changed(problem, end, slow)
                new = new + slow
        close = change < CLOSE and count >= wait
        due = helped and not end.is_held and (linear or close or count % SELDOM == 0)
        if operator is None and due:
            operator = monodromy(problem, history, end, length, scales, run.steps)
            before, uncorrected = np.inf, (end, new)
        else:
            before = change
            if approach.stalls():
                problem = sharper(problem)
            led = approach.lead()
            if led:
                end, new = history.led(problem, end, led * residual), new + led * residual
        state, values = end, new
    return Orbit(Status.NO_PERIODIC_RESPONSE, period, periods=max_periods)


def monodromy(
    problem: LateProblem,
    history: History,
    state: LateState,
    length: float,
    scales: Array,
    steps: int,
) -> Array:
    """Derivative of the history after `length` s with respect to that at the start.

    At a graze it is that of the motions that meet the same breaks as the one from `state`.

    steps : that a run needs to be accurate
    """
    # steps of one size make the same error in all runs, which cancels in their differences; where
    # a steep law is too fast for them, steps must adapt
    settings = problem.settings
    even = replace(
        problem, settings=replace(settings, rtol=LOOSE), longest_step=length / FINER / steps
    )

    def after(change: Array, by: LateProblem) -> tuple[Array, int]:
        run = by.run(0.0, length, history.changed(problem, state, change))
        assert isinstance(run.end, LateState)
        assert run.end.past is not None
        return history.values(run.end.past), run.events

    size, share = scales.size, PERTURBATION
    assert state.past is not None
    state = replace(state, past=state.past.refined(history.span / ROWS))
    (rough, _), (here, events) = (after(np.zeros(size), by) for by in (even, problem))
    if not np.max(np.abs(rough - here) / scales) <= RESOLVED:
        even, share = sharper(problem), COARSE
    operator = np.empty((size, size))
    for i in range(size):
        step = np.zeros(size)
        step[i] = share * scales[i]
        (ahead, met), (behind, met_behind) = after(step, even), after(-step, even)
        if met == met_behind or events not in (met, met_behind):
            change, width = ahead - behind, 2.0
        else:
            centre, _ = after(np.zeros(size), even)
            change, width = (ahead - centre if met == events else centre - behind), 1.0
        operator[:, i] = change / (width * step[i])
    return operator


def multipliers_of(operator: Array, together: int) -> NDArray[np.complex128]:
    """Floquet multipliers over one period, largest first; of several periods the root."""
    values = np.linalg.eigvals(operator).astype(complex) ** (1.0 / together)
    return np.asarray(values[np.argsort(-np.abs(values))])


def late_scales(problem: LateProblem, history: History, run: Run) -> Array:
    """Largest displacement and velocity of the run for every number of a history."""
    assert isinstance(run, LateRun)
    n = history.n
    z = max(np.abs(run.record[:, 1 : n + 1]).max(), problem.floor[0])
    v = max(np.abs(run.record[:, n + 1 : 2 * n + 1]).max(), problem.floor[1])
    states = run.whole[:, 1 + 4 * n :: 5]
    x = np.maximum(np.abs(states).max(0), SHARE_OF_INPUT * problem.state_scale)
    sizes = np.concatenate([np.repeat([z, v], n), x])
    return np.concatenate([sizes, np.tile(sizes[history.seen], DEGREE)])


def late_state(
    problem: LateProblem, motion: Callable[[Array], Samples], breaks: Array
) -> LateState:
    """State at t = 0 with the past of a known periodic motion.

    motion : samples at times in s
    breaks : times in s where a force jumps or has a corner
    """
    span = problem.longest_delay
    grid = np.linspace(-span, 0.0, PIECES + 1)
    breaks = np.concatenate([breaks, crossing_times(problem, motion, grid)])
    inside = np.sort(breaks[(breaks > -span) & (breaks < 0.0)])
    times = np.unique(np.concatenate([grid, inside]))
    times = times[np.concatenate([[True], np.diff(times) > 2 * BESIDE])]
    times[-1] = 0.0
    here, after, before = (motion(times + shift) for shift in (0.0, BESIDE, -BESIDE))
    left = np.vstack([before.acceleration[1:], after.acceleration[-1:]])
    record = np.column_stack([times, here.displacement, here.velocity, after.acceleration, left])
    length = np.append(np.diff(times), BESIDE)
    middle = motion(times + 0.5 * length)
    if here.states is not None:
        within = (times[:, None] + QUARTERS * length[:, None]).ravel()
        values = np.asarray(motion(within).states).reshape(times.size, POWERS, -1)
        quartics = np.einsum("jk,pkq->pqj", THROUGH, values)
        quartics[-1, :, 1:] = 0.0
        record = np.column_stack([record, quartics.reshape(times.size, -1)])
    sides = sides_along(problem, middle)
    held = np.full((times.size, problem.plant.gain.shape[0]), FREE)
    marks = np.column_stack([sides, held, np.zeros(times.size)]).astype(np.int64)
    ahead = [(t + d, START) for d in problem.system.delays for t in (*inside, 0.0) if t + d > 0.0]
    ahead.sort()
    past = Past(
        record, marks, np.array([t for t, _ in ahead]), np.array([q for _, q in ahead]),
        states=problem.state_scale.size,
    )  # fmt: skip
    fresh = problem.start(record[-1, 1 : 2 * problem.system.linear.size + 1])
    return LateState(fresh.y, fresh.side, fresh.held, past)


def crossing_times(problem: LateProblem, motion: Callable[[Array], Samples], times: Array) -> Array:
    """When a motion crosses the breaks of laws, in s, by bisection between these times."""
    sides = sides_along(problem, motion(times))
    row, which = np.nonzero(np.diff(sides, axis=0))
    low, high = times[row], times[row + 1]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        there = sides_along(problem, motion(middle))[np.arange(row.size), which]
        before = there == sides[row, which]
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return high


def sides_along(problem: LateProblem, samples: Samples) -> NDArray[np.int64]:
    """Side of every break, (p, b), at samples of a motion."""
    plant = problem.plant
    z = np.column_stack([samples.displacement, samples.base[0]])
    v = np.column_stack([samples.velocity, samples.base[1]])
    sides = np.ones((len(z), plant.breaks.shape[0]), dtype=np.int64)
    for j in range(plant.gain.shape[0]):
        first, second = plant.channels[j, [FIRST, SECOND]]
        for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
            p, q, value = plant.breaks[r, [ON_DISPLACEMENT, ON_VELOCITY, VALUE]]
            distance = p * (z[:, second] - z[:, first]) + q * (v[:, second] - v[:, first]) - value
            sides[:, r] = np.where(distance > 0.0, 1, -1)
    return sides


def late_multipliers(
    problem: LateProblem, state: LateState, period: float
) -> NDArray[np.complex128]:
    """Floquet multipliers of the periodic motion that starts from a state, largest first."""
    history = History(problem)
    together = periods_together(problem, period)
    run = problem.run(0.0, together * period, state)
    if run.status is not Status.OK:
        return np.full(1, np.nan + 0j)
    scales = late_scales(problem, history, run)
    operator = monodromy(problem, history, state, together * period, scales, run.steps)
    return multipliers_of(operator, together)
