"""What a laboratory seat test asks for: persons, masses, agreement of runs, limits of acceptance.

The limits are data that a user can replace (`data/iso7096_2000.toml`): they could not be read in
the standard itself and are marked `verified = false`.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from seatdyn.errors import RequestError
from seatdyn.standards.source import Constant, Grade
from seatdyn.units import number

_ISO_10326 = "ISO 10326-1:2016, clause 10"
_ISO_7096 = "ISO 7096:2000, clause 5"
RUNS = Constant(3.0, "1", _ISO_10326, Grade.FOUND)
RUN_AGREEMENT = Constant(0.05, "1", _ISO_10326, Grade.FOUND)  # of the mean of the runs
INERT_MASS = Constant(75.0, "kg", _ISO_10326, Grade.FOUND)  # of the damping test, within 1 %
LIGHT_PERSON = tuple(Constant(m, "kg", _ISO_7096, Grade.RECALLED) for m in (52.0, 55.0))
HEAVY_PERSON = tuple(Constant(m, "kg", _ISO_7096, Grade.RECALLED) for m in (98.0, 103.0))
# sine of the damping test: the smaller of this share of the travel and this height, peak to peak
DAMPING_TRAVEL = Constant(0.4, "1", _ISO_7096, Grade.UNCERTAIN)
DAMPING_HEIGHT = Constant(0.05, "m", _ISO_7096, Grade.UNCERTAIN)
# and its frequencies, relative to the expected resonance
DAMPING_RANGE = tuple(Constant(r, "1", _ISO_7096, Grade.UNCERTAIN) for r in (0.5, 2.0))


@dataclass(frozen=True)
class AcceptanceLimit:
    """What a class asks of a seat.

    Parameters
    ----------
    input_class : such as "EM3"
    machines : what the class is for
    seat_factor : largest SEAT factor, 1
    resonance : largest transmissibility at resonance, 1
    verified : whether someone compared the numbers with the standard itself
    source, grade : where they are from
    """

    input_class: str
    machines: str
    seat_factor: float
    resonance: float
    verified: bool
    source: str
    grade: str


def verdict(limit: float, low: float, high: float) -> str:
    """Whether a value is below a limit, as far as its interval tells.

    Returns
    -------
    str
        "below" (or at it), "above", or "undecided": the limit lies inside the interval, or there
        is no value.

    Examples
    --------
    >>> verdict(1.0, 0.90, 0.95), verdict(1.0, 0.98, 1.03)
    ('below', 'undecided')
    """
    return "below" if high <= limit else "above" if low > limit else "undecided"


def acceptance_limits(path: str | Path | None = None) -> dict[str, AcceptanceLimit]:
    """Limits of acceptance by input class.

    Parameters
    ----------
    path : a TOML file like the one in the package, or None for that one, which is unverified

    Raises
    ------
    RequestError
        A file that is missing, not TOML, or lacks a field.

    Examples
    --------
    >>> import seatdyn as sd
    >>> limit = sd.acceptance_limits()["EM6"]
    >>> limit.seat_factor, limit.verified
    (0.7, False)
    """
    if path is None:
        name = "iso7096_2000.toml"
        text = (files("seatdyn.standards") / "data" / name).read_text(encoding="utf-8")
    else:
        name = str(path)
        try:
            text = Path(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise RequestError(f"Limits {name!r} cannot be read: {error}.") from None
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise RequestError(f"Limits {name!r} is not valid TOML: {error}.") from None
    classes = _field(data, "classes", dict, name)
    return {key: _limit(key, classes[key], data, name) for key in classes}


def _limit(key: str, row: Any, head: dict[str, Any], name: str) -> AcceptanceLimit:
    where = f"{name}: [classes.{key}]"
    if not isinstance(row, dict):
        raise RequestError(f"Limits {where} must be a table with machines, seat_factor, resonance.")

    def ratio(field: str) -> float:
        value = _field(row, field, (int, float), where)
        return number(value, f"{where} {field}", "", minimum=0.0, maximum=100.0, error=RequestError)

    return AcceptanceLimit(
        input_class=key,
        machines=_field(row, "machines", str, where),
        seat_factor=ratio("seat_factor"),
        resonance=ratio("resonance"),
        verified=_field(head, "verified", bool, name),
        source=_field(head, "source", str, name),
        grade=_field(head, "grade", str, name),
    )


def _field(table: dict[str, Any], field: str, kind: Any, where: str) -> Any:
    if field not in table or not isinstance(table[field], kind):
        raise RequestError(
            f"Limits {where}: the field {field!r} is missing or of the wrong kind. Compare it with "
            "iso7096_2000.toml of the package."
        )
    return table[field]
