"""A periodic problem condensed on its channels, and its motion as series plus sawtooth tails.

Every motion is a Fourier series in the phase theta = omega t of the excitation. Harmonic k of the
nodes follows from that of the base and of the channel forces by the linear part alone:

    z_k = L_k x0_k - X_k F_k,     X_k = (s^2 - A_v s - A_z)^-1 pull,     s = i k omega

and the relative motion of channel i is d_i = B_i z - (base, where the channel ends there). Only the
d_i are unknown (`balance`). Forces from outside drive the nodes as the base does.

Where a force jumps or has a corner its series converges slowly, and so does the motion. Such places
(events) are known exactly, so their part is summed in closed form. With P1 the sawtooth that jumps
up by one at theta = 0, and P2 .. P5 its integrals of zero mean (harmonics 1/(pi (i k)^n)), the
force F = J P1 + S P2 + C P3 + smooth leads, by X(s) = pull/s^2 + A_v pull/s^3 + A_2 pull/s^4 + ...
with A_2 = A_v^2 + A_z, to the motion

    z = -[pull J/omega^2] P3 - [pull S/omega^2 + A_v pull J/omega^3] P4
        -[pull C/omega^2 + A_v pull S/omega^3 + A_2 pull J/omega^4] P5 + faster converging

whose part beyond the last harmonic is the tail.

Arrays are few and large, with named places in them: compiling takes time for every array passed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from seatdyn.kernels.columns import FIRST, SECOND
from seatdyn.kernels.jit import inner, spliced
from seatdyn.kernels.shapes import (
    BLOCK,
    COMPLEX_BLOCK,
    COMPLEX_TABLE,
    COMPLEX_VECTOR,
    INTEGER_TABLE,
    REAL,
    TABLE,
    VECTOR,
)

OVERSAMPLING = 2  # samples per harmonic


class Condensed(NamedTuple):
    """A system under a periodic base motion; arrays as in `Plant`.

    later_pull, later_gain : A_v pull and A_2 pull, (2, N, m), and between the channels, (2, m, m)
    base : (B,) complex harmonics 0 .. B-1 of the base displacement, m
    shift : (m,) stiffness in N/m that `linear` has and the laws of the channel are reduced by
    lag : (m,) delay of each channel's force, s: a factor exp(-i k omega lag) on its harmonics
    scale : (2,) factors on what drives from outside and on the channel forces, 1 but while a
        solution is being continued in them
    omega : rad/s
    delays, late : (G,) s, and (G, N, 2N + 2) linear forces with that delay, as in `linear`
    push : (P, N) complex harmonics 0 .. P-1 of the accelerations by forces from outside
    """

    linear: np.ndarray
    pull: np.ndarray
    gain: np.ndarray
    later_pull: np.ndarray
    later_gain: np.ndarray
    channels: np.ndarray
    elements: np.ndarray
    parameters: np.ndarray
    breaks: np.ndarray
    base: np.ndarray
    shift: np.ndarray
    lag: np.ndarray
    scale: np.ndarray
    omega: float
    delays: np.ndarray
    late: np.ndarray
    push: np.ndarray


class Work(NamedTuple):
    """Space for one solution: n samples, K = n/4 harmonics, N nodes, m channels.

    series : (., K, m) complex, see SERIES ...
    response : (K, N + m, m + 1) complex: motion of the N nodes per force of the m channels, and due
        to the base in the last column; below the inverse mean tangent, (m, m)
    matrix : (N + m, N + 2m + 1) complex, space of small equations
    lines : (., n) complex: roots of unity, space of the transforms, a series, and harmonics of
        dF/dd and dF/dv of each channel
    samples : (., m, n): see DISPLACEMENT ...
    tangent : (u, u + 3): factors of the tangent, pivots, a right-hand side, steep samples
    krylov : (q + 1, q + 3): projected tangent, its rotations and right-hand side
    events : (3, E + 1, 6 + 5m): see PHASE ...; row E holds their number
    """

    series: np.ndarray
    response: np.ndarray
    matrix: np.ndarray
    lines: np.ndarray
    samples: np.ndarray
    tangent: np.ndarray
    krylov: np.ndarray
    events: np.ndarray


CONDENSED = types.NamedTuple(
    [
        TABLE, TABLE, TABLE, BLOCK, BLOCK, INTEGER_TABLE, INTEGER_TABLE, VECTOR, TABLE,
        COMPLEX_VECTOR, VECTOR, VECTOR, VECTOR, REAL, VECTOR, BLOCK,
        COMPLEX_TABLE,
    ],
    Condensed,
)  # fmt: skip
WORK = types.NamedTuple(
    [COMPLEX_BLOCK, COMPLEX_BLOCK, COMPLEX_TABLE, COMPLEX_TABLE, BLOCK, TABLE, TABLE, BLOCK], Work
)
NO_BREAK = np.int64(-1)  # numpy's, for which functions are not compiled apart as for Python's
LEVEL, STRENGTH = 0, 1  # places in Condensed.scale
# places in Work.series: the motion; without its sawtooths; forces; residual; the motion before a
# step; the step; a motion kept; its change with a parameter; the tangent times a direction; the
# Krylov space
SERIES, REDUCED, FORCE, RESIDUAL, BEFORE, CHANGE, KEPT, RATE, PRODUCT, BASIS = range(10)
# places in Work.lines
ROOTS, ONE, TWO, LINE, SLOPES = range(5)
# places in Work.samples: motion, force, its slopes, a direction, what a force moves
DISPLACEMENT, VELOCITY, LAW, IN_D, IN_V, MOVE_D, MOVE_V, RESPONSES = range(8)
# sets of events: those of the motion, those being found, those of the motion before a step
PRESENT, FOUND, PAST = range(3)
# an event: phase in rad, break, channel, jump J of the force of that channel in the direction of
# time, weights of the impulses in dF/dd and dF/dv that it stands for; then for every channel the
# jumps S of dF/dtheta and C of its second derivative, and the weights of P3 .. P5 in its motion
PHASE, ROW, CHANNEL, JUMP, IMPULSE_D, IMPULSE_V, CORNER = range(7)
TAILS = 3  # sawtooths in a motion: P3, P4, P5
MOST_EVENTS = 64
ON_EVENT = 0.03  # rad: nearer than this to a jump its mean acceleration is meant
KRYLOV = 40  # directions of one solution by GMRES
TOGETHER = 8  # harmonics solved together
STEEPEST = 160  # samples solved together


def make_work(nodes: int, channels: int, samples: int) -> Work:
    """Space for solutions of up to so many samples (a power of two)."""
    n, m, count = samples, channels, samples // OVERSAMPLING
    unknowns = max(m * (2 * min(TOGETHER, count - 1) + 1), STEEPEST)
    lines = np.zeros((SLOPES + 2 * m, n), complex)
    lines[ROOTS] = np.exp(-2j * np.pi * np.arange(n) / n)
    return Work(
        np.zeros((BASIS + KRYLOV + 1, count, m), complex),
        np.zeros((count, nodes + m, m + 1), complex),
        np.zeros((nodes + m, nodes + 2 * m + 1), complex),
        lines,
        np.zeros((RESPONSES + 2 * m, m, n)),
        np.zeros((unknowns, unknowns + 3)),
        np.zeros((KRYLOV + 1, KRYLOV + 3)),
        np.zeros((3, MOST_EVENTS + 1, CORNER + (2 + TAILS) * m)),
    )


@spliced
def number_of(events):
    """Number of events in a set (E + 1, .)."""
    return int(events[MOST_EVENTS, 0])


@spliced
def copy_events(work, source, target):
    """Copy a set of events."""
    events = work.events
    for e in range(MOST_EVENTS + 1):
        for c in range(events.shape[2]):
            events[target, e, c] = events[source, e, c]
        if e < MOST_EVENTS and e >= number_of(events[source]):
            break
    events[target, MOST_EVENTS, 0] = events[source, MOST_EVENTS, 0]


@spliced
def sawtooth(theta):
    """P1 .. P5 at a phase; P1 jumps from -1/2 to 1/2 at multiples of 2 pi."""
    x = theta - 2.0 * math.pi * math.floor(theta / (2.0 * math.pi))
    u = math.pi - x  # the polynomials are odd or even about pi
    p, q = math.pi, u * u
    return (
        u / (2 * p),
        (p * p / 3 - q) / (4 * p),
        u * (q - p * p) / (12 * p),
        -(q * (q - 2 * p * p) + 7 * p**4 / 15) / (48 * p),
        u * (q * (q / 5 - 2 * p * p / 3) + 7 * p**4 / 15) / (48 * p),
    )


@inner
def add_sawtooths(target, n, origin, w1, w2, w3, w4, w5):
    """Add w1 P1 + ... + w5 P5, beginning at the phase `origin`, to n samples of a period."""
    p, step = math.pi, 2.0 * math.pi / n
    # polynomials of u and u^2, see `sawtooth`
    a = w1 / (2 * p) - w3 * p / 12 + w5 * 7 * p**3 / 720
    b, c = w3 / (12 * p) - w5 * p / 72, w5 / (240 * p)
    d, e, f = w2 * p / 12 - w4 * 7 * p**3 / 720, w4 * p / 24 - w2 / (4 * p), -w4 / (48 * p)
    start = 2 * p * math.floor(origin / (2 * p)) - origin  # of theta - origin, -2 pi .. 0
    wrap = min(n, math.ceil(-start / step))
    for i in range(wrap):
        u = -p - start - i * step
        q = u * u
        target[i] += u * (a + q * (b + q * c)) + d + q * (e + q * f)
    for i in range(wrap, n):
        u = p - start - i * step
        q = u * u
        target[i] += u * (a + q * (b + q * c)) + d + q * (e + q * f)


@inner
def solve_complex(matrix, size, columns):
    """Gauss elimination with row pivoting, in place, of [A | B]; B (size, columns) is replaced."""
    width = size + columns
    for i in range(size):
        p = i
        for k in range(i + 1, size):
            if abs(matrix[k, i].real) + abs(matrix[k, i].imag) > (
                abs(matrix[p, i].real) + abs(matrix[p, i].imag)
            ):
                p = k
        if p != i:
            for c in range(i, width):
                matrix[i, c], matrix[p, c] = matrix[p, c], matrix[i, c]
        if matrix[i, i] == 0.0:  # no answer; what comes of it is not finite, and is refused
            matrix[i, i] = np.nan
        inverse = 1.0 / matrix[i, i]
        for k in range(i + 1, size):
            f = matrix[k, i] * inverse
            for c in range(i + 1, width):
                matrix[k, c] -= f * matrix[i, c]
    for i in range(size - 1, -1, -1):
        inverse = 1.0 / matrix[i, i]
        for c in range(size, width):
            total = matrix[i, c]
            for k in range(i + 1, size):
                total -= matrix[i, k] * matrix[k, c]
            matrix[i, c] = total * inverse


@inner
def respond(problem, work, k):
    """Fill harmonic k of work.response: the nodes' motion."""
    n, m = problem.pull.shape
    linear, matrix = problem.linear, work.matrix
    w = k * problem.omega
    base = problem.base[k] * problem.scale[LEVEL] if k < problem.base.size else 0j
    for i in range(n):
        for c in range(n):
            matrix[i, c] = complex(-linear[i, c], -w * linear[i, n + c])
        matrix[i, i] -= w * w
        for j in range(m):
            matrix[i, n + j] = problem.pull[i, j]
        matrix[i, n + m] = complex(linear[i, 2 * n], w * linear[i, 2 * n + 1]) * base
        if k < problem.push.shape[0]:
            matrix[i, n + m] += problem.push[k, i] * problem.scale[LEVEL]
    for g in range(problem.delays.size):
        turn = complex(math.cos(w * problem.delays[g]), -math.sin(w * problem.delays[g]))
        late = problem.late[g]
        for i in range(n):
            for c in range(n):
                matrix[i, c] -= turn * complex(late[i, c], w * late[i, n + c])
            matrix[i, n + m] += turn * complex(late[i, 2 * n], w * late[i, 2 * n + 1]) * base
    solve_complex(matrix, n, m + 1)
    for i in range(n):
        for j in range(m):
            angle = -w * problem.lag[j]
            factor = complex(math.cos(angle), math.sin(angle)) * problem.scale[STRENGTH]
            work.response[k, i, j] = matrix[i, n + j] * factor
        work.response[k, i, m] = matrix[i, n + m]


@spliced
def across(problem, work, k, i, column):
    """Motion of channel i in harmonic k per force of channel `column`; of the base for column m."""
    a, b = problem.channels[i, FIRST], problem.channels[i, SECOND]
    base = 0j
    if column == problem.lag.size and k < problem.base.size:
        base = problem.base[k] * problem.scale[LEVEL]
    motion = work.response[k, b, column] if b >= 0 else base
    return motion - (work.response[k, a, column] if a >= 0 else base)


@inner
def tail_weights(problem, events, pull, later, weights):
    """Fill weights (E, 3c) of P3, P4, P5, in turn, in the displacements of c nodes or channels.

    pull, later : (c, m) and (2, c, m), of the nodes or between the channels
    """
    m, w = problem.lag.size, problem.omega
    for e in range(number_of(events)):
        jumping = int(events[e, CHANNEL])
        for i in range(pull.shape[0]):
            third = pull[i, jumping] * events[e, JUMP] / (w * w)
            fourth = later[0, i, jumping] * events[e, JUMP] / w**3
            fifth = later[1, i, jumping] * events[e, JUMP] / w**4
            for j in range(m):
                if problem.lag[j] == problem.lag[jumping]:
                    corner, bend = events[e, CORNER + j], events[e, CORNER + m + j]
                    fourth += pull[i, j] * corner / (w * w)
                    fifth += pull[i, j] * bend / (w * w) + later[0, i, j] * corner / w**3
            weights[e, TAILS * i] = -problem.scale[STRENGTH] * third
            weights[e, TAILS * i + 1] = -problem.scale[STRENGTH] * fourth
            weights[e, TAILS * i + 2] = -problem.scale[STRENGTH] * fifth


@inner
def reduce_series(problem, series, count, events, weights, reduced):
    """Take the sawtooths out of a series (K, c): what is left converges fast."""
    for k in range(count):
        for c in range(series.shape[1]):
            reduced[k, c] = series[k, c]
    for e in range(number_of(events)):
        angle = -events[e, PHASE] - problem.omega * problem.lag[int(events[e, CHANNEL])]
        z = complex(math.cos(angle), math.sin(angle))
        power = z
        for k in range(1, count):
            cube = 1.0 / (math.pi * float(k) ** 3)
            # 1/(pi (i k)^3) = i/(pi k^3), 1/(pi (i k)^4) = 1/(pi k^4), ...
            for c in range(series.shape[1]):
                odd = weights[e, TAILS * c] - weights[e, TAILS * c + 2] / (float(k) * k)
                part = complex(weights[e, TAILS * c + 1] / k, odd)
                reduced[k, c] -= power * part * cube
            power *= z


@inner
def state_at(problem, reduced, count, events, weights, column, theta):
    """Displacement, velocity and acceleration of a column: reduced series and sawtooths.

    Near an event the acceleration is without its jump, as if the force took its mean there.
    """
    w = problem.omega
    z = complex(math.cos(theta), math.sin(theta))
    x, dx, ddx = 0j, 0j, 0j
    for k in range(count - 1, 0, -1):
        c = reduced[k, column]
        x = (x + c) * z
        dx = (dx + k * c) * z
        ddx = (ddx + float(k * k) * c) * z
    d, v, a = reduced[0, column].real + x.real, -w * dx.imag, -w * w * ddx.real
    for e in range(number_of(events)):
        third, fourth = weights[e, TAILS * column], weights[e, TAILS * column + 1]
        fifth = weights[e, TAILS * column + 2]
        angle = theta - events[e, PHASE] - w * problem.lag[int(events[e, CHANNEL])]
        p1, p2, p3, p4, p5 = sawtooth(angle)
        if abs(p1) > 0.5 - ON_EVENT / (2.0 * math.pi):
            p1 -= math.copysign(0.5, p1)
        d += third * p3 + fourth * p4 + fifth * p5
        v += w * (third * p2 + fourth * p3 + fifth * p4)
        a += w * w * (third * p1 + fourth * p2 + fifth * p3)
    return d, v, a
