"""Fourier series of several members at once: between n equal samples and harmonics 0 .. n/2.

The method is that of `kernels.fourier`. Harmonics are two-sided, c_k = X_k/2 and c_0 = X_0.

A motion whose second half is the first with the other sign has the harmonics 1, 3, 5 ... only, and
the m samples of one half tell all: y_j = x_j - i x_(j + m/2) is 2 exp(i pi j/m) times the transform
of the m/2 numbers c_1, c_5, ... conj c_7, conj c_3.
"""

from __future__ import annotations

from seatdyn.kernels.jit import inner, spliced
from seatdyn.kernels.rows import load, spread, store


@spliced
def number(k, odd):
    """Harmonic at place k of a series."""
    return 2 * k + 1 if odd else k


@inner
def transform(x, y, n, roots):
    """Sum over j of x_j exp(-2 pi i j k/n), complex rows, see `kernels.fourier`.

    It is in y where this returns true, else in x.
    """
    source, target, swapped = x, y, False
    rest, block = n, 1
    total = roots.shape[0]
    while rest >= 4:
        stride, quarter = total // rest, rest // 4
        ahead = quarter * block
        for j in range(quarter):
            u1, w1 = roots[j * stride, 0], roots[j * stride, 1]
            u2, w2 = roots[2 * j * stride, 0], roots[2 * j * stride, 1]
            u3, w3 = roots[3 * j * stride, 0], roots[3 * j * stride, 1]
            for k in range(j * block, (j + 1) * block):
                ar, ai = load(source, 2 * k), load(source, 2 * k + 1)
                br, bi = load(source, 2 * (k + ahead)), load(source, 2 * (k + ahead) + 1)
                cr, ci = load(source, 2 * (k + 2 * ahead)), load(source, 2 * (k + 2 * ahead) + 1)
                dr, di = load(source, 2 * (k + 3 * ahead)), load(source, 2 * (k + 3 * ahead) + 1)
                sr, si, tr, ti = ar + cr, ai + ci, ar - cr, ai - ci
                er, ei = br + dr, bi + di
                fr, fi = bi - di, dr - br  # -i (b - d)
                q = 2 * (k + 3 * j * block)
                store(target, q, sr + er)
                store(target, q + 1, si + ei)
                pr, pi = tr + fr, ti + fi
                store(target, q + 2 * block, pr * u1 - pi * w1)
                store(target, q + 2 * block + 1, pr * w1 + pi * u1)
                pr, pi = sr - er, si - ei
                store(target, q + 4 * block, pr * u2 - pi * w2)
                store(target, q + 4 * block + 1, pr * w2 + pi * u2)
                pr, pi = tr - fr, ti - fi
                store(target, q + 6 * block, pr * u3 - pi * w3)
                store(target, q + 6 * block + 1, pr * w3 + pi * u3)
        source, target, swapped = target, source, not swapped
        rest = quarter
        block *= 4
    if rest == 2:
        for k in range(block):
            for part in range(2):
                a, b = load(source, 2 * k + part), load(source, 2 * (k + block) + part)
                store(target, 2 * k + part, a + b)
                store(target, 2 * (k + block) + part, a - b)
        swapped = not swapped
    return swapped


@inner
def samples_of(series, rate, order, count, n, odd, roots, x, y, result):
    """result[:n] = samples of a series (K, 2, W), or with order 1 of its derivative in time.

    rate : row omega, of the derivative; odd : n samples of half a period, harmonics 1, 3, 5 ...
    """
    if odd:
        samples_of_odd(series, rate, order, count, n, roots, x, y, result)
        return
    m = n // 2
    stride = roots.shape[0] // n
    for k in range(m):
        ar, ai, br, bi = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
        if k < count:
            ar, ai = load(series, 2 * k), load(series, 2 * k + 1)
        if 0 < m - k < count:  # its conjugate
            br, bi = load(series, 2 * (m - k)), load(series, 2 * (m - k) + 1) * -1.0
        if order == 1:
            w = rate * float(k)
            ar, ai = ai * w * -1.0, ar * w
            w = rate * float(m - k)
            br, bi = bi * w, br * w * -1.0
        if k == 0:
            ai = spread(0.0)
        er, ei, pr, pi = ar + br, ai + bi, ar - br, ai - bi
        u, w = roots[k * stride, 0], -roots[k * stride, 1]
        # conjugate of even + i odd
        store(x, 2 * k, er - (pr * w + pi * u))
        store(x, 2 * k + 1, (ei + (pr * u - pi * w)) * -1.0)
    found = y if transform(x, y, m, roots) else x
    for j in range(m):
        store(result, 2 * j, load(found, 2 * j))
        store(result, 2 * j + 1, load(found, 2 * j + 1) * -1.0)


@inner
def samples_of_odd(series, rate, order, count, m, roots, x, y, result):
    """The same of the odd harmonics: m samples of half a period."""
    half, stride = m // 2, roots.shape[0] // (2 * m)
    for q in range(half // 2):
        for k, place, sign in ((2 * q, q, -1.0), (2 * q + 1, half - 1 - q, 1.0)):
            a, b = spread(0.0), spread(0.0)
            if k < count:
                a, b = load(series, 2 * k), load(series, 2 * k + 1)
            if order == 1:
                w = rate * float(2 * k + 1)
                a, b = b * w * -1.0, a * w
            store(x, 2 * place, a)
            store(x, 2 * place + 1, b * sign)
    found = y if transform(x, y, half, roots) else x
    for j in range(half):
        u, w = 2.0 * roots[j * stride, 0], 2.0 * roots[j * stride, 1]
        a, b = load(found, 2 * j), load(found, 2 * j + 1)
        store(result, j, a * u - b * w)
        store(result, j + half, a * w + b * u)


@inner
def odd_harmonics(samples, m, roots, count, x, y, result):
    """result[:count] = harmonics 1, 3, 5 ... of m samples of half a period."""
    half, stride, share = m // 2, roots.shape[0] // (2 * m), 1.0 / m
    for j in range(half):
        u, w = roots[j * stride, 0] * share, roots[j * stride, 1] * share
        a, b = load(samples, j), load(samples, j + half)
        store(x, 2 * j, a * u + b * w)
        store(x, 2 * j + 1, a * w - b * u)
    found = y if transform(x, y, half, roots) else x
    for k in range(count):
        place, sign = (k // 2, 1.0) if k % 2 == 0 else (half - 1 - k // 2, -1.0)
        store(result, 2 * k, load(found, 2 * place))
        store(result, 2 * k + 1, load(found, 2 * place + 1) * sign)


@inner
def harmonics(samples, n, odd, roots, count, x, y, result):
    """result[:count] = harmonics (K, 2, W) of n samples, see `samples_of`."""
    if odd:
        odd_harmonics(samples, n, roots, count, x, y, result)
        return
    m = n // 2
    stride = roots.shape[0] // n
    for j in range(2 * m):
        store(x, j, load(samples, j))
    found = y if transform(x, y, m, roots) else x
    store(result, 0, (load(found, 0) + load(found, 1)) * (1.0 / n))
    store(result, 1, 0.0)
    half = 0.5 / n
    for k in range(1, count):
        ar, ai = load(found, 2 * k), load(found, 2 * k + 1)
        br, bi = load(found, 2 * (m - k)), load(found, 2 * (m - k) + 1) * -1.0
        pr, pi = ar - br, ai - bi
        u, w = roots[k * stride, 0], roots[k * stride, 1]
        # even - i w odd
        store(result, 2 * k, (ar + br + (pr * w + pi * u)) * half)
        store(result, 2 * k + 1, (ai + bi - (pr * u - pi * w)) * half)
