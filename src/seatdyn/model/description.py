"""A seat in words and numbers: what reports and JSON answers show of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from seatdyn.model.custom import CustomElement
from seatdyn.model.elements import Element
from seatdyn.model.seat import Seat
from seatdyn.model.tables import UNITS

SHOWN_APART = ("between", "label")


def seat_description(seat: Seat, elements: Sequence[Element]) -> dict[str, Any]:
    """Return a seat as plain data that JSON can hold.

    Parameters
    ----------
    seat : Seat
    elements : all that act in its system, each with its whole delay

    Returns
    -------
    dict
        name, title, source, mass and cushion_mass (kg), and `elements`: of each its
        element (the name), type, between (two nodes) and parameters: name -> value and unit.
    """
    return {
        **{key: getattr(seat, key) for key in ("name", "title", "source")},
        **{key: getattr(seat, key) for key in ("mass", "cushion_mass")},
        "elements": [
            {
                "element": part.name,
                "type": type(part).__name__,
                "between": list(part.between),
                "parameters": _parameters(part),
            }
            for part in elements
        ],
    }


def _parameters(element: Element) -> dict[str, dict[str, Any]]:
    """Value and unit of what an element was made with; of what is behind a lever, too."""
    found: dict[str, dict[str, Any]] = {}
    for field in dataclasses.fields(element):
        value = getattr(element, field.name)
        if field.name in SHOWN_APART or (field.name == "delay" and value == 0.0):
            continue
        if isinstance(value, Element):
            kind = type(value).__name__
            found |= {f"{kind}: {name}": item for name, item in _parameters(value).items()}
        elif not isinstance(element, CustomElement):
            unit = field.metadata.get("unit", UNITS.get(field.name, ""))
            found[field.name] = {"value": value, "unit": unit}
    if isinstance(element, CustomElement) and element.law is not None:
        for (name, unit), value in zip(element.law.units.items(), element.values, strict=True):
            found[name] = {"value": value, "unit": unit}
    return found
