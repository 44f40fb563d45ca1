"""A balanced motion looked at: nodes, forces, outputs and their extrema.

Outputs are fixed linear combinations of the displacements, velocities and accelerations of the
nodes, the forces of the elements and the motion of the base (columns in that order), then, for
each delay, displacements and velocities of nodes and base one delay earlier. Forces come from the
laws on the motion that they see, accelerations from the equations of motion with these forces.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from seatdyn.kernels.balance import sample_column
from seatdyn.kernels.breaking import beside
from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import (
    ADDRESS,
    BREAKS,
    ELEMENTS,
    FIRST,
    IS_JUMP,
    OFFSET,
    SECOND,
)
from seatdyn.kernels.condensed import (
    CHANNEL,
    CONDENSED,
    FORCE,
    LINE,
    MOST_EVENTS,
    NO_BREAK,
    OVERSAMPLING,
    PHASE,
    PRESENT,
    ROW,
    TAILS,
    WORK,
    number_of,
    reduce_series,
    state_at,
    tail_weights,
)
from seatdyn.kernels.fourier import samples_of
from seatdyn.kernels.jit import inner, kernel, spliced, stage, takes
from seatdyn.kernels.shapes import (
    COMPLEX_BLOCK,
    INTEGER,
    INTEGERS,
    TABLE,
    VECTOR,
)

STENCIL = 5  # samples through which an extremum is refined
BETWEEN = 16  # parts of the way between two events that is too short for the samples
DOUBT = 2.0  # of what a parabola rises above a sample: a peak may be so much higher
NODES, NODES_REDUCED = 0, 1  # places in Look.nodes
# places in Look.extrema: extrema, their phases in rad, and the extrema of the level before
HIGH, LOW, HIGH_PHASE, LOW_PHASE, HIGH_BEFORE, LOW_BEFORE = range(6)


class Look(NamedTuple):
    """Space to look at a motion of at most n samples and K harmonics.

    rows : (o, C) outputs as combinations of the C = 3N + e + 3 + G (2N + 2) columns
    nodes : (2, K, N) complex, harmonics of the nodes, and without their sawtooths
    weights : (E + 1, 3N) of the sawtooths
    columns : (C + 1, n) samples of the columns; the last row is space
    state : (C + STENCIL,) columns at one phase; the rest is space
    extrema : (6, o), see HIGH ...
    """

    rows: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray
    columns: np.ndarray
    state: np.ndarray
    extrema: np.ndarray


LOOK = types.NamedTuple([TABLE, COMPLEX_BLOCK, TABLE, TABLE, VECTOR, TABLE], Look)


def make_look(rows: np.ndarray, nodes: int, samples: int) -> Look:
    """Space for the outputs `rows` of motions of up to so many samples."""
    outputs, columns = rows.shape
    return Look(
        rows,
        np.zeros((2, samples // OVERSAMPLING, nodes), complex),
        np.zeros((MOST_EVENTS + 1, TAILS * nodes)),
        np.zeros((columns + 1, samples)),
        np.zeros(columns + STENCIL),
        np.zeros((6, outputs)),
    )


@inner
def node_series(problem, work, look, count):
    """Fill harmonics of the nodes from the channel forces."""
    n, m = problem.pull.shape
    for k in range(count):
        for i in range(n):
            total = work.response[k, i, m]
            for j in range(m):
                total -= work.response[k, i, j] * work.series[FORCE, k, j]
            look.nodes[NODES, k, i] = total if k > 0 else complex(total.real, 0.0)
    tail_weights(
        problem, work.events[PRESENT], problem.pull, problem.later_pull, look.weights[:, 0:]
    )


@spliced
def seen_from(problem, j):
    """First column of what the force of channel j sees: displacements, N on velocities; and base.

    The latter with displacement and velocity after each other.
    """
    n = problem.pull.shape[0]
    base = 3 * n + problem.elements.shape[0]
    for g in range(problem.delays.size):
        if problem.lag[j] == problem.delays[g]:
            first = base + 3 + g * (2 * n + 2)
            return first, first + 2 * n
    return 0, base


@inner
def look_back(problem, work, look, count, g, theta, past):
    """Fill what was one delay before a phase: displacements, velocities, base (2N + 2)."""
    n, w = problem.pull.shape[0], problem.omega
    then = theta - w * problem.delays[g]
    for i in range(n):
        past[i], past[n + i], _ = state_at(
            problem, look.nodes[NODES_REDUCED], count, work.events[PRESENT], look.weights[:, 0:],
            i, then,
        )  # fmt: skip
    past[2 * n], past[2 * n + 1] = 0.0, 0.0
    for k in range(problem.base.size):
        z = problem.base[k] * complex(math.cos(k * then), math.sin(k * then))
        past[2 * n] += z.real
        past[2 * n + 1] -= k * w * z.imag


@spliced
def felt(problem, events, e):
    """Phase at which the force of the channel of an event jumps or has its corner."""
    return events[e, PHASE] + problem.omega * problem.lag[int(events[e, CHANNEL])]


@inner
def look_at(problem, work, look, count, theta, row, side):
    """Fill look.state at a phase; with row >= 0 on one side of that jump, which the phase is on."""
    n, m = problem.pull.shape
    state, w = look.state, problem.omega
    first = 3 * n + problem.elements.shape[0]
    x, v, a = 0.0, 0.0, 0.0
    for k in range(problem.base.size):
        z = problem.base[k] * complex(math.cos(k * theta), math.sin(k * theta))
        x, v, a = x + z.real, v - k * w * z.imag, a - (k * w) * (k * w) * z.real
    state[first], state[first + 1], state[first + 2] = x, v, a
    for i in range(n):
        state[i], state[n + i], _ = state_at(
            problem, look.nodes[NODES_REDUCED], count, work.events[PRESENT], look.weights[:, 0:],
            i, theta,
        )  # fmt: skip
    for i in range(n):
        total = problem.linear[i, 2 * n] * x + problem.linear[i, 2 * n + 1] * v
        for c in range(2 * n):
            total += problem.linear[i, c] * state[c]
        for k in range(problem.push.shape[0]):
            total += (problem.push[k, i] * complex(math.cos(k * theta), math.sin(k * theta))).real
        state[2 * n + i] = total
    for g in range(problem.delays.size):
        past = state[first + 3 + g * (2 * n + 2) : first + 3 + (g + 1) * (2 * n + 2)]
        look_back(problem, work, look, count, g, theta, past)
        for i in range(n):
            for c in range(2 * n + 2):
                state[2 * n + i] += problem.late[g, i, c] * past[c]
    for j in range(m):
        start, end = problem.channels[j, FIRST], problem.channels[j, SECOND]
        p, b = seen_from(problem, j)
        d = state[p + end if end >= 0 else b] - state[p + start if start >= 0 else b]
        s = (
            state[p + n + end if end >= 0 else b + 1]
            - state[p + n + start if start >= 0 else b + 1]
        )
        here = problem.channels[j, BREAKS] <= row < problem.channels[j + 1, BREAKS]
        if here and problem.breaks[row, IS_JUMP] != 0.0:
            d, s = beside(problem, row, d, s, side)
        total = -problem.shift[j] * d
        for e in range(problem.channels[j, ELEMENTS], problem.channels[j + 1, ELEMENTS]):
            address, offset = problem.elements[e, ADDRESS], problem.elements[e, OFFSET]
            force = call_law(address, d, s, problem.parameters, offset)
            state[3 * n + e] = force
            total += force
        for i in range(n):
            state[2 * n + i] -= problem.pull[i, j] * total


@spliced
def is_asked(rows, first, last):
    """Whether any output needs any of the columns first .. last - 1."""
    for o in range(rows.shape[0]):
        for c in range(first, last):
            if rows[o, c] != 0.0:
                return True
    return False


@inner
def sample_columns(problem, work, look, count, samples, whole):
    """Fill the first `samples` samples of every column.

    Else of those that the outputs need, where accelerations, forces and what is late are not.
    """
    n, m = problem.pull.shape
    columns, line = look.columns, work.lines[LINE]
    first = 3 * n + problem.elements.shape[0]
    events, weights = work.events[PRESENT], look.weights[:, 0:]
    reduced = look.nodes[NODES_REDUCED]
    reduce_series(problem, look.nodes[NODES], count, events, weights, reduced)
    for i in range(n):
        for order in range(2):
            place = order * n + i
            if whole or is_asked(look.rows, place, place + 1):
                sample_column(
                    problem, work.lines, reduced, count, samples, events, weights, i, order,
                    columns[place],
                )  # fmt: skip
    top = min(problem.base.size, count)
    for k in range(top):
        line[k] = problem.base[k]
    for order in range(3):
        samples_of(line, top, samples, work.lines, columns[first + order])
        for k in range(top):
            line[k] *= 1j * (k * problem.omega)
    if not whole:
        return
    for i in range(n):
        target = columns[2 * n + i]
        for c in range(2 * n + 2):
            factor, source = problem.linear[i, c], columns[c if c < 2 * n else first + c - 2 * n]
            for q in range(samples):
                target[q] = factor * source[q] + (target[q] if c > 0 else 0.0)
    pushed, spare = min(problem.push.shape[0], count), columns[columns.shape[0] - 1]
    if pushed > 0:
        for i in range(n):
            for k in range(pushed):
                line[k] = problem.push[k, i]
            samples_of(line, pushed, samples, work.lines, spare)
            for q in range(samples):
                columns[2 * n + i, q] += spare[q]
    past = look.state[: 2 * n + 2]
    for g in range(problem.delays.size):
        begin = first + 3 + g * (2 * n + 2)
        for q in range(samples):
            theta = 2.0 * math.pi * q / samples
            look_back(problem, work, look, count, g, theta, past)
            for c in range(2 * n + 2):
                columns[begin + c, q] = past[c]
        for i in range(n):
            for c in range(2 * n + 2):
                factor, source = problem.late[g, i, c], columns[begin + c]
                for q in range(samples):
                    columns[2 * n + i, q] += factor * source[q]
    for j in range(m):
        start, end = problem.channels[j, FIRST], problem.channels[j, SECOND]
        p, b = seen_from(problem, j)
        d0, d1 = columns[p + start if start >= 0 else b], columns[p + end if end >= 0 else b]
        v0 = columns[p + n + start if start >= 0 else b + 1]
        v1 = columns[p + n + end if end >= 0 else b + 1]
        for i in range(n):
            share, target = problem.pull[i, j] * problem.shift[j], columns[2 * n + i]
            if share != 0.0:
                for q in range(samples):
                    target[q] += share * (d1[q] - d0[q])
        for e in range(problem.channels[j, ELEMENTS], problem.channels[j + 1, ELEMENTS]):
            address, offset = problem.elements[e, ADDRESS], problem.elements[e, OFFSET]
            force = columns[3 * n + e]
            for q in range(samples):
                force[q] = call_law(
                    address, d1[q] - d0[q], v1[q] - v0[q], problem.parameters, offset
                )
            for i in range(n):
                pull, target = problem.pull[i, j], columns[2 * n + i]
                for q in range(samples):
                    target[q] -= pull * force[q]


@inner
def refine(look, n, i, left, right):
    """Maximum near sample i of the signal in the last row, by a quartic, and its place from i.

    left, right : distances, in samples, to the events beside it
    """
    values, c = look.columns[look.columns.shape[0] - 1], look.state[look.rows.shape[1] :]
    best, place = values[i], 0.0
    start = -2
    if left < 2.0:
        start = -int(left)
    if right < start + STENCIL - 1:
        start = int(right) - STENCIL + 1
    if start > 0 or start <= -STENCIL or -start > left:
        return best, place
    for k in range(STENCIL):
        c[k] = values[(i + start + k) % n]
    for order in range(1, STENCIL):
        for k in range(STENCIL - 1, order - 1, -1):
            c[k] = (c[k] - c[k - 1]) / order
    low, high = max(-1.0, -left), min(1.0, right)
    x = 0.0
    for _ in range(8):
        # Newton's form with its first two derivatives
        f, df, ddf = c[STENCIL - 1], 0.0, 0.0
        for k in range(STENCIL - 2, -1, -1):
            t = x - start - k
            ddf = ddf * t + 2.0 * df
            df = df * t + f
            f = f * t + c[k]
        if f > best:
            best, place = f, x
        if ddf >= 0.0:
            break
        before, x = x, min(max(x - df / ddf, low), high)
        if abs(x - before) < 1e-9:
            break
    return best, place


@inner
def peak(problem, work, look, samples, i):
    """Maximum near sample i of the signal in the last row, and its place, between the events."""
    events = work.events[PRESENT]
    left, right = 1e9, 1e9
    for e in range(number_of(events)):
        gap = felt(problem, events, e) * samples / (2.0 * math.pi) - i
        gap -= samples * math.floor(gap / samples)
        left, right = min(left, samples - gap), min(right, gap)
    best, place = refine(look, samples, i, left, right)
    return best, i + place, left, right


@spliced
def rise(values, samples, i):
    """What the parabola through a sample and its neighbours rises above it."""
    left, right = values[i - 1 if i > 0 else samples - 1], values[i + 1 if i + 1 < samples else 0]
    bend = 2.0 * values[i] - left - right
    return (right - left) ** 2 / (8.0 * bend) if bend > 0.0 else 0.0


@inner
def find_maximum(problem, work, look, samples):
    """Maximum of the signal in the last row, and its place in samples.

    Not only the highest sample is looked at: a lower one may be beside a higher peak, and an event
    may hide what is beyond it.
    """
    values = look.columns[look.rows.shape[1]]
    top = 0
    for q in range(1, samples):
        if values[q] > values[top]:
            top = q
    best, place, left, right = peak(problem, work, look, samples, top)
    for q in range(samples):
        hidden = (left < 1.0 and q == (top - 1) % samples) or (
            right < 1.0 and q == (top + 1) % samples
        )
        before, after = values[q - 1 if q > 0 else samples - 1], values[(q + 1) % samples]
        local = before < values[q] >= after and q != top
        if hidden or (local and values[q] + DOUBT * rise(values, samples, q) > best):
            other, there, _, _ = peak(problem, work, look, samples, q)
            if other > best:
                best, place = other, there
    return best, place


@takes(CONDENSED, WORK, LOOK, INTEGER)
@stage
def find_extrema(problem, work, look, samples):
    """Fill the extrema of every output over the period, both sides of every event included."""
    count = samples // OVERSAMPLING
    node_series(problem, work, look, count)
    events, rows, extrema = work.events[PRESENT], look.rows, look.extrema
    n, first = problem.pull.shape[0], 3 * problem.pull.shape[0] + problem.elements.shape[0]
    whole = is_asked(rows, 2 * n, first) or is_asked(rows, first + 3, rows.shape[1])
    sample_columns(problem, work, look, count, samples, whole)
    step = 2.0 * math.pi / samples
    values = look.columns[rows.shape[1]]
    for o in range(rows.shape[0]):
        for q in range(samples):
            values[q] = 0.0
        for c in range(rows.shape[1]):
            factor = rows[o, c]
            if factor != 0.0:
                source = look.columns[c]
                for q in range(samples):
                    values[q] += factor * source[q]
        for way in range(2):
            best, place = find_maximum(problem, work, look, samples)
            extrema[way, o] = best if way == HIGH else -best
            extrema[HIGH_PHASE + way, o] = step * place
            for q in range(samples):
                values[q] = -values[q]
    for e in range(number_of(events)):
        phase = felt(problem, events, e)
        for side in (-1.0, 1.0):
            look_at(problem, work, look, count, phase, int(events[e, ROW]), side)
            keep_extrema(look, phase)
        gap = 2.0 * math.pi
        for other in range(number_of(events)):
            ahead = felt(problem, events, other) - phase
            ahead -= 2.0 * math.pi * math.floor(ahead / (2.0 * math.pi))
            gap = min(gap, ahead) if ahead > 0.0 else gap
        if gap < STENCIL * step:  # too short for the samples
            for k in range(1, BETWEEN):
                there = phase + gap * k / BETWEEN
                look_at(problem, work, look, count, there, NO_BREAK, 0.0)
                keep_extrema(look, there)


@inner
def keep_extrema(look, phase):
    """Keep the outputs of look.state where they are beyond the extrema so far."""
    rows, extrema = look.rows, look.extrema
    for o in range(rows.shape[0]):
        total = 0.0
        for c in range(rows.shape[1]):
            total += rows[o, c] * look.state[c]
        if total > extrema[HIGH, o]:
            extrema[HIGH, o], extrema[HIGH_PHASE, o] = total, phase
        if total < extrema[LOW, o]:
            extrema[LOW, o], extrema[LOW_PHASE, o] = total, phase


@takes(CONDENSED, WORK, LOOK, INTEGER, VECTOR, INTEGERS, VECTOR, TABLE)
@kernel
def states(problem, work, look, count, phases, rows, sides, result):
    """Fill columns (p, C) at phases, on one side of the breaks `rows` (-1: none)."""
    for p in range(phases.size):
        look_at(problem, work, look, count, phases[p], rows[p], sides[p])
        for c in range(result.shape[1]):
            result[p, c] = look.state[c]
