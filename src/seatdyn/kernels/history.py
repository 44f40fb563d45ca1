"""States of elements along a periodic motion, and the balance of harmonics with their forces.

The motion is known at n samples; between two of them the travel is the quintic through
displacement, velocity and acceleration at both, the speed of the second node the cubic through
speed and acceleration. Along it the rates of the states are integrated by Runge-Kutta steps, which
end where the travel turns: the rates of hysteresis have a kink there. The states at the start of
the period follow from their being the same at its end, by Newton's method.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from seatdyn.kernels.balance import evaluate
from seatdyn.kernels.condensed import (
    CHANNEL,
    CORNER,
    DISPLACEMENT,
    FORCE,
    LEVEL,
    LINE,
    PHASE,
    PRESENT,
    REDUCED,
    RESIDUAL,
    SERIES,
    TAILS,
    VELOCITY,
    across,
    add_sawtooths,
    number_of,
    reduce_series,
    tail_weights,
)
from seatdyn.kernels.fourier import harmonics, samples_of
from seatdyn.kernels.jit import inner, kernel
from seatdyn.kernels.levels import refine_motion, start_linear
from seatdyn.kernels.memory import (
    FORCE as LAW_FORCE,
)
from seatdyn.kernels.memory import (
    PARAMETERS,
    RATE,
    STATES,
    call_memory_force,
    call_memory_rate,
)
from seatdyn.kernels.orbit import node_series, sample_columns
from seatdyn.kernels.tangent import back_substitute, factorise

FINER = 4  # samples per harmonic: between them the motion is interpolated
STIFFEST = 0.3  # step times fastest rate of the states
MOST_PARTS = 20_000  # steps between two samples
DIFFERENCE = 1e-6  # of the size of a state
CLOSED = 1e-13  # of the size of the states: what the end may differ from the start
ENOUGH = 1e-9  # the same, where rounding lets it come no nearer
MOST_ROUNDS = 200
TRAVEL, SPEED, GAIN, NODE_SPEED, NODE_GAIN = range(5)  # columns of `motion`
OF_TRAVEL, OF_NODE, RESTS = range(3)  # columns of `place`
START, LAST, TRIAL, MOVED, STAGE, RATES, SUM = range(7)  # rows of `space`


class History(NamedTuple):
    """Elements with states under a periodic motion of at most n samples; q states in all.

    place : (e, 3) int: channel of the travel, channel from the base to the second node (-1 where
        it is the base), whether the rates break where the travel turns
    size : (q,) of each state
    motion : (e, n + 1, 5): see TRAVEL ...
    states : (n + 1, q) at the samples
    force : (e, n)
    space : (., q): see START ...
    matrix : (q, q + 3)
    parts : (1,) int, how many times as many steps as the fastest rates ask for
    """

    place: np.ndarray
    size: np.ndarray
    motion: np.ndarray
    states: np.ndarray
    force: np.ndarray
    space: np.ndarray
    matrix: np.ndarray
    parts: np.ndarray


def make_history(place: np.ndarray, size: np.ndarray, samples: int) -> History:
    """Space for motions of up to so many samples."""
    e, q = place.shape[0], size.size
    return History(
        place, size, np.zeros((e, samples + 1, 5)), np.zeros((samples + 1, q)),
        np.zeros((e, samples)), np.zeros((SUM + 1, q)), np.zeros((q, q + 3)),
        np.ones(1, np.int64),
    )  # fmt: skip


@inner
def second_derivative(problem, work, c, count, n, result):
    """Samples of the acceleration of channel c; its jumps are between the samples."""
    w, line, events = problem.omega, work.lines[LINE], work.events[PRESENT]
    for k in range(count):
        line[k] = -work.series[REDUCED, k, c] * (k * w) ** 2
    samples_of(line, count, n, work.lines, result)
    first = CORNER + 2 * problem.lag.size + TAILS * c
    for e in range(number_of(events)):
        origin = events[e, PHASE] + w * problem.lag[int(events[e, CHANNEL])]
        third, fourth = w * w * events[e, first], w * w * events[e, first + 1]
        fifth = w * w * events[e, first + 2]
        add_sawtooths(result, n, origin, third, fourth, fifth, 0.0, 0.0)


@inner
def fill_accelerations(problem, work, history, count, n):
    """Fill the accelerations of every element, and whole what it sees of the base."""
    m, w = problem.lag.size, problem.omega
    events = work.events[PRESENT]
    weights = events[:, CORNER + 2 * m :]
    tail_weights(problem, events, problem.gain, problem.later_gain, weights)
    reduce_series(problem, work.series[SERIES], count, events, weights, work.series[REDUCED])
    spare = work.samples[work.samples.shape[0] - 1, 0]
    for e in range(history.place.shape[0]):
        motion = history.motion[e]
        second_derivative(problem, work, history.place[e, OF_TRAVEL], count, n, spare)
        for i in range(n):
            motion[i, GAIN] = spare[i]
            motion[i, NODE_SPEED], motion[i, NODE_GAIN] = 0.0, 0.0
            for k in range(1, problem.base.size):
                angle = 2.0 * math.pi * ((i * k) % n) / n
                z = problem.base[k] * complex(math.cos(angle), math.sin(angle))
                motion[i, NODE_SPEED] -= k * w * z.imag * problem.scale[LEVEL]
                motion[i, NODE_GAIN] -= (k * w) ** 2 * z.real * problem.scale[LEVEL]
        c = history.place[e, OF_NODE]
        if c >= 0:
            second_derivative(problem, work, c, count, n, spare)
            for i in range(n):
                motion[i, NODE_GAIN] += spare[i]


@inner
def fill_motion(work, history, n):
    """Fill the rest of the motion of every element from the samples of the channels."""
    for e in range(history.place.shape[0]):
        motion, node = history.motion[e], history.place[e, OF_NODE]
        for i in range(n):
            motion[i, TRAVEL] = work.samples[DISPLACEMENT, history.place[e, OF_TRAVEL], i]
            motion[i, SPEED] = work.samples[VELOCITY, history.place[e, OF_TRAVEL], i]
            if node >= 0:
                motion[i, NODE_SPEED] += work.samples[VELOCITY, node, i]
        for column in range(motion.shape[1]):
            motion[n, column] = motion[0, column]


@inner
def between(motion, i, share, h):
    """Travel, its rate, speed and acceleration of the second node at a share of interval i."""
    x0, v0, a0 = motion[i, TRAVEL], h * motion[i, SPEED], h * h * motion[i, GAIN]
    v1, a1 = h * motion[i + 1, SPEED], h * h * motion[i + 1, GAIN]
    rise = motion[i + 1, TRAVEL] - x0 - v0 - 0.5 * a0
    turn, bend = v1 - v0 - a0, a1 - a0
    c3 = 10.0 * rise - 4.0 * turn + 0.5 * bend
    c4 = -15.0 * rise + 7.0 * turn - bend
    c5 = 6.0 * rise - 3.0 * turn + 0.5 * bend
    s = share
    d = x0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    v = v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    w0, m0, m1 = motion[i, NODE_SPEED], h * motion[i, NODE_GAIN], h * motion[i + 1, NODE_GAIN]
    climb = motion[i + 1, NODE_SPEED] - w0
    c2, c3 = 3.0 * climb - 2.0 * m0 - m1, m0 + m1 - 2.0 * climb
    w = w0 + s * (m0 + s * (c2 + s * c3))
    a = m0 + s * (2.0 * c2 + 3.0 * s * c3)
    return d, v / h, w, a / h


@inner
def rate_at(memory, history, e, i, share, h, side, y, out):
    """Fill the rates of the states of element e; the travel goes to one side, or either (0)."""
    d, v, w, a = between(history.motion[e], i, share, h)
    if side > 0.0:
        v = max(v, 1e-300)
    elif side < 0.0:
        v = min(v, -1e-300)
    call_memory_rate(
        memory.laws[e, RATE], d, v, w, a, y, memory.laws[e, STATES], memory.parameters,
        memory.laws[e, PARAMETERS], out,
    )  # fmt: skip


@inner
def stiffness_at(memory, history, e, i, share, h, side, y):
    """Fastest rate of the states, by differences, 1/s."""
    space, fastest = history.space, 0.0
    begin, end = memory.laws[e, STATES], memory.laws[e + 1, STATES]
    rate_at(memory, history, e, i, share, h, side, y, space[RATES])
    for q in range(begin, end):
        kept, moved = y[q], DIFFERENCE * history.size[q]
        y[q] = kept + moved
        rate_at(memory, history, e, i, share, h, side, y, space[SUM])
        y[q] = kept
        fastest = max(fastest, abs(space[SUM, q] - space[RATES, q]) / moved)
    return fastest


@inner
def advance(memory, history, e, i, first, last, h, side, y):
    """Integrate the states of element e over the shares first .. last of interval i, in place."""
    space = history.space
    begin, end = memory.laws[e, STATES], memory.laws[e + 1, STATES]
    rate = stiffness_at(memory, history, e, i, first, h, side, y)
    rate = max(rate, stiffness_at(memory, history, e, i, last, h, side, y))
    wanted = 1.0 + (last - first) * h * rate / STIFFEST
    parts = int(min(wanted, MOST_PARTS)) if wanted > 0.0 else 1  # a nan stays one
    parts *= history.parts[0]
    step = (last - first) / parts
    for part in range(parts):
        begins = first + part * step
        for q in range(begin, end):
            space[SUM, q], space[STAGE, q] = y[q], y[q]
        for stage in range(4):
            share = begins + step * (0.0 if stage == 0 else (1.0 if stage == 3 else 0.5))
            rate_at(memory, history, e, i, share, h, side, space[STAGE], space[RATES])
            weight = 1.0 / 6.0 if stage == 0 or stage == 3 else 1.0 / 3.0
            way = 1.0 if stage == 2 else 0.5
            for q in range(begin, end):
                space[SUM, q] += weight * step * h * space[RATES, q]
                space[STAGE, q] = y[q] + way * step * h * space[RATES, q]
        for q in range(begin, end):
            y[q] = space[SUM, q]


@inner
def pass_interval(memory, history, e, i, last, h, y):
    """Integrate the states of element e from sample i to a share of the interval behind it."""
    motion = history.motion[e]
    _, after, _, _ = between(motion, i, last, h)
    before = motion[i, SPEED]
    if history.place[e, RESTS] == 0:
        advance(memory, history, e, i, 0.0, last, h, 0.0, y)
    elif (before > 0.0) == (after > 0.0):
        advance(memory, history, e, i, 0.0, last, h, 1.0 if before > 0.0 else -1.0, y)
    else:
        low, high = 0.0, last
        for _ in range(50):
            middle = 0.5 * (low + high)
            _, v, _, _ = between(motion, i, middle, h)
            if (v > 0.0) == (before > 0.0):
                low = middle
            else:
                high = middle
        side = 1.0 if before > 0.0 else -1.0
        advance(memory, history, e, i, 0.0, high, h, side, y)
        advance(memory, history, e, i, high, last, h, -side, y)


@inner
def sweep(memory, history, e, n, h, y):
    """Integrate the states of element e over the period, in place, and keep them on the way."""
    for i in range(n):
        for q in range(memory.laws[e, STATES], memory.laws[e + 1, STATES]):
            history.states[i, q] = y[q]
        pass_interval(memory, history, e, i, 1.0, h, y)
    for q in range(memory.laws[e, STATES], memory.laws[e + 1, STATES]):
        history.states[n, q] = y[q]


@inner
def close(memory, history, e, n, h):
    """Find the states of element e that the period brings back; False where there are none.

    Newton's method, and a period more (which the states forget something in) where it does not
    come nearer.
    """
    space, matrix = history.space, history.matrix
    begin, end = memory.laws[e, STATES], memory.laws[e + 1, STATES]
    pivots = matrix.shape[0]
    before = np.inf
    for _ in range(MOST_ROUNDS):
        for q in range(begin, end):
            space[LAST, q] = space[START, q]
        sweep(memory, history, e, n, h, space[LAST])
        open_by = 0.0
        for q in range(begin, end):
            size = history.size[q]
            for i in range(n):
                size = max(size, abs(history.states[i, q]))
            open_by = max(open_by, abs(space[LAST, q] - space[START, q]) / size)
        if not np.isfinite(open_by):
            return False
        if open_by <= CLOSED or (open_by <= ENOUGH and open_by > 0.5 * before):
            return True
        if open_by > 0.5 * before:
            before = np.inf
            for q in range(begin, end):
                space[START, q] = space[LAST, q]
            continue
        before = open_by
        for c in range(begin, end):
            moved = DIFFERENCE * history.size[c]
            for q in range(begin, end):
                space[MOVED, q] = space[START, q]
            space[MOVED, c] += moved
            for i in range(n):
                pass_interval(memory, history, e, i, 1.0, h, space[MOVED])
            for q in range(begin, end):
                slope = (space[MOVED, q] - space[LAST, q]) / moved
                matrix[q - begin, c - begin] = (1.0 if q == c else 0.0) - slope
        for q in range(begin, end):
            matrix[q - begin, pivots + 1] = space[LAST, q] - space[START, q]
        if factorise(matrix, end - begin):
            back_substitute(matrix, end - begin)
        for q in range(begin, end):
            space[START, q] += matrix[q - begin, pivots + 1]
    return False


@kernel
def evaluate_with_states(problem, work, memory, history, n):
    """Fill motion, events, forces and residual of the present series, states included.

    False where there are too many events or the states do not come back.
    """
    m, count = problem.lag.size, n // FINER
    h = 2.0 * math.pi / (n * problem.omega)
    fill_accelerations(problem, work, history, count, n)
    good = evaluate(problem, work, count, n)
    fill_motion(work, history, n)
    line = work.lines[LINE]
    for e in range(history.place.shape[0]):
        good = close(memory, history, e, n, h) and good
        motion, j = history.motion[e], history.place[e, OF_TRAVEL]
        for i in range(n):
            history.force[e, i] = call_memory_force(
                memory.laws[e, LAW_FORCE], motion[i, TRAVEL], motion[i, SPEED],
                history.states[i], memory.laws[e, STATES], memory.parameters,
                memory.laws[e, PARAMETERS],
            )  # fmt: skip
        harmonics(history.force[e], n, work.lines, count, line)
        for k in range(count):
            work.series[FORCE, k, j] += line[k]
            for i in range(m):
                extra = across(problem, work, k, i, j) * line[k]
                work.series[RESIDUAL, k, i] += extra if k > 0 else complex(extra.real, 0.0)
    return good


@kernel
def look_with_states(problem, work, look, n):
    """Fill the series of the nodes; their accelerations are without forces that have states."""
    node_series(problem, work, look, n // FINER)
    sample_columns(problem, work, look, n // FINER, n, True)


@kernel
def states_at(problem, memory, history, n, phases, result, forces):
    """Fill states (p, q) and forces (p, e) at phases in rad."""
    h = 2.0 * math.pi / (n * problem.omega)
    for p in range(phases.size):
        place = phases[p] * n / (2.0 * math.pi)
        whole = math.floor(place)
        i, share = int(whole % n), place - whole
        for q in range(result.shape[1]):
            result[p, q] = history.states[i, q]
        for e in range(history.place.shape[0]):
            if share > 0.0:
                pass_interval(memory, history, e, i, share, h, result[p])
            d, v, _, _ = between(history.motion[e], i, share, h)
            forces[p, e] = call_memory_force(
                memory.laws[e, LAW_FORCE], d, v, result[p], memory.laws[e, STATES],
                memory.parameters, memory.laws[e, PARAMETERS],
            )  # fmt: skip


@kernel
def begin(problem, work, count):
    """Fill responses, and the motion without channel forces."""
    start_linear(problem, work, count)


@kernel
def refine(problem, work, old, new):
    """Fill responses and first guess of the harmonics old .. new-1."""
    refine_motion(problem, work, old, new)
