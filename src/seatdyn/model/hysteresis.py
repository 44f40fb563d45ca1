"""Friction and hysteresis with internal states: Dahl, LuGre, Bouc-Wen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from seatdyn.errors import ModelError
from seatdyn.kernels import memory_laws as laws
from seatdyn.model.memory import AT_REST, LinearMemory, MemoryElement, MemoryLaw
from seatdyn.units import DAMPING, FORCE, SPEED, STIFFNESS, Limits, quantity

ABOVE_ZERO = 1e-9  # N, N/m, m/s: smallest of what a law divides by
SLIDING = Limits(minimum=ABOVE_ZERO, maximum=FORCE["maximum"])  # N
STUCK = Limits(minimum=ABOVE_ZERO, maximum=STIFFNESS["maximum"])  # N/m


@dataclass(frozen=True)
class DahlFriction(MemoryElement):
    """Friction that is a spring before it slides (Dahl 1968, Aerospace Corp. TOR-0158).

    dF/dt = sigma v |1 - F/F_c sign v|^i sign(1 - F/F_c sign v), and c v beside it. For i = 1 and a
    travel in one direction F = F_c - (F_c - F_0) exp(-sigma |d|/F_c).

    Parameters
    ----------
    sliding : F_c in N, 1e-9 .. 1e9
    stiffness : sigma of the stuck contact, N/m, 1e-9 .. 1e12
    exponent : i, 0.5 .. 4
    viscous : c in N s/m, 0 .. 1e9
    """

    states: ClassVar = (("force", "N"),)
    sliding: float = quantity("N", **SLIDING)
    stiffness: float = quantity("N/m", **STUCK)
    exponent: float = quantity("", default=1.0, minimum=0.5, maximum=4.0)
    viscous: float = quantity("N s/m", default=0.0, **DAMPING)

    def lower(self) -> MemoryLaw:
        """The law; its rate has a kink where the direction changes."""
        parameters = (self.stiffness, self.sliding, self.exponent, self.viscous)
        return MemoryLaw(laws.dahl_force, laws.dahl_rate, parameters, (self.sliding,), AT_REST)

    def settled(self, d: float) -> tuple[float, ...]:
        """No force."""
        return (0.0,)

    def linearised(self) -> LinearMemory:
        """Stiffness of the stuck contact, and the viscous damping."""
        return LinearMemory.without_states(self.stiffness, self.viscous)


@dataclass(frozen=True)
class LuGreFriction(MemoryElement):
    """Friction by bristles that bend: presliding stiffness, Stribeck effect and lag in one law.

    F = sigma0 z + sigma1 dz/dt + c v, dz/dt = v - sigma0 |v| z/g(v),
    g = F_c + (F_s - F_c) exp(-(v/v_s)^2) (Canudas de Wit et al. 1995, IEEE Trans. Autom. Control
    40:419-425). At a constant speed F = g(v) sign v + c v.

    Parameters
    ----------
    sliding : F_c in N, 1e-9 .. 1e9
    static : F_s in N, F_c .. 1e9
    speed : v_s in m/s, 1e-9 .. 1e4
    stiffness : sigma0 of the bristles, N/m, 1e-9 .. 1e12
    damping : sigma1 of the bristles, N s/m, 0 .. 1e9
    viscous : c in N s/m, 0 .. 1e9
    """

    states: ClassVar = (("bristle", "m"),)
    sliding: float = quantity("N", **SLIDING)
    static: float = quantity("N", **SLIDING)
    speed: float = quantity("m/s", minimum=ABOVE_ZERO, maximum=SPEED["maximum"])
    stiffness: float = quantity("N/m", **STUCK)
    damping: float = quantity("N s/m", default=0.0, **DAMPING)
    viscous: float = quantity("N s/m", default=0.0, **DAMPING)

    def __post_init__(self) -> None:
        """Check that friction does not rise from the static to the sliding level."""
        super().__post_init__()
        if self.static < self.sliding:
            raise ModelError(
                f"{self.name}.static = {self.static:g} N is not allowed; it must be at least "
                f"sliding = {self.sliding:g} N. Exchange them, or give the same value twice."
            )

    def lower(self) -> MemoryLaw:
        """The law; its rate has a kink where the direction changes."""
        parameters = (self.stiffness, self.damping, self.viscous)
        return MemoryLaw(
            laws.lugre_force,
            laws.lugre_rate,
            (*parameters, self.sliding, self.static, self.speed),
            (self.sliding / self.stiffness,),
            AT_REST,
        )

    def settled(self, d: float) -> tuple[float, ...]:
        """Straight bristles."""
        return (0.0,)

    def linearised(self) -> LinearMemory:
        """Stiffness sigma0 and damping sigma1 + c of the stuck contact."""
        return LinearMemory.without_states(self.stiffness, self.damping + self.viscous)


@dataclass(frozen=True)
class BoucWen(MemoryElement):
    """Smooth hysteresis: F = alpha k d + (1 - alpha) k z + c v.

    dz/dt = A v - gamma |v| |z|^(n-1) z - beta v |z|^n (Wen 1976, J. Eng. Mech. Div. 102:249-263).
    |z| stays below (A/(beta + gamma))^(1/n). The element only dissipates where |beta| <= gamma.

    Parameters
    ----------
    stiffness : k in N/m, 0 .. 1e12
    share : alpha, 0 .. 1, of the stiffness that stays after yield
    gamma, beta : in m^-n, gamma 1e-9 .. 1e15, beta within +-gamma
    exponent : n, 1 .. 10
    scale : A, 1e-6 .. 1e6
    viscous : c in N s/m, 0 .. 1e9
    """

    states: ClassVar = (("z", "m"),)
    stiffness: float = quantity("N/m", **STIFFNESS)
    share: float = quantity("", minimum=0.0, maximum=1.0)
    gamma: float = quantity("1/m^n", minimum=ABOVE_ZERO, maximum=1e15)
    beta: float = quantity("1/m^n", minimum=-1e15, maximum=1e15)
    exponent: float = quantity("", default=1.0, minimum=1.0, maximum=10.0)
    scale: float = quantity("", default=1.0, minimum=1e-6, maximum=1e6)
    viscous: float = quantity("N s/m", default=0.0, **DAMPING)

    def __post_init__(self) -> None:
        """Check that the loop dissipates."""
        super().__post_init__()
        if abs(self.beta) > self.gamma:
            raise ModelError(
                f"{self.name}.beta = {self.beta:g} is not allowed; it must be within +-gamma = "
                f"{self.gamma:g}, or the element could drive."
            )

    @property
    def largest(self) -> float:
        """Largest |z| in m."""
        return (
            float((self.scale / (self.beta + self.gamma)) ** (1.0 / self.exponent))
            if (self.beta + self.gamma)
            else float("inf")
        )

    def lower(self) -> MemoryLaw:
        """The law; its rate has a kink where the direction changes."""
        shape = (self.scale, self.beta, self.gamma, self.exponent)
        parameters = (self.stiffness, self.share, self.viscous, *shape)
        size = (self.scale / self.gamma) ** (1.0 / self.exponent)
        return MemoryLaw(laws.bouc_wen_force, laws.bouc_wen_rate, parameters, (size,), AT_REST)

    def settled(self, d: float) -> tuple[float, ...]:
        """No hysteretic displacement."""
        return (0.0,)

    def linearised(self) -> LinearMemory:
        """Stiffness alpha k + (1 - alpha) k A at rest, and c."""
        stiffness = self.stiffness * (self.share + (1.0 - self.share) * self.scale)
        return LinearMemory.without_states(stiffness, self.viscous)
