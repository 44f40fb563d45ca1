"""Where a step meets a break: the distance to it as a polynomial, and its first zero."""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.columns import BREAKS, IS_JUMP, ON_DISPLACEMENT, ON_VELOCITY, VALUE
from seatdyn.kernels.jit import inlined, inner, stage, takes
from seatdyn.kernels.plant import AT_PLANT, relative, relative_acceleration
from seatdyn.kernels.shapes import BASE, INTEGERS, REAL, VECTOR
from seatdyn.kernels.sides import sum_of_laws

ROUNDING, KINK = 1e-13, 1e-11  # shares of a motion: being on a jump, on a kink
NEAR = 4.0  # tolerances of a break: so far below it nothing is met
TOUCH = 1e-6  # of a step: a dip narrower than this is none
SECANTS, SHORTEST = 60, 1e-12  # steps of false position; interval that ends it, of a step


@inlined
def distance(plant, r, j, y, base, acceleration, side):
    """Signed distance g of the state to break r of channel j (g >= 0 on our side), and g'."""
    d, v = relative(plant, j, y, base[0], base[1])
    a = relative_acceleration(plant, j, acceleration, base[2])
    p, q, s = plant.breaks[r, ON_DISPLACEMENT], plant.breaks[r, ON_VELOCITY], side[r]
    return s * (p * d + q * v - plant.breaks[r, VALUE]), s * (p * v + q * a)


@inlined
def bernstein(h, d0, v0, a0, d1, v1, a1, p, q, value):
    """p d + q v - value over a step, d the quintic between its ends: six Bernstein coefficients."""
    rate = 5.0 * ((d1 - d0) / h - 0.4 * (v0 + v1)) + 0.25 * h * (a1 - a0)
    rate0, rate1 = v0 + 0.25 * h * a0, v1 - 0.25 * h * a1
    bend0, bend1 = 0.05 * h * h * a0, 0.05 * h * h * a1
    return (
        p * d0 + q * v0 - value,
        p * (d0 + 0.2 * h * v0) + q * (0.2 * v0 + 0.8 * rate0) - value,
        p * (d0 + 0.4 * h * v0 + bend0) + q * (0.4 * rate0 + 0.6 * rate) - value,
        p * (d1 - 0.4 * h * v1 + bend1) + q * (0.6 * rate + 0.4 * rate1) - value,
        p * (d1 - 0.2 * h * v1) + q * (0.8 * rate1 + 0.2 * v1) - value,
        p * d1 + q * v1 - value,
    )


@inlined
def sign_changes(b, degree):
    """Number of sign changes in the coefficients: no fewer than zeros between 0 and 1."""
    changes, positive = 0, b[0] >= 0.0
    for i in range(1, degree + 1):
        if (b[i] >= 0.0) != positive:
            changes, positive = changes + 1, not positive
    return changes


@inlined
def restrict(b, degree, low, high):
    """Coefficients of the same polynomial over low..high instead of 0..1 (de Casteljau)."""
    for r in range(1, degree + 1):
        for i in range(degree + 1 - r):
            b[i] += low * (b[i + 1] - b[i])
    share = (high - low) / (1.0 - low)
    for r in range(1, degree + 1):
        for i in range(degree, r - 1, -1):
            b[i] = b[i - 1] + share * (b[i] - b[i - 1])


@inlined
def bernstein_value(b, degree, s):
    """Polynomial of degree 4 or 5 at s."""
    u = 1.0 - s
    if degree == 4:
        return (
            u * (u * (u * (u * b[0] + 4 * s * b[1]) + 6 * s * s * b[2]) + 4 * s**3 * b[3])
            + s**4 * b[4]
        )
    return (
        u
        * (
            u * (u * (u * (u * b[0] + 5 * s * b[1]) + 10 * s * s * b[2]) + 10 * s**3 * b[3])
            + 5 * s**4 * b[4]
        )
        + s**5 * b[5]
    )


@inlined
def depth_of_dip(b):
    """How far a quintic that begins to fall does so before it rises, by its first three terms."""
    fall, bend = 5.0 * (b[0] - b[1]), 10.0 * (b[0] - 2.0 * b[1] + b[2])
    return 0.25 * fall * fall / max(bend, 0.5 * fall) if fall > 0.0 else 0.0


@inner
def first_zero(b, tolerance):
    """Where in 0..1 the quintic with Bernstein coefficients b first falls below zero; 2 if nowhere.

    Zero means that it falls below at once, one that it is about to; less than `tolerance` below
    zero does not count. The interval is halved until the signs of the coefficients show a single
    zero (Descartes). `b` is used up.
    """
    lowest = min(min(b[1], b[2]), min(b[3], b[4]), b[5])
    if lowest >= -tolerance:
        meets = b[0] > tolerance and b[4] > tolerance and b[5] <= tolerance
        return 1.0 if meets else 2.0  # just at the end of the step
    degree = 5
    if b[0] <= tolerance:
        # on the break: what is left after division by s tells where it is met again; a slope that
        # falls by no more than roundings, with a rise after it, is none
        rises = b[1] >= -tolerance and b[2] > tolerance
        if b[1] - b[0] <= 0.0 and not rises:
            return 0.0 if b[5] < -tolerance or depth_of_dip(b) > tolerance else 2.0
        degree = 4
        for i in range(5):
            b[i] = 5.0 / (i + 1) * b[i + 1]
        b[0] = max(b[0], 0.0)
    whole = (b[0], b[1], b[2], b[3], b[4], b[5])
    low, size = 0.0, 1.0
    changes = sign_changes(b, degree)
    while changes != 1:
        if changes > 0 and size > TOUCH:
            size *= 0.5
        else:
            low += size
            size = min(2 * size, 1.0 - low)
            if size <= 0.0:
                return 2.0
        for i in range(6):
            b[i] = whole[i]
        restrict(b, degree, low, low + size)
        if b[0] < 0.0:
            return low
        changes = sign_changes(b, degree)
    # a zero between two ends of opposite sign: false position, an end kept twice counts half
    left, right, above, below, kept = 0.0, 1.0, b[0], b[degree], 0
    s = 0.0
    for _ in range(SECANTS):
        s = (left * below - right * above) / (below - above)
        g = bernstein_value(b, degree, s)
        if abs(g) <= 0.01 * tolerance or right - left < SHORTEST:
            break
        if g > 0.0:
            left, above = s, g
            if kept > 0:
                below *= 0.5
            kept = 1
        else:
            right, below = s, g
            if kept < 0:
                above *= 0.5
            kept = -1
    return low + s * size


@inlined
def meeting(h, start, end, p, q, value, tolerance, b):
    """Where in 0..1 a step first goes below p d + q v = value; see `first_zero`.

    start, end : d, v and a across the channel
    b : (6,) scratch
    """
    b0, b1, b2, b3, b4, b5 = bernstein(h, *start, *end, p, q, value)
    if min(min(b1, b2), min(b3, b4), b5) > tolerance:
        return 2.0
    b[0], b[1], b[2], b[3], b[4], b[5] = b0, b1, b2, b3, b4, b5
    return first_zero(b, tolerance)


@takes(
    AT_PLANT, REAL, BASE, BASE, VECTOR, VECTOR, VECTOR, VECTOR, INTEGERS, INTEGERS, REAL, REAL,
    VECTOR,
)  # fmt: skip
@stage
def find_event(plant, h, base, base1, y, y1, a, a1, side, held, z_scale, v_scale, b):
    """Earliest break met in a step: share of the step (2 if none), its row and channel.

    b : (6,) scratch
    """
    best, row, channel = 2.0, -1, -1
    for j in range(held.size):
        d0, v0 = relative(plant, j, y, base[0], base[1])
        d1, v1 = relative(plant, j, y1, base1[0], base1[1])
        acc0 = relative_acceleration(plant, j, a, base[2])
        acc1 = relative_acceleration(plant, j, a1, base1[2])
        for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
            if held[j] == r:
                continue
            p, q = (
                side[r] * plant.breaks[r, ON_DISPLACEMENT],
                side[r] * plant.breaks[r, ON_VELOCITY],
            )
            value = side[r] * plant.breaks[r, VALUE]
            near = NEAR * break_tolerance(plant, r, z_scale, v_scale)
            share = meeting(h, (d0, v0, acc0), (d1, v1, acc1), p, q, value, near, b)
            if share < best:
                best, row, channel = share, r, j
    return best, row, channel


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


@inner
def is_left_with(plant, q, r):
    """Whether a state that rests on jump r and leaves it leaves jump q, too.

    At rest on a jump with the displacement, v = 0: dry friction of the channel gives way with it.
    """
    if q == r:
        return True
    resting = plant.breaks[r, ON_DISPLACEMENT] != 0.0 and plant.breaks[q, IS_JUMP] == 1
    friction = plant.breaks[q, ON_DISPLACEMENT] == 0.0 and plant.breaks[q, VALUE] == 0.0
    return resting and friction


@inner
def leave(plant, r, j, way, side):
    """Go from jump r of channel j to one side (way 1 or -1) of it."""
    for q in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
        if is_left_with(plant, q, r):
            side[q] = way


@inner
def beside_jump(plant, r, j, d, v, side, way):
    """State (d, v) on jump r of channel j, moved to one side of it by a rounding."""
    for q in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS]):
        if plant.breaks[q, IS_JUMP] == 0:
            continue
        there = way if is_left_with(plant, q, r) else side[q]
        edge = np.nextafter(plant.breaks[q, VALUE], there * np.inf)
        if plant.breaks[q, ON_DISPLACEMENT] != 0.0:
            d = max(d, edge) if there > 0 else min(d, edge)
        else:
            v = max(v, edge) if there > 0 else min(v, edge)
    return d, v


@inner
def one_sided_forces(plant, r, j, y, base, side):
    """Force of channel j just below and just above its jump r, the jump reached exactly."""
    d, v = resting_on(plant, r, j, y, base)
    d_low, v_low = beside_jump(plant, r, j, d, v, side, -1)
    d_high, v_high = beside_jump(plant, r, j, d, v, side, 1)
    return sum_of_laws(plant, j, d_low, v_low), sum_of_laws(plant, j, d_high, v_high)


@takes(AT_PLANT, VECTOR, BASE, VECTOR, INTEGERS)
@stage
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
