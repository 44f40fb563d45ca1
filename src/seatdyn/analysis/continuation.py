"""Branches of periodic motions by pseudo-arclength continuation of the period map.

A periodic motion is a fixed point y = P(y, p) of the map over one period, p the parameter. Along
the branch both are unknown; the step is measured along the branch, so folds are points like
others (Keller 1977). P and its derivatives come from time integration, which locates jumps and
kinks of forces; eigenvalues of dP/dy are the Floquet multipliers, so every point knows its
stability. At a graze, where a motion begins to touch a break of a law, dP/dy leaps: the branch has
a corner there, and a multiplier that is found on the other side of 1 has not passed it. Where
forces act late, y is a piece of history (`period_map`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.period_map import Period, one_sided, period_map
from seatdyn.analysis.run import Run, Settings
from seatdyn.analysis.steady import extrema, find_orbit, require_period
from seatdyn.errors import Status
from seatdyn.model.excitation import Excitation
from seatdyn.model.system import SeatSystem

Array = NDArray[np.float64]
Make = Callable[[float], tuple[SeatSystem, Excitation]]

SETTINGS = Settings(rtol=1e-10)
TOLERANCE = 1e-8  # of the fixed point, relative to the largest motion
FAST = 0.3  # fall of the residual that lets Broyden's update go on
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.01, 0.03, 1e-6  # along the branch, range of p = 1
MOST_ITERATIONS = 8
FEW_ITERATIONS = 3  # let the step grow
SHARPEST_TURN = 0.92  # cosine of the angle between tangents of neighbours
MOST_POINTS = 5000
LOCATED = 1e-7  # of the place of a special point along the branch
LEAP = 1e-2  # of a multiplier, within that: no smooth map does it
APART = 10.0  # times as far from each other as they should be: not on the same branch
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
    """A fold, a corner or a change of stability."""

    kind: str  # fold, period doubling, Neimark-Sacker, branch point, graze, break
    point: Point


@dataclass
class Branch:
    """Points in order along a branch, special points, and how it ended."""

    points: list[Point] = field(default_factory=list)
    special: list[Special] = field(default_factory=list)
    status: Status = Status.OK
    message: str = ""


class _Near(NamedTuple):
    """A run near the one that is looked for, and derivatives that hold there."""

    period: Period
    run: Run
    jacobian: Array  # (K, K + 1) of P - y in scaled variables, K numbers of y


class _Solved(NamedTuple):
    """A solution of the bordered equations, with its derivatives."""

    u: Array
    near: _Near
    iterations: int


class _At(NamedTuple):
    """A solution and what is kept of it."""

    solved: _Solved
    point: Point


class Tracer:
    """Follows one branch of `make(p)` over start .. stop."""

    def __init__(self, make: Make, start: float, stop: float) -> None:
        """Keep the family and its range."""
        self.make, self.start, self.span = make, start, stop - start
        self.scales = np.zeros(0)

    def period(self, value: float) -> Period:
        """One period of the system at a value of the parameter."""
        system, excitation = self.make(value)
        return period_map(system, excitation, require_period(excitation), SETTINGS)

    def value(self, u: Array) -> float:
        """Parameter of scaled unknowns u = [y / scales, (p - start) / span]."""
        return float(self.start + self.span * u[-1])

    def residual(self, u: Array, period: Period, run: Run) -> Array:
        """Scaled change of the numbers over the period."""
        return np.asarray(period.end(run) / self.scales - u[:-1])

    def derivatives(self, u: Array, period: Period, run: Run) -> Array:
        """Derivatives of the residual by every unknown, (K, K + 1)."""
        y = u[:-1] * self.scales

        def moved(share: float) -> tuple[Run, Array]:
            there = np.append(u[:-1], u[-1] + share)
            other = self.period(self.value(there))
            beside = other.run(y, run)
            return beside, self.residual(there, other, beside)

        by_y = period.differences(y, run, self.scales) - np.eye(y.size)
        by_p = one_sided(moved, run, self.residual(u, period, run))
        return np.column_stack([by_y, by_p])

    def solve(self, guess: Array, near: _Near, normal: Array) -> _Solved | None:
        """Point of the branch in the plane through `guess` with this normal, near `guess`.

        Newton's method that begins with the derivatives of a neighbour, improves them by Broyden's
        update, and takes new ones where that is slow.
        """
        u, before, fresh = guess.copy(), math.inf, False
        run, jacobian, breaks = near.run, near.jacobian, near.run.events
        step, residual = np.zeros_like(u), np.zeros(u.size - 1)
        for iteration in range(1, MOST_ITERATIONS + 1):
            period = self.period(self.value(u))
            run = period.run(u[:-1] * self.scales, run)
            if run.status is not Status.OK:
                return None
            new = self.residual(u, period, run)
            size = float(np.max(np.abs(new)))
            if size <= TOLERANCE:
                found = _Near(period, run, self.derivatives(u, period, run))
                return _Solved(u, found, iteration)
            if iteration > 1 and size > FAST * before and (not fresh or run.events != breaks):
                jacobian, fresh, breaks = self.derivatives(u, period, run), True, run.events
            elif iteration > 1 and size <= before:
                defect = new - residual - jacobian @ step
                jacobian = jacobian + np.outer(defect, step) / (step @ step)
            elif iteration > 1:
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
        period, run, jacobian = solved.near
        derivatives = jacobian[:, :-1] + np.eye(jacobian.shape[0])
        multipliers = period.multipliers(derivatives)
        return Point(
            self.value(solved.u),
            run.record[0, 1 : 1 + run.end.y.size],
            multipliers,
            tangent,
            *extrema(run),
        )


def trace(make: Make, start: float, stop: float) -> Branch:
    """Branch of periodic motions through the stable one at `start`, until p leaves the range.

    A branch can end inside the range, as where a motion begins to touch a jump of a force: there
    its derivatives have no bound. The place is a special point, "break". The curve goes on with the
    stable motion that time integration reaches a hundredth of the range (or twice, four times that)
    beyond all that was found before, followed both on and back to the break.

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
        furthest = max((point.value - start) / tracer.span for point in branch.points)
        if furthest + gap > 1.0:
            break
        more = _from_rest(tracer, start + (furthest + gap) * tracer.span, back_to=last.value)
        if not more.points:
            gap *= 2
            continue
        gap = GAP
        branch.special += [Special("break", last), *more.special]
        branch.points += more.points
        branch.status, branch.message = more.status, more.message
    return branch


def _from_rest(tracer: Tracer, value: float, back_to: float | None = None) -> Branch:
    """Branch through the stable motion that is reached from rest at a value of the parameter.

    back_to : where to begin, if the branch reaches back so far; else it begins at `value`
    """
    _, excitation = tracer.make(value)
    period = tracer.period(value)
    orbit = find_orbit(period.problem, excitation, START_TOLERANCE, START_PERIODS)
    if orbit.status is not Status.CONVERGED or orbit.run is None:
        return Branch(status=orbit.status, message=f"At {value:.6g}: {orbit.status.message}")
    tracer.scales = scales = period.scales(orbit.run)
    u = np.append(period.end(orbit.run) / scales, (value - tracer.start) / tracer.span)
    along = np.eye(u.size)[-1]
    run = period.run(u[:-1] * scales, orbit.run)
    solved = tracer.solve(u, _Near(period, run, tracer.derivatives(u, period, run)), along)
    if solved is None:
        message = f"No motion was found at {value:.6g} that can be followed."
        return Branch(status=Status.NOT_CONVERGED, message=message)
    tangent = tracer.tangent(solved.near.jacobian, along)
    branch = _follow(tracer, solved, tangent)
    if back_to is not None:
        tracer.scales = scales
        back = _follow(tracer, solved, -tangent, (back_to - tracer.start) / tracer.span)
        reversed_points = [point._replace(tangent=-point.tangent) for point in back.points[:0:-1]]
        branch.points = reversed_points + branch.points
        branch.special = back.special[::-1] + branch.special
    return branch


def _follow(tracer: Tracer, solved: _Solved, tangent: Array, low: float = 0.0) -> Branch:
    """March with steps as long as bends allow to the end of the range, or below `low` (scaled)."""
    branch = Branch(points=[tracer.point(solved, tangent)])
    length = FIRST_STEP
    while len(branch.points) < MOST_POINTS:
        if length < SHORTEST_STEP:
            branch.status = Status.NOT_CONVERGED
            branch.message = (
                f"The branch was lost at {tracer.value(solved.u):.6g}: no neighbour was found "
                "however short the step."
            )
            return branch
        found = _advance(tracer, solved, tangent, length)
        if found is None:
            length /= 2
            continue
        new, direction = found
        beyond = new.u[-1] > 1.0 or new.u[-1] < low
        if beyond:  # the last point is that on the end of the range
            edge = 1.0 if new.u[-1] > 1.0 else low
            share = (edge - solved.u[-1]) / (new.u[-1] - solved.u[-1])
            guess = solved.u + share * (new.u - solved.u)
            guess[-1] = edge
            last = tracer.solve(guess, new.near, np.eye(guess.size)[-1])
            if last is None:
                length /= 2
                continue
            new, direction = last, tracer.tangent(last.near.jacobian, direction)
        point = tracer.point(new, direction)
        left = _At(solved, branch.points[-1]._replace(tangent=tangent))
        right = _At(new, point)
        change = _change(left, right)
        if change:
            special = _special(tracer, left, right, change)
            if special is None:
                length /= 2
                continue
            branch.special.append(special)
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
    new = tracer.solve(solved.u + length * tangent, solved.near, tangent)
    if new is None:
        return None
    direction = tracer.tangent(new.near.jacobian, tangent)
    bends = direction @ tangent < SHARPEST_TURN
    return None if bends and new.near.run.events == solved.near.run.events else (new, direction)


def _rescaled(tracer: Tracer, solved: _Solved, tangent: Array) -> tuple[_Solved, Array]:
    """The same in units of the larger motion, where it has grown."""
    period, run, jacobian = solved.near
    scales = np.maximum(tracer.scales, period.scales(run))
    ratio = tracer.scales / scales
    tracer.scales = scales
    u = np.append(solved.u[:-1] * ratio, solved.u[-1])
    direction = np.append(tangent[:-1] * ratio, tangent[-1])
    jacobian = np.column_stack([jacobian[:, :-1] * ratio[:, None] / ratio, jacobian[:, -1] * ratio])
    return solved._replace(u=u, near=_Near(period, run, jacobian)), direction / np.linalg.norm(
        direction
    )


def _change(left: _At, right: _At) -> str:
    """What happens between two neighbours: "corner", "fold", "stability", or nothing."""
    for change in ("corner", "fold", "stability"):
        if change == "corner" and not _is_corner(left.point, right.point):
            continue
        if _side(left, change) != _side(right, change):
            return change
    return ""


def _is_corner(before: Point, after: Point) -> bool:
    """Whether the branch turns more between two points than neighbours may."""
    return bool(before.tangent @ after.tangent < SHARPEST_TURN)


def _side(at: _At, change: str) -> float:
    """What has another value behind a change."""
    if change == "corner":  # only a graze makes one
        return at.solved.near.run.events
    return np.sign(at.point.tangent[-1]) if change == "fold" else at.point.unstable_count


def _special(tracer: Tracer, left: _At, right: _At, change: str) -> Special | None:
    """The change between two neighbours, located by bisection.

    None where the branch is not continuous there: one of them is on another branch.
    """
    chord = right.solved.u - left.solved.u
    length = width = float(np.linalg.norm(chord))
    before, after, low, gap = left, right, 0.0, width
    while width > LOCATED and not (gap > APART * width and _leaps(before, after, change)):
        guess = left.solved.u + (low + 0.5 * width / length) * chord
        ways = (tracer.solve(guess, at.solved.near, chord / length) for at in (before, after))
        middle = next((solved for solved in ways if solved is not None), None)
        if middle is None:
            break
        width *= 0.5
        tangent = tracer.tangent(middle.near.jacobian, chord / length)
        at = _At(middle, tracer.point(middle, tangent))
        if _side(at, change) == _side(left, change):
            before, low = at, low + width / length
        else:
            after = at
        gap = float(np.linalg.norm(after.solved.u - before.solved.u))
    leaps = _leaps(before, after, change)
    if leaps and (width > LOCATED or gap > APART * width):
        return None
    if left.point.tangent[-1] * right.point.tangent[-1] < 0.0:
        return Special("fold", after.point)
    if leaps:
        return Special("graze", after.point)
    return None if change == "corner" else Special(_kind(left.point, after.point), after.point)


def _leaps(before: _At, after: _At, change: str) -> bool:
    """Whether the branch's direction or the multiplier that passes 1 differs between neighbours.

    At a branch point the direction does on a smooth branch, too, for want of digits.
    """
    old, new = before.point, after.point
    if change == "corner":
        return _is_corner(old, new)
    which = min(old.unstable_count, new.unstable_count, old.multipliers.size - 1)
    return bool(abs(abs(new.multipliers[which]) - abs(old.multipliers[which])) > LEAP)


def _kind(before: Point, after: Point) -> str:
    """What a multiplier does that leaves or enters the unit circle."""
    changed = abs(after.unstable_count - before.unstable_count)
    near = after.multipliers[np.argmin(np.abs(np.abs(after.multipliers) - 1.0))]
    if changed >= 2 and abs(near.imag) > 1e-6:
        return "Neimark-Sacker"
    return "period doubling" if near.real < 0.0 else "branch point"
