"""A user's own element: a Python function of (d, v, p), marked with `force_law`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from seatdyn.errors import ModelError
from seatdyn.model.elements import Break, Law, NonlinearElement
from seatdyn.units import number, suggestion

Where = Mapping[str, Sequence[float | str]]


@dataclass(frozen=True)
class ForceLaw:
    """A marked function; call it with parameter values to get an element."""

    function: Callable[[float, float, Any], float]
    units: Mapping[str, str]
    jumps_at: Where
    kinks_at: Where

    def __call__(
        self,
        *,
        between: tuple[str, str] = ("base", "seat"),
        label: str = "",
        delay: float = 0.0,
        **values: float,
    ) -> CustomElement:
        """Make an element with these parameter values."""
        name = label or self.function.__name__
        for given in values:
            if given not in self.units:
                hint = suggestion(given, self.units)
                raise ModelError(f"{name} has no parameter {given!r}. {hint}")
        missing = [key for key in self.units if key not in values]
        if missing:
            raise ModelError(f"{name} needs the parameters {missing}.")
        ordered = tuple(number(values[k], f"{name}.{k}", unit) for k, unit in self.units.items())
        return CustomElement(law=self, values=ordered, between=between, label=name, delay=delay)


@dataclass(frozen=True)
class CustomElement(NonlinearElement):
    """An element made from a `ForceLaw`."""

    law: ForceLaw | None = None
    values: tuple[float, ...] = field(default=())

    def _require_law(self) -> ForceLaw:
        if self.law is None:
            raise ModelError("CustomElement needs a law; make it with @force_law.")
        return self.law

    def lower(self) -> Law:
        """The law with its breaks placed."""
        law = self._require_law()
        breaks = self._breaks(law.jumps_at, True) + self._breaks(law.kinks_at, False)
        return Law(law.function, self.values, tuple(breaks))

    def _breaks(self, where: Where, jumps: bool) -> list[Break]:
        law = self._require_law()
        breaks = []
        for variable, places in where.items():
            if variable not in ("displacement", "velocity"):
                raise ModelError(
                    f"{self.name}: breaks are placed on 'displacement' or 'velocity', "
                    f"not on {variable!r}."
                )
            for place in places:
                if isinstance(place, str):
                    sign = -1.0 if place.startswith("-") else 1.0
                    key = place.lstrip("-")
                    if key not in law.units:
                        hint = suggestion(key, law.units)
                        raise ModelError(f"{self.name}: no parameter {key!r} for a break. {hint}")
                    value = sign * self.values[list(law.units).index(key)]
                else:
                    value = number(place, f"{self.name}: place of a break", "m or m/s")
                on_d = variable == "displacement"
                breaks.append(Break(float(on_d), float(not on_d), value, jumps))
        return breaks

    def tangent(self) -> tuple[float, float]:
        """Central differences of the function at rest."""
        law = self._require_law()
        step = 1e-6

        def force(d: float, v: float) -> float:
            return float(law.function(d, v, self.values))

        return (
            (force(step, 0.0) - force(-step, 0.0)) / (2 * step),
            (force(0.0, step) - force(0.0, -step)) / (2 * step),
        )


def force_law(
    parameters: Mapping[str, str],
    *,
    jumps_at: Where | None = None,
    kinks_at: Where | None = None,
) -> Callable[[Callable[[float, float, Any], float]], ForceLaw]:
    """Mark a function F(d, v, p) as the force law of an element.

    The function gets displacement d (m) and velocity v (m/s) of the second node relative to the
    first and its parameters as p[0], p[1], ... in the order of `parameters`; it returns the force
    in N, positive in tension. It is compiled, so it may use numbers, `math`, and plain control
    flow. It needs no derivative. A law that jumps must say where.

    Parameters
    ----------
    parameters : name -> unit, in the order of p
    jumps_at : {"displacement": [...], "velocity": [...]}: places where the force jumps; each a
        number, the name of a parameter, or "-" and the name
    kinks_at : the same for places where only a derivative jumps

    Examples
    --------
    >>> import seatdyn as sd
    >>> @sd.force_law({"k3": "N/m3"})
    ... def cubic(d, v, p):
    ...     return p[0] * d**3
    >>> cubic(k3=1e6).tangent()[0] < 1e-3
    True
    """

    def mark(function: Callable[[float, float, Any], float]) -> ForceLaw:
        return ForceLaw(function, dict(parameters), dict(jumps_at or {}), dict(kinks_at or {}))

    return mark
