"""Forces on nodes from outside: histories in N that go with a base motion.

A history has the arrays of a base motion (`Motion`), its value a force instead of a displacement.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import ExcitationError, RequestError
from seatdyn.model.excitation import (
    LARGEST_DENOMINATOR,
    LONGEST_PERIOD,
    PHASE,
    Excitation,
    Motion,
    Still,
    set_number,
)
from seatdyn.units import DURATION, FORCE, FREQUENCY, either_sign, number

SAME = 1e-12  # relative: periods that are multiples of each other


@dataclass(frozen=True)
class ExternalForce(ABC):
    """Base of all forces from outside; positive upwards, on one free node."""

    node: str

    @abstractmethod
    def lower(self) -> Motion:
        """The history as arrays, N over s."""

    @property
    def period(self) -> float | None:
        """Period in s; 0 for a constant force, None for one that does not repeat."""
        return None

    @cached_property
    def history(self) -> Motion:
        """The lowered history, made once."""
        return self.lower()

    def force(self, time: ArrayLike) -> NDArray[np.float64]:
        """Force in N at `time` in s."""
        return self.history.evaluate(time, 0)


@dataclass(frozen=True)
class SineForce(ExternalForce):
    """Sinusoidal force F sin(w t + phase).

    Parameters
    ----------
    node : free node that it acts on, such as "seat"
    frequency : Hz, 1e-4 .. 1e5
    amplitude : peak in N, 0 .. 1e9
    rms : r.m.s. in N, 0 .. 1e9; give exactly one of `amplitude` and `rms`
    phase : rad, within +-1e6

    Examples
    --------
    >>> import seatdyn as sd
    >>> round(sd.SineForce("seat", 5.0, rms=10.0).peak, 6)
    14.142136
    """

    frequency: float
    amplitude: float | None = None
    rms: float | None = field(default=None, kw_only=True)
    phase: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        """Check frequency and that exactly one level is given."""
        set_number(self, "frequency", "Hz", **FREQUENCY)
        set_number(self, "phase", "rad", **PHASE)
        if (self.amplitude is None) == (self.rms is None):
            raise ExcitationError(
                "SineForce needs exactly one level, amplitude (N peak) or rms (N); pass one."
            )
        _ = self.peak

    @property
    def peak(self) -> float:
        """Peak force in N."""
        name = "amplitude" if self.rms is None else "rms"
        level = number(
            getattr(self, name), f"SineForce.{name}", "N", **FORCE, error=ExcitationError
        )
        return level if self.rms is None else level * math.sqrt(2.0)

    @property
    def period(self) -> float:
        """Period in s."""
        return 1.0 / self.frequency

    def lower(self) -> Motion:
        """One lasting sine."""
        return Motion(sines=np.array([[self.peak, 2 * math.pi * self.frequency, self.phase]]))


@dataclass(frozen=True)
class PulseForce(ExternalForce):
    """Half a sine of force: an impact.

    Parameters
    ----------
    node : free node that it acts on
    amplitude : peak in N, within +-1e9
    duration : s, 1e-6 .. 1e9
    start : s, 0 .. 1e9
    """

    amplitude: float
    duration: float
    start: float = 0.0

    def __post_init__(self) -> None:
        """Check every number."""
        set_number(self, "amplitude", "N", **either_sign(FORCE))
        set_number(self, "duration", "s", **DURATION)
        set_number(self, "start", "s", minimum=0.0, maximum=DURATION["maximum"])

    def lower(self) -> Motion:
        """Nothing, the half sine, and nothing."""
        half = [self.amplitude, math.pi / self.duration, 0.0]
        starts = np.array([0.0, self.start, self.start + self.duration])
        sines = np.array([[0.0] * 3, half, [0.0] * 3])
        first = 0 if self.start > 0.0 else 1
        return Motion(
            starts=starts[first:], polynomials=np.zeros((3 - first, 6)), segment_sines=sines[first:]
        )


@dataclass(frozen=True)
class ConstantForce(ExternalForce):
    """A force that acts from t = 0 on, such as a weight put on the seat.

    Parameters
    ----------
    node : free node that it acts on
    level : N, within +-1e9; a weight is negative
    """

    level: float

    def __post_init__(self) -> None:
        """Check the level."""
        set_number(self, "level", "N", **either_sign(FORCE))

    @property
    def period(self) -> float:
        """It repeats with any period."""
        return 0.0

    def lower(self) -> Motion:
        """A constant."""
        return Motion(polynomials=np.array([[self.level, 0.0, 0.0, 0.0, 0.0, 0.0]]))


@dataclass(frozen=True)
class WithForces(Excitation):
    """A base motion, and forces from outside on nodes.

    Parameters
    ----------
    forces : one or more `SineForce`, `PulseForce`, `ConstantForce`; several on one node add up
    base : the base motion; default at rest

    Examples
    --------
    >>> import seatdyn as sd
    >>> shaker = sd.WithForces([sd.SineForce("seat", 4.0, amplitude=50.0)])
    >>> system = sd.SeatSystem(sd.load_body("fairley1989"), sd.load_seat("illustrative_suspension"))
    >>> sd.steady_state(system, shaker).attrs["status"]
    'converged'
    """

    forces: tuple[ExternalForce, ...]
    base: Excitation = field(default_factory=Still)

    def __post_init__(self) -> None:
        """Check the parts."""
        forces = tuple(self.forces) if isinstance(self.forces, Iterable) else ()
        if not forces or not all(isinstance(force, ExternalForce) for force in forces):
            raise ExcitationError(
                f"WithForces.forces = {self.forces!r} is not allowed; it must be a list of at "
                "least one force, such as [SineForce('seat', 5.0, amplitude=20.0)]."
            )
        object.__setattr__(self, "forces", forces)
        if not isinstance(self.base, Excitation) or isinstance(self.base, WithForces):
            raise ExcitationError(
                f"WithForces.base = {self.base!r} is no base motion; use Sine, Step, Record, ..."
            )

    @property
    def period(self) -> float | None:
        """Common period in s of base motion and forces, or None."""
        resting = isinstance(self.base, Still)
        periods = [force.period for force in self.forces] + ([] if resting else [self.base.period])
        if any(period is None for period in periods):
            return None
        repeating = [period for period in periods if period]
        return common_period(repeating) if repeating else None

    @property
    def notes(self) -> dict[str, float]:
        """Those of the base motion."""
        return self.base.notes

    def lower(self) -> Motion:
        """Refused: the forces would be forgotten."""
        raise RequestError(
            "This analysis takes a base motion only, and here forces act on nodes too. Use "
            "simulate or steady_state; for a harmonic force receptance."
        )


def base_and_forces(excitation: Excitation) -> tuple[Excitation, tuple[ExternalForce, ...]]:
    """The base motion, and the forces from outside."""
    if isinstance(excitation, WithForces):
        return excitation.base, excitation.forces
    return excitation, ()


def common_period(periods: list[float]) -> float | None:
    """Smallest multiple of all periods in s, or None beyond 1000 of the longest."""
    longest = max(periods)
    steps = []
    for period in periods:
        ratio = longest / period
        fraction = Fraction(ratio).limit_denominator(LARGEST_DENOMINATOR)
        if abs(float(fraction) - ratio) > SAME * ratio:
            return None
        steps.append(fraction.denominator)
    count = reduce(math.lcm, steps)
    return count * longest if count <= LONGEST_PERIOD else None
