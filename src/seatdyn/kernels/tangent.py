"""The tangent of the balance of harmonics: applied, inverted nearly, and solved with.

With p_q and r_q the harmonics of dF/dd and dF/dv along the motion, a small motion Re x exp(i l th)
makes the force harmonic k

    (p_(k-l) + i l w r_(k-l)) x + (p_(k+l) - i l w r_(k+l)) x*

Two inverses of I + G T are nearly right, one for either kind of law:

* smooth laws: exact on the lowest harmonics, and with the mean slopes on the higher ones, where G
  is small;
* steep laws (friction, hard stops), whose slopes are large at few samples: exact at these samples
  for all harmonics, and with the mean slopes elsewhere.

GMRES with the nearer one as preconditioner solves with the whole tangent.
"""

from __future__ import annotations

import math

from seatdyn.kernels.breaking import STEP, law_slope
from seatdyn.kernels.condensed import (
    BASIS,
    CHANGE,
    CHANNEL,
    DISPLACEMENT,
    FORCE,
    IMPULSE_D,
    IMPULSE_V,
    IN_D,
    IN_V,
    JUMP,
    KRYLOV,
    LINE,
    MOVE_D,
    MOVE_V,
    PHASE,
    PRESENT,
    PRODUCT,
    RESPONSES,
    SLOPES,
    STEEPEST,
    TOGETHER,
    VELOCITY,
    across,
    number_of,
    solve_complex,
)
from seatdyn.kernels.fourier import harmonics, samples_of
from seatdyn.kernels.jit import inner, spliced

CELL = 0.25  # of the change over two samples: half the width of a difference
SMALL = 1e-300
STEEP = 0.5  # effect of the largest slope on the higher harmonics from which on it matters
STEEP_SHARE = 1.0 / 6.0  # of the samples that may be steep


@inner
def evaluate_slopes(problem, work, n):
    """Fill the samples of dF/dd and dF/dv along the motion; returns mean and largest size."""
    total, largest = 0.0, 0.0
    for j in range(problem.lag.size):
        d, v = work.samples[DISPLACEMENT, j], work.samples[VELOCITY, j]
        dd, dv = SMALL, SMALL
        for i in range(n):
            dd, dv = max(dd, STEP * abs(d[i])), max(dv, STEP * abs(v[i]))
        for i in range(n):
            # over the motion between two samples, so that no steep part of a law is missed
            before, after = (i - 1 if i > 0 else n - 1), (i + 1 if i + 1 < n else 0)
            width_d = max(dd, CELL * abs(d[after] - d[before]))
            width_v = max(dv, CELL * abs(v[after] - v[before]))
            in_d = law_slope(problem, j, d[i], v[i], width_d, 0.0)
            in_v = law_slope(problem, j, d[i], v[i], 0.0, width_v)
            work.samples[IN_D, j, i], work.samples[IN_V, j, i] = in_d, in_v
            size = abs(in_d) + problem.omega * abs(in_v)
            total, largest = total + size, max(largest, size)
    return total / n, largest


@inner
def slope_harmonics(problem, work, n, together):
    """Fill the two-sided harmonics 0 .. 2 together of the slopes, impulses at jumps included."""
    m, events = problem.lag.size, work.events[PRESENT]
    for j in range(m):
        for s in range(2):
            spectrum = work.lines[SLOPES + s * m + j]
            harmonics(work.samples[IN_D + s, j], n, work.lines, 2 * together + 1, spectrum)
            for k in range(1, 2 * together + 1):
                spectrum[k] *= 0.5
            for e in range(number_of(events)):
                impulse = events[e, IMPULSE_D + s]
                if events[e, CHANNEL] == j and impulse != 0.0:
                    z = complex(math.cos(events[e, PHASE]), -math.sin(events[e, PHASE]))
                    power = complex(impulse / (2.0 * math.pi), 0.0)
                    for k in range(2 * together + 1):
                        spectrum[k] += power
                        power *= z


@inner
def assemble(problem, work, together):
    """Fill the tangent of the harmonics 0 .. together: real unknowns D_0, Re D_1, Im D_1, ..."""
    m, w = problem.lag.size, problem.omega
    size = 2 * together + 1
    a = work.tangent
    for i in range(m * size):
        for c in range(m * size):
            a[i, c] = 0.0
        a[i, i] = 1.0
    for i in range(m):
        for j in range(m):
            p, r = work.lines[SLOPES + j], work.lines[SLOPES + m + j]
            for k in range(together + 1):
                gain = across(problem, work, k, i, j)
                row = i * size + max(2 * k - 1, 0)
                if k == 0:
                    gain *= 0.5
                for q in range(together + 1):
                    rate = 1j * (q * w)
                    if k >= q:
                        left = p[k - q] + rate * r[k - q]
                    else:
                        left = p[q - k].conjugate() + rate * r[q - k].conjugate()
                    right = p[k + q] - rate * r[k + q]
                    x, y = gain * (left + right), 1j * gain * (left - right)
                    column = j * size + max(2 * q - 1, 0)
                    a[row, column] += x.real
                    if k > 0:
                        a[row + 1, column] += x.imag
                    if q > 0:
                        a[row, column + 1] += y.real
                        if k > 0:
                            a[row + 1, column + 1] += y.imag


@inner
def mean_inverse(problem, work, count):
    """Fill the inverse of I + G_k (p_0 + i k w r_0) of every harmonic below the responses."""
    n, m = problem.pull.shape
    matrix = work.matrix
    for k in range(count):
        for i in range(m):
            for j in range(m):
                in_d, in_v = work.lines[SLOPES + j, 0].real, work.lines[SLOPES + m + j, 0].real
                slope = complex(in_d, k * problem.omega * in_v)
                one = 1.0 if i == j else 0.0
                matrix[i, j] = across(problem, work, k, i, j) * slope + one
                matrix[i, m + j] = complex(one, 0.0)
        solve_complex(matrix, m, m)
        for i in range(m):
            for j in range(m):
                work.response[k, n + i, j] = matrix[i, m + j]


@inner
def factorise(a, size):
    """LU factors with row pivoting in a[:size, :size], pivots beside; False where singular."""
    pivots = a.shape[0]
    for i in range(size):
        p = i
        for k in range(i + 1, size):
            if abs(a[k, i]) > abs(a[p, i]):
                p = k
        a[i, pivots] = p
        if p != i:
            for c in range(size):
                a[i, c], a[p, c] = a[p, c], a[i, c]
        if not abs(a[i, i]) > SMALL:
            return False
        inverse = 1.0 / a[i, i]
        for k in range(i + 1, size):
            f = a[k, i] * inverse
            a[k, i] = f
            if f != 0.0:
                for c in range(i + 1, size):
                    a[k, c] -= f * a[i, c]
    return True


@inner
def back_substitute(a, size):
    """Solve with the factors for the right-hand side beside them, in place."""
    pivots, x = a.shape[0], a.shape[0] + 1
    for i in range(size):
        p = int(a[i, pivots])
        a[i, x], a[p, x] = a[p, x], a[i, x]
    for i in range(size):
        total = a[i, x]
        for c in range(i):
            total -= a[i, c] * a[c, x]
        a[i, x] = total
    for i in range(size - 1, -1, -1):
        total = a[i, x]
        for c in range(i + 1, size):
            total -= a[i, c] * a[c, x]
        a[i, x] = total / a[i, i]


@inner
def steep_samples(problem, work, n, mean):
    """List samples with slopes above the mean beside the tangent: channel * n + sample.

    Returns their number, or zero where they are too many for a steep law.
    """
    m, found = problem.lag.size, 0
    most = min(work.tangent.shape[0], STEEPEST, int(STEEP_SHARE * m * n))
    place = work.tangent.shape[0] + 2
    for j in range(m):
        for i in range(n):
            size = abs(work.samples[IN_D, j, i])
            if size + problem.omega * abs(work.samples[IN_V, j, i]) > mean:
                if found == most:
                    return 0
                work.tangent[found, place] = j * n + i
                found += 1
    return found


@inner
def steep_equations(problem, work, count, n, found):
    """Fill the equations of the forces at the steep samples, and the responses that they use.

    The mean slope of the other samples stays in `mean_inverse`, that of the steep ones is beside.
    """
    nodes, m = problem.pull.shape
    line, place = work.lines[LINE], work.tangent.shape[0] + 2
    for s in range(2):
        for j in range(m):
            total = work.lines[SLOPES + s * m + j, 0].real * n
            for a in range(found):
                if int(work.tangent[a, place]) // n == j:
                    total -= work.samples[IN_D + s, j, int(work.tangent[a, place]) % n]
            work.lines[SLOPES + s * m + j, 0] = complex(total / n, 0.0)
    mean_inverse(problem, work, count)
    for i in range(m):
        for j in range(m):
            for s in range(2):
                for k in range(count):
                    total = 0j
                    for c in range(m):
                        total += work.response[k, nodes + i, c] * across(problem, work, k, c, j)
                    factor = complex(0.0, k * problem.omega) if s == 1 else 1.0 + 0j
                    line[k] = total * factor * ((2.0 if k > 0 else 1.0) / n)
                samples_of(line, count, n, work.lines, work.samples[RESPONSES + s * m + i, j])
    for a in range(found):
        i, row = int(work.tangent[a, place]) // n, int(work.tangent[a, place]) % n
        in_d = work.samples[IN_D, i, row] - work.lines[SLOPES + i, 0].real
        in_v = work.samples[IN_V, i, row] - work.lines[SLOPES + m + i, 0].real
        for b in range(found):
            j, column = int(work.tangent[b, place]) // n, int(work.tangent[b, place]) % n
            late = row - column if row >= column else row - column + n
            value = in_d * work.samples[RESPONSES + i, j, late]
            value += in_v * work.samples[RESPONSES + m + i, j, late]
            work.tangent[a, b] = value + (1.0 if a == b else 0.0)


@inner
def prepare_tangent(problem, work, count, n):
    """Factorise the tangent at the motion evaluated last.

    Returns the number of unknowns solved together, negative for steep samples, or zero where the
    equations are singular.
    """
    together = min(TOGETHER, count - 1)
    mean, largest = evaluate_slopes(problem, work, n)
    slope_harmonics(problem, work, n, together)
    gain, high, found = 0.0, min(together + 1, count - 1), 0
    for i in range(problem.lag.size):
        for j in range(problem.lag.size):
            gain = max(gain, abs(across(problem, work, high, i, j)))
    if largest * gain * high > STEEP:
        found = steep_samples(problem, work, n, mean)
    if found > 0:
        steep_equations(problem, work, count, n, found)
        return -found if factorise(work.tangent, found) else 0
    assemble(problem, work, together)
    mean_inverse(problem, work, count)
    size = problem.lag.size * (2 * together + 1)
    return size if factorise(work.tangent, size) else 0


@spliced
def apply_mean(problem, work, right, first, count, result):
    """result = mean inverse times right, for harmonics first .. count-1."""
    nodes, m = problem.pull.shape
    for k in range(first, count):
        for i in range(m):
            total = 0j
            for j in range(m):
                total += work.response[k, nodes + i, j] * right[k, j]
            result[k, i] = total


@inner
def sample_direction(problem, work, x, count, n):
    """Samples of displacement and velocity of a direction (K, m)."""
    line = work.lines[LINE]
    for j in range(problem.lag.size):
        for k in range(count):
            line[k] = x[k, j]
        samples_of(line, count, n, work.lines, work.samples[MOVE_D, j])
        for k in range(count):
            line[k] = complex(0.0, k * problem.omega) * x[k, j]
        samples_of(line, count, n, work.lines, work.samples[MOVE_V, j])


@inner
def apply_inverse(problem, work, right, count, n, factors, result):
    """Approximate inverse of the tangent times `right` (K, m)."""
    nodes, m = problem.pull.shape
    a, x = work.tangent, work.tangent.shape[0] + 1
    if factors > 0:
        size = factors // m
        together = size // 2
        for j in range(m):
            a[j * size, x] = right[0, j].real
            for k in range(1, together + 1):
                a[j * size + 2 * k - 1, x] = right[k, j].real
                a[j * size + 2 * k, x] = right[k, j].imag
        back_substitute(a, factors)
        for j in range(m):
            result[0, j] = complex(a[j * size, x], 0.0)
            for k in range(1, together + 1):
                result[k, j] = complex(a[j * size + 2 * k - 1, x], a[j * size + 2 * k, x])
        apply_mean(problem, work, right, together + 1, count, result)
        return
    place, found = x + 1, -factors
    apply_mean(problem, work, right, 0, count, result)
    sample_direction(problem, work, result, count, n)
    for b in range(found):
        j, i = int(a[b, place]) // n, int(a[b, place]) % n
        in_d = work.samples[IN_D, j, i] - work.lines[SLOPES + j, 0].real
        in_v = work.samples[IN_V, j, i] - work.lines[SLOPES + m + j, 0].real
        a[b, x] = in_d * work.samples[MOVE_D, j, i] + in_v * work.samples[MOVE_V, j, i]
    back_substitute(a, found)
    for j in range(m):
        for i in range(n):
            work.samples[MOVE_D, j, i] = 0.0
    for b in range(found):
        work.samples[MOVE_D, int(a[b, place]) // n, int(a[b, place]) % n] = a[b, x]
    for j in range(m):
        line = work.lines[LINE]
        harmonics(work.samples[MOVE_D, j], n, work.lines, count, line)
        for k in range(count):
            for i in range(m):
                total = 0j
                for c in range(m):
                    total += work.response[k, nodes + i, c] * across(problem, work, k, c, j)
                result[k, i] -= total * line[k]
    for i in range(m):
        result[0, i] = complex(result[0, i].real, 0.0)


@inner
def apply_tangent(problem, work, x, count, n, result):
    """Tangent at the motion evaluated last times a direction x (K, m), at full length."""
    m, w, events = problem.lag.size, problem.omega, work.events[PRESENT]
    line = work.lines[LINE]
    sample_direction(problem, work, x, count, n)
    for j in range(m):
        moved = work.samples[MOVE_D, j]
        for i in range(n):
            moved[i] = (
                work.samples[IN_D, j, i] * moved[i]
                + work.samples[IN_V, j, i] * work.samples[MOVE_V, j, i]
            )
        harmonics(moved, n, work.lines, count, line)
        for e in range(number_of(events)):
            if events[e, CHANNEL] != j or events[e, JUMP] == 0.0:
                continue
            z = complex(math.cos(events[e, PHASE]), math.sin(events[e, PHASE]))
            hit, power = x[0, j].real * events[e, IMPULSE_D], z
            for k in range(1, count):
                hit += (x[k, j] * power).real * events[e, IMPULSE_D]
                hit -= (x[k, j] * power).imag * k * w * events[e, IMPULSE_V]
                power *= z
            power = complex(hit / math.pi, 0.0)
            line[0] += 0.5 * power
            for k in range(1, count):
                power *= z.conjugate()
                line[k] += power
        for k in range(count):
            work.series[FORCE, k, j] = line[k]
    for k in range(count):
        for i in range(m):
            total = x[k, i]
            for j in range(m):
                total += across(problem, work, k, i, j) * work.series[FORCE, k, j]
            result[k, i] = total if k > 0 else complex(total.real, 0.0)


@inner
def inner_product(a, b, count):
    """Real inner product that weighs displacement and velocity alike."""
    total = 0.0
    for k in range(count):
        for j in range(a.shape[1]):
            total += (1.0 + k * k) * (a[k, j].real * b[k, j].real + a[k, j].imag * b[k, j].imag)
    return total


@spliced
def add_multiple(x, factor, y, count):
    """y = y + factor x, for series (K, m)."""
    for k in range(count):
        for j in range(x.shape[1]):
            y[k, j] += factor * x[k, j]


@inner
def solve_tangent(problem, work, right, count, n, factors, tolerance):
    """Solve tangent * CHANGE = right by GMRES (Saad and Schultz 1986), preconditioned.

    It overwrites FORCE. Returns the share of the right-hand side that is left.
    """
    series, h = work.series, work.krylov
    cosine, sine, g = KRYLOV, KRYLOV + 1, KRYLOV + 2  # columns beside the projected tangent
    apply_inverse(problem, work, right, count, n, factors, series[BASIS])
    norm = math.sqrt(inner_product(series[BASIS], series[BASIS], count))
    for k in range(count):
        for j in range(right.shape[1]):
            series[CHANGE, k, j] = 0j
    if norm == 0.0:
        return 0.0
    add_multiple(series[BASIS], 1.0 / norm - 1.0, series[BASIS], count)
    h[0, g] = norm
    used = 0
    while used < KRYLOV:
        q = used
        new = series[BASIS + q + 1]
        apply_tangent(problem, work, series[BASIS + q], count, n, series[PRODUCT])
        apply_inverse(problem, work, series[PRODUCT], count, n, factors, new)
        for i in range(q + 1):
            h[i, q] = inner_product(series[BASIS + i], new, count)
            add_multiple(series[BASIS + i], -h[i, q], new, count)
        length = math.sqrt(inner_product(new, new, count))
        if length > 0.0:
            add_multiple(new, 1.0 / length - 1.0, new, count)
        for i in range(q):
            a, b = h[i, q], h[i + 1, q]
            h[i, q] = h[i, cosine] * a + h[i, sine] * b
            h[i + 1, q] = h[i, cosine] * b - h[i, sine] * a
        size = math.hypot(h[q, q], length) + SMALL
        h[q, cosine], h[q, sine] = h[q, q] / size, length / size
        h[q, q] = size
        h[q + 1, g] = -h[q, sine] * h[q, g]
        h[q, g] *= h[q, cosine]
        used = q + 1
        if abs(h[used, g]) <= tolerance * norm:
            break
    for i in range(used - 1, -1, -1):
        for c in range(i + 1, used):
            h[i, g] -= h[i, c] * h[c, g]
        h[i, g] /= h[i, i]
        add_multiple(series[BASIS + i], h[i, g], series[CHANGE], count)
    return abs(h[used, g]) / norm
