"""Routh-Hurwitz test of many polynomials that are multi-affine in three parameters.

Corner polynomials come as (2, 2, 2, degree + 1), highest power first, at the corners of a box of
the parameters; coordinates are 0 and 1 there, and may lie outside.
"""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.jit import kernel


@kernel
def is_hurwitz(c):
    """Whether all roots of c[0] s^n + ... + c[n], c[0] > 0, have negative real part.

    Routh's array, each row written over the one before the last, as a polynomial test: it stops at
    the first element of the first column that is not positive. Zero there means a root on the
    imaginary axis or to the right of it, so zero is not stable. `c` is destroyed.
    """
    n = c.size - 1
    if not c[0] > 0.0:
        return False
    for i in range(1, n):
        if not c[i] > 0.0:
            return False
        factor = c[i - 1] / c[i]
        for j in range(i + 1, n, 2):
            c[j] -= factor * c[j + 1]
    return c[n] > 0.0


@kernel
def hurwitz_grid(corners, x, y, z, stable):
    """Fill stable (x.size, y.size, z.size) on the grid of the box coordinates x, y, z."""
    size = corners.shape[3]
    start, step, c = np.empty(size), np.empty(size), np.empty(size)
    for i in range(x.size):
        for j in range(y.size):
            # along z the polynomial is affine: start + z step
            for q in range(size):
                near = (1.0 - y[j]) * corners[0, 0, 0, q] + y[j] * corners[0, 1, 0, q]
                far = (1.0 - y[j]) * corners[1, 0, 0, q] + y[j] * corners[1, 1, 0, q]
                start[q] = (1.0 - x[i]) * near + x[i] * far
                near = (1.0 - y[j]) * corners[0, 0, 1, q] + y[j] * corners[0, 1, 1, q]
                far = (1.0 - y[j]) * corners[1, 0, 1, q] + y[j] * corners[1, 1, 1, q]
                step[q] = (1.0 - x[i]) * near + x[i] * far - start[q]
            for k in range(z.size):
                for q in range(size):
                    c[q] = start[q] + z[k] * step[q]
                stable[i, j, k] = is_hurwitz(c)


@kernel
def hurwitz_points(corners, points, stable):
    """Fill stable (P,) at P points of the box, given as coordinates (P, 3)."""
    verdict = np.empty((1, 1, 1), np.bool_)
    for i in range(len(points)):
        p = points[i]
        hurwitz_grid(corners, p[0:1], p[1:2], p[2:3], verdict)
        stable[i] = verdict[0, 0, 0]
