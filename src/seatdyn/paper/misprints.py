"""The paper's misprints: which cell, what it should be, how sure that is and why."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from functools import cache
from importlib import resources

DATA = resources.files("seatdyn.paper") / "data"


@dataclass(frozen=True)
class Misprint:
    """One suspected misprint.

    Parameters
    ----------
    table : number of the table as text, or the place in the text (``"eq. (3)"``)
    row : row of the table as ``"gamma=800"``; ``"header"`` or a range where it is no single cell
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
    def cell(self) -> tuple[int, float, str] | None:
        """Table, value of the row's parameter and column; None where it is no single cell."""
        name, _, value = self.row.partition("=")
        if not self.table.isdigit() or name not in ("gamma", "beta1", "beta2"):
            return None
        try:
            return int(self.table), float(value), self.column
        except ValueError:  # a range of rows
            return None

    @property
    def excluded(self) -> bool:
        """Whether the cell is left out of the statistics: single, and certain."""
        return self.cell is not None and self.confidence == "high"


def read_rows(name: str) -> list[dict[str, str]]:
    """Rows of a data file of the reproduction, every value as the text in the file."""
    text = (DATA / name).read_text(encoding="utf-8")
    return list(csv.DictReader(io.StringIO(text, newline="")))


@cache
def load_misprints() -> tuple[Misprint, ...]:
    """All suspected misprints of Tables 1 to 8 and of the text around them."""
    return tuple(Misprint(**row) for row in read_rows("misprints.csv"))


def excluded_cells(table: int) -> dict[tuple[float, str], Misprint]:
    """Cells of a table that are left out of the statistics: (parameter, column) -> misprint."""
    return {
        (m.cell[1], m.cell[2]): m
        for m in load_misprints()
        if m.excluded and m.cell is not None and m.cell[0] == table
    }
