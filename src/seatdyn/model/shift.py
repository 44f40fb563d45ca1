"""An element whose travel is measured from another place, less its force at rest there."""

from __future__ import annotations

from dataclasses import dataclass, replace

from seatdyn.model.elements import Break, Law, NonlinearElement
from seatdyn.units import LENGTH, either_sign, quantity


@dataclass(frozen=True)
class Shifted(NonlinearElement):
    """An element seen from its loaded position: F(s + d, v) - F(s, 0).

    `settled` makes them; what the element bears there is its `load`.

    Parameters
    ----------
    element : a non-linear element; its own `between` is not used
    travel : s in m, within +-1000
    """

    element: NonlinearElement
    travel: float = quantity("m", **either_sign(LENGTH))

    @property
    def load(self) -> float:
        """What it bears at the new d = 0."""
        return self.element.load - self.element.rest_force(self.travel)

    def about(self, travel: float) -> NonlinearElement:
        """Shifted once, by the sum."""
        return replace(self, travel=self.travel + travel)

    def lower(self) -> Law:
        """The law with its breaks moved."""
        from seatdyn.kernels.jit import shifted

        law, s = self.element.lower(), self.travel
        function = shifted(law.function, len(law.parameters))
        at_rest = law.function(s, 0.0, law.parameters)
        breaks = tuple(
            Break(b.displacement, b.velocity, b.value - b.displacement * s, b.jumps)
            for b in law.breaks
        )
        limits = law.limits
        if limits is not None and limits[0] == "displacement":
            limits = (limits[0], limits[1] - s, limits[2] - s)
        return Law(function, (*law.parameters, s, at_rest), breaks, limits)

    def tangent(self) -> tuple[float, float]:
        """Slopes of the law by differences, for it is taken away from its own d = 0."""
        h = 1e-6
        along_d, along_v = self.force_at([-h, h]), self.force_at(0.0, [-h, h])
        return (float(along_d[1] - along_d[0]) / (2 * h), float(along_v[1] - along_v[0]) / (2 * h))
