"""Spectra that standards prescribe: seat-test input classes, and roads at a speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seatdyn.errors import ExcitationError
from seatdyn.signals.shaping import Shaping, butterworth_poles
from seatdyn.signals.spectrum import Array, Spectrum, check_band
from seatdyn.standards.inputs import (
    INPUT_CLASSES,
    LOWEST,
    ROAD_BAND,
    ROAD_CLASSES,
    ROAD_REFERENCE,
    InputClass,
)
from seatdyn.units import FREQUENCY, number, quantity, suggestion, validated

LOW_CUT = 0.3  # Hz, of the seat-test classes


@dataclass(frozen=True)
class SeatTestInput(Spectrum):
    """Input class of a laboratory seat test; make it with `seat_test_input`.

    The density of the class is A HP LP with Butterworth filters (`standards.inputs`). The band is
    from `low`, below which the class has next to no acceleration but displacement without bound
    for a class such as EM6, to the upper end of the band of its target.
    """

    name: str
    low: float = quantity("Hz", **FREQUENCY)

    def __post_init__(self) -> None:
        """Look the class up."""
        if self.name not in INPUT_CLASSES:
            hint = suggestion(str(self.name), INPUT_CLASSES)
            raise ExcitationError(f"There is no seat-test input class {self.name!r}. {hint}")
        object.__setattr__(self, "low", check_band("SeatTestInput", self.low, self.high)[0])

    @property
    def definition(self) -> InputClass:
        """Standard, constants and target of the class."""
        return INPUT_CLASSES[self.name]

    @property
    def high(self) -> float:  # type: ignore[override]
        """Upper end of the band in Hz."""
        return self.definition.highest

    @property
    def target(self) -> float:
        """R.m.s. acceleration in m/s2 that the standard asks for in 0.89 Hz .. `high`."""
        return self.definition.target

    @cached_property
    def shaping(self) -> Shaping:
        """Butterworth filters in series."""
        level, (n_high, f_high), (n_low, f_low) = self.definition[1:4]
        omega = 2 * math.pi * f_low
        poles = (
            *butterworth_poles(n_high, 2 * math.pi * f_high),
            *butterworth_poles(n_low, omega),
        )
        return Shaping(math.sqrt(level) * omega**n_low, n_high, poles)

    def inside(self, frequency: Array) -> Array:
        """A HP LP."""
        level, (n_high, f_high), (n_low, f_low) = self.definition[1:4]
        above, below = (frequency / f_high) ** (2 * n_high), (frequency / f_low) ** (2 * n_low)
        return np.asarray(level * above / (1.0 + above) / (1.0 + below))


def seat_test_input(name: str, *, low: float = LOW_CUT) -> SeatTestInput:
    """Return the input class of a seat test: EM1 - EM9, IT1 - IT4, AG1 - AG3.

    EM: earth-moving machinery (ISO 7096:2000), IT: industrial trucks (EN 13490:2001), AG:
    agricultural tractors (ISO 5007:2003). The constants are from a public
    transcription, not from the standards themselves, see `standards.inputs`.

    Parameters
    ----------
    name : of the class, such as "EM3", in capitals or not
    low : low cut in Hz, below the band of the target, which begins at 0.89 Hz

    Raises
    ------
    ExcitationError
        Unknown class (with a suggestion), or a cut that is not below the band.

    Examples
    --------
    >>> import seatdyn as sd
    >>> em3 = sd.seat_test_input("EM3")
    >>> em3.target, round(em3.acceleration_rms(0.89, 11.22), 2)
    (1.73, 1.73)
    """
    cut = number(low, "low", "Hz", minimum=1e-3, maximum=LOWEST, error=ExcitationError)
    known = str(name).upper()
    return SeatTestInput(known if known in INPUT_CLASSES else name, cut)


@dataclass(frozen=True)
class Road(Spectrum):
    """Vertical acceleration of a point that follows a road of ISO 8608 at a constant speed.

    Displacement density Gd(n) = Gd(n0) (n/n0)^-2 over the wave number n, one-sided; with f = v n,
    G(f) = (2 pi f)^4 Gd(n0) n0^2 v/f^2. The geometric means of the
    classes are from a public transcription, not from the standard itself.

    Parameters
    ----------
    road_class : "A" (very good) ... "H"
    speed : v in m/s, 0.1 .. 100
    lowest, highest : band in cycle/m, 1e-4 .. 100; ISO 8608 evaluates 0.01 .. 10 on roads. The
        low cut decides the displacement: its r.m.s. is sqrt(Gd(n0) n0^2 (1/lowest - 1/highest)).

    Examples
    --------
    >>> import seatdyn as sd
    >>> road = sd.Road("C", speed=10.0)
    >>> road.low, road.high, round(1000 * road.displacement_rms(), 1)
    (0.1, 100.0, 16.0)
    """

    road_class: str
    speed: float = quantity("m/s", minimum=0.1, maximum=100.0)
    lowest: float = quantity("cycle/m", default=ROAD_BAND[0], minimum=1e-4, maximum=100.0)
    highest: float = quantity("cycle/m", default=ROAD_BAND[1], minimum=1e-4, maximum=100.0)

    def __post_init__(self) -> None:
        """Check class, speed and band."""
        if self.road_class not in ROAD_CLASSES:
            raise ExcitationError(
                f"Road.road_class = {self.road_class!r} is not allowed; "
                f"it must be one of {', '.join(ROAD_CLASSES)}."
            )
        validated(self, error=ExcitationError)
        check_band("Road", self.low, self.high)

    @property
    def low(self) -> float:  # type: ignore[override]
        """Low cut in Hz."""
        return self.speed * self.lowest

    @property
    def high(self) -> float:  # type: ignore[override]
        """High cut in Hz."""
        return self.speed * self.highest

    @property
    def shaping(self) -> Shaping:
        """White velocity, differentiated."""
        level = ROAD_CLASSES[self.road_class]
        return Shaping(2 * math.pi * ROAD_REFERENCE * math.sqrt(level * self.speed), 1, ())

    def inside(self, frequency: Array) -> Array:
        """(2 pi f)^4 of the displacement density."""
        return np.asarray(np.abs(self.shaping.response(frequency)) ** 2)
