"""The seat: a frame mass on suspension elements, and a cushion on the frame if there is one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from seatdyn.errors import ModelError
from seatdyn.model.body import SEAT
from seatdyn.model.elements import Element
from seatdyn.units import DELAY, MASS, quantity, validated

SEAT_SURFACE = "seat_surface"  # node between cushion and occupant, of seats that have a cushion
CUSHION = (SEAT, SEAT_SURFACE)


@dataclass(frozen=True)
class Seat:
    """Seat frame, its suspension, and the cushion between frame and occupant.

    Without a cushion the occupant sits on the node "seat", the frame. With one he sits on
    "seat_surface", whose mass is `cushion_mass` and the mass of the body that rests on it.

    Parameters
    ----------
    mass : mass that moves with the seat frame, kg, 1e-6 .. 1e6
    suspension : elements; each acts between base and seat unless its `between` says otherwise,
        and elements across the same two nodes add up
    delay : reaction delay of the whole suspension, s, 0 .. 10; it adds to delays of its elements
    cushion : elements between seat and seat_surface, such as `KelvinVoigt` or `Zener`
    cushion_mass : of the cushion's upper part, kg, 0 .. 1e6; 0 is allowed under a body with mass at
        its node "seat"
    name, title, source : texts for people; `source` says where the numbers come from

    Examples
    --------
    >>> import seatdyn as sd
    >>> foam = sd.Zener(60e3, 30e3, 0.02)
    >>> seat = sd.Seat(20.0, [sd.Spring(9500.0), sd.Damper(600.0)], cushion=[foam])
    >>> sd.SeatSystem(sd.load_body("fairley1989"), seat).nodes
    ('seat', 'seat_surface', 'm1')
    """

    mass: float = quantity("kg", **MASS)
    suspension: tuple[Element, ...] = ()
    delay: float = quantity("s", default=0.0, **DELAY)
    cushion: tuple[Element, ...] = field(default=(), kw_only=True)
    cushion_mass: float = quantity("kg", default=0.0, minimum=0.0, maximum=1e6)
    name: str = field(default="", kw_only=True)
    title: str = field(default="", kw_only=True)
    source: str = field(default="", kw_only=True)

    def __post_init__(self) -> None:
        """Check the masses and that suspension and cushion are lists of elements."""
        validated(self)
        for key in ("name", "title", "source"):
            if not isinstance(getattr(self, key), str):
                raise ModelError(f"Seat.{key} = {getattr(self, key)!r} must be a text.")
        object.__setattr__(self, "suspension", elements_of(self.suspension, "Seat.suspension"))
        cushion = [
            element if set(element.between) == set(CUSHION) else replace(element, between=CUSHION)
            for element in elements_of(self.cushion, "Seat.cushion")
        ]
        object.__setattr__(self, "cushion", tuple(cushion))
        if self.cushion_mass and not self.cushion:
            raise ModelError(
                f"Seat.cushion_mass = {self.cushion_mass:g} kg has no effect without a cushion; "
                "give its elements, or add the mass to that of the frame."
            )


def elements_of(values: Any, label: str) -> tuple[Element, ...]:
    """Return a tuple of what must be a list of elements."""
    if not isinstance(values, list | tuple):
        raise ModelError(
            f"{label} = {values!r} must be a list of elements, such as "
            "[Spring(9950.0), Damper(260.0)]."
        )
    for element in values:
        if not isinstance(element, Element):
            raise ModelError(
                f"{label} holds {element!r}, which is no element; use Spring, Damper, "
                "QuadraticDamper, ..."
            )
    return tuple(values)
