"""The characteristic polynomial det(M s^2 + C s + K), from the matrices and never from its roots.

A seat mass, a damping, a stiffness or a feedback gain enters the matrices by a rank-one term, so
the determinant is affine in each of them (matrix determinant lemma). Over a box of k parameters it
is known everywhere from its 2^k corners.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from seatdyn.analysis.linear import Array, natural_rate
from seatdyn.errors import RequestError
from seatdyn.model.system import LinearModel, RankOne
from seatdyn.units import DAMPING, MASS, STIFFNESS, either_sign, number, suggestion

Matrices = tuple[Array, Array, Array]

MAXIMUM_PARAMETERS = 3
LIMITS = {"seat_mass": MASS, "damping": DAMPING, "stiffness": STIFFNESS}
GAIN_LIMITS = either_sign(STIFFNESS)
FASTEST_TO_SLOWEST = 1e30  # of roots, as far as they are looked for


def parameter(model: LinearModel, name: str) -> RankOne:
    """Return how a named parameter enters; an unknown name is refused with a suggestion."""
    if name not in model.parameters:
        known = suggestion(name, model.parameters) if model.parameters else "It has none."
        raise RequestError(f"This system has no parameter {name!r}. {known}")
    return model.parameters[name]


def parameter_values(model: LinearModel, name: str, values: ArrayLike) -> Array:
    """Return values of one parameter as a checked array, within the limits of a Seat, a Spring, ...

    Feedback gains may have any sign.
    """
    term = parameter(model, name)
    try:
        array = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        raise RequestError(f"{name} must be an array of numbers in {term.unit}.") from None
    if array.ndim != 1 or array.size == 0:
        raise RequestError(
            f"{name} has the shape {array.shape}; it must be a list of numbers in {term.unit}."
        )
    limits = LIMITS.get(name, GAIN_LIMITS)
    worst = array[np.argmin(np.where(np.isfinite(array), array, -np.inf))]
    for value in (worst, array.max()):
        number(value, name, term.unit, error=RequestError, **limits)
    return array


def substituted(model: LinearModel, values: Mapping[str, float | Array]) -> Matrices:
    """M, C, K with named parameters replaced; arrays (P,) of values give stacks (P, N, N)."""
    matrices = [model.stiffness, model.damping, model.mass]
    for name, value in values.items():
        term = parameter(model, name)
        change = np.asarray(value, dtype=float) - term.value
        addition = change[..., None, None] * np.outer(term.left, term.right)
        matrices[term.order] = matrices[term.order] + addition
    stiffness, damping, mass = matrices
    return mass, damping, stiffness


def characteristic_polynomial(
    mass: Array, damping: Array, stiffness: Array, rate: float = 1.0
) -> Array:
    """Coefficients of det(M s^2 + C s + K) in s/rate, (2N + 1,), highest power first.

    Parameters
    ----------
    mass, damping, stiffness : (N, N), kg, N s/m, N/m; mass regular
    rate : 1/s, the unit in which s is counted

    Notes
    -----
    The determinant is taken by LU at 2N + 1 points of a circle, whose discrete Fourier transform
    is the list of coefficients times powers of the radius. Its rounding is a fraction of the
    product of the lengths of the rows (Hadamard's bound), so the small coefficients of a wide
    polynomial would be lost. Hence circles one octave apart cover all moduli that a root can have,
    and each coefficient is taken from the circle on which it weighs most. What is rounding even
    there (odd powers of an undamped system) is set to zero.

    Examples
    --------
    >>> one = np.eye(1)
    >>> characteristic_polynomial(2.0 * one, 0.0 * one, 18.0 * one).round(12).tolist()
    [2.0, 0.0, 18.0]
    """
    n = len(mass)
    low, high = _root_bounds(mass, damping, stiffness)
    radii = low * 2.0 ** np.arange(np.ceil(np.log2(high / low)) + 1.0)
    count = 2 * n + 1
    s = radii[:, None] * np.exp(2j * np.pi * np.arange(count) / count)
    z = s[..., None, None]
    with np.errstate(over="ignore", invalid="ignore"):
        values = np.linalg.det(stiffness + z * damping + z**2 * mass)
        terms = np.fft.fft(values, axis=1).real / count  # a_j radius^j
        r = radii[:, None, None]
        rows = np.abs(stiffness) + r * np.abs(damping) + r**2 * np.abs(mass)
        bound = np.prod(np.linalg.norm(rows, axis=2), axis=1)
        weight = np.abs(terms) / bound[:, None]
    if not np.all(np.isfinite(weight)):
        raise RequestError(
            f"The characteristic polynomial of {n} masses leaves the range of numbers; "
            'use method="poles".'
        )
    best = np.argmax(weight, axis=0)
    power = np.arange(count)
    coefficients = terms[best, power] * (rate / radii[best]) ** power
    coefficients[weight[best, power] < 4 * count * np.finfo(float).eps] = 0.0
    return np.array(coefficients[::-1])


def corner_polynomials(model: LinearModel, box: Mapping[str, tuple[float, float]]) -> Array:
    """Polynomials at the corners of a box of up to three parameters, (2, 2, 2, 2N + 1).

    Parameters
    ----------
    model : the system
    box : name -> (low, high); missing axes are filled with copies

    Returns
    -------
    numpy.ndarray
        Highest power first, leading coefficient positive, s counted in one rate for all corners,
        which does not move roots across the imaginary axis.
    """
    rate = natural_rate(model.mass, model.stiffness)
    corners = np.empty((2,) * MAXIMUM_PARAMETERS + (2 * model.size + 1,))
    for corner in product((0, 1), repeat=len(box)):
        values = {name: box[name][side] for name, side in zip(box, corner, strict=True)}
        corners[corner] = characteristic_polynomial(*substituted(model, values), rate)
    return corners


def _root_bounds(mass: Array, damping: Array, stiffness: Array) -> tuple[float, float]:
    """Bounds of the moduli of the non-zero roots, 1/s.

    |s|^2 <= |s| |M^-1 C| + |M^-1 K| for every root, and the same from below with 1/s.
    """

    def bound(first: Array, zeroth: Array) -> float:
        c, k = np.linalg.norm(first, 1), np.linalg.norm(zeroth, 1)
        return float(c + np.sqrt(c * c + 4.0 * k)) / 2.0

    high = bound(np.linalg.solve(mass, damping), np.linalg.solve(mass, stiffness)) or 1.0
    try:
        low = 1.0 / bound(np.linalg.solve(stiffness, damping), np.linalg.solve(stiffness, mass))
    except np.linalg.LinAlgError:  # a root at zero; the others are anywhere
        low = 0.0
    return max(low, high / FASTEST_TO_SLOWEST), high
