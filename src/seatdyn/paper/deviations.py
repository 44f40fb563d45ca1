"""How far a computed table lies from the printed one: statistics per column group."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seatdyn.paper.tables import GROUPS, Array, PrintedCells, PrintedTable, group_columns

TARGET = 0.003  # r.m.s. of the relative deviation
# Table -> groups for which the target is set under the reading "as_read".
TARGETS: dict[int, tuple[str, ...]] = {
    5: ("acceleration", "force"),
    6: ("acceleration", "force", "displacement", "relative"),
    7: GROUPS,
    8: ("displacement", "relative", "force", "nonlinear_force"),
}
DEFINITIONS = {
    "unit": "relative deviations are fractions (0.003 = 0.3 %): (computed - printed) / printed",
    "amplitude": "(maximum - minimum) / 2 over one period of the steady state, SI units",
    "rms": "root mean square of the relative deviations over the cells of a group",
    "worst": "relative deviation of largest size, signed, in the cell worst_cell",
    "excluded": "single cells, certain misprints, left out of rms and worst",
    "zeros": "printed zeros: largest absolute value computed there, in the unit of the column",
    "rounding": "rms that the rounding of the print would give by itself (evenly spread errors)",
    "cells": "number of cells that rms and worst are over",
    "target": f"rms at most {TARGET}, for the groups where it is set (reading as_read)",
}


def relative_deviation(printed: Array, computed: Array) -> Array:
    """(computed - printed) / printed; NaN where the print is zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(printed == 0.0, np.nan, (computed - printed) / printed)


def group_statistics(table: PrintedTable, computed: Array, group: str) -> dict[str, Any]:
    """Deviation of one column group, see `DEFINITIONS`."""
    wanted = np.zeros(computed.shape, dtype=bool)
    wanted[:, group_columns(group)] = True
    return cell_statistics(table, computed, wanted)


def cell_statistics(
    table: PrintedCells, computed: Array, wanted: NDArray[np.bool_]
) -> dict[str, Any]:
    """Deviation of the cells `wanted`, see `DEFINITIONS`."""
    deviation = relative_deviation(table.values, computed)
    zero = table.values == 0.0
    counted = wanted.copy()
    left_out = np.argwhere(counted & table.excluded)
    zeros = np.argwhere(counted & zero)
    counted &= ~(table.excluded | zero)
    size = np.where(counted, np.abs(deviation), -1.0)
    worst = np.unravel_index(int(np.argmax(size)), size.shape)
    with np.errstate(divide="ignore"):
        half_unit = table.rounding / np.abs(table.values)
    return {
        "rms": float(np.sqrt(np.mean(deviation[counted] ** 2))),
        "worst": float(deviation[worst]),
        "worst_cell": table.cell(int(worst[0]), int(worst[1])),
        "rounding": float(np.sqrt(np.mean(half_unit[counted] ** 2 / 3.0))),
        "cells": int(counted.sum()),
        "excluded": [table.cell(*map(int, place)) for place in left_out],
        "zeros": {
            "cells": [table.cell(*map(int, place)) for place in zeros],
            "largest": float(max((abs(computed[tuple(p)]) for p in zeros), default=0.0)),
        },
    }


def table_statistics(table: PrintedTable, computed: Array) -> dict[str, dict[str, Any]]:
    """Deviation of every column group."""
    return {group: group_statistics(table, computed, group) for group in GROUPS}
