"""The paper's misprints: which cell, what it should be, how sure that is and why."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass
from functools import cache
from importlib import resources

DATA = resources.files("seatdyn.paper") / "data"
# A row of Tables 3 to 8, or with a level one of Tables 9 and 10; not a range of rows.
ROW = re.compile(r"(gamma|beta1|beta2)=\d+(, [248]?a0)?")


@dataclass(frozen=True)
class Misprint:
    """One suspected misprint.

    Parameters
    ----------
    table : number of the table as text, or the place in the text (``"eq. (3)"``)
    row : row of the table as ``"gamma=800"``, with its level in Tables 9 and 10 (``"gamma=100,
        2a0"``); ``"header"`` or a range where it is no single cell
    column : header of the column as printed
    printed, likely : what stands there, and what most likely should
    confidence : ``"high"``, ``"low"``, or a remark
    basis : why
    """

    table: str
    row: str
    column: str
    printed: str
    likely: str
    confidence: str
    basis: str

    @property
    def excluded(self) -> bool:
        """Whether the cell is left out of the statistics: single, and certain."""
        single = self.table.isdigit() and ROW.fullmatch(self.row) is not None
        return single and self.confidence == "high"


def read_rows(name: str) -> list[dict[str, str]]:
    """Rows of a data file of the reproduction, every value as the text in the file."""
    text = (DATA / name).read_text(encoding="utf-8")
    return list(csv.DictReader(io.StringIO(text, newline="")))


@cache
def load_misprints() -> tuple[Misprint, ...]:
    """All suspected misprints of Tables 1 to 10 and of the text around them."""
    return tuple(Misprint(**row) for row in read_rows("misprints.csv"))


def excluded_cells(table: int) -> dict[tuple[str, str], Misprint]:
    """Cells of a table that are left out of the statistics: (row, column) -> misprint."""
    return {(m.row, m.column): m for m in load_misprints() if m.excluded and m.table == str(table)}
