"""Magnetorheological dampers at a constant current."""

from __future__ import annotations

from dataclasses import dataclass, field

from seatdyn.kernels import laws
from seatdyn.model.elements import Break, Law, NonlinearElement
from seatdyn.model.friction import SIGN_SLOPE, SLOPE, no_tangent
from seatdyn.units import DAMPING, FORCE, STIFFNESS, either_sign, quantity


@dataclass(frozen=True)
class BinghamDamper(NonlinearElement):
    """Bingham model: yield force, viscous damping and offset, F = f_y sign(v) + c v + f0.

    The sign is smoothed to (2/pi) atan(slope v), or jumps with `dry` (Stanway, Sproston and Stevens
    1987, J. Electrostatics 20:167-184).

    Parameters
    ----------
    yield_force : f_y in N, 0 .. 1e9, at the current considered
    viscous : c in N s/m, 0 .. 1e9
    offset : f0 in N, within +-1e9, of the gas accumulator
    slope : of the smoothed sign in s/m, 1e-6 .. 1e9
    dry : the force jumps at v = 0; `slope` is not used
    """

    yield_force: float = quantity("N", **FORCE)
    viscous: float = quantity("N s/m", **DAMPING)
    offset: float = quantity("N", default=0.0, **either_sign(FORCE))
    slope: float = quantity("s/m", default=1000.0, **SLOPE)
    dry: bool = field(default=False, kw_only=True)

    def lower(self) -> Law:
        """The law; dry it jumps at v = 0."""
        slope = 0.0 if self.dry else self.slope
        jump = (Break(0.0, 1.0, 0.0, jumps=True),) if self.dry and self.yield_force > 0.0 else ()
        return Law(laws.bingham, (self.yield_force, self.viscous, self.offset, slope), jump)

    def tangent(self) -> tuple[float, float]:
        """Damping of the smoothed law at rest."""
        if self.dry:
            raise no_tangent(self, "it jumps at v = 0: at rest it sticks")
        return (0.0, SIGN_SLOPE * self.yield_force * self.slope + self.viscous)


@dataclass(frozen=True)
class TanhDamper(NonlinearElement):
    """Model with a hyperbolic tangent: F = c v + k d + a tanh(b v + w sign(d)) + f0.

    Two branches w apart make the loop in the force-velocity plane (Kwok et al. 2006, Sensors and
    Actuators A 132:441-451). The force jumps at d = 0 unless w is zero.

    Parameters
    ----------
    viscous : c in N s/m, 0 .. 1e9
    stiffness : k in N/m, within +-1e12
    height : a in N, 0 .. 1e9
    sharpness : b in s/m, 0 .. 1e9
    width : w, 0 .. 100
    offset : f0 in N, within +-1e9
    """

    viscous: float = quantity("N s/m", **DAMPING)
    stiffness: float = quantity("N/m", **either_sign(STIFFNESS))
    height: float = quantity("N", **FORCE)
    sharpness: float = quantity("s/m", minimum=0.0, maximum=SLOPE["maximum"])
    width: float = quantity("", default=0.0, minimum=0.0, maximum=100.0)
    offset: float = quantity("N", default=0.0, **either_sign(FORCE))

    def lower(self) -> Law:
        """The law with its jump at d = 0."""
        jumps = self.width > 0.0 and self.height > 0.0
        breaks = (Break(1.0, 0.0, 0.0, jumps=True),) if jumps else ()
        parameters = (self.viscous, self.stiffness, self.height, self.sharpness)
        return Law(laws.tanh_damper, (*parameters, self.width, self.offset), breaks)

    def tangent(self) -> tuple[float, float]:
        """Stiffness k and damping c + a b, for w = 0."""
        if self.width > 0.0 and self.height > 0.0:
            raise no_tangent(self, "it jumps at d = 0")
        return (self.stiffness, self.viscous + self.height * self.sharpness)
