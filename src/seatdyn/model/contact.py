"""End stops with a power law: Hertz contact and the damping of Hunt and Crossley."""

from __future__ import annotations

from dataclasses import dataclass

from seatdyn.kernels import laws
from seatdyn.model.elements import Break, Law, NonlinearElement, with_clearances
from seatdyn.units import LENGTH, SPEED, number, quantity

HERTZ = 1.5  # exponent of a sphere on a plane
LARGEST_DAMPING = 1e6  # s/m


@dataclass(frozen=True)
class ContactStop(NonlinearElement):
    """End stops with a power law and Hunt-Crossley damping; they push and never pull.

    With the compression delta > 0 of the stop touched, the push is
    k delta^n max(0, 1 + lambda delta'): it starts from zero at contact, whatever the speed
    (Hunt and Crossley 1975, J. Appl. Mech. 42:440-445). n = 3/2 is Hertz contact. For a sum of
    powers put two stops side by side.

    Parameters
    ----------
    stiffness : k in N/m^n, 0 .. 1e15
    bump_clearance : free travel in compression, m, 0 .. 1000
    rebound_clearance : free travel in extension, m, 0 .. 1000
    exponent : n, 1 .. 6
    damping : lambda in s/m, 0 .. 1e6; see `hunt_crossley` and `lankarani_nikravesh`
    """

    stiffness: float = quantity("N/m^n", minimum=0.0, maximum=1e15)
    bump_clearance: float = quantity("m", **LENGTH)
    rebound_clearance: float = quantity("m", **LENGTH)
    exponent: float = quantity("", default=HERTZ, minimum=1.0, maximum=6.0)
    damping: float = quantity("s/m", default=0.0, minimum=0.0, maximum=LARGEST_DAMPING)

    def lower(self) -> Law:
        """The law; kinks at contact, and where it lets go while still compressed."""
        b, r, slowing = self.bump_clearance, self.rebound_clearance, self.damping
        breaks = [Break(1.0, 0.0, edge, jumps=False) for edge in sorted({-b, r})]
        if slowing > 0.0:
            breaks += [Break(0.0, 1.0, sign / slowing, jumps=False) for sign in (-1.0, 1.0)]
        law = laws.hertz if self.exponent == HERTZ else laws.contact
        return Law(law, (self.stiffness, -b, r, self.exponent, slowing), tuple(breaks))

    def about(self, travel: float) -> NonlinearElement:
        """With the clearances that are left."""
        stop: NonlinearElement = with_clearances(self, travel)
        return stop

    def tangent(self) -> tuple[float, float]:
        """Zero in the free travel; mean of both sides for a linear stop without free travel."""
        closed = (self.bump_clearance == 0.0) + (self.rebound_clearance == 0.0)
        return (self.stiffness * closed / 2 if self.exponent == 1.0 else 0.0, 0.0)


def hunt_crossley(restitution: float, impact_speed: float) -> float:
    """Damping lambda = 3 (1 - e)/(2 v) of a `ContactStop`, in s/m, for e near 1.

    Parameters
    ----------
    restitution : e, 0 .. 1, speed after over speed before the impact
    impact_speed : v in m/s, > 0

    Examples
    --------
    >>> import seatdyn as sd
    >>> round(sd.hunt_crossley(0.9, impact_speed=0.5), 6)
    0.3
    """
    e, v = _impact(restitution, impact_speed)
    return 1.5 * (1.0 - e) / v


def lankarani_nikravesh(restitution: float, impact_speed: float) -> float:
    """Damping lambda = 3 (1 - e^2)/(4 v) of a `ContactStop`, in s/m, for e near 1.

    From the energy lost in the impact (Lankarani and Nikravesh 1990, J. Mech. Des. 112:369-376).

    Parameters
    ----------
    restitution : e, 0 .. 1, speed after over speed before the impact
    impact_speed : v in m/s, > 0

    Examples
    --------
    >>> import seatdyn as sd
    >>> round(sd.lankarani_nikravesh(0.9, impact_speed=0.5), 6)
    0.285
    """
    e, v = _impact(restitution, impact_speed)
    return 0.75 * (1.0 - e * e) / v


def _impact(restitution: float, impact_speed: float) -> tuple[float, float]:
    e = number(restitution, "restitution", "", minimum=0.0, maximum=1.0)
    return e, number(impact_speed, "impact_speed", "m/s", minimum=1e-6, maximum=SPEED["maximum"])
