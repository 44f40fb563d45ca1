"""Fields of model objects that know their unit and admissible range.

`quantity("N/m", minimum=0, maximum=1e12)` declares a field of a frozen dataclass; `validated(self)`
in `__post_init__` turns its value into a float and refuses what is outside the range with a
message that names object, field, value, unit, range and what to do.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
import reprlib
from collections.abc import Iterable
from typing import Any, TypedDict

from seatdyn.errors import ModelError, SeatdynError


class Limits(TypedDict):
    """Smallest and largest value allowed."""

    minimum: float
    maximum: float


# Generous limits of what a seat, a body or a base motion can be; nothing overflows inside them.
MASS = Limits(minimum=1e-6, maximum=1e6)  # kg
STIFFNESS = Limits(minimum=0.0, maximum=1e12)  # N/m
DAMPING = Limits(minimum=0.0, maximum=1e9)  # N s/m, and N s2/m2
FORCE = Limits(minimum=0.0, maximum=1e9)  # N
LENGTH = Limits(minimum=0.0, maximum=1e3)  # m
SPEED = Limits(minimum=0.0, maximum=1e4)  # m/s
ACCELERATION = Limits(minimum=0.0, maximum=1e6)  # m/s2
FREQUENCY = Limits(minimum=1e-4, maximum=1e5)  # Hz
DURATION = Limits(minimum=1e-6, maximum=1e9)  # s, of a base motion
DELAY = Limits(minimum=0.0, maximum=10.0)  # s, of a force
RATE = Limits(minimum=1e-3, maximum=1e7)  # Hz, of samples


def either_sign(limits: Limits) -> Limits:
    """The same largest size for a number of either sign."""
    return Limits(minimum=-limits["maximum"], maximum=limits["maximum"])


def quantity(
    unit: str,
    *,
    default: Any = dataclasses.MISSING,
    minimum: float = -math.inf,
    maximum: float = math.inf,
    hint: str = "",
) -> Any:
    """Dataclass field that holds one finite number in `unit` (SI), in `minimum` .. `maximum`."""
    limits = Limits(minimum=minimum, maximum=maximum)
    metadata = {"unit": unit, "limits": limits, "hint": hint}
    return dataclasses.field(default=default, metadata=metadata)


def number(
    value: Any,
    name: str,
    unit: str,
    *,
    minimum: float = -math.inf,
    maximum: float = math.inf,
    above: float | None = None,
    hint: str = "",
    error: type[SeatdynError] = ModelError,
) -> float:
    """Return `value` as a float, or raise `error` that names it, its unit, range and next step."""
    if above is not None:
        allowed = f"a finite number > {above:g} {unit}"
    elif maximum < math.inf:
        allowed = f"a number in {minimum:g} .. {maximum:g} {unit}"
    elif minimum > -math.inf:
        allowed = f"a finite number >= {minimum:g} {unit}"
    else:
        allowed = f"a finite number in {unit}"
    allowed = allowed.rstrip()
    if isinstance(value, str | bytes | bool):
        raise error(f"{name} = {value!r} is not a number; it must be {allowed}. {hint}".rstrip())
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    except (TypeError, ValueError):
        given = reprlib.repr(value)
        message = f"{name} = {given} is not a number; it must be {allowed}. {hint}"
        raise error(message.rstrip()) from None
    inside = result > above if above is not None else minimum <= result <= maximum
    if not (inside and math.isfinite(result)):
        given = f"{result:g} {unit}".rstrip()
        message = f"{name} = {given} is not allowed; it must be {allowed}. {hint}"
        raise error(message.rstrip())
    return result


def whole(
    value: Any, name: str, *, minimum: int, maximum: int, error: type[SeatdynError] = ModelError
) -> int:
    """Return `value` as a whole number in `minimum` .. `maximum`, or raise `error`."""
    result = number(value, name, "", minimum=minimum, maximum=maximum, error=error)
    if result != int(result):
        raise error(f"{name} = {value!r} must be a whole number.")
    return int(value)  # by way of a float a large one would lose digits


# Units that a text may carry, by the SI unit that they stand for.
OTHER_UNITS: dict[str, dict[str, float]] = {
    "kg": {"g": 1e-3, "t": 1e3},
    "m": {"mm": 1e-3, "cm": 1e-2},
    "m2": {"mm2": 1e-6, "cm2": 1e-4},
    "m3": {"mm3": 1e-9, "cm3": 1e-6, "l": 1e-3},
    "m/s": {"mm/s": 1e-3, "km/h": 1 / 3.6},
    "s": {"ms": 1e-3},
    "N": {"kN": 1e3},
    "N/m": {"kN/m": 1e3, "N/mm": 1e3, "N/cm": 1e2},
    "N s/m": {"kN s/m": 1e3, "N s/mm": 1e3, "N s/cm": 1e2},
    "Pa": {"kPa": 1e3, "MPa": 1e6, "bar": 1e5},
}
WITH_UNIT = re.compile(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def in_unit(value: Any, name: str, unit: str) -> Any:
    """Return a text such as "12 kN/m" as a number in `unit`; anything else as it is.

    Raises
    ------
    ModelError
        A text that is no number with `unit` or a unit that stands for it.

    Examples
    --------
    >>> in_unit("12 kN/m", "Spring.stiffness", "N/m")
    12000.0
    """
    if not isinstance(value, str):
        return value
    units = {unit: 1.0, **OTHER_UNITS.get(unit, {})}
    match = WITH_UNIT.fullmatch(value)
    try:
        size, given = float(match[1] if match else value), match[2] if match else ""
    except ValueError:
        raise ModelError(
            f"{name} = {value!r} is not a number with a unit; write it like '1.5 {unit}'."
        ) from None
    if given not in units:
        known = ", ".join(units)
        raise ModelError(f"{name} = {value!r} is not in a unit that fits; use one of {known}.")
    return size * units[given]


def validated(obj: Any, *, error: type[SeatdynError] = ModelError) -> None:
    """Check and convert every `quantity` field of the frozen dataclass `obj`, in place."""
    for field in dataclasses.fields(obj):
        if "unit" not in field.metadata:
            continue
        value = number(
            getattr(obj, field.name),
            f"{type(obj).__name__}.{field.name}",
            field.metadata["unit"],
            **field.metadata["limits"],
            hint=field.metadata["hint"],
            error=error,
        )
        object.__setattr__(obj, field.name, value)


def suggestion(word: str, known: Iterable[str]) -> str:
    """Say `Did you mean ...?` with the nearest known words, or list what is known."""
    names = sorted(known)
    near = difflib.get_close_matches(word, names, n=3, cutoff=0.5)
    if near:
        return "Did you mean " + " or ".join(repr(name) for name in near) + "?"
    return "Known: " + ", ".join(names) + "."
