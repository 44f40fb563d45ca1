"""Tables as CSV in blocks: printed, computed, deviation; of ratios also their intervals."""

from __future__ import annotations

import numpy as np

from seatdyn.paper.deviations import relative_deviation
from seatdyn.paper.linear_tables import LinearCell
from seatdyn.paper.random_tables import PrintedRatios
from seatdyn.paper.tables import COLUMNS, UNITS, Array, PrintedTable, printed_table
from seatdyn.paper.writing import OutputFolder


def number(value: float, digits: int = 9) -> str:
    """Text of a number; empty where there is none."""
    return "" if np.isnan(value) else f"{value:.{digits}g}"


def write_amplitudes(folder: OutputFolder, table: PrintedTable, computed: dict[str, Array]) -> None:
    """Write one of Tables 3 to 8; the blocks computed and deviation once for each reading.

    Deviations are relative, and empty where the print is zero.
    """
    rows: list[list[str]] = []
    values = [f"{value:g}" for value in table.rows]
    for value, text in zip(values, table.text, strict=True):
        rows.append(["printed", "", value, *text])
    for reading, array in computed.items():
        deviation = relative_deviation(table.values, array)
        for block, content, digits in (("computed", array, 9), ("deviation", deviation, 4)):
            for value, line in zip(values, content, strict=True):
                rows.append([block, reading, value, *(number(x, digits) for x in line.tolist())])
    header = ["block", "reading", table.parameter, *table.columns]
    folder.write_csv(f"tables/{table.key}.csv", header, rows)


def write_ratios(folder: OutputFolder, table: PrintedRatios, computed: dict[str, Array]) -> None:
    """Write Table 9 or 10; the blocks computed, low, high and deviation once for each reading."""
    rows: list[list[str]] = []
    names = [[parameter, f"{value:g}", str(n)] for parameter, value, n in table.rows]
    for name, text in zip(names, table.text, strict=True):
        rows.append(["printed", "", *name, *text])
    for reading, array in computed.items():
        deviation = relative_deviation(table.values, array[0])
        blocks = {"computed": array[0], "low": array[1], "high": array[2], "deviation": deviation}
        for block, content in blocks.items():
            digits = 4 if block == "deviation" else 6
            for name, line in zip(names, content, strict=True):
                rows.append([block, reading, *name, *(number(x, digits) for x in line.tolist())])
    header = ["block", "reading", "parameter", "value", "n", *table.columns]
    folder.write_csv(f"tables/{table.key}.csv", header, rows)


def write_linear(folder: OutputFolder, key: str, cells: list[LinearCell], first: str) -> None:
    """Write Table 1 or 2; deviations are differences in the unit of the cell."""
    columns = list(dict.fromkeys(cell.column for cell in cells))
    names = list(dict.fromkeys(cell.row for cell in cells))
    place = {(cell.row, cell.column): cell for cell in cells}
    with_unit = len({cell.unit for cell in cells}) > 1
    rows = []
    for block in ("printed", "computed", "deviation"):
        for name in names:
            found = [place.get((name, column)) for column in columns]
            unit = [next(cell.unit for cell in found if cell)] if with_unit else []
            rows.append([block, name, *unit, *(_text(cell, block) for cell in found)])
    folder.write_csv(f"tables/{key}.csv", ["block", first, *["unit"] * with_unit, *columns], rows)


def _text(cell: LinearCell | None, block: str) -> str:
    if cell is None:  # Table 2 has two poles for a body alone, three with a suspension
        return ""
    if block == "printed":
        return cell.printed
    return number(cell.computed, 9) if block == "computed" else f"{cell.deviation:.3g}"


def write_columns(folder: OutputFolder) -> None:
    """Write what each printed header of Tables 3 to 8 stands for."""
    rows = []
    for number_ in (3, 5, 7):
        table = printed_table(number_)
        for header, (output, group) in zip(table.columns, COLUMNS, strict=True):
            rows.append([f"{number_};{number_ + 1}", header, output, UNITS[group], group])
    folder.write_csv(
        "tables/columns.csv", ["tables", "printed_header", "output", "unit", "group"], rows
    )
