"""Characteristic roots of a linear system with delayed forces.

    D(s) = M s^2 + C s + K + sum over delays of exp(-s tau) (K_tau + s C_tau),   det D(s) = 0

has infinitely many roots, of which finitely many lie to the right of any vertical line. A delayed
force sees few signals w = R x of the state x = [z, z'] (one, for a suspension). Its past
w(t + theta), -tau <= theta <= 0, is carried along by u_t = u_theta; collocated in Chebyshev points
that is a matrix, whose eigenvalues converge to the roots faster than any power of the number of
points (Breda, Maset and Vermiglio, SIAM J. Sci. Comput. 27 (2005) 482). They are starting values:
each root is then found by Newton's method on D itself, and their number is held against the
argument principle, so that none is missing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.linear import Array, ComplexArray, companion, dynamic_stiffness
from seatdyn.errors import RequestError
from seatdyn.model.system import DelayedForces, LinearModel

FEWEST_POINTS, MOST_POINTS = 16, 1024  # of a delay
NEWTON_STEPS = 12
SETTLED = 1e-12  # last relative change of a root
TOGETHER = 1e-5  # roots this near to each other, relatively, are one multiple root
GAP = 1e-6  # relative distance of real parts between which the line of the count may lie
LARGEST_EXPONENT = 300.0  # of exp(-s tau) on that line
RANK = 1e-12  # singular values of a delayed force below this share of the largest are rounding
TURN = 0.5  # largest estimated change of the logarithm between neighbours on the line
MOST_SAMPLES = 2_000_000


def rightmost_roots(model: LinearModel, count: int | None = None) -> tuple[ComplexArray, float]:
    """Rightmost roots, at least `count` (2N), and the real part in 1/s above which these are all.

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
    wanted = 2 * model.size if count is None else count
    points = FEWEST_POINTS
    while points <= MOST_POINTS:
        found = _resolved(model, points, wanted)
        if found is not None and roots_right_of(model, found[1]) == found[0].size:
            return found
        points *= 2
    delay = max(group.delay for group in model.delayed)
    raise RequestError(
        f"The rightmost characteristic roots could not be told apart with {MOST_POINTS} points "
        f"over the delay of {delay:g} s. Check its unit; a delay of many periods of the fastest "
        "mode is out of reach."
    )


def roots_right_of(model: LinearModel, line: float) -> int:
    """Number of roots with a real part > `line` (1/s), by the argument principle.

    det D, which far out is s^2N det M, turns by N pi along the upper half of the line if no root
    lies to the right of it, and by pi less for every one that does.
    """
    far = _far_out(model, line)
    w = np.concatenate([[0.0], np.geomspace(1e-6 * far, far, 64)])

    def logarithm(w: Array) -> tuple[ComplexArray, Array]:
        """Phase factor of det D and the size of the derivative of its logarithm."""
        d = dynamic_stiffness(model, line + 1j * w)
        phase = np.linalg.slogdet(d)[0]
        slope = np.full(w.size, np.inf)
        fine = phase != 0.0
        ratio = np.linalg.solve(d[fine], _slope(model, line + 1j * w[fine]))
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
    angle = 2 * model.size * math.atan2(far, line)
    turned += model.size * np.pi - angle - float(np.angle(phase[-1] * np.exp(-1j * angle)))
    return round(model.size - turned / np.pi)


def _resolved(model: LinearModel, points: int, wanted: int) -> tuple[ComplexArray, float] | None:
    """Roots from `points` collocation points and the line left of them, if these settle."""
    starts = np.linalg.eigvals(_collocated(model, points)).astype(complex)
    starts = starts[np.argsort(-starts.real, kind="stable")]
    longest = max(group.delay for group in model.delayed)
    starts = starts[starts.real * longest > -LARGEST_EXPONENT][: 4 * wanted + 8]
    roots, clear = _polished(model, starts)
    place = wanted
    while place < roots.size and clear[:place].all():
        gap = roots[place - 1].real - roots[place].real
        if gap > GAP * np.abs(roots[place]):
            return roots[:place], float(roots[place].real + 0.5 * gap)
        place += 1
    return None


def _polished(model: LinearModel, starts: ComplexArray) -> tuple[ComplexArray, NDArray[np.bool_]]:
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
        d = dynamic_stiffness(model, s)
        away = np.linalg.slogdet(d)[0] != 0.0  # not exactly on a root
        ratio = np.linalg.solve(d[away], _slope(model, s[away]))
        step[~away] = 0.0
        step[away] = multiple[away] / np.trace(ratio, axis1=1, axis2=2)
        s = s - np.where(np.abs(s - step - middle) < room, step, 0.0)
    settled = np.abs(step) <= SETTLED * np.abs(s) * multiple
    order = np.argsort(-s.real, kind="stable")
    return s[order], settled[order]


def _slope(model: LinearModel, s: ComplexArray) -> ComplexArray:
    """dD/ds, (..., N, N)."""
    n, z = model.size, np.asarray(s)[..., None, None]
    prompt = model.prompt
    total = prompt.damping + 2.0 * z * prompt.mass
    for group in model.delayed:
        k, c = group.stiffness[:n, :n], group.damping[:n, :n]
        total = total + np.exp(-z * group.delay) * (c - group.delay * (k + z * c))
    return np.asarray(total)


def signals(group: DelayedForces, size: int) -> tuple[Array, Array]:
    """Delayed forces on the free nodes as left (N, r) times right (r, 2N) of [z, z']."""
    both = np.hstack([group.stiffness[:size, :size], group.damping[:size, :size]])
    left, values, right = np.linalg.svd(both, full_matrices=False)
    rank = int(np.sum(values > RANK * values[0])) if values[0] > 0.0 else 0
    return left[:, :rank], values[:rank, None] * right[:rank]


def _collocated(model: LinearModel, points: int) -> Array:
    """Generator of the state [z, z'] and the past of all delayed signals."""
    prompt, n = model.prompt, model.size
    a = companion(prompt.mass, prompt.damping, prompt.stiffness)
    blocks = [(group.delay, *signals(group, n)) for group in model.delayed]
    size = 2 * n + points * sum(right.shape[0] for _, _, right in blocks)
    generator = np.zeros((size, size))
    generator[: 2 * n, : 2 * n] = a
    derivative = chebyshev_derivative(points)
    place = 2 * n
    for delay, left, right in blocks:
        pull = np.linalg.solve(model.mass, left)
        d = derivative * (2.0 / delay)
        for k in range(right.shape[0]):
            rows = slice(place, place + points)
            generator[rows, rows] = d[1:, 1:]
            generator[rows, : 2 * n] = np.outer(d[1:, 0], right[k])
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


def _far_out(model: LinearModel, line: float) -> float:
    """Distance from the real axis beyond which M s^2 outweighs all else on the line."""
    share = 1.0 / (4.0 * model.size)
    prompt, n = model.prompt, model.size

    def size(matrix: Array) -> float:
        return float(np.linalg.norm(np.linalg.solve(model.mass, matrix), 2))

    c, k = size(prompt.damping), size(prompt.stiffness)
    for group in model.delayed:
        grown = math.exp(-line * group.delay)
        c += grown * size(group.damping[:n, :n])
        k += grown * size(group.stiffness[:n, :n])
    # c w + k <= share w^2
    return (c + math.sqrt(c * c + 4.0 * share * k)) / (2.0 * share) + abs(line)
