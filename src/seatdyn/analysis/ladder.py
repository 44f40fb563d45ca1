"""Exact propagators of the linear part for steps h, h/2, h/4, ...

Between two instants the linear part of a system is known exactly; only the channel forces and the
base motion have to be approximated, here by their quartic through the five Lobatto points of a
step. With u(t) = sum_k u_k t^k/k! the augmented linear system

    y' = A y + G e_0,   e_0' = e_1,   ...,   e_4' = 0

carries the response to every coefficient, so that one matrix exponential holds the state
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

Array = NDArray[np.float64]
POINTS = NODES.size
TAYLOR_TERMS = 14


def make_ladder(plant: Plant, longest: float) -> Ladder:
    """Propagators of `plant` for steps `longest` * 2**-(LEVELS-1) ... `longest` (s)."""
    n, m = plant.linear.shape[0], plant.gain.shape[0]
    inputs = m + 2
    size = 2 * n + POINTS * inputs
    augmented = np.zeros((size, size))
    augmented[:n, n : 2 * n] = np.eye(n)
    augmented[n : 2 * n, : 2 * n] = plant.linear[:, : 2 * n]
    augmented[n : 2 * n, 2 * n : 2 * n + m] = -plant.pull
    augmented[n : 2 * n, 2 * n + m : 2 * n + inputs] = plant.linear[:, 2 * n :]
    shift = np.arange(2 * n, size - inputs)
    augmented[shift, shift + inputs] = 1.0

    steps = longest * 2.0 ** np.arange(1 - LEVELS, 1)
    halvings = max(0, math.ceil(math.log2(max(np.abs(augmented).sum(0).max() * steps[0], 1e-300))))
    scaled = NODES[1:, None, None] * (augmented * (steps[0] * 2.0**-halvings))
    power = np.broadcast_to(np.eye(size), scaled.shape)
    transition = power.copy()
    for k in range(1, TAYLOR_TERMS):
        power = power @ scaled / k
        transition += power
    for _ in range(halvings):
        transition = transition @ transition
    tables = np.empty((LEVELS, POINTS - 1, 2 * n, size))
    for level in range(LEVELS):
        tables[level] = transition[:, : 2 * n]
        transition = transition @ transition

    # from values at the nodes to the coefficients u_k, for a step of 1 and of h
    to_monomials = np.linalg.inv(np.vander(NODES, increasing=True))
    factorials = np.array([math.factorial(k) for k in range(POINTS)], dtype=float)
    per_step = (factorials[:, None] * to_monomials) / steps[:, None, None] ** np.arange(POINTS)[
        :, None
    ]
    by_coefficient = tables[..., 2 * n :].reshape(LEVELS, POINTS - 1, 2 * n, POINTS, inputs)
    by_node = per_step.swapaxes(1, 2)[:, None, None] @ by_coefficient
    rows = np.concatenate(
        [tables[..., : 2 * n], by_node.reshape(LEVELS, POINTS - 1, 2 * n, -1)], axis=-1
    ).swapaxes(-1, -2)  # (L, 4, 2N + 5p, 2N)

    across = np.zeros((2 * n, 2 * m))
    for j in range(m):
        for node, sign in ((plant.channels[j, FIRST], -1.0), (plant.channels[j, SECOND], 1.0)):
            if node >= 0:
                across[node, j] += sign
                across[n + node, m + j] += sign

    legendre = np.polynomial.legendre.legvander(2 * NODES - 1, POINTS - 1)
    effects = [0, 3]
    # from the coefficients to the end state, (L, 2N, k, p) -> (L, k, p, 2N)
    response = np.moveaxis(legendre[:, effects].T @ by_node[:, -1], 1, -1)
    relative = (rows @ across).swapaxes(1, 2).reshape(LEVELS, rows.shape[2], -1)
    angle = steps[:, None, None] * NODES[:, None] * plant.sines[:, 1]
    middle, end = (_with_accelerations(plant, rows[:, i], i + 1) for i in (1, 3))
    return Ladder(
        step=steps,
        turn=np.stack([np.cos(angle), np.sin(angle)], axis=-1),
        advance=np.ascontiguousarray(np.concatenate([middle, end], axis=-1)),
        relative=np.ascontiguousarray(relative),
        to_legendre=np.ascontiguousarray(np.linalg.inv(legendre)[2:]),
        response=np.ascontiguousarray(np.abs(response)),
    )


def _with_accelerations(plant: Plant, rows: Array, node: int) -> Array:
    """Append to the maps to the state at a node those to the accelerations there, (L, R, 3N)."""
    n, m = plant.linear.shape[0], plant.gain.shape[0]
    accelerations = rows @ plant.linear[:, : 2 * n].T
    place = 2 * n + node * (m + 2)
    accelerations[:, place : place + m] -= plant.pull.T
    accelerations[:, place + m : place + m + 2] += plant.linear[:, 2 * n :].T
    return np.concatenate([rows, accelerations], axis=-1)
