"""Exact propagators of the linear part for steps h, h/2, h/4, ...

Between two instants the linear part of a system is known exactly, and so is its answer to a lasting
sine. Only the channel forces have to be approximated, and a base motion that is more than a few
sines: by their polynomials through the Lobatto points of a step. Over a step h the state is

    y(x h) = T(x) y(0) + W(x) u,   T(x) = exp(x h A),   W(x) = int_0^x exp((x - s) h A) G l(s) h ds

with u the values of the inputs at the points and l(s) their Lagrange polynomials. For a tiny step
both are Taylor series; twice the step are two steps, the second from x h on, each with the values
that the inputs have at its own points (S(x): from the values on twice the step to those on the
step that begins at x h):

    T'(x) = T(x) T(x),   W'(x) = T(x) W(x) S(0) + W(x) S(x).

No eigenvectors are needed: defective and real modes are no special case.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from seatdyn.kernels.columns import FIRST, SECOND
from seatdyn.kernels.exponential import BLOCKS, LATER, LEVELS, NODES, PLACES, POINTS, Ladder
from seatdyn.kernels.plant import Plant
from seatdyn.kernels.rows import WIDTH, aligned

Array = NDArray[np.float64]
TERMS, SMALL = 16, 0.5  # of the series, and the norm of h A that they are enough for
MOST_EXACT_SINES = 8  # each adds two rows to every matrix
INSTANTS = np.array([*NODES, 0.25, 0.75])  # of a step: its points, and the quarters beside them
QUARTERS = np.array([POINTS, LATER // 2, POINTS + 1, LATER])  # those at 1/4, 1/2, 3/4, 1
LATEST = POINTS - 6  # the last six Legendre coefficients tell how well a polynomial fits
LEGENDRE = np.polynomial.legendre.legvander(2 * NODES - 1, LATER)
TO_LEGENDRE = np.linalg.inv(LEGENDRE)


def _values(places: Array, degree: int = LATER) -> Array:
    """From values at the points of a step 0..1 to those at `places` (...), (..., 9)."""
    polynomials = np.polynomial.legendre.legvander(2 * places - 1, degree)
    found: Array = polynomials @ TO_LEGENDRE[: degree + 1]
    return found


def _moments() -> Array:
    """Integrals of (x - s)^k / k! l(s) over 0 .. x, x the later places, (TERMS, 10, 9)."""
    places, weights = np.polynomial.legendre.leggauss(TERMS)
    x = INSTANTS[1:, None]
    s, ds = 0.5 * x * (1 + places), 0.5 * x * weights
    k = np.arange(TERMS)[:, None, None]
    factorials = np.array([math.factorial(i) for i in range(TERMS)])[:, None, None]
    weights = ds * (x - s) ** k / factorials
    found: Array = np.einsum("kxs,xsq->kxq", weights, _values(s))
    return found


MOMENTS = _moments()
POWERS = INSTANTS[1:] ** np.arange(TERMS)[:, None] / [[math.factorial(k)] for k in range(TERMS)]
SECOND_STEP = _values(0.5 * (INSTANTS[1:, None] + NODES))  # S(x) of the later places
FIRST_STEP = _values(0.5 * NODES)  # S(0)
RATIOS = 2.0 ** np.arange(1, -LEVELS, -1)  # of the step to the one before
ONWARD_DEGREE = 4  # of what is carried on beyond its step: higher ones only carry on errors
ONWARD = _values(1 + RATIOS[:, None] * NODES[1:], ONWARD_DEGREE).swapaxes(1, 2)


def make_ladder(plant: Plant, longest: float) -> Ladder:
    """Propagators of `plant` for steps `longest` * 2**-(LEVELS-1) ... `longest` (s)."""
    n, m, sines = plant.linear.shape[0], plant.gain.shape[0], plant.sines.shape[0]
    exact = sines <= MOST_EXACT_SINES and not plant.segments[:, 1:8].any()
    # what belongs to the state, and the inputs that are polynomials
    size, inputs = (2 * n + 2 * sines, m) if exact else (2 * n, m + 2)
    a, g = np.zeros((size, size)), np.zeros((size, inputs))
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, : 2 * n] = plant.linear[:, : 2 * n]
    g[n : 2 * n, :m] = -plant.pull
    if exact:
        sine, omega = 2 * n + 2 * np.arange(sines), plant.sines[:, 1]
        a[n : 2 * n, sine] = plant.linear[:, [2 * n]]
        a[n : 2 * n, sine + 1] = plant.linear[:, [2 * n + 1]] * omega
        a[sine, sine + 1], a[sine + 1, sine] = omega, -omega
    else:
        g[n : 2 * n, m:] = plant.linear[:, 2 * n :]

    steps = np.asarray(longest * 2.0 ** np.arange(1 - LEVELS, 1), dtype=float)
    free, driven = _propagators(a, g, steps)
    free, driven = free[:, :, : 2 * n], driven[:, :, : 2 * n]
    force = driven[:, :, :, :m]
    base = free[..., 2 * n :]
    if not exact:
        base = driven[:, :, :, m:].swapaxes(-1, -2).reshape(*free.shape[:3], -1)
    parts = (free[..., : 2 * n], base, force[..., 0], force[..., 1:].reshape(*free.shape[:3], -1))
    rows = np.concatenate(parts, axis=-1).swapaxes(-1, -2)  # (L, 10, R, 2N)

    angle = steps[:, None, None] * INSTANTS[:, None] * plant.sines[:, 1]
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    everything = np.concatenate([rows, _base_at_places(plant, turn, rows.shape, exact)], axis=-1)
    across = np.zeros((2 * n + 2, 2 * m))
    for j in range(m):
        for node, sign in ((plant.channels[j, FIRST], -1.0), (plant.channels[j, SECOND], 1.0)):
            across[node if node >= 0 else 2 * n, 2 * j] += sign
            across[n + node if node >= 0 else 2 * n + 1, 2 * j + 1] += sign
    relative = np.moveaxis(everything[:, :LATER] @ across, 1, -1)
    relative = relative.reshape(LEVELS, rows.shape[2], -1)
    unknown = rows.shape[2] - LATER * m

    # states and accelerations, these with the force at their own point
    advance = []
    for place in QUARTERS:
        acceleration = everything[:, place - 1] @ plant.linear.T
        if place < POINTS:
            for j in range(m):
                acceleration[:, unknown + LATER * j + place - 1] -= plant.pull[:, j]
        advance += [rows[:, place - 1], acceleration]
    filling = np.zeros((LEVELS, rows.shape[2], -12 * n % WIDTH))

    to_legendre = np.zeros((POINTS, WIDTH))
    to_legendre[:, : POINTS - LATEST] = TO_LEGENDRE[LATEST:].T
    # to the end state from a constant, and from the polynomial that the ninth looks like
    response = np.moveaxis(driven[:, LATER - 1] @ LEGENDRE[:, [0, LATER - 1]], (1, 2, 3), (3, 2, 1))
    places = np.zeros(BLOCKS * WIDTH)
    places[: PLACES.size] = PLACES
    angle = steps[:, None, None] * plant.sines[:, 1, None] * places
    return Ladder(
        step=steps,
        exact_sines=exact,
        turn=aligned(np.stack([np.cos(angle), np.sin(angle)], axis=2)),
        advance=aligned(np.concatenate([*advance, filling], axis=-1)),
        known=aligned(relative[:, :unknown]),
        unknown=aligned(relative[:, unknown:]),
        onward=aligned(ONWARD),
        to_legendre=aligned(to_legendre),
        response=aligned(np.pad(np.abs(response), [*[(0, 0)] * 3, (0, -2 * n % WIDTH)])),
    )


def _propagators(a: Array, g: Array, steps: Array) -> tuple[Array, Array]:
    """T (L, 10, s, s) and W (L, 10, s, inputs, 9) of y' = A y + G u for steps, each twice the last.

    s = 2N, and the sine and cosine parts of sines.
    """
    size = g.shape[0]
    smaller = max(0, math.ceil(math.log2(max(np.abs(a).sum(1).max() * steps[0] / SMALL, 1e-300))))
    h = steps[0] * 0.5**smaller
    powers = np.empty((TERMS, size, size))
    powers[0] = np.eye(size)
    for k in range(1, TERMS):
        powers[k] = powers[k - 1] @ (h * a)
    # T - 1, so that short steps keep their digits
    change = np.tensordot(POWERS[1:], powers[1:], (0, 0))
    driven = np.tensordot(powers @ (h * g), MOMENTS, (0, 0)).transpose(2, 0, 1, 3)
    all_free = np.empty((steps.size, *change.shape))
    all_driven = np.empty((steps.size, *driven.shape))
    for level in range(-smaller, steps.size):
        if level >= 0:
            all_free[level], all_driven[level] = np.eye(size) + change, driven
        first = driven @ FIRST_STEP
        more = (change @ first.reshape(*change.shape[:2], -1)).reshape(driven.shape)
        driven = first + more + driven @ SECOND_STEP[:, None]
        change = 2 * change + change @ change
    return all_free, all_driven


def _base_at_places(plant: Plant, turn: Array, shape: tuple[int, ...], exact: bool) -> Array:
    """From the row to displacement and velocity of the base at the later places, (L, 10, R, 2)."""
    result = np.zeros((*shape[:3], 2))
    first = 2 * plant.linear.shape[0]
    if exact:
        omega = plant.sines[:, 1]
        cosine, sine = np.moveaxis(turn[:, 1:], -1, 0)
        places = first + 2 * np.arange(omega.size)
        result[:, :, places, 0], result[:, :, places + 1, 0] = cosine, sine
        result[:, :, places, 1], result[:, :, places + 1, 1] = -omega * sine, omega * cosine
    else:
        values = _values(INSTANTS[1:])
        for point in range(POINTS):
            row = first + 2 * point
            result[:, :, row, 0] = result[:, :, row + 1, 1] = values[:, point]
    return result
