"""Covariances of a linear system under random base motion, by two independent routes.

Rows C, D make outputs y = C x + D [u, u', u''] of x' = A x + B [u, u'] and a base motion u whose
acceleration has the one-sided density G(f).

In frequency: with s = i 2 pi f and h(s) = C (s - A)^-1 B [1/s^2, 1/s] + D [1/s^2, 1/s, 1] the
responses to a unit of base acceleration, the covariance is the integral of Re(h h^H) G. What acts
tau late enters A, B, C and D with the factor exp(-s tau), which is exact.

In state space: where G = |H|^2 with a rational H, the filter H/s^2 joins the states, white noise
w drives them, x' = F x + g w, and X = integral of Re(p g g^T p^H) df over the band, p = (s - F)^-1,
solves the Lyapunov equation of a limited band (Gawronski and Juang, Int. J. Syst. Sci. 21 (1990)
349)

    F X + X F^T + (S g g^T + g g^T S^T)/2 = 0,   S = (1/pi) Im[ln(i w2 - F) - ln(i w1 - F)].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import RequestError
from seatdyn.signals.shaping import Shaping
from seatdyn.signals.spectrum import POINTS, WEIGHTS, Spectrum

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
ACCURACY = 1e-10  # of the frequency integral, relative to the variance of each output
MOST_HALVINGS = 40
LEAK = 3e-4  # of the low cut: rate at which an integrator of the shaping filter forgets
NEAR = 3.0  # first panels around a resonance, in its half widths


class Covariance(NamedTuple):
    """Of o outputs: covariance (o, o), and mean squares of their rates (o,), NaN if not asked."""

    covariance: Array
    rate: Array


class Matrices(NamedTuple):
    """A, B, C and D of S states, o outputs and a base motion."""

    a: Array  # (S, S)
    b: Array  # (S, 2)
    c: Array  # (o, S)
    d: Array  # (o, 3)


class LinearSystem(NamedTuple):
    """What acts at once, what acts late by delay in s, and the (rightmost) poles in 1/s."""

    prompt: Matrices
    late: tuple[tuple[float, Matrices], ...]
    poles: ComplexArray

    def seen(self, c: Array, d: Array) -> LinearSystem:
        """The same with other outputs, which feel states and base at once."""
        late = tuple((t, Matrices(m.a, m.b, 0.0 * c, 0.0 * d)) for t, m in self.late)
        return LinearSystem(Matrices(self.prompt.a, self.prompt.b, c, d), late, self.poles)


def transfer(system: LinearSystem, frequency: Array) -> ComplexArray:
    """Outputs per unit of base acceleration at `frequency` in Hz, (F, o)."""
    s = 2j * np.pi * np.asarray(frequency)
    motion = np.stack([1 / s**2, 1 / s, np.ones_like(s)], axis=1)
    prompt = system.prompt
    matrix = s[:, None, None] * np.eye(len(prompt.a)) - prompt.a
    drive = motion[:, :2] @ prompt.b.T
    factors = [np.exp(-s * delay)[:, None] for delay, _ in system.late]
    for factor, (_, late) in zip(factors, system.late, strict=True):
        matrix = matrix - factor[..., None] * late.a
        drive = drive + factor * (motion[:, :2] @ late.b.T)
    states = np.linalg.solve(matrix, drive[..., None])[..., 0]
    outputs = states @ prompt.c.T + motion @ prompt.d.T
    for factor, (_, late) in zip(factors, system.late, strict=True):
        outputs = outputs + factor * (states @ late.c.T + motion @ late.d.T)
    return np.asarray(outputs)


def in_frequency(system: LinearSystem, spectrum: Spectrum) -> Covariance:
    """Covariance by an adaptive integral over frequency.

    Gauss-Legendre panels are halved until halving changes no variance by more than 1e-10 of it.
    """
    edges = _first_panels(system.poles, spectrum)
    low, high = edges[:-1], edges[1:]
    size = system.prompt.c.shape[0]
    covariance, rate = np.zeros((size, size)), np.zeros(size)

    def panels(begin: Array, end: Array) -> tuple[Array, Array]:
        half = (end - begin)[:, None] / 2
        f = begin[:, None] + half * (1.0 + POINTS)
        y = transfer(system, f.ravel()).reshape(*f.shape, size)
        weight = half * WEIGHTS * spectrum.density(f)
        squares = np.einsum("pq,pqi,pqj->pij", weight, y, y.conj(), optimize=True).real
        rates = np.einsum("pq,pqi->pi", weight * (2 * np.pi * f) ** 2, np.abs(y) ** 2)
        return squares, rates

    whole = panels(low, high)
    total = np.zeros(size)
    for _ in range(MOST_HALVINGS):
        middle = (low + high) / 2
        left, right = panels(low, middle), panels(middle, high)
        halves = (left[0] + right[0], left[1] + right[1])
        sums = np.einsum("pii->pi", halves[0])
        change = np.abs(sums - np.einsum("pii->pi", whole[0]))
        total = np.diagonal(covariance) + sums.sum(0)
        good = np.all(change <= ACCURACY * np.maximum(total, 1e-300), axis=1)
        covariance += halves[0][good].sum(0)
        rate += halves[1][good].sum(0)
        if np.all(good):
            return Covariance(covariance, rate)
        bad = ~good
        low, high = np.append(low[bad], middle[bad]), np.append(middle[bad], high[bad])
        whole = (
            np.concatenate([left[0][bad], right[0][bad]]),
            np.concatenate([left[1][bad], right[1][bad]]),
        )
    raise RequestError(
        "The frequency integral does not converge: the response has an infinite peak inside the "
        "band. Give the system some damping."
    )


def _first_panels(poles: ComplexArray, spectrum: Spectrum) -> Array:
    """Knots of the density, and the neighbourhood of every resonance."""
    place, width = np.abs(poles.imag) / (2 * np.pi), np.abs(poles.real) / (2 * np.pi)
    spots = [spectrum.knots, *(place + k * width for k in (-NEAR, -1.0, 0.0, 1.0, NEAR))]
    edges = np.unique(np.concatenate(spots))
    return edges[(edges >= spectrum.low) & (edges <= spectrum.high)]


def in_state_space(system: LinearSystem, spectrum: Spectrum) -> Covariance:
    """Covariance by the Lyapunov equation of a limited band.

    An integrator that the filter H/s^2 keeps is given a leak of 3e-4 of the low cut, which
    changes the density of the displacement by at most 2e-7.

    Raises
    ------
    RequestError
        Delayed forces, a spectrum without a rational shaping filter, or an output that contains
        the base acceleration of one with a white acceleration.
    """
    from scipy.linalg import logm, matrix_balance, solve_continuous_lyapunov

    if system.late:
        raise RequestError(
            "The Lyapunov route has a finite number of states and knows no delays; use the "
            "frequency integral."
        )
    a, b, c, d = system.prompt
    shaping = spectrum.shaping
    if shaping is None:
        raise RequestError(
            f"{type(spectrum).__name__} has no rational shaping filter, which the Lyapunov route "
            "needs; use the frequency integral."
        )
    if np.any(d[:, 2] != 0.0):
        raise RequestError("The Lyapunov route has no outputs that contain the base acceleration.")
    f, g, motion, direct = _base_motion(shaping, LEAK * 2 * np.pi * spectrum.low)
    n, m = len(a), len(f)
    matrix = np.block([[a, b @ motion], [np.zeros((m, n)), f]])
    drive = np.concatenate([b @ direct, g])
    rows = np.hstack([c, d[:, :2] @ motion])
    through = d[:, :2] @ direct
    # states have very different sizes
    matrix, scale = matrix_balance(matrix, permute=False, separate=False)
    diagonal = np.diag(scale)
    drive, rows = drive / diagonal, rows * diagonal
    eye = np.eye(n + m)
    ends = (2j * np.pi * spectrum.low, 2j * np.pi * spectrum.high)
    first, second = (logm(end * eye - matrix) for end in ends)
    band = (second - first).imag / np.pi
    spread = np.outer(band @ drive, drive) / 2
    states = solve_continuous_lyapunov(matrix, -(spread + spread.T))
    mixed = np.outer(rows @ band @ drive / 2, through)
    width = spectrum.high - spectrum.low
    covariance = rows @ states @ rows.T + mixed + mixed.T + width * np.outer(through, through)
    return Covariance(covariance, np.full(len(c), np.nan))


def _base_motion(shaping: Shaping, leak: float) -> tuple[Array, Array, Array, Array]:
    """States f, g of the filter H/s^2, rows (2, m) to u and u', and how white noise enters (2,).

    Sections of one or two poles in series; conjugate poles are adjacent. Zeros at s = 0 go to the
    sections in turn.
    """
    order = shaping.order - 2
    poles = [*shaping.poles, *([complex(-leak)] * max(0, -order))]
    zeros = max(0, order)
    f, g = np.zeros((0, 0)), np.zeros(0)
    row, through = np.zeros(0), shaping.gain
    while poles:
        pole = poles.pop(0)
        if pole.imag != 0.0:
            poles.pop(0)
            block = np.array([[0.0, 1.0], [-(abs(pole) ** 2), 2 * pole.real]])
            count = min(2, zeros)
        else:
            block, count = np.array([[pole.real]]), min(1, zeros)
        zeros -= count
        size = len(block)
        entry = np.eye(size)[-1]
        # s^count of the lowest state; with as many zeros as poles the input goes straight through
        out, straight = (np.eye(size)[count], 0.0) if count < size else (block[-1], 1.0)
        f = np.block([[f, np.zeros((len(f), size))], [np.outer(entry, row), block]])
        g = np.concatenate([g, entry * through])
        row, through = np.concatenate([straight * row, out]), straight * through
    if through != 0.0:
        raise RequestError("The shaping filter makes a displacement that is white; cut its order.")
    motion = np.vstack([row, row @ f])
    return f, g, motion, np.array([0.0, row @ g])
