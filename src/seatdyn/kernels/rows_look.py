"""The motions of many members looked at, a row of them at once: extrema of their outputs.

As `kernels.orbit` does for one member; arrays are those of `kernels.side_by_side`.
"""

from __future__ import annotations

from seatdyn.kernels.jit import inner, kernel, spliced
from seatdyn.kernels.orbit import DOUBT, HIGH, LOW
from seatdyn.kernels.rows import (
    any_larger,
    larger_of,
    load,
    size_of,
    spread,
    store,
    where_larger,
)
from seatdyn.kernels.rows_fourier import number, samples_of

TINY = 1e-300
NEWTON_STEPS = 4  # to the top of a quartic
# places among extrema, beside HIGH and LOW: how unsure they are, and how rough the signal is there
UNSURE, ROUGH = 2, 4
AHEAD = 3  # samples that a signal is continued by on either side


@spliced
def rises(bend, square, over_before, over_after, way):
    """Positive where a peak beside a sample may be higher than it by more than `way`.

    Not only the highest sample is looked at: a lower one may be beside a higher peak.
    """
    hope = square * (DOUBT / 8.0) - bend * way + TINY
    hope = where_larger(over_before, 0.0, hope, -1.0)
    return where_larger(0.0, over_after, -1.0, hope)


@inner
def widen(signal, i, sign, hope, extrema, way, o):
    """Widen an extremum (row o of extrema[way]) where `hope` > 0: sign * signal has a peak near i.

    By a quartic through five samples; what a parabola gives otherwise says how unsure that is, and
    the largest of three fourth differences how rough the signal is.
    """
    a, b = load(signal, i - 2) * sign, load(signal, i - 1) * sign
    c = load(signal, i) * sign
    d, e = load(signal, i + 1) * sign, load(signal, i + 2) * sign
    c1 = (a - e - (b - d) * 8.0) * (1 / 12)
    c2 = ((b + d) * 16.0 - a - e - c * 30.0) * (1 / 24)
    c3 = (e - a + (b - d) * 2.0) * (1 / 12)
    c4 = (a + e - (b + d) * 4.0 + c * 6.0) * (1 / 24)
    best, x = c, spread(0.0)
    for _ in range(NEWTON_STEPS):
        bend = c2 * 2.0 + x * (c3 * 6.0 + x * c4 * 12.0)
        slope = c1 + x * (c2 * 2.0 + x * (c3 * 3.0 + x * c4 * 4.0))
        x = where_larger(0.0, bend, x - slope / bend, x)
        x = where_larger(x, 1.0, 1.0, where_larger(-1.0, x, -1.0, x))
        value = c + x * (c1 + x * (c2 + x * (c3 + x * c4)))
        best = where_larger(value, best, value, best)
    parabola = c + (d - b) * (d - b) / ((c * 2.0 - b - d) * 8.0)
    unsure = where_larger(best, parabola, best - parabola, parabola - best)
    before, after = load(signal, i - 3) * sign, load(signal, i + 3) * sign
    rough = spread(0.0)
    for fourth in (
        before + d + b * 6.0 - (a + c) * 4.0, c4 * 24.0, b + after + d * 6.0 - (c + e) * 4.0,
    ):  # fmt: skip
        rough = larger_of(size_of(fourth), rough)
    known = load(extrema[way], o) * sign
    better = where_larger(hope, 0.0, where_larger(known, best, 0.0, 1.0), 0.0)
    store(extrema[way], o, where_larger(better, 0.0, best, known) * sign)
    for place, value in ((extrema[UNSURE + way], unsure), (extrema[ROUGH + way], rough)):
        store(place, o, where_larger(better, 0.0, value, load(place, o)))


@kernel
def look(
    node, places, force, forces, base, omega, weights, matters, used, begins, roots, odd, extrema,
    lines, series, columns, signal,
):  # fmt: skip
    """Fill the extrema (G, 6, o, W) of the outputs, and how unsure and how rough they are.

    places : of the nodes among those in `node`, see `side_by_side.respond`
    weights : (G, o, C, W) of the columns z, v, the element forces, and u, u', u''
    matters : (C,) whether any output needs a column
    used, begins : those of one output after the other, and where each begins (o + 1,)
    lines : (2, n, W); series : (K, 2, W); columns : (C, n, W); signal : (n + 2 AHEAD, W), space
    """
    groups, nodes, count, n = node.shape[0], places.size, node.shape[3], columns.shape[1]
    m, e = node.shape[2] - 1, forces.shape[1]
    turn = -1.0 if odd else 1.0  # sign of what comes after the last sample
    for g in range(groups):
        rate = load(omega[g], 0)
        for i in range(nodes):
            if places[i] < 0:
                continue
            for k in range(count):
                place = 2 * ((places[i] * (m + 1) + m) * count + k)
                a, b = load(node[g], place), load(node[g], place + 1)
                for j in range(m):
                    place = 2 * ((places[i] * (m + 1) + j) * count + k)
                    x, y = load(node[g], place), load(node[g], place + 1)
                    place = 2 * (j * count + k)
                    fr, fi = load(force[g], place), load(force[g], place + 1)
                    a, b = a - (x * fr - y * fi), b - (x * fi + y * fr)
                store(series, 2 * k, a)
                store(series, 2 * k + 1, b)
            for order in range(2):
                if matters[order * nodes + i]:
                    samples_of(
                        series, rate, order, count, n, odd, roots, lines[0], lines[1],
                        columns[order * nodes + i],
                    )  # fmt: skip
        for i in range(e):
            if matters[2 * nodes + i]:
                for s in range(n):
                    store(columns[2 * nodes + i], s, load(forces[g, i], s))
        known = base.shape[1] // 2 if odd else base.shape[1]
        for k in range(known):
            store(series, 2 * k, load(base[g], 2 * number(k, odd)))
            store(series, 2 * k + 1, load(base[g], 2 * number(k, odd) + 1))
        for order in range(3):
            if matters[2 * nodes + e + order]:
                samples_of(
                    series, rate, 0, known, n, odd, roots, lines[0], lines[1],
                    columns[2 * nodes + e + order],
                )  # fmt: skip
            for k in range(known):
                w = rate * float(number(k, odd))
                x, y = load(series, 2 * k), load(series, 2 * k + 1)
                store(series, 2 * k, y * w * -1.0)
                store(series, 2 * k + 1, x * w)
        for o in range(begins.size - 1):
            for s in range(0, n, 4):  # four sums at once: one would wait for its last addition
                v0, v1, v2, v3 = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
                for u in range(begins[o], begins[o + 1]):
                    weight, column = load(weights[g, o], used[u]), columns[used[u]]
                    v0, v1 = v0 + weight * load(column, s), v1 + weight * load(column, s + 1)
                    v2, v3 = v2 + weight * load(column, s + 2), v3 + weight * load(column, s + 3)
                store(signal, AHEAD + s, v0)
                store(signal, AHEAD + s + 1, v1)
                store(signal, AHEAD + s + 2, v2)
                store(signal, AHEAD + s + 3, v3)
            for s in range(AHEAD):
                store(signal, s, load(signal, n + s) * turn)
                store(signal, n + AHEAD + s, load(signal, AHEAD + s) * turn)
            before = load(signal, AHEAD - 1)
            high, low, leap = before, before, spread(0.0)
            for s in range(AHEAD, n + AHEAD):
                value = load(signal, s)
                high = where_larger(value, high, value, high)
                low = where_larger(low, value, value, low)
                leap = larger_of(size_of(value - before), leap)
                before = value
            if odd:
                high = larger_of(high, low * -1.0)
                low = high * -1.0
            store(extrema[g, HIGH], o, high)
            store(extrema[g, LOW], o, low)
            for place in range(UNSURE, ROUGH + 2):
                store(extrema[g, place], o, 0.0)
            for s in range(AHEAD, n + AHEAD):
                here = load(signal, s)
                # a parabola through a sample and two lower ones rises above it by less than this
                if not (any_larger(here, high - leap) or any_larger(low + leap, here)):
                    continue
                before, after = load(signal, s - 1), load(signal, s + 1)
                bend, square = here * 2.0 - before - after, (after - before) * (after - before)
                above = rises(bend, square, here - before, here - after, high - here)
                below = rises(bend * -1.0, square, before - here, after - here, here - low)
                if any_larger(above, 0.0):
                    widen(signal, s, 1.0, above, extrema[g], HIGH, o)
                if any_larger(below, 0.0):
                    widen(signal, s, -1.0, below, extrema[g], LOW, o)
            if odd:  # what is lowest in one half is highest in the other
                high, low = load(extrema[g, HIGH], o), load(extrema[g, LOW], o) * -1.0
                for place in (UNSURE, ROUGH):
                    value = load(extrema[g, place + HIGH], o)
                    value = where_larger(low, high, load(extrema[g, place + LOW], o), value)
                    store(extrema[g, place + HIGH], o, value)
                    store(extrema[g, place + LOW], o, value)
                high = where_larger(low, high, low, high)
                store(extrema[g, HIGH], o, high)
                store(extrema[g, LOW], o, high * -1.0)
