"""Many members of an ensemble at once: the same system, another base motion in every lane.

The linear part is propagated exactly, the base motion is the quintic through its displacement,
velocity and acceleration at the nodes, and the channel forces are approximated by the four stages
of an exponential Runge-Kutta method of order four (Krogstad 2005, J. Comput. Phys. 203:72-88).
Breaks of a law are not located: a fixed step serves averages over long records, and its error is
measured by halving it. Motions are relative to the base, so that a drift of the base costs no
digits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from seatdyn.kernels.call import call_law
from seatdyn.kernels.columns import ADDRESS, ELEMENTS, FIRST, OFFSET, SECOND
from seatdyn.kernels.jit import inlined, kernel
from seatdyn.kernels.lanes import LANES, add_row, gather_row, set_row

CHUNK = 8  # nodes of the input that are turned from one row a member to one row a node together


class March(NamedTuple):
    """One step for N free nodes, m channels, e elements, s outputs; states are [r, r'], 2N.

    Each matrix has a row per quantity that it starts from.
    """

    state: np.ndarray  # (2N, 2N) to the state at the end of the step
    inputs: np.ndarray  # (6, 2N) from base x, v, a at both ends
    forces: np.ndarray  # (4m, 2N) from the forces of the four stages
    middle: np.ndarray  # (2N + 6, 2m) to d, v across the channels at half a step
    end: np.ndarray  # (2N + 6, 2m) and at its end
    stages: np.ndarray  # (5m, 2m) from the forces at the start to stages 2, 3, 4; 2 to 3; 3 to 4
    inside: np.ndarray  # (S, 6, 3) from base x, v, a at two nodes to that at the ends of S steps
    outputs: np.ndarray  # (2N + 3 + e, s) from state, base x, v, a and element forces
    channels: np.ndarray  # as in Plant
    elements: np.ndarray
    parameters: np.ndarray


@inlined
def add_rows(matrix, first, count, source, target):
    """target += matrix[first : first + count].T @ source, lane by lane."""
    for i in range(target.shape[0]):
        add_row(matrix, first, count, i, source, target)


@inlined
def set_rows(matrix, first, count, source, target):
    """The same, beginning from zero."""
    for i in range(target.shape[0]):
        set_row(matrix, first, count, i, source, target)


@inlined
def channel_forces(march, motion, force, elements):
    """Forces of channels (m, L) and elements (e, L) from d, v across the channels (2m, L)."""
    m = force.shape[0]
    for j in range(m):
        for lane in range(LANES):
            force[j, lane] = 0.0
        for e in range(march.channels[j, ELEMENTS], march.channels[j + 1, ELEMENTS]):
            address, offset = march.elements[e, ADDRESS], march.elements[e, OFFSET]
            for lane in range(LANES):
                value = call_law(
                    address, motion[j, lane], motion[m + j, lane], march.parameters, offset
                )
                elements[e, lane] = value
                force[j, lane] += value


@inlined
def across(march, y, motion):
    """Displacement and velocity across the channels from the state."""
    m, n = motion.shape[0] // 2, y.shape[0] // 2
    for j in range(m):
        a, b = march.channels[j, FIRST], march.channels[j, SECOND]
        for lane in range(LANES):
            motion[j, lane] = (y[b, lane] if b >= 0 else 0.0) - (y[a, lane] if a >= 0 else 0.0)
            motion[m + j, lane] = (y[n + b, lane] if b >= 0 else 0.0) - (
                y[n + a, lane] if a >= 0 else 0.0
            )


@inlined
def one_step(march, y, left, right, force, elements, motion, stage, after):
    """From the states y (2N, L) to those `after` a step, base x, v, a (3, L) at both its ends.

    `force` holds the channel forces at the start, and afterwards those at the end.
    """
    n2, m = y.shape[0], force.shape[0]
    set_rows(march.state, 0, n2, y, after)
    add_rows(march.inputs, 0, 3, left, after)
    add_rows(march.inputs, 3, 3, right, after)
    if m > 0:
        add_rows(march.forces, 0, m, force, after)
        relative(march.middle, y, left, right, motion)
        add_rows(march.stages, 0, m, force, motion)
        channel_forces(march, motion, stage, elements)
        add_rows(march.forces, m, m, stage, after)

        relative(march.middle, y, left, right, motion)
        add_rows(march.stages, m, m, force, motion)
        add_rows(march.stages, 3 * m, m, stage, motion)
        channel_forces(march, motion, stage, elements)
        add_rows(march.forces, 2 * m, m, stage, after)

        relative(march.end, y, left, right, motion)
        add_rows(march.stages, 2 * m, m, force, motion)
        add_rows(march.stages, 4 * m, m, stage, motion)
        channel_forces(march, motion, stage, elements)
        add_rows(march.forces, 3 * m, m, stage, after)

        across(march, after, motion)
        channel_forces(march, motion, force, elements)


@inlined
def relative(matrix, y, left, right, motion):
    """Motion across the channels (2m, L) without what the forces of the step do to it."""
    n2 = y.shape[0]
    set_rows(matrix, 0, n2, y, motion)
    add_rows(matrix, n2, 3, left, motion)
    add_rows(matrix, n2 + 3, 3, right, motion)


@inlined
def turn(x, v, a, node, count, base):
    """Fill base (k, 3, L) with `count` nodes from `node` of records (L, nodes)."""
    for lane in range(LANES):
        for k in range(count):
            base[k, 0, lane] = x[lane, node + k]
            base[k, 1, lane] = v[lane, node + k]
            base[k, 2, lane] = a[lane, node + k]


@kernel
def march_block(march, x, v, a, settle, every, y, wanted, series):
    """March a block of members over their records.

    x, v, a : (L, nodes) base displacement, velocity, acceleration, a row a member
    settle : intervals between nodes that are passed over before anything is gathered
    every : steps from one instant that is gathered to the next; it divides those of an interval
    y : (2N, L) states [r, r'] at the first node; its memory is used
    wanted, series : outputs (q,) to be kept as series, (L, q, instants)

    Returns the states at the end, (2N, L), and the statistics of every output over the instants
    gathered, (s, 5, L): sum, of squares, of fourth powers, lowest, highest.
    """
    n2, m = y.shape[0], march.stages.shape[1] // 2
    e, s = march.elements.shape[0], march.outputs.shape[1]
    steps, intervals = march.inside.shape[0], x.shape[1] - 1
    base = np.empty((CHUNK + 1, 3, LANES))
    left, right = np.empty((3, LANES)), np.empty((3, LANES))
    after, motion = np.empty((n2, LANES)), np.empty((2 * m, LANES))
    force, stage, elements = np.zeros((m, LANES)), np.empty((m, LANES)), np.zeros((e, LANES))
    sample, statistics = np.empty((s, LANES)), np.zeros((s, 5, LANES))
    statistics[:, 3], statistics[:, 4] = np.inf, -np.inf

    across(march, y, motion)
    channel_forces(march, motion, force, elements)
    for begin in range(0, intervals, CHUNK):
        size = min(CHUNK, intervals - begin)
        turn(x, v, a, begin, size + 1, base)
        left[:] = base[0]
        for k in range(size):
            here, there = base[k], base[k + 1]
            for step in range(steps):
                place = (begin + k - settle) * steps + step
                if place >= 0 and step % every == 0:
                    set_rows(march.outputs, 0, n2, y, sample)
                    add_rows(march.outputs, n2, 3, left, sample)
                    add_rows(march.outputs, n2 + 3, e, elements, sample)
                    for i in range(s):
                        gather_row(sample, i, statistics)
                    for q in range(wanted.size):
                        for lane in range(LANES):
                            series[lane, q, place // every] = sample[wanted[q], lane]
                set_rows(march.inside[step], 0, 3, here, right)
                add_rows(march.inside[step], 3, 3, there, right)
                one_step(march, y, left, right, force, elements, motion, stage, after)
                y, after = after, y
                left, right = right, left
    return y, statistics
