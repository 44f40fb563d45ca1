"""One Dormand-Prince 5(4) step in physical coordinates (1980, J. Comput. Appl. Math. 6:19-26)."""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.jit import stage, takes
from seatdyn.kernels.plant import AT_PLANT, accelerations, base_motion
from seatdyn.kernels.shapes import INTEGER, INTEGERS, REAL, TABLE, VECTOR

C = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
A = np.array(
    [
        [0, 0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
E = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


@takes(AT_PLANT, REAL, REAL, INTEGER, VECTOR, TABLE, INTEGERS, INTEGERS, VECTOR, VECTOR)
@stage
def rk_step(plant, t, h, segment, y, k, side, held, y1, force):
    """One step from y; k (7, 2N) has its first row set, gets the others; fills y1 and force."""
    n = y.size // 2
    for s in range(1, 7):
        for i in range(2 * n):
            total = 0.0
            for q in range(s):
                total += A[s, q] * k[q, i]
            y1[i] = y[i] + h * total
        for i in range(n):
            k[s, i] = y1[n + i]
        base = base_motion(plant, t + C[s] * h, segment)
        accelerations(plant, base, y1, side, held, k[s, n:], force)


@takes(TABLE, REAL, INTEGER, REAL, REAL)
@stage
def rk_error(k, h, n, z_tolerance, v_tolerance):
    """Largest estimated error of the step over its tolerance."""
    worst = 0.0
    for i in range(2 * n):
        total = 0.0
        for s in range(7):
            total += E[s] * k[s, i]
        share = abs(h * total) / (z_tolerance if i < n else v_tolerance)
        if not share <= worst:
            worst = share if share < np.inf else np.inf  # what is no number is too much, too
    return worst
