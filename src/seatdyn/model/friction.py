"""Friction that depends on the sliding speed, smooth or dry."""

from __future__ import annotations

from dataclasses import dataclass, field

from seatdyn.errors import ModelError
from seatdyn.kernels import laws
from seatdyn.model.elements import Break, Element, Law, NonlinearElement
from seatdyn.units import DAMPING, FORCE, SPEED, Limits, quantity

SLOPE = Limits(minimum=1e-6, maximum=1e9)  # s/m, of a smoothed sign
SIGN_SLOPE = 0.6366197723675814  # 2/pi, slope of (2/pi) atan at zero
SLOWEST = 1e-9  # m/s, of a speed that friction is compared with


@dataclass(frozen=True)
class StribeckFriction(NonlinearElement):
    """Friction that falls from a static to a sliding level as the speed rises (Stribeck 1902).

    F = [F_c + (F_s - F_c) exp(-|v/v_s|^q)] sign(v) + c v. The sign is smoothed to
    (2/pi) atan(slope v), as in `CoulombFriction`; with `dry` it jumps, and the element sticks while
    the force on it stays below F_s. With F_s = F_c and `dry` this is dry Coulomb friction.

    Parameters
    ----------
    sliding : F_c in N, 0 .. 1e9
    static : F_s in N, F_c .. 1e9
    speed : v_s in m/s, 1e-9 .. 1e4
    exponent : q, 0.5 .. 4; 1 and 2 are usual
    viscous : c in N s/m, 0 .. 1e9
    slope : of the smoothed sign in s/m, 1e-6 .. 1e9; below about 1/slope the element creeps
    dry : the force jumps at v = 0; `slope` is not used
    """

    sliding: float = quantity("N", **FORCE)
    static: float = quantity("N", **FORCE)
    speed: float = quantity("m/s", minimum=SLOWEST, maximum=SPEED["maximum"])
    exponent: float = quantity("", default=2.0, minimum=0.5, maximum=4.0)
    viscous: float = quantity("N s/m", default=0.0, **DAMPING)
    slope: float = quantity("s/m", default=1000.0, **SLOPE)
    dry: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        """Check that friction does not rise from the static to the sliding level."""
        super().__post_init__()
        if self.static < self.sliding:
            raise ModelError(
                f"{self.name}.static = {self.static:g} N is not allowed; it must be at least "
                f"sliding = {self.sliding:g} N. Exchange them, or give the same value twice."
            )

    def lower(self) -> Law:
        """The law; dry it jumps at v = 0, smooth it may have a kink in its second derivative."""
        slope = 0.0 if self.dry else self.slope
        parameters = (self.sliding, self.static, self.speed, self.exponent, self.viscous, slope)
        jumps = self.dry and self.static > 0.0
        return Law(laws.stribeck, parameters, (Break(0.0, 1.0, 0.0, jumps=jumps),))

    def tangent(self) -> tuple[float, float]:
        """Damping of the smoothed law at rest; dry friction has none, for it sticks."""
        if self.dry:
            raise no_tangent(self, "it jumps at v = 0: at rest it sticks")
        return (0.0, SIGN_SLOPE * self.static * self.slope + self.viscous)


def no_tangent(element: Element, why: str) -> ModelError:
    """Error of an element whose law has no slope at rest."""
    return ModelError(
        f"{element.name} has no tangent at rest, for {why}. Use its smooth form, or analyse the "
        "linear part without it (linearise=None)."
    )
