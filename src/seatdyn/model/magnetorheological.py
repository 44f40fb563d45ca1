"""Magnetorheological dampers at a constant current or voltage."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

from seatdyn.kernels import laws, memory_laws
from seatdyn.model.elements import Break, Law, NonlinearElement
from seatdyn.model.friction import SIGN_SLOPE, SLOPE, no_tangent
from seatdyn.model.memory import MemoryElement, MemoryLaw
from seatdyn.units import DAMPING, FORCE, LENGTH, STIFFNESS, either_sign, number, quantity

VOLTAGE = 2.25  # V, the largest of Spencer's tests


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


@dataclass(frozen=True)
class SpencerDamper(MemoryElement):
    """Phenomenological model (Spencer et al. 1997, J. Eng. Mech. 123:230-238).

    F = c1 dy/dt + k1 (d - x0), dy/dt = (alpha z + c0 v + k0 (d - y))/(c0 + c1),
    dz/dt = A u - gamma |u| |z|^(n-1) z - beta u |z|^n with u = v - dy/dt: a damper c1, which rolls
    off the force at low speed, in series with a Bouc-Wen element, and the gas accumulator k1
    beside them.

    Parameters
    ----------
    alpha : N/m, 0 .. 1e12
    c0, c1 : N s/m, 0 .. 1e9; c1 greater than 0
    k0, k1 : N/m, 0 .. 1e12
    x0 : m, within +-1000
    gamma, beta : m^-n, gamma 1e-9 .. 1e15, beta within +-1e15
    scale : A, 1e-6 .. 1e6
    exponent : n, 1 .. 10
    """

    states: ClassVar = (("dashpot", "m"), ("z", "m"))
    alpha: float = quantity("N/m", **STIFFNESS)
    c0: float = quantity("N s/m", **DAMPING)
    c1: float = quantity("N s/m", minimum=1e-9, maximum=DAMPING["maximum"])
    k0: float = quantity("N/m", **STIFFNESS)
    k1: float = quantity("N/m", **STIFFNESS)
    x0: float = quantity("m", **either_sign(LENGTH))
    gamma: float = quantity("1/m^n", minimum=1e-9, maximum=1e15)
    beta: float = quantity("1/m^n", minimum=-1e15, maximum=1e15)
    scale: float = quantity("", minimum=1e-6, maximum=1e6)
    exponent: float = quantity("", minimum=1.0, maximum=10.0)

    @classmethod
    def spencer1997(cls, voltage: float) -> SpencerDamper:
        """The damper of the 1997 paper, of the 3 kN class and no seat's, at a constant voltage.

        Parameters
        ----------
        voltage : V, 0 .. 2.25

        Examples
        --------
        >>> import seatdyn as sd
        >>> sd.SpencerDamper.spencer1997(voltage=1.5).c0
        2625.0
        """
        u = number(voltage, "voltage", "V", minimum=0.0, maximum=VOLTAGE)
        return cls(
            alpha=14000.0 + 69500.0 * u,
            c0=2100.0 + 350.0 * u,
            c1=28300.0 + 295.0 * u,
            k0=4690.0,
            k1=500.0,
            x0=0.143,
            gamma=3.63e6,
            beta=3.63e6,
            scale=301.0,
            exponent=2.0,
        )

    def lower(self) -> MemoryLaw:
        """The law; its rates have kinks where the slip changes its direction."""
        linear = (self.alpha, self.c0, self.c1, self.k0, self.k1, self.x0)
        size = (self.scale / self.gamma) ** (1.0 / self.exponent)
        return MemoryLaw(
            memory_laws.spencer_force,
            memory_laws.spencer_rate,
            (*linear, self.scale, self.beta, self.gamma, self.exponent),
            (1e-3, size),
        )

    @property
    def load(self) -> float:
        """What the accumulator pushes with at d = 0."""
        return self.k1 * self.x0

    def about(self, travel: float) -> SpencerDamper:
        """With the accumulator in balance there."""
        return replace(self, x0=0.0)

    def settled(self, d: float) -> tuple[float, ...]:
        """The dashpot has given way."""
        return (d, 0.0)
