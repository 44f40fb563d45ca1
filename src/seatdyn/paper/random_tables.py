"""Tables 9 and 10 as printed: ratios of r.m.s. values, non-linear over linear suspension."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from seatdyn.paper.deviations import cell_statistics
from seatdyn.paper.misprints import read_rows
from seatdyn.paper.tables import Array, PrintedCells

RANDOM_TABLES = (9, 10)
RANDOM_GROUPS = ("acceleration", "relative", "force")
LAWS = ("beta1", "beta2", "gamma")
# Output of `random_response` and group of every column, in the order of print.
RATIO_COLUMNS: tuple[tuple[str, str], ...] = (
    ("acc_m1", "acceleration"),
    ("acc_m2", "acceleration"),
    ("acc_seat", "acceleration"),
    ("m2-m1", "relative"),
    ("m1-seat", "relative"),
    ("m2-seat", "relative"),
    ("F_suspension", "force"),
    ("F_body", "force"),
)
RATIO_OUTPUTS = tuple(output for output, _ in RATIO_COLUMNS)


@dataclass(frozen=True)
class PrintedRatios(PrintedCells):
    """Table 9 or 10.

    rows : parameter ("beta1", "beta2" or "gamma"), its value as printed, level over a_0
    """

    rows: tuple[tuple[str, float, int], ...]

    def statistics(self, computed: Array) -> dict[str, dict[str, Any]]:
        """Deviation of every column group, of all laws together and of each (`laws`)."""
        law = np.array([parameter for parameter, _, _ in self.rows])
        group = np.array([name for _, name in RATIO_COLUMNS])
        found = {}
        for name in RANDOM_GROUPS:
            whole = np.broadcast_to(group == name, computed.shape)
            found[name] = cell_statistics(self, computed, whole)
            found[name]["laws"] = {
                one: cell_statistics(self, computed, whole & (law == one)[:, None]) for one in LAWS
            }
        return found


@cache
def printed_ratios(number: int) -> PrintedRatios:
    """Read Table 9 or 10 from the data of the package."""
    lines = read_rows(f"table{number:02d}.csv")
    columns = tuple(lines[0])[3:]
    text = tuple(tuple(line[c] for c in columns) for line in lines)
    rows = tuple((line["parameter"], float(line["value"]), int(line["n"])) for line in lines)
    return PrintedRatios(
        number=number,
        labels=tuple(row_name(*row) for row in rows),
        columns=columns,
        text=text,
        values=np.array(text, dtype=float),
        rows=rows,
    )


def row_name(parameter: str, value: float, level: int) -> str:
    """Name of a row, ``"beta1=500, 2a0"``."""
    return f"{parameter}={value:g}, {'' if level == 1 else level}a0"
