"""Dampers with a power law, and one that is switched by travel and speed."""

from __future__ import annotations

from dataclasses import dataclass

from seatdyn.errors import ModelError
from seatdyn.kernels import laws
from seatdyn.model.elements import Break, Law, NonlinearElement
from seatdyn.units import DAMPING, STIFFNESS, quantity

LARGEST_COEFFICIENT = 1e12  # of a power-law damper, in the unit of its exponent


@dataclass(frozen=True)
class PowerDamper(NonlinearElement):
    """Damper with a power of the speed: F = c |v|^n sign(v).

    Below n = 1 its slope at rest has no bound, so that it is blended into a line near rest:
    F = c v (v^2 + v_b^2)^((n-1)/2).

    Parameters
    ----------
    coefficient : c in N s^n/m^n, 0 .. 1e12
    exponent : n, 0.1 .. 5
    blend : v_b in m/s, 0 .. 10; greater than 0 for n < 1
    """

    coefficient: float = quantity("N (s/m)^n", minimum=0.0, maximum=LARGEST_COEFFICIENT)
    exponent: float = quantity("", minimum=0.1, maximum=5.0)
    blend: float = quantity("m/s", default=0.0, minimum=0.0, maximum=10.0)

    def __post_init__(self) -> None:
        """Check that the slope at rest is finite."""
        super().__post_init__()
        if self.exponent < 1.0 and self.blend == 0.0:
            raise ModelError(
                f"{self.name}.blend = 0 m/s is not allowed with exponent = {self.exponent:g}: "
                "below 1 the slope at rest has no bound. Give a speed far below those that "
                "matter, such as blend=1e-3."
            )

    def lower(self) -> Law:
        """The law; without blending a derivative jumps at v = 0."""
        smooth = self.blend > 0.0 or self.exponent in (1.0, 3.0, 5.0)
        kink = () if smooth else (Break(0.0, 1.0, 0.0, jumps=False),)
        return Law(laws.power_damper, (self.coefficient, self.exponent, self.blend), kink)

    def tangent(self) -> tuple[float, float]:
        """Damping at rest: c for n = 1, zero above it, c v_b^(n-1) with blending."""
        if self.exponent == 1.0:
            return (0.0, self.coefficient)
        if self.blend == 0.0:
            return (0.0, 0.0)
        return (0.0, self.coefficient * self.blend ** (self.exponent - 1.0))


@dataclass(frozen=True)
class BalanceDamper(NonlinearElement):
    """Semi-active damper that cancels the force of a spring wherever a damper can.

    Moving towards the middle (d v < 0) it pushes with -k d, within what the damper can do:
    c_min <= F/v <= c_max; moving away it has c_min (Rakheja and Sankar 1985, J. Vib. Acoust. Stress
    Reliab. Des. 107:398-403). It needs only the travel and its rate, and never drives.

    Parameters
    ----------
    stiffness : k of the spring to be cancelled, N/m, 0 .. 1e12
    minimum : c_min in N s/m, 0 .. 1e9
    maximum : c_max in N s/m, c_min .. 1e9
    """

    stiffness: float = quantity("N/m", **STIFFNESS)
    minimum: float = quantity("N s/m", **DAMPING)
    maximum: float = quantity("N s/m", **DAMPING)

    def __post_init__(self) -> None:
        """Check the order of the limits."""
        super().__post_init__()
        check_order(self.name, self.minimum, self.maximum)

    def lower(self) -> Law:
        """The law; continuous, with kinks where a limit is reached and at v = 0."""
        lines = [(self.stiffness, self.minimum), (self.stiffness, self.maximum), (0.0, 1.0)]
        kinks = [Break(p, q, 0.0, jumps=False) for p, q in dict.fromkeys(lines) if p or q]
        return Law(laws.balance_damper, (self.stiffness, self.minimum, self.maximum), tuple(kinks))

    def tangent(self) -> tuple[float, float]:
        """Mean of both branches at d = 0, where it has c_min on either side."""
        return (0.0, self.minimum)


def check_order(name: str, minimum: float, maximum: float) -> None:
    """Refuse a largest damping below the smallest."""
    if maximum < minimum:
        raise ModelError(
            f"{name}.maximum = {maximum:g} N s/m is not allowed; it must be at least minimum = "
            f"{minimum:g} N s/m. Exchange them."
        )
