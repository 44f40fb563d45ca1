"""Values of one parameter at which a pole lies on the imaginary axis.

A parameter theta that enters by a rank-one term has a pole at s where

    theta = theta_0 - 1/g(s),     g(s) = s^order r' (M s^2 + C s + K)^-1 l     (matrices at theta_0)

(matrix determinant lemma). At s = i w theta must come out real, which is the eigenvalue problem
theta(s) = theta(-s); no polynomial is formed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.characteristic import Matrices
from seatdyn.analysis.linear import Array, companion, on_left, quadratic_eigenvalues
from seatdyn.model.system import RankOne

NEAR_AXIS = 1e-3  # how far, relatively, an eigenvalue may be off the axis to be tried as crossing
NEWTON_STEPS = 40


def crossings(
    matrices: Matrices, term: RankOne, low: float, high: float
) -> tuple[Array, Array, NDArray[np.int_]]:
    """Sorted values in (low, high) with a pole on the axis, its rates, unstable poles between.

    `matrices` are M, C, K at `term.value`. The counts are one more than the values: below the
    first, between, and above the last.
    """
    found = [_polish(matrices, term, w) for w in _candidates(matrices, term)]
    inside = sorted((v, w) for v, w in found if low < v < high)
    # one crossing may be reached from several candidates
    kept = [
        pair
        for i, pair in enumerate(inside)
        if i == 0 or not np.allclose(pair, inside[i - 1], rtol=1e-9, atol=0.0)
    ]
    values = np.array([v for v, _ in kept])
    rates = np.array([w for _, w in kept])
    last = 2.0 * values[-1] + 1.0 if values.size else low + 1.0
    edges = np.concatenate([[low], values, [high if np.isfinite(high) else 2.0 * last - low]])
    change = (edges[:-1] + edges[1:]) / 2.0 - term.value
    stack = list(matrices)
    index = 2 - term.order  # matrices are in falling order: M, C, K
    stack[index] = stack[index] + change[:, None, None] * np.outer(term.left, term.right)
    poles = np.linalg.eigvals(companion(*stack))
    left = on_left(poles.real, np.abs(poles).max(axis=1, keepdims=True))
    return values, rates, np.sum(~left, axis=1)


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


def _polish(matrices: Matrices, term: RankOne, w: float) -> tuple[float, float]:
    """Newton's method for theta real and a pole at i w; NaN where it does not settle.

    h = -1/g is the change of theta that puts a pole at s. It is taken at the latest theta, where
    it is nearly zero, so that the result is as good as the matrices.
    """
    mass, damping, stiffness = matrices
    at = {2: mass, 1: damping, 0: stiffness}[term.order]
    outer = np.outer(term.left, term.right)
    theta = float(term.value)
    for _ in range(NEWTON_STEPS):
        shifted = {2: mass, 1: damping, 0: stiffness}
        shifted[term.order] = at + (theta - term.value) * outer
        s = 1j * w
        p = shifted[0] + s * shifted[1] + s**2 * shifted[2]
        slope = shifted[1] + 2 * s * shifted[2]
        try:
            x = np.linalg.solve(p, term.left.astype(complex))
            y = np.linalg.solve(p.T, term.right.astype(complex))
        except np.linalg.LinAlgError:
            return theta, w  # a pole exactly at i w
        power, rise = s**term.order, term.order * s ** max(term.order - 1, 0)
        with np.errstate(all="ignore"):
            g = power * (term.right @ x)
            h = -1.0 / g
            dh = (rise * (term.right @ x) - power * (y @ slope @ x)) / g**2
            dw = 0.0 if w == 0.0 else -h.imag / dh.real
            dtheta = h.real - dh.imag * dw
        if not np.isfinite(dw + dtheta):
            break
        w, theta = float(w + dw), float(theta + dtheta)
        if abs(dw) <= 1e-14 * abs(w) and abs(dtheta) <= 1e-13 * abs(theta):
            return float(theta), float(w)
    return float("nan"), float("nan")
