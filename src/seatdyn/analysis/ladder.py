"""Exact propagators of the linear part for steps h, h/2, h/4, ...

Between two instants the linear part of a system is known exactly, and so is its answer to a lasting
sine. Only the channel forces have to be approximated, and a base motion that is more than a few
sines: by their quartics through the five Lobatto points of a step. With u(t) = sum_k u_k t^k/k! the
augmented linear system

    y' = A y + G e_0 + H w,   e_0' = e_1,   ...,   e_4' = 0,   w' = Omega w

carries the response to every coefficient and sine, so that one matrix exponential holds the state
transition and all the input weights (Van Loan 1978, IEEE Trans. Autom. Control 23:395-404), and
squaring it doubles the step. No eigenvectors are needed: defective and real modes are no special
case.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from seatdyn.kernels.columns import FIRST, SECOND
from seatdyn.kernels.exponential import LEVELS, NODES, Ladder
from seatdyn.kernels.plant import Plant
from seatdyn.kernels.product import WIDTH

Array = NDArray[np.float64]
POINTS = NODES.size
TAYLOR_TERMS = 14
MOST_EXACT_SINES = 8  # each adds two rows to every matrix

# from values at the nodes of a step of 1 to the coefficients u_k
TO_MONOMIALS = np.linalg.inv(np.vander(NODES, increasing=True))
FACTORIALS = np.array([math.factorial(k) for k in range(POINTS)], dtype=float)
LEGENDRE = np.polynomial.legendre.legvander(2 * NODES - 1, POINTS - 1)
RATIOS = 2.0 ** np.arange(1, -LEVELS, -1)  # of the step to the one before
ONWARD = np.vander((1 + RATIOS[:, None] * NODES[1:]).ravel(), POINTS, increasing=True)


def make_ladder(plant: Plant, longest: float) -> Ladder:
    """Propagators of `plant` for steps `longest` * 2**-(LEVELS-1) ... `longest` (s)."""
    n, m, sines = plant.linear.shape[0], plant.gain.shape[0], plant.sines.shape[0]
    exact = sines <= MOST_EXACT_SINES and not plant.segments[:, 1:8].any()
    # what stands between the state and the inputs, and the inputs that are quartics
    extra, inputs = (2 * sines, m) if exact else (0, m + 2)
    first = 2 * n + extra
    size = first + POINTS * inputs
    a = np.zeros((size, size))
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, : 2 * n] = plant.linear[:, : 2 * n]
    a[n : 2 * n, first : first + m] = -plant.pull
    if exact:
        sine = 2 * n + 2 * np.arange(sines)
        omega = plant.sines[:, 1]
        a[n : 2 * n, sine] = plant.linear[:, [2 * n]]
        a[n : 2 * n, sine + 1] = plant.linear[:, [2 * n + 1]] * omega
        a[sine, sine + 1], a[sine + 1, sine] = omega, -omega
    else:
        a[n : 2 * n, first + m : first + inputs] = plant.linear[:, 2 * n :]
    shift = np.arange(first, size - inputs)
    a[shift, shift + inputs] = 1.0

    steps = longest * 2.0 ** np.arange(1 - LEVELS, 1)
    transition = _exponential(NODES[1:, None, None] * (a * steps[0]))
    tables = np.empty((LEVELS, POINTS - 1, 2 * n, size))
    for level in range(LEVELS):
        tables[level] = transition[:, : 2 * n]
        transition = transition @ transition

    # from coefficients to nodal values, (L, 4, 2N, k, p) -> (L, 4, 2N, q, p)
    per_step = (FACTORIALS[:, None] * TO_MONOMIALS) / (
        steps[:, None, None] ** np.arange(POINTS)[:, None]
    )
    by_coefficient = tables[..., first:].reshape(LEVELS, POINTS - 1, 2 * n, POINTS, inputs)
    by_node = per_step.swapaxes(1, 2)[:, None, None] @ by_coefficient
    base = (
        tables[..., 2 * n : first]
        if exact
        else by_node[..., m:].reshape(LEVELS, POINTS - 1, 2 * n, -1)
    )
    force = by_node[..., :m].reshape(LEVELS, POINTS - 1, 2 * n, -1)
    # (L, 4, R, 2N)
    rows = np.concatenate([tables[..., : 2 * n], base, force], axis=-1).swapaxes(-1, -2)

    angle = steps[:, None, None] * NODES[:, None] * plant.sines[:, 1]
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    driven = _base_at_nodes(plant, turn, rows.shape, exact)
    across = np.zeros((2 * n + 2, 2 * m))
    for j in range(m):
        for node, sign in ((plant.channels[j, FIRST], -1.0), (plant.channels[j, SECOND], 1.0)):
            across[node if node >= 0 else 2 * n, j] += sign
            across[n + node if node >= 0 else 2 * n + 1, m + j] += sign
    everything = np.concatenate([rows, driven], axis=-1)
    relative = (everything @ across).swapaxes(1, 2).reshape(LEVELS, rows.shape[2], -1)
    unknown = rows.shape[2] - (POINTS - 1) * m

    accelerations = everything @ plant.linear.T
    for node in range(1, POINTS):
        place = rows.shape[2] - (POINTS - node) * m
        accelerations[:, node - 1, place : place + m] -= plant.pull.T
    advance = np.concatenate(
        [part[:, node] for node in (1, 3) for part in (rows, accelerations)], axis=-1
    )
    filling = np.zeros((*advance.shape[:2], -advance.shape[2] % WIDTH))

    effects = [0, 3]
    # from the coefficients to the end state, (L, 2N, k, p) -> (L, k, p, 2N)
    response = np.moveaxis(LEGENDRE[:, effects].T @ by_node[:, -1], 1, -1)
    return Ladder(
        step=steps,
        exact_sines=exact,
        turn=turn,
        advance=np.concatenate([advance, filling], axis=-1),
        known=np.ascontiguousarray(relative[:, :unknown]),
        unknown=np.ascontiguousarray(relative[:, unknown:]),
        onward=(ONWARD @ TO_MONOMIALS).reshape(RATIOS.size, POINTS - 1, POINTS),
        to_legendre=np.ascontiguousarray(np.linalg.inv(LEGENDRE)[2:]),
        response=np.ascontiguousarray(np.abs(response)),
    )


def _exponential(scaled: Array) -> Array:
    """Matrix exponentials, by their series and squaring."""
    halvings = max(0, math.ceil(math.log2(max(np.abs(scaled).sum(1).max(), 1e-300))))
    scaled = scaled * 2.0**-halvings
    power = np.broadcast_to(np.eye(scaled.shape[-1]), scaled.shape)
    result = power.copy()
    for k in range(1, TAYLOR_TERMS):
        power = power @ scaled / k
        result += power
    for _ in range(halvings):
        result = result @ result
    return result


def _base_at_nodes(plant: Plant, turn: Array, shape: tuple[int, ...], exact: bool) -> Array:
    """From the row to displacement and velocity of the base at nodes 1-4, (L, 4, R, 2)."""
    result = np.zeros((*shape[:3], 2))
    first = 2 * plant.linear.shape[0]
    if exact:
        omega = plant.sines[:, 1]
        cosine, sine = np.moveaxis(turn[:, 1:], -1, 0)
        places = first + 2 * np.arange(omega.size)
        result[:, :, places, 0], result[:, :, places + 1, 0] = cosine, sine
        result[:, :, places, 1], result[:, :, places + 1, 1] = -omega * sine, omega * cosine
    else:
        for node in range(1, POINTS):
            place = first + 2 * node
            result[:, node - 1, place, 0] = result[:, node - 1, place + 1, 1] = 1.0
    return result
