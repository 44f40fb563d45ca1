"""Springs with a geometry: air spring, and three springs with a stiffness near zero."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from seatdyn.errors import ModelError
from seatdyn.kernels import laws, memory_laws
from seatdyn.model.elements import Law, NonlinearElement
from seatdyn.model.memory import LinearMemory, MemoryElement, MemoryLaw
from seatdyn.units import LENGTH, STIFFNESS, Limits, number, quantity

ATMOSPHERE = 101325.0  # Pa, standard atmosphere
PRESSURE = Limits(minimum=1e3, maximum=1e9)  # Pa, absolute
AREA = Limits(minimum=1e-9, maximum=1e3)  # m2
VOLUME = Limits(minimum=1e-12, maximum=1e3)  # m3
SMALLEST_SHARE = 0.05  # of volume and area, where the law of an air spring goes on along its slope
SHORTEST = 1e-6  # m


@dataclass(frozen=True)
class AirSpring(NonlinearElement):
    """Air spring with a polytropic gas: p V^n constant.

    The volume grows with the travel by the effective area, dV/dd = A + A' d, so that no energy is
    made. The force is that beside the load (p0 - pa) A borne at d = 0:
    F = (p0 - pa) A - (p - pa) (A + A' d). Its stiffness at d = 0 is n p0 A^2/V - (p0 - pa) A'.
    Where a twentieth of the volume or of the area is left, it goes on along its slope.

    Parameters
    ----------
    pressure : p0 at d = 0 in Pa, absolute, 1e3 .. 1e9
    area : effective area A at d = 0 in m2, 1e-9 .. 1e3
    volume : V at d = 0 in m3, 1e-12 .. 1e3
    exponent : n, 1 (slow, isothermal) .. 1.7; 1.4 is adiabatic for air
    area_slope : A' in m2/m, within +-1e3; negative where the area shrinks in rebound
    ambient : pa in Pa, absolute, 0 .. 1e9

    Examples
    --------
    >>> import seatdyn as sd
    >>> spring = sd.AirSpring(pressure=5e5, area=5e-3, volume=1e-3, exponent=1.4)
    >>> round(spring.tangent()[0], 3), round(spring.load, 3)
    (17500.0, 1993.375)
    """

    pressure: float = quantity("Pa", **PRESSURE)
    area: float = quantity("m2", **AREA)
    volume: float = quantity("m3", **VOLUME)
    exponent: float = quantity("", minimum=1.0, maximum=1.7)
    area_slope: float = quantity("m", default=0.0, minimum=-1e3, maximum=1e3)
    ambient: float = quantity("Pa", default=ATMOSPHERE, minimum=0.0, maximum=1e9)

    @property
    def load(self) -> float:
        """Weight in N that it bears at d = 0: (p0 - pa) A."""
        return (self.pressure - self.ambient) * self.area

    def about(self, travel: float) -> AirSpring:
        """With the pressure, area and volume that it has there: the same gas."""
        volume = self.volume + travel * (self.area + 0.5 * self.area_slope * travel)
        pressure = self.pressure * (self.volume / volume) ** self.exponent
        area = self.area + self.area_slope * travel
        return replace(self, pressure=pressure, area=area, volume=volume)

    def lower(self) -> Law:
        """The law, smooth between its edges."""
        parameters = (self.pressure, self.ambient, self.area, self.area_slope, self.volume)
        return Law(laws.air_spring, (*parameters, self.exponent, *self._edges()))

    def _edges(self) -> tuple[float, float]:
        """Travels in bump and rebound beyond which the law goes on along its slope."""
        a, bend, lost = self.area, self.area_slope, (1.0 - SMALLEST_SHARE) * self.volume
        shrunk = -(1.0 - SMALLEST_SHARE) * a / bend if bend else math.inf
        # V0 + A d + A' d^2/2 = 5 % of V0, the root nearer to zero
        root = a * a - 2.0 * bend * lost
        flat = -2.0 * lost / (a + math.sqrt(root)) if root > 0.0 else -math.inf
        low = max(flat, shrunk if bend > 0.0 else -math.inf, -LENGTH["maximum"])
        return low, min(shrunk if bend < 0.0 else math.inf, LENGTH["maximum"])

    def tangent(self) -> tuple[float, float]:
        """Stiffness n p0 A^2/V - (p0 - pa) A'."""
        gas = self.exponent * self.pressure * self.area**2 / self.volume
        return (gas - (self.pressure - self.ambient) * self.area_slope, 0.0)


@dataclass(frozen=True)
class AirSpringWithTank(MemoryElement):
    """Air spring whose bellows breathes through a restriction into a tank.

    Pressures p_b = p0 ((1 - s) V_b/(V_b + A d))^n and p_t = p0 (1 + s V_b/V_t)^n, s the share of
    the bellows' air that went over, V_b ds/dt = (p_b - p_t)/R. F = (p0 - p_b) A beside the load
    (p0 - pa) A. For small motions, with C = V/(n p0), its stiffness is
    A^2 (1 + i w R C_t)/(C_b + C_t + i w R C_b C_t): from n p0 A^2/(V_b + V_t) (slow) to
    n p0 A^2/V_b (fast), with damping between.

    Parameters
    ----------
    pressure : p0 at d = 0 in Pa, absolute, 1e3 .. 1e9
    area : effective area A in m2, 1e-9 .. 1e3
    volume : V_b of the bellows at d = 0 in m3, 1e-12 .. 1e3
    tank : V_t in m3, 1e-12 .. 1e3
    restriction : R in Pa s/m3, 1e-3 .. 1e15
    exponent : n, 1 (slow, isothermal) .. 1.7; 1.4 is adiabatic for air
    ambient : pa in Pa, absolute, 0 .. 1e9
    """

    states: ClassVar = (("share in the tank", ""),)
    pressure: float = quantity("Pa", **PRESSURE)
    area: float = quantity("m2", **AREA)
    volume: float = quantity("m3", **VOLUME)
    tank: float = quantity("m3", **VOLUME)
    restriction: float = quantity("Pa s/m3", minimum=1e-3, maximum=1e15)
    exponent: float = quantity("", minimum=1.0, maximum=1.7)
    ambient: float = quantity("Pa", default=ATMOSPHERE, minimum=0.0, maximum=1e9)

    @property
    def load(self) -> float:
        """Weight in N that it bears at d = 0: (p0 - pa) A."""
        return (self.pressure - self.ambient) * self.area

    def about(self, travel: float) -> AirSpringWithTank:
        """With the pressure and volume that it has settled at there: the same gas."""
        volume = self.volume + self.area * travel
        density = (self.volume + self.tank) / (volume + self.tank)  # over that at d = 0
        pressure = self.pressure * density**self.exponent
        restriction = self.restriction * density
        return replace(self, pressure=pressure, volume=volume, restriction=restriction)

    def lower(self) -> MemoryLaw:
        """The law, smooth."""
        gas = (self.pressure, self.ambient, self.area, self.volume, self.tank, self.exponent)
        scale = (1e-3 * self.area / self.volume,)  # a millimetre of travel
        parameters = (*gas, self.restriction)
        return MemoryLaw(memory_laws.tank_force, memory_laws.tank_rate, parameters, scale)

    def settled(self, d: float) -> tuple[float, ...]:
        """Equal pressures: (1 - s)/(1 + A d/V_b) = 1 + s V_b/V_t."""
        grown = self.area * d / self.volume
        return (-grown / (1.0 + (1.0 + grown) * self.volume / self.tank),)

    def linearised(self) -> LinearMemory:
        """Both pressures by their slopes at d = 0: p_b falls by n p0 (s + A d/V_b)."""
        gas = self.exponent * self.pressure
        flow, rise = gas / (self.restriction * self.volume), self.area / self.volume
        return LinearMemory(
            np.array([[-flow * (1.0 + self.volume / self.tank)]]),
            np.array([-flow * rise]),
            np.zeros(1),
            np.array([gas * self.area]),
            gas * self.area * rise,
            0.0,
        )


@dataclass(frozen=True)
class ThreeSpring(NonlinearElement):
    """A vertical spring and two oblique ones that take stiffness away near the middle.

    F = k_v d + 2 k_o d (1 - L0/sqrt(d^2 + a^2)): the oblique springs lie flat at d = 0 over the
    span a < L0 and are compressed there (Carrella, Brennan and Waters 2007, J. Sound Vib.
    301:678-689).
    Its stiffness at d = 0 is k_v - 2 k_o (L0/a - 1).

    Parameters
    ----------
    vertical : k_v in N/m, 0 .. 1e12
    oblique : k_o of each, N/m, 0 .. 1e12
    free_length : L0 in m, 1e-6 .. 1000
    span : a in m, 1e-6 .. 1000
    """

    vertical: float = quantity("N/m", **STIFFNESS)
    oblique: float = quantity("N/m", **STIFFNESS)
    free_length: float = quantity("m", minimum=SHORTEST, maximum=LENGTH["maximum"])
    span: float = quantity("m", minimum=SHORTEST, maximum=LENGTH["maximum"])

    @classmethod
    def quasi_zero(cls, vertical: float, oblique: float, free_length: float) -> ThreeSpring:
        """The mechanism with the span at which the stiffness at d = 0 is zero.

        a = 2 k_o L0/(k_v + 2 k_o).

        Examples
        --------
        >>> import seatdyn as sd
        >>> mechanism = sd.ThreeSpring.quasi_zero(8000.0, 8000.0, free_length=0.15)
        >>> round(mechanism.span, 9), abs(mechanism.tangent()[0]) < 1e-9
        (0.1, True)
        """
        k = number(vertical, "ThreeSpring.vertical", "N/m", **STIFFNESS)
        o = number(oblique, "ThreeSpring.oblique", "N/m", **STIFFNESS)
        length = number(free_length, "ThreeSpring.free_length", "m", **LENGTH)
        if not o > 0.0:
            raise ModelError("ThreeSpring.oblique = 0 N/m is not allowed here; give it stiffness.")
        return cls(k, o, length, 2.0 * o * length / (k + 2.0 * o))

    def lower(self) -> Law:
        """The law, smooth."""
        return Law(laws.three_springs, (self.vertical, self.oblique, self.free_length, self.span))

    def tangent(self) -> tuple[float, float]:
        """Stiffness k_v + 2 k_o (1 - L0/a)."""
        return (self.vertical + 2.0 * self.oblique * (1.0 - self.free_length / self.span), 0.0)
