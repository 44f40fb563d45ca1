"""A seat as the rows of a table, from the description that a result carries."""

from __future__ import annotations

import json
from typing import Any

MOST_SHOWN = 6  # points of a measured table


def seat_rows(description: str) -> list[tuple[str, str, str, str]]:
    """Part, parameter, value and unit of every row.

    Parameters
    ----------
    description : attribute `seat_description` of a result, JSON of `seat_description`
    """
    seat: dict[str, Any] = json.loads(description)
    rows = [("seat", "mass", _text(seat["mass"]), "kg")]
    if seat["cushion_mass"]:
        rows.append(("cushion", "mass", _text(seat["cushion_mass"]), "kg"))
    for part in seat["elements"]:
        kind = "" if part["element"] == part["type"] else f" ({part['type']})"
        name = f"{part['element']}{kind}, {' to '.join(part['between'])}"
        rows += [
            (name, parameter.replace("_", " "), _text(item["value"]), item["unit"])
            for parameter, item in part["parameters"].items()
        ]
    return rows


def _text(value: Any) -> str:
    if isinstance(value, list):
        shown = ", ".join(_text(item) for item in value[:MOST_SHOWN])
        return shown if len(value) <= MOST_SHOWN else f"{shown}, ... ({len(value)} values)"
    return f"{value:.6g}" if isinstance(value, float | int) else str(value)
