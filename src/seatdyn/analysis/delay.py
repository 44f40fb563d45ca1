"""Characteristic roots of a linear system with delayed forces.

    det D(s) = 0,   D(s) = M s^2 + C s + K + sum over delays of exp(-s tau) (K_tau + s C_tau)

(see `pencil`) has infinitely many roots, of which finitely many lie to the right of any vertical
line. A delayed force sees few signals w = R y of the state y, displacements, velocities and states
of elements (one signal, for a suspension). Its past w(t + theta), -tau <= theta <= 0, is carried
along by u_t = u_theta; collocated in Chebyshev points that is a matrix, whose eigenvalues converge
to the roots faster than any power of the number of points (Breda, Maset and Vermiglio, SIAM J. Sci.
Comput. 27 (2005) 482). They are starting values: each root is then found by Newton's method on D
itself, and their number is held against the argument principle, so that none is missing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.linear import Array, ComplexArray
from seatdyn.analysis.pencil import Pencil, state_columns
from seatdyn.errors import RequestError
from seatdyn.model.system import LinearModel

FEWEST_POINTS, MOST_POINTS = 16, 1024  # of a delay
NEWTON_STEPS = 12
SETTLED = 1e-12  # last relative change of a root
TOGETHER = 1e-5  # roots this near to each other, relatively, are one multiple root
GAP = 1e-6  # relative distance of real parts between which the line of the count may lie
LARGEST_EXPONENT = 300.0  # of exp(-s tau) on that line
TURN = 0.5  # largest estimated change of the logarithm between neighbours on the line
MOST_SAMPLES = 2_000_000


def rightmost_roots(model: LinearModel, count: int | None = None) -> tuple[ComplexArray, float]:
    """Rightmost roots, at least `count`, and the real part in 1/s above which these are all.

    Unless given, `count` is the number of poles without delay.

    Raises
    ------
    RequestError
        The roots cannot be resolved: the delay is too long for the fastest of them.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)], delay=0.02)
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> roots, above = rightmost_roots(system.linear)
    >>> roots.size >= 6 and bool(np.all(roots.real > above))
    True
    """
    pencil = Pencil.of(model)
    wanted = pencil.degree if count is None else count
    points = FEWEST_POINTS
    while points <= MOST_POINTS:
        found = _resolved(pencil, points, wanted)
        if found is not None and _right_of(pencil, found[1]) == found[0].size:
            return found
        points *= 2
    raise RequestError(
        f"The rightmost characteristic roots could not be told apart with {MOST_POINTS} points "
        f"over the delay of {model.delays[-1]:g} s. Check its unit; a delay of many periods of the "
        "fastest mode is out of reach."
    )


def roots_right_of(model: LinearModel, line: float) -> int:
    """Number of roots with a real part > `line` (1/s), by the argument principle."""
    return _right_of(Pencil.of(model), line)


def _right_of(pencil: Pencil, line: float) -> int:
    """The same.

    det D, which far out is s^p det M with p = 2N + q, turns by p pi/2 along the upper half of the
    line if no root lies to the right of it, and by pi less for every one that does.
    """
    far = _far_out(pencil, line)
    w = np.concatenate([[0.0], np.geomspace(1e-6 * far, far, 64)])

    def logarithm(w: Array) -> tuple[ComplexArray, Array]:
        """Phase factor of det D and the size of the derivative of its logarithm."""
        d = pencil.at(line + 1j * w)
        phase = np.linalg.slogdet(d)[0]
        slope = np.full(w.size, np.inf)
        fine = phase != 0.0
        ratio = np.linalg.solve(d[fine], pencil.slope(line + 1j * w[fine]))
        slope[fine] = np.abs(np.trace(ratio, axis1=1, axis2=2))
        return phase, slope

    phase, slope = logarithm(w)
    while True:
        change = np.diff(w) * np.maximum(slope[1:], slope[:-1])
        coarse = np.flatnonzero(~(change <= TURN))
        if coarse.size == 0:
            break
        if w.size > MOST_SAMPLES or np.min(np.diff(w)[coarse]) < 1e-14 * far:
            raise RequestError(
                f"A root lies on the line Re s = {line:g} 1/s up to rounding; the roots to the "
                "right of it cannot be counted. Change the delay a little."
            )
        middle = 0.5 * (w[coarse] + w[coarse + 1])
        extra = logarithm(middle)
        order = np.argsort(np.concatenate([w, middle]), kind="stable")
        w = np.concatenate([w, middle])[order]
        phase = np.concatenate([phase, extra[0]])[order]
        slope = np.concatenate([slope, extra[1]])[order]
    turned = float(np.sum(np.angle(phase[1:] / phase[:-1])))
    # what is left from here to infinity, where the phase of s is pi/2
    angle = pencil.degree * math.atan2(far, line)
    turned += pencil.degree * np.pi / 2 - angle
    turned -= float(np.angle(phase[-1] * np.exp(-1j * angle)))
    return round(pencil.degree / 2 - turned / np.pi)


def _resolved(pencil: Pencil, points: int, wanted: int) -> tuple[ComplexArray, float] | None:
    """Roots from `points` collocation points and the line left of them, if these settle."""
    starts = np.linalg.eigvals(_collocated(pencil, points)).astype(complex)
    starts = starts[np.argsort(-starts.real, kind="stable")]
    longest = max(late.delay for late in pencil.late)
    starts = starts[starts.real * longest > -LARGEST_EXPONENT][: 4 * wanted + 8]
    roots, clear = _polished(pencil, starts)
    place = wanted
    while place < roots.size and clear[:place].all():
        gap = roots[place - 1].real - roots[place].real
        if gap > GAP * np.abs(roots[place]):
            return roots[:place], float(roots[place].real + 0.5 * gap)
        place += 1
    return None


def _polished(pencil: Pencil, starts: ComplexArray) -> tuple[ComplexArray, NDArray[np.bool_]]:
    """Newton's method on det D from every start, sorted from the right; and what settled nearby.

    Starts that are nearly equal belong to one multiple root.
    """
    distance = np.abs(starts[:, None] - starts)
    near = distance <= TOGETHER * np.abs(starts)[:, None]
    multiple = near.sum(1)
    s = (near @ starts) / multiple
    room = np.where(near, np.inf, distance).min(1) / 2
    middle, step = s.copy(), np.zeros_like(s)
    for _ in range(NEWTON_STEPS):
        d = pencil.at(s)
        away = np.linalg.slogdet(d)[0] != 0.0  # not exactly on a root
        ratio = np.linalg.solve(d[away], pencil.slope(s[away]))
        step[~away] = 0.0
        step[away] = multiple[away] / np.trace(ratio, axis1=1, axis2=2)
        s = s - np.where(np.abs(s - step - middle) < room, step, 0.0)
    settled = np.abs(step) <= SETTLED * np.abs(s) * multiple
    order = np.argsort(-s.real, kind="stable")
    return s[order], settled[order]


def _collocated(pencil: Pencil, points: int) -> Array:
    """Generator of the state [z, z', x] and the past of all delayed signals."""
    n, first = pencil.nodes, pencil.degree
    blocks = [(late.delay, *late.signals(n)) for late in pencil.late]
    size = first + points * sum(right.shape[0] for _, _, right in blocks)
    generator = np.zeros((size, size))
    generator[:first, :first] = pencil.state_matrix()
    derivative = chebyshev_derivative(points)
    place = first
    for delay, left, right in blocks:
        pull = np.linalg.solve(pencil.mass, left)
        d = derivative * (2.0 / delay)
        for k in range(right.shape[0]):
            rows = slice(place, place + points)
            generator[rows, rows] = d[1:, 1:]
            generator[rows, :first] = np.outer(d[1:, 0], right[k])
            generator[n : 2 * n, place + points - 1] = -pull[:, k]
            place += points
    return generator


def chebyshev_derivative(points: int) -> Array:
    """Derivatives in the points cos(pi k/points), k = 0 .. points, of the polynomial through them.

    Trefethen, Spectral Methods in MATLAB, 2000, chapter 6.
    """
    x = np.cos(np.pi * np.arange(points + 1) / points)
    weight = np.where((np.arange(points + 1) % points) == 0, 2.0, 1.0)
    weight = weight * (-1.0) ** np.arange(points + 1)
    matrix = np.outer(weight, 1.0 / weight) / (x[:, None] - x + np.eye(points + 1))
    return np.asarray(matrix - np.diag(matrix.sum(1)))


def _far_out(pencil: Pencil, line: float) -> float:
    """Distance from the real axis beyond which det D turns as s^p does on the line, nearly.

    With y' = A y - B w and late signals w = R y, det D is det(s I - X), X = A - e^(-s tau) B R. No
    eigenvalue of X exceeds the largest of a matrix that bounds its entries (Perron, Frobenius).
    """
    n, bound = pencil.nodes, np.abs(pencil.state_matrix())
    for late in pencil.late:
        pull = np.linalg.solve(pencil.mass, state_columns(late.stiffness, late.damping, n))
        bound[n : 2 * n] += math.exp(-line * late.delay) * np.abs(pull)
    return 2.0 * pencil.degree * float(np.abs(np.linalg.eigvals(bound)).max()) + abs(line)
