"""Where a periodic motion meets the breaks of its laws, and what the force does there.

A break of channel j is a line p d + q v = value. Crossings are bracketed on the samples and
located on the series itself. The force just before and just after is evaluated on the line, one
rounding to either side, as time integration does; its derivatives along the motion are one-sided
differences.
"""

from __future__ import annotations

import math

import numpy as np

from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import (
    ADDRESS,
    BREAKS,
    ELEMENTS,
    IS_JUMP,
    OFFSET,
    ON_DISPLACEMENT,
    ON_VELOCITY,
    VALUE,
)
from seatdyn.kernels.condensed import (
    CHANNEL,
    CORNER,
    DISPLACEMENT,
    FOUND,
    IMPULSE_D,
    IMPULSE_V,
    JUMP,
    MOST_EVENTS,
    PHASE,
    PRESENT,
    REDUCED,
    ROW,
    STRENGTH,
    VELOCITY,
    number_of,
    state_at,
)
from seatdyn.kernels.jit import inner, spliced

STEP = 1e-6  # of the largest motion: differences of laws
SHORT = 1e-3  # rad: one-sided differences along the motion
REFINEMENTS = 40
SETTLED = 1e-8  # rad: a step of Newton's method after which the next would be a rounding
NO_CORNER = 1e-7  # of the largest force: weaker corners are no matter


@inner
def law_force(problem, j, d, v):
    """Sum of the forces of the elements of channel j, less what the linear part has of it."""
    total = -problem.shift[j] * d
    for e in range(problem.channels[j, ELEMENTS], problem.channels[j + 1, ELEMENTS]):
        address, offset = problem.elements[e, ADDRESS], problem.elements[e, OFFSET]
        total += call_law(address, d, v, problem.parameters, offset)
    return total


@inner
def same_side(problem, j, d0, v0, d1, v1):
    """Whether no jump of channel j lies between two states."""
    for r in range(problem.channels[j, BREAKS], problem.channels[j + 1, BREAKS]):
        if problem.breaks[r, IS_JUMP] != 0.0:
            p, q = problem.breaks[r, ON_DISPLACEMENT], problem.breaks[r, ON_VELOCITY]
            value = problem.breaks[r, VALUE]
            if (p * d0 + q * v0 > value) != (p * d1 + q * v1 > value):
                return False
    return True


@inner
def law_slope(problem, j, d, v, dd, dv):
    """Change of the force from one side (-dd, -dv) to the other, relative to the way.

    It never reaches across a jump; dd and dv are not negative and one of them is zero.
    """
    up, down = dd + dv, dd + dv
    if not same_side(problem, j, d, v, d + dd, v + dv):
        up = 0.0
    if not same_side(problem, j, d, v, d - dd, v - dv):
        down = 0.0
    if up + down == 0.0:
        return 0.0
    above = law_force(problem, j, d + dd, v + dv) if up > 0.0 else law_force(problem, j, d, v)
    below = law_force(problem, j, d - dd, v - dv) if down > 0.0 else law_force(problem, j, d, v)
    return (above - below) / (up + down)


@spliced
def beside(problem, r, d, v, side):
    """Move a state on break r to the next number on one side of it."""
    p, q = problem.breaks[r, ON_DISPLACEMENT], problem.breaks[r, ON_VELOCITY]
    if p != 0.0 and q != 0.0:  # a kink: no side is needed
        return d, v
    if p != 0.0:
        return np.nextafter(problem.breaks[r, VALUE] / p, side * p * np.inf), v
    return d, np.nextafter(problem.breaks[r, VALUE] / q, side * q * np.inf)


@spliced
def distance_at(problem, work, count, r, j, theta):
    """Distance of channel j from its break r at a phase, its change with phase, d, v and a."""
    d, v, a = state_at(
        problem, work.series[REDUCED], count, work.events[PRESENT],
        work.events[PRESENT, :, CORNER + 2 * problem.lag.size :], j, theta,
    )  # fmt: skip
    p, q = problem.breaks[r, ON_DISPLACEMENT], problem.breaks[r, ON_VELOCITY]
    return p * d + q * v - problem.breaks[r, VALUE], (p * v + q * a) / problem.omega, d, v, a


@inner
def one_sided(problem, j, d, v, a, way, force):
    """First and second derivative of the force with phase just after (way 1) or before (-1).

    force : of the state on that side. A second derivative that changes with the step of the
    differences belongs to a steep law, not to the break; zero then.
    """
    first, second, fine = 0.0, 0.0, 0.0
    for step in (SHORT, 0.25 * SHORT):
        h = way * step / problem.omega
        near = law_force(problem, j, d + h * (v + 0.5 * h * a), v + h * a)
        far = law_force(problem, j, d + 2 * h * (v + h * a), v + 2 * h * a)
        first = way * (4.0 * near - 3.0 * force - far) / (2.0 * step)
        second, fine = fine, (force - 2.0 * near + far) / (step * step)
    return first, fine if abs(fine - second) <= 0.1 * abs(second) else 0.0


@inner
def keep_event(problem, work, count, r, j, theta, side):
    """Append the event of channel j reaching `side` of break r at a phase; False if too many."""
    found = work.events[FOUND]
    m = problem.lag.size
    e = number_of(found)
    if e >= MOST_EVENTS:
        return False
    _, rate, d, v, a = distance_at(problem, work, count, r, j, theta)
    d0, v0 = beside(problem, r, d, v, -side)
    d1, v1 = beside(problem, r, d, v, side)
    before, after = law_force(problem, j, d0, v0), law_force(problem, j, d1, v1)
    jump = after - before if problem.breaks[r, IS_JUMP] != 0.0 else 0.0
    weight = 0.0
    for i in range(m):
        # the acceleration of every channel jumps, and with it the slope of its force
        leap = problem.gain[i, j] * jump * problem.scale[STRENGTH]
        if problem.lag[j] != 0.0:
            leap = 0.0
        found[e, CORNER + i], found[e, CORNER + m + i] = 0.0, 0.0
        if i == j:
            first0, second0 = one_sided(problem, j, d0, v0, a + 0.5 * leap, -1.0, before)
            first1, second1 = one_sided(problem, j, d1, v1, a - 0.5 * leap, 1.0, after)
            found[e, CORNER + i], found[e, CORNER + m + i] = first1 - first0, second1 - second0
            size = abs(first0) + abs(first1) + abs(second0) + abs(second1)
            weight = abs(first1 - first0) + abs(second1 - second0) - NO_CORNER * size
        elif leap != 0.0:
            _, _, d2, v2, a2 = distance_at(problem, work, count, r, i, theta)
            force = law_force(problem, i, d2, v2)
            first0, second0 = one_sided(problem, i, d2, v2, a2 + 0.5 * leap, -1.0, force)
            first1, second1 = one_sided(problem, i, d2, v2, a2 - 0.5 * leap, 1.0, force)
            found[e, CORNER + i], found[e, CORNER + m + i] = first1 - first0, second1 - second0
    if jump == 0.0 and weight <= 0.0:
        return True
    found[MOST_EVENTS, 0] = e + 1
    found[e, PHASE], found[e, ROW], found[e, CHANNEL], found[e, JUMP] = theta, r, j, jump
    steepness = jump / rate if rate != 0.0 else 0.0
    found[e, IMPULSE_D] = problem.breaks[r, ON_DISPLACEMENT] * steepness
    found[e, IMPULSE_V] = problem.breaks[r, ON_VELOCITY] * steepness
    return True


@inner
def locate(problem, work, count, r, j, low, high, low_value, high_value):
    """Keep the event at which channel j crosses break r between two phases; False if too many."""
    low_above, side = low_value > 0.0, 1.0 if high_value > 0.0 else -1.0
    theta = low + (high - low) * low_value / (low_value - high_value)
    for _ in range(REFINEMENTS):
        g, slope, _, _, _ = distance_at(problem, work, count, r, j, theta)
        if (g > 0.0) == low_above:
            low = theta
        else:
            high = theta
        trial = theta - g / slope if slope != 0.0 else low
        if not low < trial < high:
            trial = 0.5 * (low + high)
        settled = abs(trial - theta) <= SETTLED
        theta = trial
        if settled:
            break
    return keep_event(problem, work, count, r, j, theta, side)


@inner
def find_events(problem, work, count, n):
    """Fill the events FOUND: where the sampled channels meet breaks. False if too often."""
    work.events[FOUND, MOST_EVENTS, 0] = 0.0
    step = 2.0 * math.pi / n
    enough = True
    for j in range(problem.lag.size):
        d, v = work.samples[DISPLACEMENT, j], work.samples[VELOCITY, j]
        for r in range(problem.channels[j, BREAKS], problem.channels[j + 1, BREAKS]):
            p, q = problem.breaks[r, ON_DISPLACEMENT], problem.breaks[r, ON_VELOCITY]
            value = problem.breaks[r, VALUE]
            before = p * d[n - 2] + q * v[n - 2] - value
            here = p * d[n - 1] + q * v[n - 1] - value
            for i in range(n):
                after = p * d[i] + q * v[i] - value
                theta = (i - 1) * step  # of `here`
                above = here > 0.0
                bend = before - 2.0 * here + after
                nearest = abs(here) <= abs(before) and abs(here) <= abs(after)
                if above != (after > 0.0):
                    enough = enough and locate(
                        problem, work, count, r, j, theta, theta + step, here, after
                    )
                elif above == (before > 0.0) and nearest and 4 * abs(here) < abs(bend):
                    # between the samples the distance may change its sign twice
                    turn = theta + step * 0.5 * (before - after) / bend
                    middle, _, _, _, _ = distance_at(problem, work, count, r, j, turn)
                    if (middle > 0.0) != above:
                        enough = enough and locate(
                            problem, work, count, r, j, theta - step, turn, before, middle
                        )
                        enough = enough and locate(
                            problem, work, count, r, j, turn, theta + step, middle, after
                        )
                before, here = here, after
    return enough
