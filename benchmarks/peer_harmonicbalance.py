"""The paper's seat for the package harmonicbalance 0.2.0, condensed on the suspension travel.

`Fourier.dt()` of that version has the wrong sign: it makes -w cos(w t) of sin(w t). With it the
solver converges to an amplitude some per cent wrong. It is repaired here; and |v| v is given as a
function of samples, for abs() of a Fourier object is its amplitude.
"""

from __future__ import annotations

import contextlib
import io

import numpy as np


def repaired():
    """The class, with a derivative of the right sign, and the solver, silent."""
    from harmonicbalance.fourier import Fourier
    from harmonicbalance.solvers import fouriersolve

    def dt(self):
        w = self._omegas()
        return Fourier(0.0, w * self.coeffs_sin, -w * self.coeffs_cos, self.omega, self.n)

    Fourier.dt = dt

    def solve(residual, start):
        with contextlib.redirect_stdout(io.StringIO()):
            return fouriersolve(residual, start, method="hybr")[0]

    return Fourier, solve


def travel_of(condensed, law, count):
    """Function without arguments that gives the travel, a Fourier object of so many harmonics.

    condensed : our linear part, of one channel; law : force of samples d, v. What is linear is put
    together before: the peer is given what ours starts from.
    """
    fourier, solve = repaired()
    omega, n = condensed.omega, condensed.pull.shape[0]
    linear, pull = condensed.linear, condensed.pull[:, 0]
    s = 1j * omega * np.arange(count + 1)
    gain, free = np.zeros((2, count + 1), complex)
    node = condensed.channels[0, 1]
    for k in range(count + 1):
        base = condensed.base[k] if k < condensed.base.size else 0.0
        matrix = s[k] ** 2 * np.eye(n) - s[k] * linear[:, n : 2 * n] - linear[:, :n]
        gain[k] = np.linalg.solve(matrix, pull)[node]
        drive = (linear[:, 2 * n] + s[k] * linear[:, 2 * n + 1]) * base
        free[k] = np.linalg.solve(matrix, drive)[node] - base

    def series(z):
        return fourier(z[0].real, z[1:].real, -z[1:].imag, omega, count)

    def phasors(x):
        return np.concatenate([[x.coeff_dc], x.coeffs_cos - 1j * x.coeffs_sin])

    def residual(x):
        v = x.dt()
        force = x._from_time_domain(law(x._to_time_domain(), v._to_time_domain()))
        return x - series(free) + series(gain * phasors(force))

    return lambda: solve(residual, series(free))


def swing(x):
    """Half of peak to peak, from many samples."""
    t = np.linspace(0.0, 2 * np.pi / x.omega, 20001)
    values = x(t)
    return (values.max() - values.min()) / 2
