"""The force laws: plain functions F(d, v, p) of travel, rate and parameters, compiled on first use.

Each is compiled to a C function of its own (`jit.law_address`), which the kernels call by its
address: a built-in law and a user's law are the same thing. They may use numbers, the math module
and plain control flow; p is indexed only. Where all parameters are read at the begin, no branch
waits for memory, and ensembles compute several members with one instruction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

TANGENT_END = 0.999  # share of the travel where the tangent law goes on along its slope
TWO_OVER_PI = 2.0 / math.pi
STEEP, MIDDLE = 1.0 + math.sqrt(2.0), 0.66  # tan(3 pi/8), and near tan(pi/5): see `arctangent`


def arctangent(x: float) -> float:
    """Arc tangent to 1 unit in the last place, by arithmetic only: a loop over it is vectorised.

    Rational approximation of the Cephes library (S. Moshier), on one of three ranges.
    """
    t = abs(x)
    steep, middle = t > STEEP, t > MIDDLE
    above = -1.0 if steep else (t - 1.0 if middle else t)
    below = t if steep else (t + 1.0 if middle else 1.0)
    start = math.pi / 2 if steep else (math.pi / 4 if middle else 0.0)
    r = above / below
    z = r * r
    p = -8.750608600031904122785e-1 * z - 1.615753718733365076637e1
    p = ((p * z - 7.500855792314704667340e1) * z - 1.228866684490136173410e2) * z
    q = (z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2
    q = ((q * z + 4.328810604912902668951e2) * z + 4.853903996359136964868e2) * z
    part = (p - 6.485021904942025371773e1) / (q + 1.945506571482613964425e2)
    return math.copysign(start + (r + r * z * part), x)


def quadratic(d: float, v: float, p: Sequence[float]) -> float:
    """Quadratic damping; p = coefficient."""
    return p[0] * abs(v) * v


def coulomb(d: float, v: float, p: Sequence[float]) -> float:
    """Smoothed Coulomb friction; p = force, slope."""
    return TWO_OVER_PI * p[0] * arctangent(p[1] * v)


def jump(d: float, v: float, p: Sequence[float]) -> float:
    """Spring that acts in full outside a free zone; p = stiffness, lower, upper end of the zone."""
    k, lower, upper = p[0], p[1], p[2]
    return k * d if (d > upper or d < lower) else 0.0


def gap(d: float, v: float, p: Sequence[float]) -> float:
    """Spring that starts at the ends of a free zone; p = stiffness, lower, upper end."""
    k, lower, upper = p[0], p[1], p[2]
    if d > upper:
        return k * (d - upper)
    return k * (d - lower) if d < lower else 0.0


def end_stop(d: float, v: float, p: Sequence[float]) -> float:
    """Buffers with damping that never pull; p = stiffness, lower, upper contact, damping."""
    k, lower, upper, c = p[0], p[1], p[2], p[3]
    if d > upper:
        return max(0.0, k * (d - upper) + c * v)
    if d < lower:
        return min(0.0, k * (d - lower) + c * v)
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
    bump, rebound = p[0], p[1]
    return bump * v if v < 0.0 else rebound * v


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


def linear(d: float, v: float, p: Sequence[float]) -> float:
    """Spring and damper, as an element behind a lever sees them; p = stiffness, coefficient."""
    return p[0] * d + p[1] * v


def stribeck(d: float, v: float, p: Sequence[float]) -> float:
    """Stribeck friction; p = sliding, static force, speed, exponent, viscous, slope (0: dry)."""
    level = p[0] + (p[1] - p[0]) * math.exp(-math.pow(abs(v) / p[2], p[3]))
    if p[5] > 0.0:
        sign = TWO_OVER_PI * arctangent(p[5] * v)
    elif v == 0.0:
        sign = 0.0
    else:
        sign = math.copysign(1.0, v)
    return level * sign + p[4] * v


def power_damper(d: float, v: float, p: Sequence[float]) -> float:
    """Damper with a power of the speed; p = coefficient, exponent, blending speed."""
    return p[0] * v * math.pow(v * v + p[2] * p[2], 0.5 * (p[1] - 1.0))


def contact(d: float, v: float, p: Sequence[float]) -> float:
    """Contact k delta^n (1 + lambda delta'), never pulling; p = k, lower, upper, n, lambda."""
    if d > p[2]:
        return p[0] * math.pow(d - p[2], p[3]) * max(0.0, 1.0 + p[4] * v)
    if d < p[1]:
        return -p[0] * math.pow(p[1] - d, p[3]) * max(0.0, 1.0 - p[4] * v)
    return 0.0


def hertz(d: float, v: float, p: Sequence[float]) -> float:
    """The same for n = 3/2, p = k, lower, upper, (unused), lambda: roots are faster than powers."""
    k, lower, upper, slowing = p[0], p[1], p[2], p[4]
    side = 1.0 if d > upper else -1.0
    inside = max(d - upper, lower - d, 0.0)
    return side * k * inside * math.sqrt(inside) * max(0.0, 1.0 + side * slowing * v)


def air_spring(d: float, v: float, p: Sequence[float]) -> float:
    """Polytropic air spring less its load at d = 0, along its slope outside two edges.

    p = pressure, ambient pressure, area, its slope, volume, exponent, lower and upper edge
    """
    inside = min(max(d, p[6]), p[7])
    area = p[2] + p[3] * inside
    volume = p[4] + inside * (p[2] + 0.5 * p[3] * inside)
    pressure = p[0] * math.pow(p[4] / volume, p[5])
    slope = p[5] * pressure * area * area / volume - (pressure - p[1]) * p[3]
    return (p[0] - p[1]) * p[2] - (pressure - p[1]) * area + slope * (d - inside)


def three_springs(d: float, v: float, p: Sequence[float]) -> float:
    """One vertical and two oblique springs; p = vertical, oblique, free length, span."""
    return d * (p[0] + 2.0 * p[1] * (1.0 - p[2] / math.sqrt(d * d + p[3] * p[3])))


def bingham(d: float, v: float, p: Sequence[float]) -> float:
    """Bingham damper; p = yield force, viscous coefficient, offset, slope (0: dry)."""
    if p[3] > 0.0:
        sign = TWO_OVER_PI * arctangent(p[3] * v)
    elif v == 0.0:
        sign = 0.0
    else:
        sign = math.copysign(1.0, v)
    return p[0] * sign + p[1] * v + p[2]


def tanh_damper(d: float, v: float, p: Sequence[float]) -> float:
    """Damper with a tanh loop; p = viscous, stiffness, height, 1/speed, width, offset."""
    side = 0.0 if d == 0.0 else math.copysign(p[4], d)
    return p[0] * v + p[1] * d + p[2] * math.tanh(p[3] * v + side) + p[5]


def balance_damper(d: float, v: float, p: Sequence[float]) -> float:
    """Damper that cancels a spring where a damper can; p = stiffness, smallest, largest."""
    if d * v >= 0.0:
        return p[1] * v
    wanted = -p[0] * d
    if v > 0.0:
        return min(max(wanted, p[1] * v), p[2] * v)
    return max(min(wanted, p[1] * v), p[2] * v)


def polynomial_lever(d: float, p: Sequence[float], m: int) -> tuple[float, float]:
    """Travel and ratio of a lever; p from m on = bump and rebound end, ratio r0 ... r4."""
    x = min(max(d, p[m]), p[m + 1])
    a, b, c, e, f = p[m + 2], p[m + 3], p[m + 4], p[m + 5], p[m + 6]
    ratio = a + x * (b + x * (c + x * (e + x * f)))
    travel = x * (a + x * (b / 2 + x * (c / 3 + x * (e / 4 + x * f / 5))))
    return travel + ratio * (d - x), ratio


def scissor_lever(d: float, p: Sequence[float], m: int) -> tuple[float, float]:
    """Travel and ratio of a horizontal element in a scissor; p from m on = arm, height, ends."""
    x = min(max(d, p[m + 2]), p[m + 3])
    height = p[m + 1] + x
    width = math.sqrt(p[m] * p[m] - height * height)
    ratio = height / width
    rest = math.sqrt(p[m] * p[m] - p[m + 1] * p[m + 1])
    return rest - width + ratio * (d - x), ratio
