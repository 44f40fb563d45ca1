"""Where a step meets a break: the distance to it as a polynomial, and its first zero."""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.columns import BREAKS, IS_JUMP, ON_DISPLACEMENT, ON_VELOCITY, VALUE
from seatdyn.kernels.jit import allocating, inlined, inner
from seatdyn.kernels.plant import channel_force, relative, relative_acceleration

ROUNDING, KINK = 1e-13, 1e-11  # shares of a motion: being on a jump, on a kink
PROBES = 16  # points at which a step with a possible crossing is searched
BISECTIONS = 60


@inlined
def distance(plant, r, j, y, base, acceleration, side):
    """Signed distance g of the state to break r of channel j (g >= 0 on our side), g', g''."""
    d, v = relative(plant, j, y, base[0], base[1])
    a = relative_acceleration(plant, j, acceleration, base[2])
    p, q = plant.breaks[r, ON_DISPLACEMENT], plant.breaks[r, ON_VELOCITY]
    s = side[r]
    # the second derivative is only used where the break does not depend on the velocity
    return s * (p * d + q * v - plant.breaks[r, VALUE]), s * (p * v + q * a), s * p * a


@inlined
def quintic(s, h, g0, s0, c0, g1, s1, c1, curved):
    """Hermite polynomial at share s of a step: values, slopes and (if `curved`) curvatures."""
    m0, m1 = h * s0, h * s1
    rise = g1 - g0
    if not curved:
        return g0 + s * (m0 + s * (3 * rise - 2 * m0 - m1 + s * (m0 + m1 - 2 * rise)))
    k0, k1 = h * h * c0, h * h * c1
    p3 = 10 * rise - 6 * m0 - 4 * m1 - 1.5 * k0 + 0.5 * k1
    p4 = -15 * rise + 8 * m0 + 7 * m1 + 1.5 * k0 - k1
    p5 = 6 * rise - 3 * m0 - 3 * m1 - 0.5 * k0 + 0.5 * k1
    return g0 + s * (m0 + s * (0.5 * k0 + s * (p3 + s * (p4 + s * p5))))


@inner
def first_zero(h, g0, s0, c0, g1, s1, c1, curved, tolerance):
    """Share of the step at which g first falls below zero; 2 where it does not.

    Zero means that the state leaves its side at once. The step is searched where g ends below
    zero or dips inside (slopes of opposite sign).
    """
    starts_on = g0 <= tolerance
    if starts_on and s0 <= 0.0 and g1 < -tolerance:
        return 0.0
    dips = s0 < 0.0 and s1 > 0.0
    if g1 >= -tolerance and not dips:
        return 2.0
    low, high = 0.0, 2.0
    inside = not starts_on
    for i in range(1, PROBES + 1):
        s = i / PROBES
        g = g1 if i == PROBES else quintic(s, h, g0, s0, c0, g1, s1, c1, curved)
        if inside and g < 0.0 and (g < -tolerance or i < PROBES):
            high = s
            break
        if g > tolerance:
            inside = True
            low = s
    if high > 1.0:
        if not dips:
            # left the break and came back between two probes, or grazes within the tolerance
            return 0.5 / PROBES if g1 < -tolerance else 2.0
        # a dip narrower than the probes: look at the bottom
        low, high = 0.0, 1.0
        for _ in range(BISECTIONS):
            a, b = low + (high - low) / 3, high - (high - low) / 3
            ga = quintic(a, h, g0, s0, c0, g1, s1, c1, curved)
            gb = quintic(b, h, g0, s0, c0, g1, s1, c1, curved)
            if ga < gb:
                high = b
            else:
                low = a
        bottom = 0.5 * (low + high)
        if starts_on or quintic(bottom, h, g0, s0, c0, g1, s1, c1, curved) >= -tolerance:
            return 2.0
        low, high = 0.0, bottom
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if quintic(middle, h, g0, s0, c0, g1, s1, c1, curved) > 0.0:
            low = middle
        else:
            high = middle
    return high


@inner
def find_event(plant, h, base, base1, y, y1, a, a1, side, held, z_scale, v_scale):
    """Earliest break met in the step: share of the step (2 if none), its row and channel."""
    best, row, channel = 2.0, -1, -1
    for j in range(plant.gain.shape[0]):
        for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
            if held[j] == r:
                continue
            g0, s0, c0 = distance(plant, r, j, y, base, a, side)
            g1, s1, c1 = distance(plant, r, j, y1, base1, a1, side)
            curved = plant.breaks[r, ON_VELOCITY] == 0.0
            tolerance = 4 * break_tolerance(plant, r, z_scale, v_scale)
            share = first_zero(h, g0, s0, c0, g1, s1, c1, curved, tolerance)
            if share < best:
                best, row, channel = share, r, j
    return best, row, channel


@inlined
def far_from_breaks(plant, base0, base1, base2, y0, y1, y2, a0, a1, a2, side, z_scale, v_scale):
    """Whether no break can be met in two steps: distances positive and never turning up inside."""
    for j in range(plant.gain.shape[0]):
        for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
            g0, s0, _ = distance(plant, r, j, y0, base0, a0, side)
            g1, s1, _ = distance(plant, r, j, y1, base1, a1, side)
            g2, s2, _ = distance(plant, r, j, y2, base2, a2, side)
            near = 8 * break_tolerance(plant, r, z_scale, v_scale)
            if min(g0, g1, g2) <= near or (s0 < 0.0 < s1) or (s1 < 0.0 < s2):
                return False
    return True


@inner
def break_tolerance(plant, r, z_scale, v_scale):
    """Distance to break r that counts as being on it; a kink does no harm at first order."""
    p, q = abs(plant.breaks[r, ON_DISPLACEMENT]), abs(plant.breaks[r, ON_VELOCITY])
    share = ROUNDING if plant.breaks[r, IS_JUMP] == 1 else KINK
    return share * (p * z_scale + q * v_scale + abs(plant.breaks[r, VALUE]))


@inner
def resting_on(plant, r, j, y, base):
    """Displacement and velocity across channel j with its jump r reached exactly."""
    if plant.breaks[r, ON_DISPLACEMENT] != 0.0:
        return plant.breaks[r, VALUE], 0.0
    d, _ = relative(plant, j, y, base[0], base[1])
    return d, plant.breaks[r, VALUE]


@allocating
def one_sided_forces(plant, r, j, y, base, side):
    """Force of channel j just below and just above its jump r, the jump reached exactly."""
    d, v = resting_on(plant, r, j, y, base)
    trial = side.copy()
    trial[r] = -1
    below = channel_force(plant, j, d, v, trial)
    trial[r] = 1
    return below, channel_force(plant, j, d, v, trial)


@inner
def sides_of(plant, y, base, acceleration, side):
    """Set the side of every break from the state: by value, then velocity, then acceleration."""
    for j in range(plant.gain.shape[0]):
        d, v = relative(plant, j, y, base[0], base[1])
        a = relative_acceleration(plant, j, acceleration, base[2])
        for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
            p, q = plant.breaks[r, ON_DISPLACEMENT], plant.breaks[r, ON_VELOCITY]
            g = p * d + q * v - plant.breaks[r, VALUE]
            if g == 0.0:
                g = p * v + q * a
            if g == 0.0:
                g = -np.sign(plant.breaks[r, VALUE])
            side[r] = 1 if g > 0.0 else -1
