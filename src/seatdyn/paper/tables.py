"""Printed tables: their cells, and what each column of Tables 3 to 8 stands for."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from functools import cache

import numpy as np
from numpy.typing import NDArray

from seatdyn.paper.misprints import excluded_cells, read_rows

Array = NDArray[np.float64]
TABLES = (3, 4, 5, 6, 7, 8)
GROUPS = ("acceleration", "displacement", "relative", "force", "nonlinear_force")

# Output of `steady_state` and group of every column, in the order of print. The headers F_cm and
# F_am+F_cm are exchanged in print (see column_names.csv), so they are told by place, not by name.
COLUMNS: tuple[tuple[str, str], ...] = (
    ("acc_m1", "acceleration"),
    ("acc_m2", "acceleration"),
    ("acc_seat", "acceleration"),
    ("m1", "displacement"),
    ("m2", "displacement"),
    ("seat", "displacement"),
    ("m2-m1", "relative"),
    ("m1-seat", "relative"),
    ("m2-seat", "relative"),
    ("F_damper", "force"),
    ("F_linear", "force"),
    ("F_spring", "force"),
    ("F_damper+nonlinear", "nonlinear_force"),
    ("F_nonlinear", "nonlinear_force"),
)
OUTPUTS = tuple(output for output, _ in COLUMNS)
UNITS = {
    "acceleration": "m/s2",
    "displacement": "m",
    "relative": "m",
    "force": "N",
    "nonlinear_force": "N",
}


@dataclass(frozen=True)
class PrintedCells:
    """Rows and columns of a printed table.

    number : of the table
    labels : names of the rows, ``"gamma=800"``
    columns : headers as printed
    text : the printed figures
    values : the same as numbers, (rows, columns)
    """

    number: int
    labels: tuple[str, ...]
    columns: tuple[str, ...]
    text: tuple[tuple[str, ...], ...]
    values: Array

    @property
    def key(self) -> str:
        """Name of files and of entries in the summary."""
        return f"table{self.number:02d}"

    @property
    def back_on(self) -> bool:
        """Whether the table is of the back-on body: those with even numbers are."""
        return self.number % 2 == 0

    @property
    def rounding(self) -> Array:
        """Half a unit of the last printed digit of every cell."""
        digits = [[int(Decimal(t).as_tuple().exponent) for t in line] for line in self.text]
        return np.asarray(0.5 * 10.0 ** np.array(digits, dtype=float))

    @property
    def excluded(self) -> NDArray[np.bool_]:
        """Cells that are certain misprints."""
        cells = excluded_cells(self.number)
        return np.array([[(r, c) in cells for c in self.columns] for r in self.labels])

    def cell(self, row: int, column: int) -> str:
        """Name of a cell, ``"gamma=800 F_gamma"``."""
        return f"{self.labels[row]} {self.columns[column]}"


@dataclass(frozen=True)
class PrintedTable(PrintedCells):
    """One of Tables 3 to 8; its values are SI, (r, 14).

    parameter : "gamma", "beta1" or "beta2"
    rows : values of the parameter, (r,)
    """

    parameter: str
    rows: Array


def group_columns(*groups: str) -> list[int]:
    """Positions of the columns of some groups."""
    return [i for i, (_, name) in enumerate(COLUMNS) if name in groups]


@cache
def printed_table(number: int) -> PrintedTable:
    """Read one of Tables 3 to 8 from the data of the package."""
    lines = read_rows(f"table{number:02d}.csv")
    parameter, *columns = lines[0]
    text = tuple(tuple(line[c] for c in columns) for line in lines)
    return PrintedTable(
        number=number,
        labels=tuple(f"{parameter}={line[parameter]}" for line in lines),
        columns=tuple(columns),
        text=text,
        values=np.array(text, dtype=float),
        parameter=parameter,
        rows=np.array([float(line[parameter]) for line in lines]),
    )
