"""Branches of periodic motions by pseudo-arclength continuation of the period map.

A periodic motion is a fixed point y = P(y, p) of the map over one period, p the parameter. Along
the branch both are unknown; the step is measured along the branch, so folds are points like
others (Keller 1977). P and its derivatives come from time integration, which locates jumps and
kinks of forces; eigenvalues of dP/dy are the Floquet multipliers, so every point knows its
stability.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.run import Problem, Run, Settings
from seatdyn.analysis.steady import extrema, find_orbit, orbit_scales
from seatdyn.errors import RequestError, Status
from seatdyn.model.excitation import Excitation
from seatdyn.model.system import SeatSystem, refuse_delays

Array = NDArray[np.float64]
Make = Callable[[float], tuple[SeatSystem, Excitation]]

SETTINGS = Settings(rtol=1e-10)
TOLERANCE = 1e-8  # of the fixed point, relative to the largest motion
PERTURBATION = 1e-5  # of differences, relative
FAST = 0.3  # fall of the residual that lets Broyden's update go on
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.01, 0.03, 1e-6  # along the branch, range of p = 1
MOST_ITERATIONS = 8
FEW_ITERATIONS = 3  # let the step grow
SHARPEST_TURN = 0.92  # cosine of the angle between tangents of neighbours
MOST_POINTS = 5000
REFINEMENTS = 30  # of a special point
LOCATED = 1e-7  # of its place along the branch
START_TOLERANCE, START_PERIODS = 1e-8, 5000
GAP = 0.01  # of the range, left out where a branch ends; doubled until a motion is found


class Point(NamedTuple):
    """A periodic motion on a branch."""

    value: float  # of the parameter
    y: Array  # state at t = 0
    multipliers: NDArray[np.complex128]
    tangent: Array  # (2N + 1,) direction of the branch in scaled variables
    maximum: dict[str, float]
    minimum: dict[str, float]

    @property
    def stable(self) -> bool:
        """Whether small disturbances die out."""
        return bool(np.all(np.abs(self.multipliers) < 1.0))

    @property
    def unstable_count(self) -> int:
        """Number of multipliers outside the unit circle."""
        return int(np.sum(np.abs(self.multipliers) >= 1.0))


class Special(NamedTuple):
    """A fold or a change of stability."""

    kind: str  # fold, period doubling, Neimark-Sacker, branch point, break
    point: Point


@dataclass
class Branch:
    """Points in order along a branch, special points, and how it ended."""

    points: list[Point] = field(default_factory=list)
    special: list[Special] = field(default_factory=list)
    status: Status = Status.OK
    message: str = ""


class _Solved(NamedTuple):
    """A solution of the bordered equations, with its derivatives."""

    u: Array
    run: Run
    jacobian: Array  # (2N, 2N + 1) of P - y in scaled variables
    iterations: int


class Tracer:
    """Follows one branch of `make(p)` over start .. stop."""

    def __init__(self, make: Make, start: float, stop: float) -> None:
        """Keep the family and its range."""
        self.make, self.start, self.span = make, start, stop - start
        self.scales = np.zeros(0)

    def problem(self, value: float) -> tuple[Problem, float]:
        """The system at a value of the parameter, and its period."""
        system, excitation = self.make(value)
        if excitation.period is None:
            raise RequestError(
                f"{type(excitation).__name__} has no period; a curve of periodic motions needs one."
            )
        return Problem.make(system, excitation.motion, SETTINGS), excitation.period

    def value(self, u: Array) -> float:
        """Parameter of scaled unknowns u = [y / scales, (p - start) / span]."""
        return float(self.start + self.span * u[-1])

    def run(self, u: Array, problem: Problem, period: float) -> Run:
        """One period from the state of u."""
        return problem.run(0.0, period, problem.start(u[:-1] * self.scales))

    def residual(self, u: Array, run: Run) -> Array:
        """Scaled change of the state over the period."""
        return np.asarray(run.end.y / self.scales - u[:-1])

    def derivatives(self, u: Array, run: Run, problem: Problem, period: float) -> Array:
        """Differences of the residual by every unknown, (2N, 2N + 1)."""
        base = self.residual(u, run)
        columns = []
        for i in range(u.size):
            moved = u.copy()
            moved[i] += PERTURBATION
            if i == u.size - 1:
                problem, period = self.problem(self.value(moved))
            other = self.run(moved, problem, period)
            columns.append((self.residual(moved, other) - base) / PERTURBATION)
        return np.column_stack(columns)

    def solve(self, guess: Array, jacobian: Array, normal: Array) -> _Solved | None:
        """Point of the branch in the plane through `guess` with this normal, near `guess`.

        Newton's method that begins with the derivatives of a neighbour, improves them by Broyden's
        update, and takes new ones where that is slow.
        """
        u, before, fresh = guess.copy(), math.inf, False
        step, residual = np.zeros_like(u), np.zeros(u.size - 1)
        for iteration in range(1, MOST_ITERATIONS + 1):
            problem, period = self.problem(self.value(u))
            run = self.run(u, problem, period)
            if run.status is not Status.OK:
                return None
            new = self.residual(u, run)
            size = float(np.max(np.abs(new)))
            if size <= TOLERANCE:
                jacobian = self.derivatives(u, run, problem, period)
                return _Solved(u, run, jacobian, iteration)
            if iteration > 1 and size <= FAST * before:
                defect = new - residual - jacobian @ step
                jacobian = jacobian + np.outer(defect, step) / (step @ step)
            elif iteration > 1 and not fresh:
                jacobian, fresh = self.derivatives(u, run, problem, period), True
            elif iteration > 1 and size > before:
                return None
            before, residual = size, new
            bordered = np.vstack([jacobian, normal])
            aim = -np.append(new, normal @ (u - guess))
            step = np.asarray(np.linalg.solve(bordered, aim), dtype=float)
            u = u + step
        return None

    def tangent(self, jacobian: Array, along: Array) -> Array:
        """Unit direction of the branch, forwards in the sense of `along`."""
        bordered = np.vstack([jacobian, along])
        direction = np.linalg.solve(bordered, np.append(np.zeros(jacobian.shape[0]), 1.0))
        return np.asarray(direction / np.linalg.norm(direction))

    def point(self, solved: _Solved, tangent: Array) -> Point:
        """What is kept of a solution."""
        matrix = solved.jacobian[:, :-1] + np.eye(solved.jacobian.shape[0])
        values = np.linalg.eigvals(matrix).astype(complex)
        order = np.argsort(-np.abs(values))
        high, low = extrema(solved.run)
        y = solved.u[:-1] * self.scales
        return Point(self.value(solved.u), y, values[order], tangent, high, low)


def trace(make: Make, start: float, stop: float) -> Branch:
    """Branch of periodic motions through the stable one at `start`, until p leaves the range.

    A branch can end inside the range, as where a motion begins to touch a jump of a force: there
    its derivatives have no bound. It goes on with the stable motion that time integration reaches
    a hundredth of the range further (or twice, four times that), and the place is a special point,
    "break".

    Parameters
    ----------
    make : gives system and periodic excitation for a value of the parameter
    start, stop : range of the parameter; `start` may exceed `stop`

    Returns
    -------
    Branch
        Without points where there is no stable periodic motion at `start`; its `status` says why.
    """
    tracer = Tracer(make, start, stop)
    branch, gap = _from_rest(tracer, start), GAP
    while branch.status is Status.NOT_CONVERGED and branch.points:
        last = branch.points[-1]
        beyond = last.value + math.copysign(gap, last.tangent[-1]) * tracer.span
        if not 0.0 <= (beyond - start) / tracer.span <= 1.0:
            break
        more = _from_rest(tracer, beyond)
        if not more.points:
            gap *= 2
            continue
        gap = GAP
        branch.special += [Special("break", last), *more.special]
        branch.points += more.points
        branch.status, branch.message = more.status, more.message
    return branch


def _from_rest(tracer: Tracer, value: float) -> Branch:
    """Branch through the stable motion that is reached from rest at a value of the parameter."""
    system, excitation = tracer.make(value)
    refuse_delays(system.delays)
    problem, period = tracer.problem(value)
    orbit = find_orbit(problem, excitation, START_TOLERANCE, START_PERIODS)
    if orbit.status is not Status.CONVERGED or orbit.run is None:
        return Branch(status=orbit.status, message=f"At {value:.6g}: {orbit.status.message}")
    tracer.scales = orbit_scales(problem, orbit.run)
    u = np.append(orbit.run.end.y / tracer.scales, (value - tracer.start) / tracer.span)
    along = np.eye(u.size)[-1]
    guess = tracer.derivatives(u, tracer.run(u, problem, period), problem, period)
    solved = tracer.solve(u, guess, along)
    if solved is None:
        message = f"No motion was found at {value:.6g} that can be followed."
        return Branch(status=Status.NOT_CONVERGED, message=message)
    return _follow(tracer, solved, tracer.tangent(solved.jacobian, along))


def _follow(tracer: Tracer, solved: _Solved, tangent: Array) -> Branch:
    """March along the branch, with steps as long as its bends allow."""
    branch = Branch(points=[tracer.point(solved, tangent)])
    length = FIRST_STEP
    while len(branch.points) < MOST_POINTS:
        found = _advance(tracer, solved, tangent, length)
        if found is None:
            length /= 2
            if length < SHORTEST_STEP:
                branch.status = Status.NOT_CONVERGED
                branch.message = (
                    f"The branch was lost at {tracer.value(solved.u):.6g}: no neighbour was found "
                    "however short the step."
                )
                return branch
            continue
        new, direction = found
        beyond = new.u[-1] > 1.0 or new.u[-1] < 0.0
        if beyond:  # the last point is that on the end of the range
            edge = 1.0 if new.u[-1] > 1.0 else 0.0
            share = (edge - solved.u[-1]) / (new.u[-1] - solved.u[-1])
            guess = solved.u + share * (new.u - solved.u)
            guess[-1] = edge
            last = tracer.solve(guess, new.jacobian, np.eye(guess.size)[-1])
            if last is None:
                length /= 2
                continue
            new, direction = last, tracer.tangent(last.jacobian, direction)
        point = tracer.point(new, direction)
        special = _special_between(tracer, solved, branch.points[-1], new, point)
        branch.special += [special] if special else []
        branch.points.append(point)
        if beyond:
            return branch
        if new.iterations <= FEW_ITERATIONS:
            length = min(1.5 * length, LONGEST_STEP)
        # the largest motion so far measures all of the branch that follows
        solved, tangent = _rescaled(tracer, new, direction)
    branch.status, branch.message = Status.STEP_LIMIT, f"More than {MOST_POINTS} points."
    return branch


def _advance(
    tracer: Tracer, solved: _Solved, tangent: Array, length: float
) -> tuple[_Solved, Array] | None:
    """The point one step further and its tangent; None where the step is too long."""
    new = tracer.solve(solved.u + length * tangent, solved.jacobian, tangent)
    if new is None:
        return None
    direction = tracer.tangent(new.jacobian, tangent)
    return (new, direction) if direction @ tangent >= SHARPEST_TURN else None


def _rescaled(tracer: Tracer, solved: _Solved, tangent: Array) -> tuple[_Solved, Array]:
    """The same in units of the larger motion, where it has grown."""
    system, run = solved.run.problem, solved.run
    scales = np.maximum(tracer.scales, orbit_scales(system, run))
    ratio = tracer.scales / scales
    tracer.scales = scales
    u = np.append(solved.u[:-1] * ratio, solved.u[-1])
    direction = np.append(tangent[:-1] * ratio, tangent[-1])
    jacobian = np.column_stack(
        [solved.jacobian[:, :-1] * ratio[:, None] / ratio, solved.jacobian[:, -1] * ratio]
    )
    return solved._replace(u=u, jacobian=jacobian), direction / np.linalg.norm(direction)


def _special_between(
    tracer: Tracer, left: _Solved, at_left: Point, right: _Solved, at_right: Point
) -> Special | None:
    """The fold or change of stability between two neighbours, located by bisection."""
    fold = at_left.tangent[-1] * at_right.tangent[-1] < 0.0
    if not fold and at_left.unstable_count == at_right.unstable_count:
        return None

    def passed(point: Point) -> bool:
        if fold:
            return bool(point.tangent[-1] * at_left.tangent[-1] < 0.0)
        return point.unstable_count != at_left.unstable_count

    low, high, best = 0.0, 1.0, at_right
    chord = right.u - left.u
    normal = chord / np.linalg.norm(chord)
    for _ in range(REFINEMENTS):
        if (high - low) * np.linalg.norm(chord) <= LOCATED:
            break
        share = (low + high) / 2
        middle = tracer.solve(left.u + share * chord, left.jacobian, normal)
        if middle is None:
            break
        point = tracer.point(middle, tracer.tangent(middle.jacobian, normal))
        if passed(point):
            high, best = share, point
        else:
            low = share
    return Special("fold" if fold else _kind(at_left, best), best)


def _kind(before: Point, after: Point) -> str:
    """What a multiplier does that leaves or enters the unit circle."""
    changed = abs(after.unstable_count - before.unstable_count)
    near = after.multipliers[np.argmin(np.abs(np.abs(after.multipliers) - 1.0))]
    if changed >= 2 and abs(near.imag) > 1e-6:
        return "Neimark-Sacker"
    return "period doubling" if near.real < 0.0 else "branch point"
