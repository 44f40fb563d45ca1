"""Seats as TOML files: a mass, and elements by type with their parameters.

    mass = 20.0 # kg, or "20 kg"

    [[suspension]]
    type = "Spring"
    stiffness = "9.5 kN/m" # or 9500.0, in N/m

    [[suspension]]
    type = "ScissorLever"
    arm = "400 mm"
    height = "250 mm"
    element = { type = "Damper", coefficient = 900.0 } # what is behind the lever

A number is in the SI unit that the element's docstring names; a text carries its unit. `between`,
`label` and `delay` may be given for every element.
"""

from __future__ import annotations

import dataclasses
import json
import tomllib
from collections.abc import Iterator, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from seatdyn.disk import write_whole
from seatdyn.errors import ModelError
from seatdyn.model.contact import ContactStop
from seatdyn.model.cushion import KelvinVoigt, Zener
from seatdyn.model.dampers import BalanceDamper, PowerDamper
from seatdyn.model.elements import (
    AsymmetricDamper,
    CoulombFriction,
    Damper,
    Element,
    EndStop,
    PiecewiseSpring,
    PolynomialDamper,
    Preload,
    QuadraticDamper,
    Spring,
    TangentPolynomialSpring,
)
from seatdyn.model.friction import StribeckFriction
from seatdyn.model.hysteresis import BoucWen, DahlFriction, LuGreFriction
from seatdyn.model.lever import Lever, ScissorLever
from seatdyn.model.magnetorheological import BinghamDamper, SpencerDamper, TanhDamper
from seatdyn.model.seat import Seat
from seatdyn.model.semi_active import MRDamper, SemiActiveDamper
from seatdyn.model.shift import Shifted
from seatdyn.model.springs import AirSpring, AirSpringWithTank, ThreeSpring
from seatdyn.model.tables import TableDamper, TableSpring
from seatdyn.units import in_unit, suggestion

KINDS: dict[str, type[Element]] = {
    kind.__name__: kind
    for kind in (
        *(Spring, Damper, QuadraticDamper, CoulombFriction, PiecewiseSpring, EndStop, Preload),
        *(TangentPolynomialSpring, PolynomialDamper, AsymmetricDamper, TableSpring, TableDamper),
        *(StribeckFriction, ContactStop, AirSpring, ThreeSpring, PowerDamper, BalanceDamper),
        *(BinghamDamper, TanhDamper, Lever, ScissorLever, Shifted, KelvinVoigt, Zener),
        *(AirSpringWithTank, DahlFriction, LuGreFriction, BoucWen),
        *(SpencerDamper, SemiActiveDamper, MRDamper),
    )
}
ELEMENT_LISTS = ("suspension", "cushion")  # fields of a seat


def list_seats() -> list[str]:
    """Names of the seats of the catalogue."""
    return sorted(file.name[:-5] for file in _catalogue() if file.name.endswith(".toml"))


def load_seat(name: str | Path) -> Seat:
    """Read a seat from the catalogue by name, or from a TOML file by path.

    Parameters
    ----------
    name : a name of `list_seats()`, or the path of a file that ends in ``.toml``

    Raises
    ------
    ModelError
        Unknown name, element or parameter (with a suggestion), a parameter that is missing or out
        of its range, or a file that cannot be read.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.load_seat("illustrative_suspension")
    >>> [element.name for element in seat.suspension]
    ['Spring', 'AsymmetricDamper', 'CoulombFriction', 'ContactStop']
    """
    text = str(name)
    if text.endswith(".toml"):
        path = Path(text)
        if not path.is_file():
            raise ModelError(f"Seat file {text!r} does not exist.")
        content = path.read_bytes()
    elif text in list_seats():
        content = next(f for f in _catalogue() if f.name == f"{text}.toml").read_bytes()
    else:
        raise ModelError(f"Unknown seat {text!r}. {suggestion(text, list_seats())}")
    try:
        return seat_from_dict(tomllib.loads(content.decode("utf-8")))
    except ModelError as error:
        raise ModelError(f"Seat file {text!r}: {error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ModelError(f"Seat file {text!r} is not valid TOML: {error}.") from None


def save_seat(seat: Seat, path: str | Path) -> None:
    """Write a seat to a TOML file that `load_seat` reads back to an equal seat.

    Parameters
    ----------
    seat : Seat whose elements are of the package; a force law of your own cannot be written
    path : of the file, which ends in ``.toml``

    Raises
    ------
    ModelError
        A path with another ending, or an element that cannot be written.
    OutputError
        The disk is full or the place not writable; an older file stays as it was.
    """
    if Path(path).suffix != ".toml":
        raise ModelError(f"path = {str(path)!r} is not allowed; a seat file ends in '.toml'.")
    write_whole(Path(path), seat_to_toml(seat).encode("utf-8"))


def seat_from_dict(data: Mapping[str, Any]) -> Seat:
    """Build a `Seat` from the parsed content of a seat file."""
    known = {field.name: field for field in dataclasses.fields(Seat)}
    values: dict[str, Any] = {}
    for key, value in data.items():
        if key not in known:
            raise ModelError(f"a seat has no field {key!r}. {suggestion(key, known)}")
        unit = known[key].metadata.get("unit")
        if unit is not None:
            values[key] = in_unit(value, f"Seat.{key}", unit)
        else:
            values[key] = _elements(value, key) if key in ELEMENT_LISTS else value
    if "mass" not in values:
        raise ModelError("a seat needs a mass, such as mass = 20.0 (kg).")
    return Seat(**values)


def _elements(value: Any, key: str) -> tuple[Element, ...]:
    if not isinstance(value, list):
        raise ModelError(f"{key} must be a list of tables, each headed [[{key}]].")
    return tuple(element_from_dict(item, f"{key} {i + 1}") for i, item in enumerate(value))


def element_from_dict(data: Any, place: str) -> Element:
    """Build an element from its table; `place` names it in messages."""
    if not isinstance(data, Mapping) or not isinstance(data.get("type"), str):
        raise ModelError(f"{place} needs a type, such as type = 'Spring'.")
    name = data["type"]
    if name not in KINDS:
        raise ModelError(f"{place} has the unknown type {name!r}. {suggestion(name, KINDS)}")
    kind = KINDS[name]
    fields = {field.name: field for field in dataclasses.fields(kind)}
    values: dict[str, Any] = {}
    for key, value in data.items():
        if key == "type":
            continue
        if key not in fields:
            raise ModelError(
                f"{place} ({name}) has no parameter {key!r}. {suggestion(key, fields)}"
            )
        unit = fields[key].metadata.get("unit")
        if unit is not None:
            values[key] = in_unit(value, f"{place} ({name}): {key}", unit)
        elif isinstance(value, Mapping):
            values[key] = element_from_dict(value, f"{place} ({name}): {key}")
        else:
            values[key] = tuple(value) if isinstance(value, list) else value
    missing = [
        key
        for key, field in fields.items()
        if field.default is dataclasses.MISSING and key not in values
    ]
    if missing:
        raise ModelError(f"{place} ({name}) needs {', '.join(missing)}.")
    return kind(**values)


def seat_to_toml(seat: Seat) -> str:
    """Content of a seat file, numbers in SI units named in comments."""
    entries = _entries(seat)
    lists = [entry for entry in entries if entry[0] in ELEMENT_LISTS]
    lines = [_line(*entry) for entry in entries if entry not in lists]
    for name, elements, _ in lists:
        for element in elements:
            lines += ["", f"[[{name}]]", *(_line(*entry) for entry in _typed(element))]
    return "\n".join([*lines, ""])


def _entries(item: Any) -> list[tuple[str, Any, str]]:
    """Name, value and unit of the fields of a seat or element that are not at their default."""
    return [
        (field.name, getattr(item, field.name), field.metadata.get("unit", ""))
        for field in dataclasses.fields(item)
        if getattr(item, field.name) != field.default
    ]


def _typed(element: Element) -> list[tuple[str, Any, str]]:
    name = type(element).__name__
    if name not in KINDS:
        raise ModelError(
            f"{element.name} cannot be written to a file: a force law of your own is Python. Keep "
            "it in a script."
        )
    return [("type", name, ""), *_entries(element)]


def _line(name: str, value: Any, unit: str) -> str:
    return f"{name} = {_toml(value)}" + (f" # {unit}" if unit else "")


def _toml(value: Any) -> str:
    """A value as TOML; JSON's numbers, texts and lists are TOML too."""
    if isinstance(value, Element):
        return "{ " + ", ".join(_line(name, part, "") for name, part, _ in _typed(value)) + " }"
    return json.dumps(value, ensure_ascii=False)


def _catalogue() -> Iterator[Any]:
    return (resources.files("seatdyn.model") / "seats").iterdir()
