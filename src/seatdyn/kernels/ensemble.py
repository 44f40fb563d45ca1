"""Many members of an ensemble at once: the same system, another base motion in every lane.

The linear part is propagated exactly, the base motion is the quintic through its displacement,
velocity and acceleration at the nodes, and the channel forces are approximated by the four stages
of an exponential Runge-Kutta method of order four (Krogstad 2005, J. Comput. Phys. 203:72-88).
Breaks of a law are not located: a fixed step serves averages over long records, and its error is
measured by halving it. Motions are relative to the base, so that a drift of the base costs no
digits.

All that a step starts from stands in one table of rows, and every stage is one matrix times its
first rows:

    state | forces at the start | base x, x', ... x''''' | forces of the stages 2, 3, 4

Outputs are linear in the state, the forces at the start and the base x, x', x'', so their mean
squares follow from the products of these few rows with each other, summed up. Where there are no
forces, outputs inside a step are linear in the same rows, too, and instants inside cost nothing.
Only for extremes, fourth powers and series outputs are worked out at every instant.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from seatdyn.kernels.call import add_forces
from seatdyn.kernels.columns import ADDRESS, ELEMENTS, OFFSET
from seatdyn.kernels.jit import inlined, inner, kernel
from seatdyn.kernels.lanes import (
    LANES,
    MOMENTS,
    gather_extremes,
    gather_products,
    multiply,
)

CHUNK = 8  # nodes of the input that are turned together, and steps that are gathered together
DERIVATIVES = 6  # of the base displacement, a quintic, from the 0th on


class March(NamedTuple):
    """One step for N free nodes, m channels; states are [q, q'], 2N, motions across links.

    Each matrix has a row per quantity that it starts from, in the order of the table of rows.
    """

    base: np.ndarray  # (6S, 6) from base x, v, a at two nodes to the rows of the S steps between
    across: np.ndarray  # (2N, 2m) from the state to d, v across the channels
    second: np.ndarray  # (2N + m + 6, 2m) d, v across the channels at the second stage
    third: np.ndarray  # (2N + 2m + 6, 2m)
    fourth: np.ndarray  # (2N + 3m + 6, 2m)
    step: np.ndarray  # (2N + 4m + 6, 2N) state at the end of the step
    channels: np.ndarray  # as in Plant
    elements: np.ndarray  # as in Plant, with addresses of laws for lanes
    parameters: np.ndarray


@inlined
def channel_forces(march, motion, table, at):
    """Put the forces of the channels, from d, v across them (2m, L), into table[at : at + m]."""
    m = motion.shape[0] // 2
    for j in range(m):
        for lane in range(LANES):
            table[at + j, lane] = 0.0
        for e in range(march.channels[j, ELEMENTS], march.channels[j + 1, ELEMENTS]):
            address, offset = march.elements[e, ADDRESS], march.elements[e, OFFSET]
            add_forces(
                address, LANES, motion, j * LANES, (m + j) * LANES, march.parameters, offset, table,
                (at + j) * LANES,
            )  # fmt: skip


@inlined
def stage(march, matrix, table, at, motion, to):
    """Forces of a stage at table[to:], from the rows at table[at:] and the matrix of the stage."""
    multiply(matrix, 0, matrix.shape[0], table, at, motion, 0)
    channel_forces(march, motion, table, to)


@inlined
def turn(x, v, a, node, count, base):
    """Fill base (3k, L) with `count` nodes from `node` of records (L, nodes)."""
    for lane in range(LANES):
        for k in range(count):
            base[3 * k, lane] = x[lane, node + k]
            base[3 * k + 1, lane] = v[lane, node + k]
            base[3 * k + 2, lane] = a[lane, node + k]


@inlined
def copy_rows(table, at, to, count):
    """table[to : to + count] = table[at : at + count]."""
    for i in range(count):
        for lane in range(LANES):
            table[to + i, lane] = table[at + i, lane]


@inner
def gather(table, size, times, done, outputs, sample, extremes, series, gram):
    """Gather some `times` of the table; `done` were gathered before."""
    gather_products(table, size, times, gram)
    s = extremes.shape[0]
    instants, sources = outputs.shape[0] // gram.shape[0], gram.shape[0]
    for i in range(instants if s > 0 else 0):
        for time in range(times):
            multiply(outputs, i * sources, sources, table, time * size, sample, time * s)
        gather_extremes(sample, times, extremes)
        for lane in range(LANES):
            for q in range(series.shape[1]):
                for time in range(times):
                    series[lane, q, (done + time) * instants + i] = sample[time * s + q, lane]


@kernel
def march_block(march, x, v, a, settle, every, start, outputs, series, gram):
    """March a block of members over their records.

    x, v, a : (L, nodes) base displacement, velocity, acceleration, a row a member
    settle : intervals between nodes that are passed over before anything is gathered
    every : steps from one that is gathered to the next; it divides those of an interval
    start : (2N, L) states [q, q'] at the first node
    outputs : (I K, s) from the first K rows to s outputs at I instants of a step gathered
    series : (L, q, instants) that the first q outputs are written to
    gram : (K, K + 1, L) zeros; products of the first K rows over the steps gathered, and their sums

    Returns sums of fourth powers, lowest and highest of the outputs, (s, 3, L).
    """
    n2, m = start.shape[0], march.across.shape[1] // 2
    steps, intervals, s = march.base.shape[0] // DERIVATIVES, x.shape[1] - 1, outputs.shape[1]
    size = march.step.shape[0]
    table, base = np.zeros(((CHUNK + 1) * size, LANES)), np.empty((3 * (CHUNK + 1), LANES))
    motion, sample = np.empty((2 * m, LANES)), np.empty((CHUNK * s, LANES))
    extremes = np.zeros((s, MOMENTS, LANES))
    extremes[:, 1], extremes[:, 2] = np.inf, -np.inf
    table[:n2] = start
    quintic, late = n2 + m, n2 + m + DERIVATIVES
    waiting, done = 0, 0  # times in the table that are to be gathered, and that were

    for begin in range(0, intervals, CHUNK):
        length = min(CHUNK, intervals - begin)
        turn(x, v, a, begin, length + 1, base)
        for k in range(length):
            for step in range(steps):
                at = waiting * size
                multiply(
                    march.base, step * DERIVATIVES, DERIVATIVES, base, 3 * k, table, at + quintic
                )
                if m > 0:
                    stage(march, march.across, table, at, motion, at + n2)
                    stage(march, march.second, table, at, motion, at + late)
                    stage(march, march.third, table, at, motion, at + late + m)
                    stage(march, march.fourth, table, at, motion, at + late + 2 * m)
                after = (waiting + 1) * size
                multiply(march.step, 0, size, table, at, table, after)
                if begin + k >= settle and step % every == 0:
                    waiting += 1
                    if waiting < CHUNK:
                        continue
                    gather(table, size, CHUNK, done, outputs, sample, extremes, series, gram)
                    waiting, done = 0, done + CHUNK
                copy_rows(table, after, waiting * size, n2)
    gather(table, size, waiting, done, outputs, sample, extremes, series, gram)
    return extremes
