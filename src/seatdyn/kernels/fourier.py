"""Fourier series of real periodic signals: between n equal samples and harmonics 0 .. n/2.

    x(theta) = Re sum_k X_k exp(i k theta),   X_0 real

n is a power of two. A real transform of n is a complex one of n/2 (even samples as real parts, odd
ones as imaginary parts); that one is Stockham's, which needs no reordering. `lines` (., N) holds
exp(-2 pi i j/N), j < N, N >= n, in its row ROOTS, and space in rows ONE and TWO.
"""

from __future__ import annotations

from seatdyn.kernels.condensed import ONE, ROOTS, TWO
from seatdyn.kernels.jit import inner


@inner
def _complex_transform(x, y, n, roots):
    """Sum over j of x_j exp(-2 pi i j k/n); the result is in x, y is work space."""
    source, target = x, y
    half, block = n // 2, 1
    while half >= 1:
        stride = roots.size // (2 * half)
        for j in range(half):
            w = roots[j * stride]
            a, b = j * block, (j + half) * block
            c = 2 * j * block
            for k in range(block):
                s, t = source[a + k], source[b + k]
                target[c + k] = s + t
                target[c + block + k] = w * (s - t)
        source, target = target, source
        half //= 2
        block *= 2
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
