"""Types of what kernels hand to each other, for those that are compiled before they are called."""

from __future__ import annotations

from numba import types

REAL, INTEGER = types.float64, types.int64
VECTOR, TABLE, BLOCK, STACK = (
    types.float64[::1],
    types.float64[:, ::1],
    types.float64[:, :, ::1],
    types.float64[:, :, :, ::1],
)
INTEGERS, INTEGER_TABLE = types.int64[::1], types.int64[:, ::1]
COMPLEX_VECTOR, COMPLEX_TABLE, COMPLEX_BLOCK = (
    types.complex128[::1],
    types.complex128[:, ::1],
    types.complex128[:, :, ::1],
)
BASE = types.UniTuple(REAL, 3)  # displacement, velocity and acceleration of the base
