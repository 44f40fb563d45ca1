"""Linear viscoelastic elements, for cushions and mounts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from seatdyn.kernels import memory_laws as laws
from seatdyn.model.elements import LinearElement
from seatdyn.model.memory import LinearMemory, MemoryElement, MemoryLaw
from seatdyn.units import DAMPING, STIFFNESS, quantity


@dataclass(frozen=True)
class KelvinVoigt(LinearElement):
    """Spring and damper side by side: F = k d + c v.

    Parameters
    ----------
    stiffness : k in N/m, 0 .. 1e12
    coefficient : c in N s/m, 0 .. 1e9
    """

    stiffness: float = quantity("N/m", **STIFFNESS)
    coefficient: float = quantity("N s/m", **DAMPING)


@dataclass(frozen=True)
class Zener(MemoryElement):
    """Standard linear solid: a spring, and beside it a spring and a dashpot in series.

    F = k0 d + k1 (d - s), ds/dt = (d - s)/tau: at the frequency w its stiffness is
    k0 + k1 i w tau/(1 + i w tau), from k0 (slow) to k0 + k1 (fast).

    Parameters
    ----------
    stiffness : k0 in N/m, 0 .. 1e12
    relaxing : k1 in N/m, 0 .. 1e12
    time : tau in s, 1e-6 .. 1e4
    """

    states: ClassVar = (("dashpot", "m"),)
    is_linear: ClassVar = True
    stiffness: float = quantity("N/m", **STIFFNESS)
    relaxing: float = quantity("N/m", **STIFFNESS)
    time: float = quantity("s", minimum=1e-6, maximum=1e4)

    def lower(self) -> MemoryLaw:
        """The law, linear."""
        parameters = (self.stiffness, self.relaxing, self.time)
        return MemoryLaw(laws.zener_force, laws.zener_rate, parameters, (1e-3,))

    def linearised(self) -> LinearMemory:
        """The element itself."""
        rate = np.array([1.0 / self.time])
        force = np.array([-self.relaxing])
        k = self.stiffness + self.relaxing
        return LinearMemory(np.diag(-rate), rate, np.zeros(1), force, k, 0.0)

    def settled(self, d: float) -> tuple[float, ...]:
        """The dashpot has given way."""
        return (d,)
