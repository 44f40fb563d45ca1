"""Rational shaping filters: what turns white noise into a random acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Shaping:
    """Filter H(s) = gain * s^order / prod(s - poles), s in rad/s.

    White noise of the one-sided density 1 per Hz goes in, the acceleration in m/s2 comes out:
    G(f) = |H(i 2 pi f)|^2.
    """

    gain: float
    order: int
    poles: tuple[complex, ...]

    def response(self, frequency: ArrayLike) -> ComplexArray:
        """H(i 2 pi f), same shape as `frequency` in Hz."""
        s = 2j * np.pi * np.asarray(frequency, dtype=float)
        result = self.gain * s**self.order
        for pole in self.poles:
            result = result / (s - pole)
        return np.asarray(result)


def butterworth_poles(count: int, omega: float) -> tuple[complex, ...]:
    """Poles in rad/s of a Butterworth filter with its corner at `omega`, conjugates adjacent.

    s_k = omega exp(i pi (1/2 + (2k - 1)/2n)), k = 1 .. n: the left half of a circle.
    """
    poles: list[complex] = []
    for k in range(1, count // 2 + 1):
        pole = omega * np.exp(1j * np.pi * (0.5 + (2 * k - 1) / (2 * count)))
        poles += [complex(pole), complex(pole.conj())]
    return (*poles, complex(-omega)) if count % 2 else tuple(poles)
