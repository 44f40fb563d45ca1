"""Fields of model objects that know their unit and admissible range.

`quantity("N/m", minimum=0)` declares a field of a frozen dataclass; `validated(self)` in
`__post_init__` turns its value into a float and refuses what is outside the range with a message
that names object, field, value, unit, range and what to do.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Iterable
from typing import Any

from seatdyn.errors import ModelError, SeatdynError


def quantity(
    unit: str,
    *,
    default: Any = dataclasses.MISSING,
    minimum: float = -math.inf,
    above: float | None = None,
    hint: str = "",
) -> Any:
    """Dataclass field holding one number in `unit` (SI), finite, and >= `minimum` or > `above`."""
    metadata = {"unit": unit, "minimum": minimum, "above": above, "hint": hint}
    return dataclasses.field(default=default, metadata=metadata)


def number(
    value: Any,
    name: str,
    unit: str,
    *,
    minimum: float = -math.inf,
    above: float | None = None,
    hint: str = "",
    error: type[SeatdynError] = ModelError,
) -> float:
    """Return `value` as a float, or raise `error` that names it, its unit, range and next step."""
    if above is not None:
        allowed = f"a finite number > {above:g} {unit}"
    elif minimum > -math.inf:
        allowed = f"a finite number >= {minimum:g} {unit}"
    else:
        allowed = f"a finite number in {unit}"
    allowed = allowed.rstrip()
    if isinstance(value, str | bytes | bool):
        raise error(f"{name} = {value!r} is not a number; it must be {allowed}. {hint}".rstrip())
    try:
        result = float(value)
    except (TypeError, ValueError):
        message = f"{name} = {value!r} is not a number; it must be {allowed}. {hint}"
        raise error(message.rstrip()) from None
    inside = math.isfinite(result) and (result > above if above is not None else result >= minimum)
    if not inside:
        raise error(f"{name} = {result:g} {unit} is not allowed; it must be {allowed}. {hint}".rstrip())
    return result


def validated(obj: Any, *, error: type[SeatdynError] = ModelError) -> None:
    """Check and convert every `quantity` field of the frozen dataclass `obj`, in place."""
    for field in dataclasses.fields(obj):
        if "unit" not in field.metadata:
            continue
        limits = field.metadata
        value = number(
            getattr(obj, field.name),
            f"{type(obj).__name__}.{field.name}",
            limits["unit"],
            minimum=limits["minimum"],
            above=limits["above"],
            hint=limits["hint"],
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
