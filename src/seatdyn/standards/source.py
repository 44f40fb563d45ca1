"""Where a constant of a standard is from, and how sure we are of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Grade(StrEnum):
    """How a constant was obtained. None was read in the standard itself."""

    CHECKED = "found and checked"  # in a public transcription, and confirmed by a second route
    FOUND = "found"  # in a public transcription
    RECALLED = "recalled"  # generally known; no transcription was read
    UNCERTAIN = "recalled, uncertain"  # as before, and to be looked up before it is relied on


@dataclass(frozen=True)
class Constant:
    """A number that a standard gives, with its clause and grade.

    Parameters
    ----------
    value : in `unit`
    unit : SI
    clause : standard, edition and clause
    grade : see `Grade`
    """

    value: float
    unit: str
    clause: str
    grade: Grade

    def __float__(self) -> float:
        """The number alone."""
        return self.value
