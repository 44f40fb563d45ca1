"""Harmonic balance of many members, a row of them at once, by mixed fixed-point steps.

Harmonics are two-sided, c_k = D_k/2 and c_0 = D_0: the motion is c_0 + 2 Re sum c_k exp(i k theta).
Where the second half of every period is the first with the other sign, `odd`, place k of a series
is harmonic 2 k + 1, and samples are those of half a period.
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
from seatdyn.kernels.rows import (
    any_larger,
    larger_of,
    load,
    root_of,
    size_of,
    spread,
    store,
    where_larger,
)
from seatdyn.kernels.rows_fourier import harmonics, number, samples_of

DEPTH = 4  # earlier steps that are mixed
MOST_STEPS = 40  # of one level
SHARE_OF_HIGH = 0.05  # of the higher harmonics: about what the samples leave out
TINY, REGULAR = 1e-300, 1e-14  # the latter of the squares of the steps: no equation is singular
NOISE, EVEN = 1e-9, 1e-12  # of a force; the latter of its even part that is a rounding
# places in the memory of steps: motion and step before, then pairs of changes of motion and step
MOTION, STEP, BEFORE, PAIRS = 0, 1, 2, 3
LEFT, LEAP, IS_EVEN, STEPS = range(4)  # places in what is found, see `settle`


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
def respond(
    linear, pull, base, omega, channels, first, odd, places, node, across, doubt, matrix
):  # fmt: skip
    """Fill the linear motion of the harmonics from `first` on, of nodes and across channels.

    By elimination without pivoting, which is the same for all members; `doubt` (G, W) becomes the
    largest square of its factors.

    linear, pull : (G, N, 2N+2, W) and (G, N, m, W); base : (G, B, 2, W); omega : (G, W)
    places : (N,) of the nodes among those kept in `node`, -1 for others
    node, across : (G, kept, m+1, K, 2, W) and (G, m, m+1, K, 2, W), motion per channel force, and
        due to the base in the last column
    matrix : (N, N+m+1, 2, W), space
    """
    groups, n, columns, count = node.shape[0], places.size, node.shape[2], node.shape[3]
    m, width = columns - 1, n + columns
    for g in range(groups):
        largest = load(doubt[g], 0)
        for k in range(first, count):
            harmonic = number(k, odd)
            w = load(omega[g], 0) * float(harmonic)
            base_r, base_i = spread(0.0), spread(0.0)
            if harmonic < base.shape[1]:
                base_r, base_i = load(base[g], 2 * harmonic), load(base[g], 2 * harmonic + 1)
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
                    if places[i] >= 0:
                        place = 2 * ((places[i] * columns + c - n) * count + k)
                        store(node[g], place, a)
                        store(node[g], place + 1, b)
            for j in range(m):
                for c in range(columns):
                    for part in range(2):
                        total = spread(0.0)
                        for sign, end in ((1.0, channels[j, SECOND]), (-1.0, channels[j, FIRST])):
                            if end >= 0:
                                place = 2 * (end * width + n + c) + part
                                total = total + load(matrix, place) * sign
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


@spliced
def weight_of(k, odd):
    """Weight of the square of a harmonic: velocities count as much as displacements."""
    return 1.0 + float(number(k, odd)) * number(k, odd)


@inner
def residual_of(series, force, across, count, odd, residual):
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
            if number(k, odd) == 0:
                b = spread(0.0)
            store(residual, here, a)
            store(residual, here + 1, b)
            weight = weight_of(k, odd)
            total = total + (a * a + b * b) * weight
            part = (x * x + y * y) * weight
            scale = scale + part
            if 2 * k >= count:
                high = high + part
    return root_of(total / scale), root_of(high / scale)


@inner
def equivalent_steps(series, force, across, omega, count, odd, step, slopes, matrix):
    """Turn the residual in `step` into the step to take were every channel linear.

    Namely the spring and damper that take the same power from the motion as its force.

    slopes : (m, 2, W); matrix : (m, m+1, 2, W), space
    """
    m = series.shape[0]
    w = load(omega, 0)
    for j in range(m):
        by_d, by_v, dd, vv = spread(0.0), spread(0.0), spread(TINY), spread(TINY)
        for k in range(0 if odd else 1, count):
            place, harmonic = 2 * (j * count + k), float(number(k, odd))
            x, y = load(series, place), load(series, place + 1)
            fr, fi = load(force, place), load(force, place + 1)
            square = x * x + y * y
            by_d = by_d + fr * x + fi * y
            by_v = by_v + (fi * x - fr * y) * harmonic
            dd = dd + square
            vv = vv + square * (harmonic * harmonic)
        spring, damper = by_d / dd, by_v / (vv * w)
        store(slopes, 2 * j, where_larger(spring, 0.0, spring, 0.0))
        store(slopes, 2 * j + 1, where_larger(damper, 0.0, damper, 0.0))
    for k in range(count):
        rate = w * float(number(k, odd))
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
def product(x, y, m, count, odd):
    """Inner product of two series (m, K, 2, W)."""
    total = spread(0.0)
    for i in range(m):
        for k in range(count):
            place = 2 * (i * count + k)
            part = load(x, place) * load(y, place) + load(x, place + 1) * load(y, place + 1)
            total = total + part * weight_of(k, odd)
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
def mix(series, past, taken, squares, space, m, count, odd):
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
            found = product(past[PAIRS + 2 * a], past[slot], m, count, odd)
            store(squares, a * DEPTH + place, found)
            store(squares, place * DEPTH + a, found)
    trace = spread(TINY)
    for a in range(known):
        trace = trace + load(squares, a * DEPTH + a) * REGULAR
    for a in range(known):
        for b in range(known):
            one = trace if a == b else spread(0.0)
            store(space, a * (DEPTH + 1) + b, load(squares, a * DEPTH + b) + one)
        found = product(past[PAIRS + 2 * a], past[STEP], m, count, odd)
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
def largest_leap(total, n, odd):
    """Largest change of a channel's force between two samples, relative to its range."""
    worst = spread(0.0)
    for j in range(total.shape[0]):
        before = load(total[j], n - 1) * (-1.0 if odd else 1.0)
        high, low, leap = before, before, spread(0.0)
        for i in range(n):
            here = load(total[j], i)
            high, low = where_larger(here, high, here, high), where_larger(low, here, here, low)
            change = here - before
            leap = larger_of(size_of(change), leap)
            before = here
        top = larger_of(high, low * -1.0)
        if odd:
            high, low = top, top * -1.0
        size = top * NOISE + TINY
        leap = where_larger(leap, size, leap, 0.0) / (high - low + size)
        worst = larger_of(leap, worst)
    return worst


@inner
def even_part(channels, elements, values, motion, forces, line, n):
    """1 where the force of any element at the motion with the other sign has not that sign, else 0.

    motion : (2, m, n, W), its sign changes; line : (n, W), space
    """
    worst = spread(0.0)
    count = line.shape[0] * line.shape[1]
    for j in range(motion.shape[1]):
        for order in range(2):
            for s in range(n):
                store(motion[order, j], s, load(motion[order, j], s) * -1.0)
        for e in range(channels[j, ELEMENTS], channels[j + 1, ELEMENTS]):
            for s in range(n):
                store(line, s, 0.0)
            call_rows_law(
                elements[e, ADDRESS], count, motion[0, j].reshape(-1), motion[1, j].reshape(-1),
                values, elements[e, OFFSET], line.reshape(-1), 0,
            )  # fmt: skip
            even, size = spread(0.0), spread(TINY)
            for s in range(n):
                force = load(forces[e], s)
                even = larger_of(size_of(force + load(line, s)), even)
                size = larger_of(size_of(force), size)
            worst = where_larger(even, size * EVEN, 1.0, worst)
    return worst


@kernel
def settle(
    across, omega, parameters, channels, elements, roots, tolerance, odd, series, force, forces,
    found, past, lines, motion, total, values, squares, space, slopes, matrix,
):  # fmt: skip
    """Solve for the motions of all groups, from the guesses in `series`.

    across, omega : see `respond`; parameters : (G, P, W); roots : (., 2) cos, -sin
    series, force : (G, m, K, 2, W) harmonics of motion and force of the channels
    forces : (G, e, n, W) samples of the forces of the elements
    found : (G, 4, W): LEFT, the residual relative to the motion, infinite where there is no
        solution; LEAP, see `largest_leap`; IS_EVEN, not 0 where a law is not odd though the motion
        was taken to be; and STEPS, how many were taken
    past : (PAIRS + 2 DEPTH, m, K, 2, W); lines : (2, n, W); motion : (2, m, n, W);
    total : (m, n, W), forces of the channels; values : (P n W,);
    squares, space : (DEPTH, DEPTH, W) and (DEPTH, DEPTH + 1, W);
    slopes : (m, 2, W); matrix : (m, m + 1, 2, W)
    """
    groups, m, count = series.shape[0], series.shape[1], series.shape[2]
    n = total.shape[1]
    for g in range(groups):
        rate = load(omega[g], 0)
        for i in range(parameters.shape[1]):
            value = load(parameters[g], i)
            for s in range(n):
                store(values, i * n + s, value)
        steps = spread(0.0)
        for taken in range(MOST_STEPS):
            for j in range(m):
                for order in range(2):
                    samples_of(
                        series[g, j], rate, order, count, n, odd, roots, lines[0], lines[1],
                        motion[order, j],
                    )  # fmt: skip
            sum_forces(channels, elements, values, motion[0], motion[1], forces[g], total, n)
            for j in range(m):
                harmonics(total[j], n, odd, roots, count, lines[0], lines[1], force[g, j])
            size, high = residual_of(series[g], force[g], across[g], count, odd, past[STEP])
            allowed = where_larger(high * SHARE_OF_HIGH, tolerance, high * SHARE_OF_HIGH, tolerance)
            # also where it is not a number
            store(found[g], LEFT, where_larger(size, allowed, math.inf, size))
            steps = where_larger(size, allowed, steps + 1.0, steps)
            # one step at least: else a guess that is good enough would hide what is wrong with it
            if taken > 0 and (not any_larger(size, allowed) or taken + 1 == MOST_STEPS):
                break
            equivalent_steps(
                series[g], force[g], across[g], omega[g], count, odd, past[STEP], slopes, matrix
            )
            for i in range(2 * m * count if taken > 0 else 0):
                store(past[STEP], i, where_larger(size, allowed, load(past[STEP], i), 0.0))
            mix(series[g], past, taken, squares, space, m, count, odd)
        store(found[g], LEAP, largest_leap(total, n, odd))
        store(found[g], STEPS, steps)
        store(found[g], IS_EVEN, 0.0)
        if odd:
            even = even_part(channels, elements, values, motion, forces[g], total[0], n)
            store(found[g], IS_EVEN, even)
