"""Laws of elements with states of their own: a force and the rates of the states.

    force(d, v, s, p) -> F             travel, its rate, states, parameters
    rate(d, v, w, a, s, p, out)        w, a: absolute velocity and acceleration of the second node

They are plain functions, compiled to C functions as the force laws are (see `laws`). The rate
writes ds/dt into `out`. The force must not depend on the acceleration, which follows from it.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

Numbers = Sequence[float]
TWO_OVER_PI = 2.0 / math.pi
SKYHOOK, ON_OFF, ACCELERATION = 1.0, 2.0, 3.0  # control laws; 0 is passive


def dahl_force(d: float, v: float, s: Numbers, p: Numbers) -> float:
    """Dahl friction; s = force; p = stiffness, sliding force, exponent, viscous."""
    return s[0] + p[3] * v


def dahl_rate(
    d: float, v: float, w: float, a: float, s: Numbers, p: Numbers, out: MutableSequence[float]
) -> None:
    """dF/dt = sigma v |1 - F/Fc sign v|^i sign(1 - F/Fc sign v)."""
    left = 1.0 - s[0] / p[1] if v >= 0.0 else 1.0 + s[0] / p[1]
    out[0] = p[0] * v * math.copysign(math.pow(abs(left), p[2]), left)


def lugre_force(d: float, v: float, s: Numbers, p: Numbers) -> float:
    """LuGre friction; s = bristle deflection; p = stiffness, damping, viscous, Fc, Fs, speed."""
    ratio = v / p[5]
    level = p[3] + (p[4] - p[3]) * math.exp(-ratio * ratio)
    rate = v - p[0] * abs(v) * s[0] / level
    return p[0] * s[0] + p[1] * rate + p[2] * v


def lugre_rate(
    d: float, v: float, w: float, a: float, s: Numbers, p: Numbers, out: MutableSequence[float]
) -> None:
    """dz/dt = v - sigma0 |v| z/g(v)."""
    ratio = v / p[5]
    level = p[3] + (p[4] - p[3]) * math.exp(-ratio * ratio)
    out[0] = v - p[0] * abs(v) * s[0] / level


def bouc_wen_force(d: float, v: float, s: Numbers, p: Numbers) -> float:
    """Bouc-Wen; s = z; p = stiffness, share, viscous, A, beta, gamma, n."""
    return p[0] * (p[1] * d + (1.0 - p[1]) * s[0]) + p[2] * v


def bouc_wen_rate(
    d: float, v: float, w: float, a: float, s: Numbers, p: Numbers, out: MutableSequence[float]
) -> None:
    """dz/dt = A v - gamma |v| |z|^(n-1) z - beta v |z|^n."""
    size = math.pow(abs(s[0]), p[6])
    along = math.copysign(size, s[0])
    out[0] = p[3] * v - p[5] * abs(v) * along - p[4] * v * size


def zener_force(d: float, v: float, s: Numbers, p: Numbers) -> float:
    """Zener; s = stretch of the dashpot; p = stiffness, relaxing stiffness, time."""
    return p[0] * d + p[1] * (d - s[0])


def zener_rate(
    d: float, v: float, w: float, a: float, s: Numbers, p: Numbers, out: MutableSequence[float]
) -> None:
    """ds/dt = (d - s)/time."""
    out[0] = (d - s[0]) / p[2]


def tank_force(d: float, v: float, s: Numbers, p: Numbers) -> float:
    """Air spring with tank, less its load at d = 0; s = share of the bellows' air in the tank.

    p = pressure, ambient pressure, area, bellows' volume, tank's volume, exponent, restriction
    """
    left = max(1e-3, 1.0 - s[0]) / max(1e-3, 1.0 + p[2] * d / p[3])
    return p[2] * p[0] * (1.0 - math.pow(left, p[5]))


def tank_rate(
    d: float, v: float, w: float, a: float, s: Numbers, p: Numbers, out: MutableSequence[float]
) -> None:
    """Flow through the restriction, (pb - pa)/R, over the bellows' volume."""
    left = max(1e-3, 1.0 - s[0]) / max(1e-3, 1.0 + p[2] * d / p[3])
    tank = max(1e-3, 1.0 + s[0] * p[3] / p[4])
    out[0] = p[0] * (math.pow(left, p[5]) - math.pow(tank, p[5])) / (p[6] * p[3])


def spencer_force(d: float, v: float, s: Numbers, p: Numbers) -> float:
    """Spencer's model; s = dashpot travel y, hysteretic z; p = alpha, c0, c1, k0, k1, x0, ..."""
    rate = (p[0] * s[1] + p[1] * v + p[3] * (d - s[0])) / (p[1] + p[2])
    return p[2] * rate + p[4] * (d - p[5])


def spencer_rate(
    d: float, v: float, w: float, a: float, s: Numbers, p: Numbers, out: MutableSequence[float]
) -> None:
    """p goes on with A, beta, gamma, n."""
    out[0] = (p[0] * s[1] + p[1] * v + p[3] * (d - s[0])) / (p[1] + p[2])
    slip = v - out[0]
    size = math.pow(abs(s[1]), p[9])
    along = math.copysign(size, s[1])
    out[1] = p[6] * slip - p[8] * abs(slip) * along - p[7] * slip * size


def semi_active_force(d: float, v: float, s: Numbers, p: Numbers) -> float:
    """Damper with the coefficient s within its limits; p = smallest, largest, force limit, ..."""
    force = min(max(s[0], p[0]), p[1]) * v
    return min(max(force, -p[2]), p[2])


def semi_active_rate(
    d: float, v: float, w: float, a: float, s: Numbers, p: Numbers, out: MutableSequence[float]
) -> None:
    """The coefficient follows its command; p goes on with lag, law, gain, command, threshold."""
    wanted, way = p[6], math.copysign(1.0, v) if v != 0.0 else 0.0
    if p[4] == ON_OFF or p[4] == ACCELERATION:
        seen = w if p[4] == ON_OFF else a
        share = way * seen / math.sqrt(seen * seen + p[7] * p[7])
        wanted = p[0] + 0.5 * (1.0 + share) * (p[1] - p[0])
    elif p[4] == SKYHOOK:
        # gain w/v within the limits, without the division
        force, speed = way * p[5] * w, abs(v)
        if way == 0.0:
            wanted = 0.5 * (p[0] + p[1])
        elif force >= p[1] * speed:
            wanted = p[1]
        elif force <= p[0] * speed:
            wanted = p[0]
        else:
            wanted = force / speed
    out[0] = (wanted - s[0]) / p[3]


def mr_force(d: float, v: float, s: Numbers, p: Numbers) -> float:
    """Bingham damper with the current s; p = viscous, yield force, more per A, slope, largest A."""
    current = min(max(s[0], 0.0), p[4])
    return TWO_OVER_PI * (p[1] + p[2] * current) * math.atan(p[3] * v) + p[0] * v


def mr_rate(
    d: float, v: float, w: float, a: float, s: Numbers, p: Numbers, out: MutableSequence[float]
) -> None:
    """The current follows its command; p goes on with lag, law, gain, command, threshold."""
    wanted, way = p[8], math.copysign(1.0, v) if v != 0.0 else 0.0
    if p[6] == ON_OFF or p[6] == ACCELERATION:
        seen = w if p[6] == ON_OFF else a
        share = way * seen / math.sqrt(seen * seen + p[9] * p[9])
        wanted = 0.5 * (1.0 + share) * p[4]
    elif p[6] == SKYHOOK:
        force = way * p[7] * w
        wanted = min(max((force - p[1] - p[0] * abs(v)) / p[2], 0.0), p[4])
    out[0] = (wanted - s[0]) / p[5]
