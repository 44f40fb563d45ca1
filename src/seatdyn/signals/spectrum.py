"""One-sided spectra of base acceleration, each with a stated band.

A density G(f) in (m/s2)^2/Hz is zero outside `low` .. `high`, so that velocity and displacement
have finite variances: those of G/(2 pi f)^2 and G/(2 pi f)^4. "One-sided" means that the mean
square is the integral over positive frequencies only.
"""

from __future__ import annotations

import hashlib
import math
import reprlib
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import ExcitationError
from seatdyn.signals.shaping import Shaping
from seatdyn.units import FREQUENCY, number, quantity

Array = NDArray[np.float64]
KNOTS = 65  # of a smooth density over its band, evenly spaced in log f
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
MOST_TABLE = 100_000  # points
SHORT_TABLE = 16  # points, of a table that is shown in full


class Spectrum(ABC):
    """Base of all spectra: `low` and `high` in Hz, and a density between them."""

    low: float
    high: float

    @abstractmethod
    def inside(self, frequency: Array) -> Array:
        """Density in (m/s2)^2/Hz at frequencies in Hz that lie in the band, same shape."""

    @property
    def knots(self) -> Array:
        """Frequencies in Hz from `low` to `high` between which the density is smooth."""
        return np.geomspace(self.low, self.high, KNOTS)

    @property
    def finest(self) -> float:
        """Width in Hz of the finest feature: its inverse is how long the motion remembers."""
        return self.low

    @property
    def shaping(self) -> Shaping | None:
        """Rational filter that makes the acceleration from band-limited white noise, or None."""
        return None

    def density(self, frequency: ArrayLike) -> Array:
        """Acceleration density in (m/s2)^2/Hz at `frequency` in Hz, same shape."""
        f = np.asarray(frequency, dtype=float)
        within = (f >= self.low) & (f <= self.high)
        safe = np.where(within, f, self.low)
        return np.where(within, self.inside(safe), 0.0)

    def mean_squares(self, edges: ArrayLike, power: int = 0) -> Array:
        """Integrals of G (2 pi f)^power between neighbouring `edges` in Hz, (k+1,) -> (k,).

        Gauss-Legendre quadrature of 8 points between all edges and knots. Power 0 is the mean
        square of the acceleration, -2 that of the velocity, -4 that of the displacement.
        """
        bounds = np.asarray(edges, dtype=float)
        clipped = np.clip(bounds, self.low, self.high)
        knots = self.knots
        points = np.union1d(clipped, knots[(knots > clipped[0]) & (knots < clipped[-1])])
        pieces = integrate(lambda f: self.inside(f) * (2 * np.pi * f) ** power, points)
        place = np.searchsorted(bounds, (points[:-1] + points[1:]) / 2, side="right") - 1
        result = np.zeros(bounds.size - 1)
        np.add.at(result, place, pieces)
        return result

    def at_level(self, rms: float) -> Spectrum:
        """The same density times a constant, so that the r.m.s. acceleration is `rms` m/s2."""
        return Scaled(self, rms)

    def _rms(self, power: int, low: float | None, high: float | None) -> float:
        begin = self.low if low is None else low
        end = self.high if high is None else high
        begin, end = check_band(type(self).__name__, begin, end)
        return math.sqrt(float(self.mean_squares([begin, end], power)[0]))

    def acceleration_rms(self, low: float | None = None, high: float | None = None) -> float:
        """R.m.s. acceleration in m/s2, in all of the band or in `low` .. `high` Hz."""
        return self._rms(0, low, high)

    def velocity_rms(self, low: float | None = None, high: float | None = None) -> float:
        """R.m.s. velocity in m/s."""
        return self._rms(-2, low, high)

    def displacement_rms(self, low: float | None = None, high: float | None = None) -> float:
        """R.m.s. displacement in m."""
        return self._rms(-4, low, high)


@dataclass(frozen=True)
class Derived(Spectrum):
    """Base of spectra made of another one, in its band."""

    spectrum: Spectrum

    @property
    def low(self) -> float:  # type: ignore[override]
        """Low end of the band in Hz."""
        return self.spectrum.low

    @property
    def high(self) -> float:  # type: ignore[override]
        """High end of the band in Hz."""
        return self.spectrum.high

    @property
    def knots(self) -> Array:
        """Those of the spectrum."""
        return self.spectrum.knots


@dataclass(frozen=True)
class Scaled(Derived):
    """A spectrum raised or lowered to another level; made by `Spectrum.at_level`.

    Parameters
    ----------
    spectrum : whose form is kept
    rms : acceleration in the whole band, m/s2, > 0

    Examples
    --------
    >>> import seatdyn as sd
    >>> half = sd.seat_test_input("EM3").at_level(0.9)
    >>> round(half.acceleration_rms(), 6)
    0.9
    """

    rms: float

    def __post_init__(self) -> None:
        """Check the level."""
        level = number(self.rms, "level", "m/s2", above=0.0, error=ExcitationError)
        object.__setattr__(self, "rms", level)

    @cached_property
    def factor(self) -> float:
        """Of amplitudes."""
        return self.rms / self.spectrum.acceleration_rms()

    @property
    def finest(self) -> float:
        """That of the spectrum."""
        return self.spectrum.finest

    @property
    def shaping(self) -> Shaping | None:
        """That of the spectrum with another gain."""
        plain = self.spectrum.shaping
        return None if plain is None else replace(plain, gain=self.factor * plain.gain)

    def inside(self, frequency: Array) -> Array:
        """Density in the band."""
        return np.asarray(self.factor**2 * self.spectrum.inside(frequency))


@dataclass(frozen=True)
class SpectrumFormula(Spectrum):
    """Density given as a function of the frequency.

    Parameters
    ----------
    function : takes frequencies in Hz as an array and gives densities in (m/s2)^2/Hz, one-sided,
        finite and >= 0
    low, high : band in Hz, 1e-4 .. 1e5; the function must be smooth inside

    Examples
    --------
    >>> import seatdyn as sd
    >>> round(sd.SpectrumFormula(lambda f: 1 / f, 1.0, 2.71828).acceleration_rms(), 4)
    1.0
    """

    function: Callable[[Array], ArrayLike]
    low: float = quantity("Hz", **FREQUENCY)
    high: float = quantity("Hz", **FREQUENCY)

    def __post_init__(self) -> None:
        """Check the band and the values on it."""
        if not callable(self.function):
            raise ExcitationError(
                f"SpectrumFormula.function = {reprlib.repr(self.function)} is no function of f."
            )
        low, high = check_band("SpectrumFormula", self.low, self.high)
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)
        values = self.inside(self.knots)
        wrong = ~((values >= 0.0) & np.isfinite(values))
        if np.any(wrong):
            k = int(np.argmax(wrong))
            raise ExcitationError(
                f"SpectrumFormula.function gives {values[k]:g} at {self.knots[k]:g} Hz; a density "
                "must be finite and >= 0."
            )

    def __repr__(self) -> str:
        """Band, and what identifies the function: its values."""
        name = getattr(self.function, "__name__", "function")
        digest = digest_of(self.inside(self.knots))
        return f"SpectrumFormula({name}, low={self.low!r}, high={self.high!r}, sha256={digest!r})"

    def inside(self, frequency: Array) -> Array:
        """Values of the function."""
        return np.broadcast_to(np.asarray(self.function(frequency), dtype=float), frequency.shape)


@dataclass(frozen=True)
class SpectrumTable(Spectrum):
    """Density given as a table, straight between its points in log G over log f.

    Parameters
    ----------
    frequency : Hz, 1e-4 .. 1e5, increasing, at least two; the first and last are the band
    values : one-sided density in (m/s2)^2/Hz, > 0, as many

    Examples
    --------
    >>> import seatdyn as sd
    >>> flat = sd.SpectrumTable([1.0, 5.0], [0.25, 0.25])
    >>> round(flat.acceleration_rms(), 6)
    1.0
    """

    frequency: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the table."""
        for name in ("frequency", "values"):
            given = getattr(self, name)
            try:
                points = np.array(given, dtype=float).ravel()
            except (TypeError, ValueError, OverflowError):
                raise ExcitationError(
                    f"SpectrumTable.{name} = {reprlib.repr(given)} must be a list of numbers."
                ) from None
            if not 2 <= points.size <= MOST_TABLE:
                raise ExcitationError(
                    f"SpectrumTable.{name} has {points.size} points; give 2 to {MOST_TABLE}."
                )
            wrong = ~((points > 0.0) & np.isfinite(points))
            if np.any(wrong):
                k = int(np.argmax(wrong))
                raise ExcitationError(
                    f"SpectrumTable.{name}[{k}] = {points[k]:g} must be a finite number > 0: the "
                    "table is interpolated in logarithms. End the table where the density ends."
                )
            object.__setattr__(self, name, tuple(points.tolist()))
        if len(self.frequency) != len(self.values):
            raise ExcitationError(
                f"SpectrumTable has {len(self.frequency)} frequencies and {len(self.values)} "
                "values; give one for each."
            )
        steps = np.diff(self.frequency)
        if np.any(steps <= 0.0):
            k = int(np.argmax(steps <= 0.0)) + 1
            raise ExcitationError(
                f"SpectrumTable.frequency[{k}] = {self.frequency[k]:g} Hz must exceed the one "
                "before; sort the table and give a step as two close points."
            )
        check_band("SpectrumTable", self.low, self.high)

    @property
    def low(self) -> float:  # type: ignore[override]
        """First frequency in Hz."""
        return self.frequency[0]

    @property
    def high(self) -> float:  # type: ignore[override]
        """Last frequency in Hz."""
        return self.frequency[-1]

    @property
    def knots(self) -> Array:
        """The points of the table, and more between distant ones."""
        return np.union1d(self.frequency, super().knots)

    @property
    def finest(self) -> float:
        """Smallest spacing of the table, or the low cut."""
        return min(self.low, float(np.diff(self.frequency).min()))

    def __repr__(self) -> str:
        """The table, or its band and digest where it is long."""
        if len(self.frequency) <= SHORT_TABLE:
            return f"SpectrumTable({self.frequency!r}, {self.values!r})"
        digest = digest_of(np.array([self.frequency, self.values]))
        return (
            f"SpectrumTable({len(self.frequency)} points, {self.low!r} .. {self.high!r} Hz, "
            f"sha256={digest!r})"
        )

    def inside(self, frequency: Array) -> Array:
        """Straight lines in logarithms."""
        logs = np.interp(np.log(frequency), np.log(self.frequency), np.log(self.values))
        return np.asarray(np.exp(logs))


def integrate(function: Callable[[Array], Array], points: Array) -> Array:
    """Integrals of a smooth function between neighbouring points, (k+1,) -> (k,)."""
    half = np.diff(points)[:, None] / 2
    return np.asarray((function(points[:-1, None] + half * (1.0 + POINTS)) * half) @ WEIGHTS)


def digest_of(values: Array) -> str:
    """SHA-256 of numbers as little-endian doubles."""
    return hashlib.sha256(np.asarray(values, dtype="<f8").tobytes()).hexdigest()


def check_band(name: str, low: float, high: float, hint: str = "") -> tuple[float, float]:
    """Band of a spectrum in Hz as floats, or a refusal."""
    begin = number(low, f"{name}.low", "Hz", **FREQUENCY, hint=hint, error=ExcitationError)
    end = number(high, f"{name}.high", "Hz", **FREQUENCY, hint=hint, error=ExcitationError)
    if not begin < end:
        raise ExcitationError(
            f"{name}: low = {begin:g} Hz must lie below high = {end:g} Hz. {hint}".rstrip()
        )
    return begin, end
