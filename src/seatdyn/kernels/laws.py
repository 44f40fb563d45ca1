"""The force laws: plain functions F(d, v, p) of travel, rate and parameters, compiled on first use.

Each is compiled to a C function of its own (`jit.law_address`), which the kernels call by its
address: a built-in law and a user's law are the same thing. They may use numbers, the math module
and plain control flow; p is indexed only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

TANGENT_END = 0.999  # share of the travel where the tangent law goes on along its slope
TWO_OVER_PI = 2.0 / math.pi


def quadratic(d: float, v: float, p: Sequence[float]) -> float:
    """Quadratic damping; p = coefficient."""
    return p[0] * abs(v) * v


def coulomb(d: float, v: float, p: Sequence[float]) -> float:
    """Smoothed Coulomb friction; p = force, slope."""
    return TWO_OVER_PI * p[0] * math.atan(p[1] * v)


def jump(d: float, v: float, p: Sequence[float]) -> float:
    """Spring that acts in full outside a free zone; p = stiffness, lower, upper end of the zone."""
    return p[0] * d if (d > p[2] or d < p[1]) else 0.0


def gap(d: float, v: float, p: Sequence[float]) -> float:
    """Spring that starts at the ends of a free zone; p = stiffness, lower, upper end."""
    if d > p[2]:
        return p[0] * (d - p[2])
    return p[0] * (d - p[1]) if d < p[1] else 0.0


def end_stop(d: float, v: float, p: Sequence[float]) -> float:
    """Buffers with damping that never pull; p = stiffness, lower, upper contact, damping."""
    if d > p[2]:
        return max(0.0, p[0] * (d - p[2]) + p[3] * v)
    if d < p[1]:
        return min(0.0, p[0] * (d - p[1]) + p[3] * v)
    return 0.0


def tangent_polynomial(d: float, v: float, p: Sequence[float]) -> float:
    """Tangent spring plus quintic; p = tangent stiffness, travel, a1 ... a5."""
    edge = TANGENT_END * p[1]
    inside = min(max(d, -edge), edge)
    scale = math.pi / (2.0 * p[1])
    tangent = math.tan(scale * inside)
    spring = p[0] * (tangent / scale + (1.0 + tangent * tangent) * (d - inside))
    return spring + d * (p[2] + d * (p[3] + d * (p[4] + d * (p[5] + d * p[6]))))


def polynomial_damper(d: float, v: float, p: Sequence[float]) -> float:
    """Damping coefficient as quartic of the displacement; p = c0 ... c4."""
    return v * (p[0] + d * (p[1] + d * (p[2] + d * (p[3] + d * p[4]))))


def asymmetric_damper(d: float, v: float, p: Sequence[float]) -> float:
    """Damper with two branches; p = coefficient in bump, in rebound."""
    return p[0] * v if v < 0.0 else p[1] * v


def constant(d: float, v: float, p: Sequence[float]) -> float:
    """Constant force; p = force."""
    return p[0]


def table(d: float, v: float, p: Sequence[float]) -> float:
    """Monotone cubic through a table; p = 0 (over d) or 1 (over v), count, points, values, slopes.

    Outside the table it goes on along the slope at its end.
    """
    x = d if p[0] == 0.0 else v
    n = int(p[1])
    points, values, slopes = 2, 2 + n, 2 + 2 * n
    if x <= p[points]:
        return p[values] + p[slopes] * (x - p[points])
    if x >= p[points + n - 1]:
        return p[values + n - 1] + p[slopes + n - 1] * (x - p[points + n - 1])
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if p[points + middle] <= x:
            low = middle
        else:
            high = middle
    h = p[points + high] - p[points + low]
    s = (x - p[points + low]) / h
    rise = p[values + high] - p[values + low]
    m0, m1 = h * p[slopes + low], h * p[slopes + high]
    return p[values + low] + s * (m0 + s * (3 * rise - 2 * m0 - m1 + s * (m0 + m1 - 2 * rise)))
