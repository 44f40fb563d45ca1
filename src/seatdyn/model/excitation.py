"""Base motion: accelerations with a definite, consistent velocity and displacement.

Every excitation lowers to one `Motion`: sines that last for ever, plus segments in time, each a
polynomial plus one sine. Displacement, velocity and acceleration are exact derivatives of each
other, in the kernels and here, and integration stops at every segment boundary.
"""

from __future__ import annotations

import math
import reprlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import ExcitationError
from seatdyn.units import ACCELERATION, FREQUENCY, Limits, number

Array = NDArray[np.float64]
DEGREES = 6  # coefficients of a segment's polynomial: cubic acceleration, quintic displacement
LARGEST_DENOMINATOR = 1000
LONGEST_PERIOD = 1000  # of a sum of sines, in periods of its lowest frequency
PHASE = Limits(minimum=-1e6, maximum=1e6)  # rad


@dataclass(frozen=True)
class Motion:
    """Base motion as arrays, displacement in m over time in s.

    starts : (k,) begin of each segment; the first is 0, the last lasts for ever
    polynomials : (k, 6) coefficients in the time since the segment's start
    segment_sines : (k, 3) amplitude, angular frequency, phase of the segment's sine
    sines : (n, 3) amplitude, angular frequency, phase of the lasting sines
    """

    starts: Array = field(default_factory=lambda: np.zeros(1))
    polynomials: Array = field(default_factory=lambda: np.zeros((1, DEGREES)))
    segment_sines: Array = field(default_factory=lambda: np.zeros((1, 3)))
    sines: Array = field(default_factory=lambda: np.zeros((0, 3)))

    def evaluate(self, time: ArrayLike, derivative: int = 0) -> Array:
        """Displacement (0), velocity (1) or acceleration (2) at `time`, same shape."""
        t = np.asarray(time, dtype=float)
        k = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, None)
        tau = t - self.starts[k]
        powers = np.arange(DEGREES)
        factor = np.ones(DEGREES)
        for order in range(derivative):
            factor *= np.maximum(powers - order, 0)
        result = np.zeros_like(t)
        for j in range(DEGREES - 1, derivative - 1, -1):
            result = result * tau + factor[j] * self.polynomials[k, j]
        amplitude, omega, phase = np.moveaxis(self.segment_sines[k], -1, 0)
        result += _sine(amplitude, omega, phase, tau, derivative)
        for amplitude, omega, phase in self.sines:
            result += _sine(amplitude, omega, phase, t, derivative)
        return result

    @cached_property
    def scale(self) -> tuple[float, float]:
        """Largest displacement (m) and velocity (m/s), roughly, for absolute tolerances."""
        amplitude, omega = np.abs(self.sines[:, 0]), np.abs(self.sines[:, 1])
        ends = np.append(self.starts[1:], self.starts[-1] + 1.0)
        mid = 0.5 * (self.starts + ends)
        x = np.max(np.abs(self.evaluate(mid)), initial=0.0)
        v = np.max(np.abs(self.evaluate(mid, 1)), initial=0.0)
        return float(amplitude.sum() + x), float((amplitude * omega).sum() + v)

    @property
    def longest_step(self) -> float:
        """Step in s that cannot overlook the fastest sine, and that fits evenly spaced segments."""
        fastest = float(np.max(np.abs(self.sines[:, 1]), initial=0.0))
        limit = math.pi / 4 / fastest if fastest else math.inf
        lengths = np.diff(self.starts)
        usual = float(np.median(lengths)) if lengths.size else math.inf
        return min(limit, usual)


def _sine(a: Array, omega: Array, phase: Array, t: Array, derivative: int) -> Array:
    return np.asarray(a * omega**derivative * np.sin(omega * t + phase + derivative * np.pi / 2))


class Excitation(ABC):
    """Base of all base motions."""

    @abstractmethod
    def lower(self) -> Motion:
        """The motion as arrays."""

    @property
    def period(self) -> float | None:
        """Period in s, or None where there is none."""
        return None

    @property
    def notes(self) -> dict[str, float]:
        """What was done to make the motion consistent (compensations), with units in the names."""
        return {}

    @cached_property
    def motion(self) -> Motion:
        """The lowered motion, made once."""
        return self.lower()

    def displacement(self, time: ArrayLike) -> Array:
        """Base displacement in m at `time` in s."""
        return self.motion.evaluate(time, 0)

    def velocity(self, time: ArrayLike) -> Array:
        """Base velocity in m/s at `time` in s."""
        return self.motion.evaluate(time, 1)

    def acceleration(self, time: ArrayLike) -> Array:
        """Base acceleration in m/s2 at `time` in s."""
        return self.motion.evaluate(time, 2)


@dataclass(frozen=True)
class Still(Excitation):
    """A base at rest, for systems that move by themselves or from an initial state."""

    def lower(self) -> Motion:
        """No motion."""
        return Motion()


@dataclass(frozen=True)
class Sine(Excitation):
    """Sinusoidal base acceleration a sin(w t + phase), free of drift.

    Its displacement is x0 = -(a/w^2) sin(w t + phase).

    Parameters
    ----------
    frequency : Hz, 1e-4 .. 1e5
    amplitude : peak acceleration, m/s2, 0 .. 1e6
    rms : r.m.s. acceleration, m/s2, 0 .. 1e6; give exactly one of `amplitude` and `rms`
    phase : rad, within +-1e6

    Examples
    --------
    >>> import seatdyn as sd
    >>> round(sd.Sine(1.55, rms=0.686).peak, 6)
    0.970151
    """

    frequency: float
    amplitude: float | None = None
    rms: float | None = field(default=None, kw_only=True)
    phase: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        """Check frequency and that exactly one level is given."""
        hint = "Towards zero frequency the displacement has no bound; check the unit."
        set_number(self, "frequency", "Hz", **FREQUENCY, hint=hint)
        set_number(self, "phase", "rad", **PHASE)
        peak_level(self)

    @property
    def peak(self) -> float:
        """Peak acceleration in m/s2."""
        return peak_level(self)

    @property
    def period(self) -> float:
        """Period in s."""
        return 1.0 / self.frequency

    def lower(self) -> Motion:
        """One lasting sine."""
        omega = 2 * math.pi * self.frequency
        return Motion(sines=np.array([[-self.peak / omega**2, omega, self.phase]]))


@dataclass(frozen=True)
class SineSum(Excitation):
    """Sum of sines.

    Parameters
    ----------
    parts : one or more `Sine`
    """

    parts: Sequence[Sine]

    def __post_init__(self) -> None:
        """Check the parts."""
        parts = tuple(self.parts) if isinstance(self.parts, Iterable) else ()
        if not parts or not all(isinstance(part, Sine) for part in parts):
            raise ExcitationError(
                f"SineSum.parts = {reprlib.repr(self.parts)} is not allowed; it must be a list of "
                "at least one Sine, such as [Sine(1.5, amplitude=0.5), Sine(4.0, amplitude=1.0)]."
            )
        object.__setattr__(self, "parts", parts)

    @property
    def period(self) -> float | None:
        """Common period in s, or None above 1000 periods of the lowest frequency."""
        lowest = min(part.frequency for part in self.parts)
        steps = 1
        for part in self.parts:
            ratio = part.frequency / lowest
            fraction = Fraction(ratio).limit_denominator(LARGEST_DENOMINATOR)
            if abs(float(fraction) - ratio) > 1e-12 * ratio:
                return None
            steps = math.lcm(steps, fraction.denominator)
        return steps / lowest if steps <= LONGEST_PERIOD else None

    def lower(self) -> Motion:
        """Lasting sines."""
        return Motion(sines=np.vstack([part.motion.sines for part in self.parts]))


def set_number(
    obj: object,
    name: str,
    unit: str,
    *,
    minimum: float,
    maximum: float,
    hint: str = "",
) -> None:
    """Check and convert one field of a frozen excitation."""
    value = number(
        getattr(obj, name),
        f"{type(obj).__name__}.{name}",
        unit,
        minimum=minimum,
        maximum=maximum,
        hint=hint,
        error=ExcitationError,
    )
    object.__setattr__(obj, name, value)


def peak_level(obj: object) -> float:
    """Peak acceleration of an excitation with fields `amplitude` and `rms`, exactly one given."""
    name = type(obj).__name__
    amplitude, rms = getattr(obj, "amplitude", None), getattr(obj, "rms", None)
    if (amplitude is None) == (rms is None):
        given = (
            "neither was given; pass one of them"
            if amplitude is None
            else "both were given; pass one of them"
        )
        raise ExcitationError(
            f"{name} needs exactly one level, amplitude (m/s2 peak) or rms (m/s2), but {given}."
        )
    if amplitude is not None:
        return number(amplitude, f"{name}.amplitude", "m/s2", **ACCELERATION, error=ExcitationError)
    level = number(rms, f"{name}.rms", "m/s2", **ACCELERATION, error=ExcitationError)
    return level * math.sqrt(2.0)
