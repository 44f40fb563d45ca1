"""Harmonic balance of many members, a row of them at once, by mixed fixed-point steps.

Harmonics are two-sided, c_k = D_k/2 and c_0 = D_0: the motion is c_0 + 2 Re sum c_k exp(i k theta).
Arrays of rows end with (2, W) for complex numbers, real part first, and with (W,) for real ones.
The method is described in `seatdyn.analysis.balance_many`.
"""

from __future__ import annotations

import math

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from seatdyn.kernels.columns import ADDRESS, ELEMENTS, FIRST, OFFSET, SECOND
from seatdyn.kernels.jit import inner, kernel, spliced
from seatdyn.kernels.orbit import DOUBT, HIGH, LOW
from seatdyn.kernels.rows import any_larger, load, root_of, spread, store, where_larger
from seatdyn.kernels.rows_fourier import harmonics, samples_of

DEPTH = 4  # earlier steps that are mixed
MOST_STEPS = 40  # of one level
SHARE_OF_HIGH = 0.05  # of the higher harmonics: about what the samples leave out
TINY, REGULAR = 1e-300, 1e-14  # the latter of the squares of the steps: no equation is singular
NOISE = 1e-9  # of a force
NEWTON_STEPS = 4  # to the top of a quartic
# places in the memory of steps: motion and step before, then pairs of changes of motion and step
MOTION, STEP, BEFORE, PAIRS = 0, 1, 2, 3
UNSURE = 2  # place among extrema, beside HIGH and LOW: how unsure they are


@intrinsic
def call_rows_law(typingctx, address, count, d, v, parameters, first, force, place):
    """force[place] += F of the law for rows at `address` at `count` pairs d, v (flat arrays).

    Its parameters are the rows from parameters[first] on, each of `count` numbers.
    """
    index = types.int64
    signature = types.void(index, index, d, v, parameters, index, force, index)

    def codegen(context, builder, sig, args):
        number, whole = ir.DoubleType().as_pointer(), ir.IntType(64)
        law_type = ir.FunctionType(ir.VoidType(), [whole, number, number, number, number])
        law = builder.inttoptr(args[0], law_type.as_pointer())

        def at(array, row=None):
            data = context.make_array(sig.args[array])(context, builder, args[array]).data
            return data if row is None else builder.gep(data, [builder.mul(args[row], args[1])])

        builder.call(law, [args[1], at(2), at(3), at(4, 5), at(6, 7)])
        return context.get_dummy_value()

    return signature, codegen


@kernel
def respond(linear, pull, base, omega, channels, first, node, across, doubt, matrix):
    """Fill the linear motion of the harmonics from `first` on, of nodes and across channels.

    By elimination without pivoting, which is the same for all members; `doubt` (G, W) becomes the
    largest square of its factors.

    linear, pull : (G, N, 2N+2, W) and (G, N, m, W); base : (G, B, 2, W); omega : (G, W)
    node, across : (G, N, m+1, K, 2, W) and (G, m, m+1, K, 2, W), motion per channel force, and due
        to the base in the last column
    matrix : (N, N+m+1, 2, W), space
    """
    groups, n, columns, count = node.shape[0], node.shape[1], node.shape[2], node.shape[3]
    m, width = columns - 1, n + columns
    for g in range(groups):
        largest = load(doubt[g], 0)
        for k in range(first, count):
            w = load(omega[g], 0) * float(k)
            base_r, base_i = spread(0.0), spread(0.0)
            if k < base.shape[1]:
                base_r, base_i = load(base[g], 2 * k), load(base[g], 2 * k + 1)
            for i in range(n):
                row, own = i * (2 * n + 2), i * width
                for c in range(n):
                    real = load(linear[g], row + c) * -1.0
                    if c == i:
                        real = real - w * w
                    store(matrix, 2 * (own + c), real)
                    store(matrix, 2 * (own + c) + 1, load(linear[g], row + n + c) * w * -1.0)
                for j in range(m):
                    store(matrix, 2 * (own + n + j), load(pull[g], i * m + j))
                    store(matrix, 2 * (own + n + j) + 1, 0.0)
                x, y = load(linear[g], row + 2 * n), load(linear[g], row + 2 * n + 1) * w
                store(matrix, 2 * (own + n + m), x * base_r - y * base_i)
                store(matrix, 2 * (own + n + m) + 1, x * base_i + y * base_r)
            for i in range(n):
                a, b = load(matrix, 2 * (i * width + i)), load(matrix, 2 * (i * width + i) + 1)
                square = 1.0 / (a * a + b * b)
                inverse_r, inverse_i = a * square, b * square * -1.0
                store(matrix, 2 * (i * width + i), inverse_r)
                store(matrix, 2 * (i * width + i) + 1, inverse_i)
                for r in range(i + 1, n):
                    a, b = load(matrix, 2 * (r * width + i)), load(matrix, 2 * (r * width + i) + 1)
                    x, y = a * inverse_r - b * inverse_i, a * inverse_i + b * inverse_r
                    square = x * x + y * y
                    largest = where_larger(square, largest, square, largest)
                    for c in range(i + 1, width):
                        subtract_product(matrix, r * width + c, x, y, i * width + c)
            for i in range(n - 1, -1, -1):
                inverse_r = load(matrix, 2 * (i * width + i))
                inverse_i = load(matrix, 2 * (i * width + i) + 1)
                for c in range(n, width):
                    for r in range(i + 1, n):
                        x = load(matrix, 2 * (i * width + r))
                        y = load(matrix, 2 * (i * width + r) + 1)
                        subtract_product(matrix, i * width + c, x, y, r * width + c)
                    a, b = load(matrix, 2 * (i * width + c)), load(matrix, 2 * (i * width + c) + 1)
                    a, b = a * inverse_r - b * inverse_i, a * inverse_i + b * inverse_r
                    store(matrix, 2 * (i * width + c), a)
                    store(matrix, 2 * (i * width + c) + 1, b)
                    place = 2 * ((i * columns + c - n) * count + k)
                    store(node[g], place, a)
                    store(node[g], place + 1, b)
            for j in range(m):
                for c in range(columns):
                    for part in range(2):
                        total = spread(0.0)
                        for sign, end in ((1.0, channels[j, SECOND]), (-1.0, channels[j, FIRST])):
                            if end >= 0:
                                place = 2 * ((end * columns + c) * count + k) + part
                                total = total + load(node[g], place) * sign
                            elif c == m and part == 0:
                                total = total + base_r * sign
                            elif c == m:
                                total = total + base_i * sign
                        store(across[g], 2 * ((j * columns + c) * count + k) + part, total)
        store(doubt[g], 0, largest)


@inner
def subtract_product(matrix, place, x, y, other):
    """matrix[place] -= (x + i y) matrix[other], complex rows."""
    a, b = load(matrix, 2 * other), load(matrix, 2 * other + 1)
    store(matrix, 2 * place, load(matrix, 2 * place) - (x * a - y * b))
    store(matrix, 2 * place + 1, load(matrix, 2 * place + 1) - (x * b + y * a))


@inner
def sum_forces(channels, elements, values, d, v, forces, total, n):
    """Fill the element forces (e, n, W), and their sums (m, n, W), at motions d, v (m, n, W)."""
    m = d.shape[0]
    flat, count = forces.reshape(-1), forces.shape[1] * forces.shape[2]
    for e in range(elements.shape[0]):
        for i in range(n):
            store(forces[e], i, 0.0)
    for j in range(m):
        first = channels[j, ELEMENTS]
        for e in range(first, channels[j + 1, ELEMENTS]):
            call_rows_law(
                elements[e, ADDRESS], count, d[j].reshape(-1), v[j].reshape(-1), values,
                elements[e, OFFSET], flat, e,
            )  # fmt: skip
            for i in range(n):
                force = load(forces[e], i)
                store(total[j], i, force if e == first else load(total[j], i) + force)


@inner
def residual_of(series, force, across, count, residual):
    """Fill the residual; returns its size and that of the higher harmonics relative to the motion.

    series, force, residual : (m, K, 2, W); across : (m, m+1, K, 2, W)
    """
    m = series.shape[0]
    total, scale, high = spread(0.0), spread(TINY), spread(0.0)
    for i in range(m):
        for k in range(count):
            here = 2 * (i * count + k)
            x, y = load(series, here), load(series, here + 1)
            place = 2 * ((i * (m + 1) + m) * count + k)
            a, b = x - load(across, place), y - load(across, place + 1)
            for j in range(m):
                place = 2 * ((i * (m + 1) + j) * count + k)
                gr, gi = load(across, place), load(across, place + 1)
                fr, fi = load(force, 2 * (j * count + k)), load(force, 2 * (j * count + k) + 1)
                a, b = a + (gr * fr - gi * fi), b + (gr * fi + gi * fr)
            if k == 0:
                b = spread(0.0)
            store(residual, here, a)
            store(residual, here + 1, b)
            weight = 1.0 + float(k) * k
            total = total + (a * a + b * b) * weight
            part = (x * x + y * y) * weight
            scale = scale + part
            if 2 * k >= count:
                high = high + part
    return root_of(total / scale), root_of(high / scale)


@inner
def equivalent_steps(series, force, across, omega, count, step, slopes, matrix):
    """Turn the residual in `step` into the step to take were every channel linear.

    Namely the spring and damper that take the same power from the motion as its force.

    slopes : (m, 2, W); matrix : (m, m+1, 2, W), space
    """
    m = series.shape[0]
    w = load(omega, 0)
    for j in range(m):
        by_d, by_v, dd, vv = spread(0.0), spread(0.0), spread(TINY), spread(TINY)
        for k in range(1, count):
            place = 2 * (j * count + k)
            x, y = load(series, place), load(series, place + 1)
            fr, fi = load(force, place), load(force, place + 1)
            square = x * x + y * y
            by_d = by_d + fr * x + fi * y
            by_v = by_v + (fi * x - fr * y) * float(k)
            dd = dd + square
            vv = vv + square * (float(k) * k)
        spring, damper = by_d / dd, by_v / (vv * w)
        store(slopes, 2 * j, where_larger(spring, 0.0, spring, 0.0))
        store(slopes, 2 * j + 1, where_larger(damper, 0.0, damper, 0.0))
    for k in range(count):
        rate = w * float(k)
        for i in range(m):
            for j in range(m):
                place = 2 * ((i * (m + 1) + j) * count + k)
                gr, gi = load(across, place), load(across, place + 1)
                sr, si = load(slopes, 2 * j), load(slopes, 2 * j + 1) * rate
                one = 1.0 if i == j else 0.0
                store(matrix, 2 * (i * (m + 1) + j), gr * sr - gi * si + one)
                store(matrix, 2 * (i * (m + 1) + j) + 1, gr * si + gi * sr)
            place = 2 * (i * count + k)
            store(matrix, 2 * (i * (m + 1) + m), load(step, place) * -1.0)
            store(matrix, 2 * (i * (m + 1) + m) + 1, load(step, place + 1) * -1.0)
        for i in range(m):
            own = i * (m + 1)
            a, b = load(matrix, 2 * (own + i)), load(matrix, 2 * (own + i) + 1)
            square = 1.0 / (a * a + b * b)
            for c in range(i + 1, m + 1):
                x, y = load(matrix, 2 * (own + c)), load(matrix, 2 * (own + c) + 1)
                store(matrix, 2 * (own + c), (x * a + y * b) * square)
                store(matrix, 2 * (own + c) + 1, (y * a - x * b) * square)
            for r in range(m):
                if r != i:
                    x = load(matrix, 2 * (r * (m + 1) + i))
                    y = load(matrix, 2 * (r * (m + 1) + i) + 1)
                    for c in range(i + 1, m + 1):
                        subtract_product(matrix, r * (m + 1) + c, x, y, own + c)
        for i in range(m):
            place = 2 * (i * count + k)
            store(step, place, load(matrix, 2 * (i * (m + 1) + m)))
            store(step, place + 1, load(matrix, 2 * (i * (m + 1) + m) + 1))


@inner
def product(x, y, m, count):
    """Inner product of two series (m, K, 2, W), velocities weighing as much as displacements."""
    total = spread(0.0)
    for i in range(m):
        for k in range(count):
            place = 2 * (i * count + k)
            part = load(x, place) * load(y, place) + load(x, place + 1) * load(y, place + 1)
            total = total + part * (1.0 + float(k) * k)
    return total


@inner
def solve_least(a, size):
    """Solve the positive equations a[:size, :size] x = a[:size, DEPTH], rows, in place."""
    width = DEPTH + 1
    for i in range(size):
        inverse = 1.0 / load(a, i * width + i)
        for k in range(i + 1, size):
            f = load(a, k * width + i) * inverse
            for c in range(i + 1, size):
                store(a, k * width + c, load(a, k * width + c) - f * load(a, i * width + c))
            place = k * width + DEPTH
            store(a, place, load(a, place) - f * load(a, i * width + DEPTH))
        store(a, i * width + i, inverse)
    for i in range(size - 1, -1, -1):
        total = load(a, i * width + DEPTH)
        for c in range(i + 1, size):
            total = total - load(a, i * width + c) * load(a, c * width + DEPTH)
        store(a, i * width + DEPTH, total * load(a, i * width + i))


@inner
def mix(series, past, taken, squares, space, m, count):
    """Go the step in past[STEP], mixed (Anderson) with the steps taken before.

    squares : (DEPTH, DEPTH, W), inner products of the changes of steps
    """
    numbers = 2 * m * count
    known = min(taken, DEPTH)
    if taken > 0:
        slot = PAIRS + 2 * ((taken - 1) % DEPTH)
        for i in range(numbers):
            fell = load(past[STEP], i) - load(past[BEFORE], i)
            store(past[slot], i, fell)
            store(past[slot + 1], i, load(series, i) - load(past[MOTION], i) + fell)
        place = (taken - 1) % DEPTH
        for a in range(known):  # the others are known
            found = product(past[PAIRS + 2 * a], past[slot], m, count)
            store(squares, a * DEPTH + place, found)
            store(squares, place * DEPTH + a, found)
    trace = spread(TINY)
    for a in range(known):
        trace = trace + load(squares, a * DEPTH + a) * REGULAR
    for a in range(known):
        for b in range(known):
            one = trace if a == b else spread(0.0)
            store(space, a * (DEPTH + 1) + b, load(squares, a * DEPTH + b) + one)
        found = product(past[PAIRS + 2 * a], past[STEP], m, count)
        store(space, a * (DEPTH + 1) + DEPTH, found)
    solve_least(space, known)
    for i in range(numbers):
        x, step = load(series, i), load(past[STEP], i)
        store(past[MOTION], i, x)
        store(past[BEFORE], i, step)
        x = x + step
        for a in range(known):
            x = x - load(space, a * (DEPTH + 1) + DEPTH) * load(past[PAIRS + 2 * a + 1], i)
        store(series, i, x)


@inner
def largest_leap(total, n):
    """Largest change of a channel's force between two samples, relative to its range."""
    worst = spread(0.0)
    for j in range(total.shape[0]):
        before = load(total[j], n - 1)
        high, low, leap = before, before, spread(0.0)
        for i in range(n):
            here = load(total[j], i)
            high, low = where_larger(here, high, here, high), where_larger(low, here, here, low)
            change = here - before
            change = where_larger(change, 0.0, change, change * -1.0)
            leap = where_larger(change, leap, change, leap)
            before = here
        size = where_larger(high, low * -1.0, high, low * -1.0) * NOISE + TINY
        leap = where_larger(leap, size, leap, 0.0) / (high - low + size)
        worst = where_larger(leap, worst, leap, worst)
    return worst


@kernel
def settle(
    across, omega, parameters, channels, elements, roots, tolerance, series, force, forces, total,
    left, leap, past, lines, motion, values, squares, space, slopes, matrix,
):  # fmt: skip
    """Solve for the motions of all groups, from the guesses in `series`.

    across, omega : see `respond`; parameters : (G, P, W); roots : (., 2) cos, -sin
    series, force : (G, m, K, 2, W) harmonics of motion and force of the channels
    forces, total : (G, e, n, W) and (G, m, n, W), samples of the forces of elements and channels
    left : (G, W) residual relative to the motion, infinite where there is no solution
    leap : (G, W) see `largest_leap`
    past : (PAIRS + 2 DEPTH, m, K, 2, W); lines : (2, n, W); motion : (2, m, n, W);
    values : (P n W,); squares, space : (DEPTH, DEPTH, W) and (DEPTH, DEPTH + 1, W);
    slopes : (m, 2, W); matrix : (m, m + 1, 2, W)
    """
    groups, m, count = series.shape[0], series.shape[1], series.shape[2]
    n = total.shape[2]
    for g in range(groups):
        rate = load(omega[g], 0)
        for i in range(parameters.shape[1]):
            value = load(parameters[g], i)
            for s in range(n):
                store(values, i * n + s, value)
        for taken in range(MOST_STEPS):
            for j in range(m):
                for order in range(2):
                    samples_of(
                        series[g, j], rate, order, count, n, roots, lines[0], lines[1],
                        motion[order, j],
                    )  # fmt: skip
            sum_forces(channels, elements, values, motion[0], motion[1], forces[g], total[g], n)
            for j in range(m):
                harmonics(total[g, j], n, roots, count, lines[0], lines[1], force[g, j])
            size, high = residual_of(series[g], force[g], across[g], count, past[STEP])
            allowed = where_larger(high * SHARE_OF_HIGH, tolerance, high * SHARE_OF_HIGH, tolerance)
            # also where it is not a number
            store(left[g], 0, where_larger(size, allowed, math.inf, size))
            # one step at least: else a guess that is good enough would hide what is wrong with it
            if taken > 0 and (not any_larger(size, allowed) or taken + 1 == MOST_STEPS):
                store(leap[g], 0, largest_leap(total[g], n))
                break
            equivalent_steps(
                series[g], force[g], across[g], omega[g], count, past[STEP], slopes, matrix
            )
            for i in range(2 * m * count if taken > 0 else 0):
                store(past[STEP], i, where_larger(size, allowed, load(past[STEP], i), 0.0))
            mix(series[g], past, taken, squares, space, m, count)


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

    By a quartic through five samples; what a parabola gives otherwise says how unsure that is.
    """
    n = signal.shape[0]
    a = load(signal, i - 2 if i > 1 else i + n - 2) * sign
    b = load(signal, i - 1 if i > 0 else n - 1) * sign
    c = load(signal, i) * sign
    d = load(signal, i + 1 if i + 1 < n else 0) * sign
    e = load(signal, i + 2 if i + 2 < n else i + 2 - n) * sign
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
    known = load(extrema[way], o) * sign
    better = where_larger(hope, 0.0, where_larger(known, best, 0.0, 1.0), 0.0)
    store(extrema[way], o, where_larger(better, 0.0, best, known) * sign)
    place = extrema[UNSURE + way]
    store(place, o, where_larger(better, 0.0, unsure, load(place, o)))


@kernel
def look(
    node, force, forces, base, omega, weights, used, begins, roots, extrema, lines, series,
    columns, signal,
):  # fmt: skip
    """Fill the extrema (G, 4, o, W) of the outputs, and how unsure they are.

    weights : (G, o, C, W) of the columns z, v, the element forces, and u, u', u''
    used, begins : columns that matter, one output after the other, and where each begins (o + 1,)
    lines : (2, n, W); series : (K, 2, W); columns : (C, n, W); signal : (n, W), space
    """
    groups, nodes, count, n = node.shape[0], node.shape[1], node.shape[3], signal.shape[0]
    m, e = node.shape[2] - 1, forces.shape[1]
    for g in range(groups):
        rate = load(omega[g], 0)
        for i in range(nodes):
            for k in range(count):
                place = 2 * ((i * (m + 1) + m) * count + k)
                a, b = load(node[g], place), load(node[g], place + 1)
                for j in range(m):
                    place = 2 * ((i * (m + 1) + j) * count + k)
                    x, y = load(node[g], place), load(node[g], place + 1)
                    place = 2 * (j * count + k)
                    fr, fi = load(force[g], place), load(force[g], place + 1)
                    a, b = a - (x * fr - y * fi), b - (x * fi + y * fr)
                store(series, 2 * k, a)
                store(series, 2 * k + 1, b)
            for order in range(2):
                samples_of(
                    series, rate, order, count, n, roots, lines[0], lines[1],
                    columns[order * nodes + i],
                )  # fmt: skip
        for i in range(e):
            for s in range(n):
                store(columns[2 * nodes + i], s, load(forces[g, i], s))
        known = base.shape[1]
        for k in range(2 * known):
            store(series, k, load(base[g], k))
        for order in range(3):
            samples_of(
                series, rate, 0, known, n, roots, lines[0], lines[1],
                columns[2 * nodes + e + order],
            )  # fmt: skip
            for k in range(known):
                w = rate * float(k)
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
                store(signal, s, v0)
                store(signal, s + 1, v1)
                store(signal, s + 2, v2)
                store(signal, s + 3, v3)
            before = load(signal, n - 1)
            high, low, leap = before, before, spread(0.0)
            for s in range(n):
                value = load(signal, s)
                high = where_larger(value, high, value, high)
                low = where_larger(low, value, value, low)
                change = value - before
                change = where_larger(change, 0.0, change, change * -1.0)
                leap = where_larger(change, leap, change, leap)
                before = value
            store(extrema[g, HIGH], o, high)
            store(extrema[g, LOW], o, low)
            store(extrema[g, UNSURE + HIGH], o, 0.0)
            store(extrema[g, UNSURE + LOW], o, 0.0)
            for s in range(n):
                here = load(signal, s)
                # a parabola through a sample and two lower ones rises above it by less than this
                if not (any_larger(here, high - leap) or any_larger(low + leap, here)):
                    continue
                before = load(signal, s - 1 if s > 0 else n - 1)
                after = load(signal, s + 1 if s + 1 < n else 0)
                bend, square = here * 2.0 - before - after, (after - before) * (after - before)
                above = rises(bend, square, here - before, here - after, high - here)
                below = rises(bend * -1.0, square, before - here, after - here, here - low)
                if any_larger(above, 0.0):
                    widen(signal, s, 1.0, above, extrema[g], HIGH, o)
                if any_larger(below, 0.0):
                    widen(signal, s, -1.0, below, extrema[g], LOW, o)
