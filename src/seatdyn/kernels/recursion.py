"""Linear systems stepped exactly over a uniform grid, many members at once."""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.jit import kernel


@kernel
def accumulate(step, drive, x, v, a, skip, state, gram):
    """Step all members through the nodes and sum up products of states and base motion.

    step : (S, S), drive : (S, 6), state at the next node from state and [x, v, a] at both nodes
    x, v, a : (nodes, M) base motion
    skip : first node that counts
    state : (S, M) at the first node; holds the last one afterwards
    gram : (S+3, S+3, M) lower triangle of the sums of products of [state, x, v, a], added to
    """
    size, members = state.shape
    row = np.empty((size + 3, members))
    following = np.empty((size, members))
    for node in range(x.shape[0]):
        for m in range(members):
            row[size, m] = x[node, m]
            row[size + 1, m] = v[node, m]
            row[size + 2, m] = a[node, m]
        row[:size] = state
        if node >= skip:
            for i in range(size + 3):
                for j in range(i + 1):
                    for m in range(members):
                        gram[i, j, m] += row[i, m] * row[j, m]
        if node + 1 == x.shape[0]:
            break
        for i in range(size):
            for m in range(members):
                following[i, m] = (
                    drive[i, 3] * x[node + 1, m]
                    + drive[i, 4] * v[node + 1, m]
                    + drive[i, 5] * a[node + 1, m]
                )
            for j in range(size):
                for m in range(members):
                    following[i, m] += step[i, j] * row[j, m]
            for j in range(3):
                for m in range(members):
                    following[i, m] += drive[i, j] * row[size + j, m]
        state[:] = following
