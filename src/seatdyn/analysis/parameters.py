"""Parameters of a system and its sine by name, for batches and gradients."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from seatdyn.analysis.outputs import pair_name, unique_names
from seatdyn.errors import RequestError
from seatdyn.model.body import SeatedBody
from seatdyn.model.excitation import Sine
from seatdyn.model.system import SeatSystem
from seatdyn.units import suggestion

SEAT_MASS, DELAY, FREQUENCY, LEVEL = "seat_mass", "delay", "frequency", "base_amplitude"
UNITS = {SEAT_MASS: "kg", DELAY: "s", FREQUENCY: "Hz", LEVEL: "m/s2"}


def parameters_of(system: SeatSystem, excitation: Sine) -> dict[str, tuple[float, str]]:
    """Value and unit of every parameter, by name.

    "seat_mass", "delay" (of the whole suspension), "frequency", "base_amplitude" (m/s2 peak);
    "NAME.FIELD" of an element; "m1.mass" of a mass of the body, "m1-seat.stiffness" and
    "m1-seat.damping" of a link, and the names of feedback gains.
    """
    values: dict[str, tuple[float, str]] = {
        SEAT_MASS: (system.seat.mass, UNITS[SEAT_MASS]),
        DELAY: (system.seat.delay, UNITS[DELAY]),
        FREQUENCY: (excitation.frequency, UNITS[FREQUENCY]),
        LEVEL: (excitation.peak, UNITS[LEVEL]),
    }
    body = system.body
    values |= {f"{node}.mass": (mass, "kg") for node, mass in body.masses.items()}
    for link in body.links:
        name = pair_name(link.between)
        values[f"{name}.stiffness"] = (link.stiffness, "N/m")
        values[f"{name}.damping"] = (link.damping, "N s/m")
    for force in body.feedback:
        for term in force.terms:
            values[term.name] = (term.gain, "N/m" if term.of == "displacement" else "N s/m")
    own = (*system.seat.suspension, *system.seat.cushion, *system.elements)
    for name, element in zip(unique_names(own), own, strict=True):
        for key, field in type(element).__dataclass_fields__.items():
            value = getattr(element, key)
            if field.metadata and isinstance(value, float | int):
                values[f"{name}.{key}"] = (float(value), str(field.metadata.get("unit", "")))
    return values


def require_known(system: SeatSystem, excitation: Sine, names: list[str]) -> None:
    """Refuse names that no parameter has."""
    known = list(parameters_of(system, excitation))
    for name in names:
        if name not in known:
            raise RequestError(f"Nothing here is called {name!r}. {suggestion(name, known)}")


def with_parameters(
    system: SeatSystem, excitation: Sine, values: Mapping[str, float]
) -> tuple[SeatSystem, Sine]:
    """System and excitation with other values of some parameters."""
    values = dict(values)
    seat = system.seat
    level = values.pop(LEVEL, excitation.peak)
    frequency = values.pop(FREQUENCY, excitation.frequency)
    motion = replace(excitation, frequency=frequency, amplitude=level, rms=None)
    mass, delay = values.pop(SEAT_MASS, seat.mass), values.pop(DELAY, seat.delay)
    own = (*seat.suspension, *seat.cushion, *system.elements)
    names = unique_names(own)
    changes: dict[int, dict[str, Any]] = {}
    for name in list(values):
        element, _, key = name.rpartition(".")
        if element in names:
            changes.setdefault(names.index(element), {})[key] = values.pop(name)
    elements = [replace(e, **changes[i]) if i in changes else e for i, e in enumerate(own)]
    first, second = len(seat.suspension), len(seat.suspension) + len(seat.cushion)
    seat = replace(
        seat,
        mass=mass,
        delay=delay,
        suspension=tuple(elements[:first]),
        cushion=tuple(elements[first:second]),
    )
    body = _body_with(system.body, values) if values else system.body
    return replace(system, body=body, seat=seat, elements=tuple(elements[second:])), motion


def _body_with(body: SeatedBody, values: Mapping[str, float]) -> SeatedBody:
    """The body with other masses, links and gains."""
    masses = {node: values.get(f"{node}.mass", mass) for node, mass in body.masses.items()}
    links = tuple(
        replace(
            link,
            stiffness=values.get(f"{pair_name(link.between)}.stiffness", link.stiffness),
            damping=values.get(f"{pair_name(link.between)}.damping", link.damping),
        )
        for link in body.links
    )
    feedback = tuple(
        replace(
            force,
            terms=tuple(replace(t, gain=values.get(t.name, t.gain)) for t in force.terms),
        )
        for force in body.feedback
    )
    return replace(body, masses=masses, links=links, feedback=feedback)
