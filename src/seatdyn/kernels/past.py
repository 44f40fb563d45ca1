"""The record of a run, and what its delayed forces see in it: the motion and states one delay ago.

Between its two ends a row has the quintic through displacements, velocities and accelerations of
the masses, and for the states of elements the quartic that belongs to a Dormand-Prince step
(Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.6). The states of an
element that acts late follow a late travel by the equation that they would follow at once: what
they are now is what they would have been a delay ago. So all states go with the present motion, and
a late force is the law of what is recorded.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from seatdyn.kernels.dense import quintic
from seatdyn.kernels.events import ROUNDING
from seatdyn.kernels.jit import allocating, inlined
from seatdyn.kernels.plant import segment_motion
from seatdyn.kernels.runge_kutta import A

AT_ONCE = -1  # group of a channel without delay
D = np.array(
    [
        -12715105075 / 11282082432, 0, 87487479700 / 32700410799, -10690763975 / 1880347072,
        701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423,
    ]
)  # fmt: skip
FIRST, LAST, TO_END = np.eye(7)[0], np.eye(7)[6], np.append(A[6], 0.0)
# coefficients of the quartic, powers one to four of the share, from the rates at the seven stages
QUARTIC = np.column_stack(
    [FIRST, 3 * TO_END - 2 * FIRST - LAST + D, FIRST + LAST - 2 * TO_END - 2 * D, D]
)


class Own(NamedTuple):
    """The q states of elements along a step."""

    now: np.ndarray  # (q,) at its start
    next: np.ndarray  # (q,) at a stage, the last of which is its end
    then: np.ndarray  # (q,) in the past
    rate: np.ndarray  # (7, q) at the stages
    scale: np.ndarray  # (q,) sizes that errors are relative to
    tolerance: np.ndarray  # (q,)


class Late(NamedTuple):
    """What acts late: G delays, their linear forces, and which channels have which."""

    delay: np.ndarray  # (G,) s
    begin: np.ndarray  # (G+1,) int: where the linear forces of each delay begin in the next two
    where: np.ndarray  # (k, 2) int: node that a force accelerates, place in `Nodes.y`
    gain: np.ndarray  # (k,) acceleration per unit of what stands there
    seen: np.ndarray  # int: nodes whose past matters
    turn: np.ndarray  # (G, s, 2) cosine and sine of what each lasting sine turns by in a delay
    group: np.ndarray  # (m,) int: index of the channel's delay, or AT_ONCE
    bare: bool  # whether the base motion is its lasting sines alone
    still: int  # rows of the record in which the base stands still (before the start)
    place: float  # its displacement there, m


class Nodes(NamedTuple):
    """What drives the masses at the instants of a step's stages: the base, and the past."""

    base: np.ndarray  # (7, 3) displacement, velocity, acceleration
    sines: np.ndarray  # (7, s, 2) lasting sines of the base and their cosines
    prompt: np.ndarray  # (7, N) accelerations by the base and outside forces
    drive: np.ndarray  # (N,) the same and by all delayed forces, of one node
    force: np.ndarray  # (7, m) of the channels; those that act at once are set by the stage
    y: np.ndarray  # (2N+2,) a motion of the past, the base as the last node
    side: np.ndarray  # (b,) int, and the branches it was on
    a: np.ndarray  # (N,)
    row: np.ndarray  # (G,) row of the record that the start of a step looks back into
    active: np.ndarray  # (l,) int: segment of each outside force


@allocating
def make_own(states):
    """The same, empty."""
    return Own(
        np.empty(states), np.empty(states), np.empty(states), np.zeros((7, states)),
        np.zeros(states), np.empty(states),
    )  # fmt: skip


@allocating
def make_nodes(plant, delays, forces):
    """Scratch for a run."""
    n, m = plant.linear.shape[0], plant.gain.shape[0]
    return Nodes(
        np.empty((7, 3)), np.empty((7, plant.sines.shape[0], 2)), np.empty((7, n)), np.empty(n),
        np.zeros((7, m)),
        np.empty(2 * n + 2), np.ones(plant.breaks.shape[0], np.int64), np.zeros(n),
        np.zeros(delays, np.int64), np.zeros(forces, np.int64),
    )  # fmt: skip


@inlined
def base_now(plant, late, t, segment, sines):
    """Base displacement, velocity and acceleration, and the lasting sines among them."""
    x = v = a = 0.0
    if not late.bare:
        x, v, a = segment_motion(plant, t, segment)
    for i in range(sines.shape[0]):
        omega, angle = plant.sines[i, 1], plant.sines[i, 1] * t + plant.sines[i, 2]
        sine, cosine = plant.sines[i, 0] * math.sin(angle), plant.sines[i, 0] * math.cos(angle)
        sines[i, 0], sines[i, 1] = sine, cosine
        x += sine
        v += omega * cosine
        a -= omega * omega * sine
    return x, v, a


@inlined
def base_then(plant, late, turn, t, segment, sines):
    """Base displacement and velocity at the past time t, its lasting sines turned back from now."""
    x = v = 0.0
    if not late.bare:
        x, v, _ = segment_motion(plant, t, segment)
    for i in range(sines.shape[0]):
        x += sines[i, 0] * turn[i, 0] - sines[i, 1] * turn[i, 1]
        v += plant.sines[i, 1] * (sines[i, 1] * turn[i, 0] + sines[i, 0] * turn[i, 1])
    return x, v


@inlined
def in_row(record, row, share, nodes, n, y):
    """Motion of the `nodes` at a share of a row of the record, by its quintic."""
    start, end = record[row], record[row + 1]
    h = end[0] - start[0]
    turns = 1.0 / h
    for i in range(nodes.size):
        q = nodes[i]
        v = n + q
        c = quintic(
            h, start[1 + q], start[1 + v], start[1 + n + v], end[1 + q], end[1 + v],
            start[1 + 2 * n + v],
        )  # fmt: skip
        s = share
        y[q] = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
        rate = c[1] + s * (2 * c[2] + s * (3 * c[3] + s * (4 * c[4] + s * (5 * c[5]))))
        y[v + 1] = turns * rate


@inlined
def states_in_row(record, row, share, n, x):
    """States at a share of a row of the record, by its quartics."""
    for i in range(x.size):
        p = 1 + 4 * n + 5 * i
        x[i] = record[row, p] + share * (
            record[row, p + 1]
            + share
            * (record[row, p + 2] + share * (record[row, p + 3] + share * record[row, p + 4]))
        )


@inlined
def write_states(record, row, h, n, own):
    """Write the quartics of a step into its row; return the largest change of its end."""
    worst = 0.0
    for i in range(own.now.size):
        p, before, end = 1 + 4 * n + 5 * i, 0.0, own.now[i]
        record[row, p] = own.now[i]
        for j in range(4):
            before += record[row, p + 1 + j]
            total = 0.0
            for s in range(7):
                total += QUARTIC[s, j] * own.rate[s, i]
            record[row, p + 1 + j] = h * total
            end += h * total
        worst = max(worst, abs(end - own.now[i] - before) / own.tolerance[i])
    return worst


@inlined
def guess_states(record, row, h, n, own, ratio):
    """Write into a row, `ratio` times as long as the one before, the quartics of that one going on.

    With a ratio of zero the states go on as straight lines.
    """
    for i in range(own.now.size):
        p = 1 + 4 * n + 5 * i
        record[row, p] = own.now[i]
        if ratio == 0.0:
            record[row, p + 1] = h * own.rate[0, i]
            record[row, p + 2] = record[row, p + 3] = record[row, p + 4] = 0.0
            continue
        c1, c2, c3, c4 = (
            record[row - 1, p + 1], record[row - 1, p + 2], record[row - 1, p + 3],
            record[row - 1, p + 4],
        )  # fmt: skip
        record[row, p + 1] = ratio * (c1 + 2 * c2 + 3 * c3 + 4 * c4)
        record[row, p + 2] = ratio**2 * (c2 + 3 * c3 + 6 * c4)
        record[row, p + 3] = ratio**3 * (c3 + 4 * c4)
        record[row, p + 4] = ratio**4 * c4


@inlined
def look_back(plant, late, record, marks, row, last, s, g, t, forwards, seen, nodes, own):
    """Motion `nodes.y` of the nodes `seen` and states `own.then` one delay g before node s.

    Returns the row, looked for from `row` to `last`; at the edge of two rows the later one if
    `forwards`, else the earlier. t is the time then; the lasting sines at the node are known.
    """
    n = nodes.a.size
    slack = ROUNDING * max(abs(t), 1.0)
    edge = t + slack if forwards else t - slack
    while row < last and record[row + 1, 0] <= edge:
        row += 1
    begin = record[row, 0]
    share = (t - begin) / (record[row + 1, 0] - begin)
    in_row(record, row, share, seen, n, nodes.y)
    states_in_row(record, row, share, n, own.then)
    if row < late.still:
        nodes.y[n], nodes.y[2 * n + 1] = late.place, 0.0
    else:
        segment = marks[row, marks.shape[1] - 1]
        x0, v0 = base_then(plant, late, late.turn[g], t, segment, nodes.sines[s])
        nodes.y[n], nodes.y[2 * n + 1] = x0, v0
    return row
