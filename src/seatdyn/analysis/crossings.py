"""Values of one parameter at which a pole lies on the imaginary axis.

A parameter theta that enters by a rank-one term has a pole at s where

    theta = theta_0 - 1/g(s),     g(s) = s^order r' (M s^2 + C s + K)^-1 l     (matrices at theta_0)

(matrix determinant lemma). At s = i w theta must come out real, which is the eigenvalue problem
theta(s) = theta(-s); no polynomial is formed. What comes out is held against eigenvalues at points
of every interval between the values; where these contradict, the missing value is bisected.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.characteristic import Matrices
from seatdyn.analysis.linear import (
    Array,
    ComplexArray,
    companion,
    natural_rate,
    on_left,
    quadratic_eigenvalues,
)
from seatdyn.errors import RequestError
from seatdyn.model.system import RankOne

NEAR_AXIS = 1e-3  # how far, relatively, an eigenvalue may be off the axis to be tried as crossing
NEWTON_STEPS = 40
SETTLED = 1e-7  # relative update below which Newton's method counts as settled
TRUSTED = 1e-10  # real parts beyond this fraction of the largest pole are no rounding
EPS = float(np.finfo(float).eps)
# where the poles are counted between two values, as fractions of their distance
INSIDE = np.array([1e-9, 1e-6, 1e-3, 0.03, 0.2, 0.5, 0.8, 0.97, 1 - 1e-3, 1 - 1e-6, 1 - 1e-9])
BEYOND = np.array([1e-9, 1e-6, 1e-3, 0.03, 0.2, 1.0, 10.0, 1e3])  # the same without an upper end


class Crossing(NamedTuple):
    """A value theta with a pole at i rate, and the rounding error of theta."""

    value: float
    rate: float
    error: float


def crossings(
    matrices: Matrices, term: RankOne, low: float, high: float
) -> tuple[Array, Array, NDArray[np.int_]]:
    """Sorted values in (low, high) with a pole on the axis, its rates, unstable poles between.

    `matrices` are M, C, K at `term.value`. The counts are one more than the values: from low to
    the first, between, and from the last to high.

    Raises
    ------
    RequestError
        Eigenvalues say that a value is missing, and it cannot be found.
    """
    found: list[Crossing] = []
    for w in _candidates(matrices, term):
        _add(found, _polish(matrices, term, w, float(term.value)), low, high)
    most = len(found) + 4 * len(matrices[0]) + 2  # theta(s) = theta(-s) has fewer solutions
    while True:
        values = np.array([crossing.value for crossing in found])
        counts, missing = _counts(matrices, term, np.concatenate([[low], values, [high]]))
        if missing is None:
            return values, np.array([crossing.rate for crossing in found]), counts
        new = _bisected(matrices, term, *missing)
        if not _add(found, new, low, high) or len(found) > most:
            raise RequestError(
                "The critical values cannot be told from rounding: the number of unstable poles "
                f"changes between {min(missing):.10g} and {max(missing):.10g} {term.unit} without "
                "one. Search a narrower range, or check the size of the other parameters."
            )


def _add(found: list[Crossing], new: Crossing | None, low: float, high: float) -> bool:
    """Insert in order what is inside (low, high) beyond rounding and not there yet."""
    if new is None or not low + new.error < new.value < high - new.error:
        return False
    for old in found:  # one crossing may be reached from several candidates
        near = 1e-9 * abs(old.value) + old.error + new.error
        if abs(new.value - old.value) <= near and abs(new.rate - old.rate) <= 1e-9 * old.rate:
            return False
    found.append(new)
    found.sort()
    return True


def _poles(matrices: Matrices, term: RankOne, values: Array) -> ComplexArray:
    stack = list(matrices)
    index = 2 - term.order  # matrices are in falling order: M, C, K
    change = (values - term.value)[:, None, None]
    stack[index] = stack[index] + change * np.outer(term.left, term.right)
    return np.asarray(np.linalg.eigvals(companion(*stack)))


def _counts(
    matrices: Matrices, term: RankOne, edges: Array
) -> tuple[NDArray[np.int_], tuple[float, float] | None]:
    """Unstable poles between the edges, and two points where they contradict, if there are any.

    In each interval poles are counted at many points, with bounds for what rounding may hide. The
    count returned is that at the point whose poles keep the largest distance from the axis.
    """
    counts = np.empty(edges.size - 1, dtype=int)
    for i, (low, high) in enumerate(pairwise(edges)):
        if np.isfinite(high):
            points = low + INSIDE * (high - low)
        else:
            points = low + BEYOND * (abs(low) + _scale(matrices, term))
        points = points[(points > low) & (points < high)]
        if points.size == 0:  # neighbouring numbers
            points = np.array([(low + high) / 2.0])
        poles = _poles(matrices, term, points)
        radius = np.abs(poles).max(axis=1, keepdims=True)
        best = int(np.argmax(np.min(np.abs(poles.real) / radius, axis=1)))
        counts[i] = np.sum(~on_left(poles.real, radius)[best])
        least = np.sum(poles.real > TRUSTED * radius, axis=1)
        most = np.sum(poles.real > -TRUSTED * radius, axis=1)
        more, fewer = int(np.argmax(least)), int(np.argmin(most))
        if least[more] > most[fewer]:
            return counts, (float(points[more]), float(points[fewer]))
    return counts, None


def _bisected(matrices: Matrices, term: RankOne, more: float, fewer: float) -> Crossing:
    """Where a pole crosses between a point with more and one with fewer unstable poles."""
    many = int(np.sum(_poles(matrices, term, np.array([more])).real > 0.0))
    ends = min(more, fewer), max(more, fewer)
    while True:
        middle = more + (fewer - more) / 2.0
        poles = _poles(matrices, term, np.array([middle]))[0]
        if middle in (more, fewer):
            break
        if np.sum(poles.real > 0.0) >= many:
            more = middle
        else:
            fewer = middle
    w = float(abs(poles[np.argmin(np.abs(poles.real))].imag))
    polished = _polish(matrices, term, w, middle)
    if polished is not None and ends[0] < polished.value < ends[1]:
        return polished
    return Crossing(middle, w, EPS * (abs(middle) + _scale(matrices, term)))


def _scale(matrices: Matrices, term: RankOne) -> float:
    """Size of theta that weighs as much as what its matrix holds at present."""
    entry = np.linalg.norm(term.left) * np.linalg.norm(term.right)
    return float(np.linalg.norm(matrices[2 - term.order]) / entry) or 1.0


def _candidates(matrices: Matrices, term: RankOne) -> list[float]:
    """Rates w > 0 at which theta(i w) may be real, and 0 for a stiffness.

    With x = P(s)^-1 l u and y = P(-s)^-1 l u, theta(s) = theta(-s) says
    s^order r' x = (-s)^order r' y.
    """
    n = len(matrices[0])
    pencil = np.zeros((3, 2 * n + 1, 2 * n + 1))
    for order, matrix in zip((2, 1, 0), matrices, strict=True):
        mirror = -1.0 if order == 1 else 1.0
        e = pencil[order]
        e[:n, :n], e[n:-1, n:-1] = matrix, mirror * matrix
        if order == term.order:
            e[-1, :n], e[-1, n:-1] = term.right, -mirror * term.right
    pencil[0, :n, -1] = pencil[0, n:-1, -1] = -term.left
    s = quadratic_eigenvalues(pencil[2], pencil[1], pencil[0])
    near = (s.imag > 0.0) & (np.abs(s.real) <= NEAR_AXIS * np.abs(s))
    return sorted(s[near].imag) + ([0.0] if term.order == 0 else [])


def _polish(matrices: Matrices, term: RankOne, w: float, theta: float) -> Crossing | None:
    """Newton's method for theta real and a pole at i w; None where it does not settle.

    h = -1/g is the change of theta that puts a pole at s. It is taken at the latest theta, where
    it is nearly zero, by the Rayleigh quotient of the two null vectors in extended precision, so
    that the result is as good as the matrices. The updates fall down to rounding, which may be
    large against theta itself; the iterate after the smallest is kept.
    """
    mass, damping, stiffness = matrices
    outer = np.outer(term.left, term.right)
    wide = [matrix.astype(np.longdouble) for matrix in matrices]
    slowest = 1e-12 * natural_rate(mass, stiffness)
    size, least = _scale(matrices, term), np.inf
    best: Crossing | None = None
    for _ in range(NEWTON_STEPS):
        shifted = list(wide)
        shifted[2 - term.order] = shifted[2 - term.order] + (
            np.longdouble(theta) - np.longdouble(term.value)
        ) * outer.astype(np.longdouble)
        s = np.clongdouble(1j * w)
        p = shifted[2] + s * shifted[1] + s**2 * shifted[0]
        slope = shifted[1] + 2 * s * shifted[0]
        try:
            x = np.linalg.solve(p.astype(complex), term.left.astype(complex))
            y = np.linalg.solve(p.astype(complex).T, term.right.astype(complex))
        except np.linalg.LinAlgError:  # a pole exactly at i w
            return best or Crossing(theta, abs(w), 4 * len(mass) * EPS * (abs(theta) + size))
        power = np.array([1.0, s, s**2])[term.order]
        rise = np.array([0.0, 1.0, 2.0 * s])[term.order]
        with np.errstate(all="ignore"):
            gx = term.right @ x
            g = power * gx
            h = -(y @ p @ x) / (g * (y @ term.left))
            dh = (rise * gx - power * (y @ slope @ x)) / g**2
            dw = 0.0 if w == 0.0 else -h.imag / dh.real
            dtheta = h.real - dh.imag * dw
            # x and y are null vectors up to size: what rounding of the matrices does to theta
            terms = abs(mass) * w**2 + abs(damping) * abs(w) + abs(stiffness)
            terms = terms + abs(theta - term.value) * abs(power) * abs(outer)
            size = float((abs(y) @ terms @ abs(x) / abs(g * gx)).real)
            update = float(abs(dtheta) / (abs(theta + dtheta) + size) + (abs(dw / w) if w else 0.0))
        if not np.isfinite(update):
            break
        w, theta = float(w + dw), float(theta + dtheta)
        if update < least:
            least, best = update, Crossing(theta, abs(w), 4 * len(mass) * EPS * size)
        elif least < SETTLED:
            break
    # a pole at zero belongs to a stiffness alone, where it is tried on its own
    if best is None or least > SETTLED or 0.0 < best.rate < slowest:
        return None
    return best
