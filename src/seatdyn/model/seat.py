"""The seat: a frame mass on suspension elements."""

from __future__ import annotations

from dataclasses import dataclass, field

from seatdyn.errors import ModelError
from seatdyn.model.elements import Element
from seatdyn.units import DELAY, MASS, quantity, validated


@dataclass(frozen=True)
class Seat:
    """Seat frame and its suspension.

    Parameters
    ----------
    mass : mass that moves with the seat frame, kg, 1e-6 .. 1e6
    suspension : elements; each acts between base and seat unless its `between` says otherwise,
        and elements across the same two nodes add up
    delay : reaction delay of the whole suspension, s, 0 .. 10; it adds to delays of its elements
    name, title, source : texts for people; `source` says where the numbers come from
    """

    mass: float = quantity("kg", **MASS)
    suspension: tuple[Element, ...] = ()
    delay: float = quantity("s", default=0.0, **DELAY)
    name: str = field(default="", kw_only=True)
    title: str = field(default="", kw_only=True)
    source: str = field(default="", kw_only=True)

    def __post_init__(self) -> None:
        """Check the mass and that the suspension is a list of elements."""
        validated(self)
        if not isinstance(self.suspension, list | tuple):
            raise ModelError(
                f"Seat.suspension = {self.suspension!r} must be a list of elements, "
                "such as [Spring(9950.0), Damper(260.0)]."
            )
        object.__setattr__(self, "suspension", tuple(self.suspension))
        for key in ("name", "title", "source"):
            if not isinstance(getattr(self, key), str):
                raise ModelError(f"Seat.{key} = {getattr(self, key)!r} must be a text.")
        for element in self.suspension:
            if not isinstance(element, Element):
                raise ModelError(
                    f"Seat.suspension holds {element!r}, which is no element; "
                    "use Spring, Damper, QuadraticDamper, ..."
                )
