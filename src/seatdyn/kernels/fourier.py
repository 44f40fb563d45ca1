"""Fourier series of real periodic signals: between n equal samples and harmonics 0 .. n/2.

    x(theta) = Re sum_k X_k exp(i k theta),   X_0 real

n is a power of two. A real transform of n is a complex one of n/2 (even samples as real parts, odd
ones as imaginary parts); that one is Stockham's, by fours, which needs no reordering. `lines`
(., N) holds exp(-2 pi i j/N), j < N, N >= n, in its row ROOTS, and space in rows ONE and TWO.
"""

from __future__ import annotations

from seatdyn.kernels.condensed import ONE, ROOTS, TWO
from seatdyn.kernels.jit import inner


@inner
def _complex_transform(x, y, n, roots):
    """Sum over j of x_j exp(-2 pi i j k/n); the result is in x, y is work space."""
    source, target = x, y
    rest, block = n, 1
    while rest >= 4:
        stride, quarter = roots.size // rest, rest // 4
        for j in range(quarter):
            w1, w2, w3 = roots[j * stride], roots[2 * j * stride], roots[3 * j * stride]
            for k in range(j * block, (j + 1) * block):
                a, b = source[k], source[k + quarter * block]
                c, d = source[k + 2 * quarter * block], source[k + 3 * quarter * block]
                even, odd = b + d, b - d
                turned = complex(odd.imag, -odd.real)  # -i odd
                q = k + 3 * j * block
                target[q] = a + c + even
                target[q + block] = w1 * (a - c + turned)
                target[q + 2 * block] = w2 * (a + c - even)
                target[q + 3 * block] = w3 * (a - c - turned)
        source, target = target, source
        rest = quarter
        block *= 4
    if rest == 2:
        for k in range(block):
            a, b = source[k], source[k + block]
            target[k] = a + b
            target[k + block] = a - b
        source, target = target, source
    if source is not x:
        for j in range(n):
            x[j] = source[j]


@inner
def harmonics(samples, n, lines, count, result):
    """result[:count] = harmonics 0 .. count-1 (count <= n/2) of n real samples."""
    m = n // 2
    roots, one, two = lines[ROOTS], lines[ONE], lines[TWO]
    for j in range(m):
        one[j] = complex(samples[2 * j], samples[2 * j + 1])
    _complex_transform(one, two, m, roots)
    stride = roots.size // n
    result[0] = (one[0].real + one[0].imag) / n
    for k in range(1, count):
        a, b = one[k], one[m - k].conjugate()
        even, odd = a + b, a - b
        # (even - i w odd)/2, and 2/n for a one-sided amplitude
        result[k] = (even - 1j * roots[k * stride] * odd) / n


@inner
def samples_of(series, count, n, lines, result):
    """result[:n] = samples of the series with harmonics 0 .. count-1 (count <= n/2)."""
    m = n // 2
    roots, one, two = lines[ROOTS], lines[ONE], lines[TWO]
    stride = roots.size // n
    for k in range(m):
        # two-sided coefficients k and k - m of the signal, conjugated for the inverse transform
        low = series[k] if k < count else 0j
        high = series[m - k] if 0 < m - k < count else 0j
        low = complex(2.0 * low.real, 0.0) if k == 0 else low
        high = high.conjugate()
        even, odd = low + high, (low - high) * roots[k * stride].conjugate()
        one[k] = (0.5 * (even + 1j * odd)).conjugate()
    _complex_transform(one, two, m, roots)
    for j in range(m):
        result[2 * j] = one[j].real
        result[2 * j + 1] = -one[j].imag
