"""What the HTML report says about Tables 9 and 10, as data for its template."""

from __future__ import annotations

from typing import Any

from seatdyn.paper.deviations import relative_deviation
from seatdyn.paper.misprints import excluded_cells
from seatdyn.paper.random_cases import RANDOM_READINGS
from seatdyn.paper.random_tables import LAWS, RANDOM_GROUPS, RATIO_COLUMNS, printed_ratios
from seatdyn.paper.tables import Array

SYMBOLS = {"beta1": "quadratic (4)", "beta2": "Coulomb (5)", "gamma": "piecewise (3)"}
MEANING = {
    "acc_m1": "acc. m1",
    "acc_m2": "acc. m2",
    "acc_seat": "acc. seat",
    "m2-m1": "m2 − m1",
    "m1-seat": "m1 − seat",
    "m2-seat": "m2 − seat",
    "F_suspension": "suspension",
    "F_body": "body",
}


def random_overview(summary: dict[str, Any]) -> list[dict[str, Any]]:
    """One line per table, reading and law: r.m.s. and worst deviation of every group."""
    lines = []
    for number in (9, 10):
        for reading in RANDOM_READINGS:
            found = summary[f"table{number:02d}"][reading.name]
            for law in LAWS:
                cells = []
                for group in RANDOM_GROUPS:
                    one = found[group]["laws"][law]
                    cells.append(
                        {
                            "rms": signed(one["rms"], 3).lstrip("+"),
                            "worst": signed(one["worst"], 2),
                            "cell": one["worst_cell"],
                        }
                    )
                line = {"table": number, "reading": reading.name, "law": SYMBOLS[law]}
                lines.append(line | {"cells": cells})
    return lines


def signed(share: float, digits: int) -> str:
    """A fraction in per cent with its sign, a true minus."""
    return f"{100 * share:+.{digits}f}".replace("-", "−")


def random_views(computed: dict[int, dict[str, Array]], marked: float) -> list[dict[str, Any]]:
    """Both tables side by side with every reading, as those of the other tables."""
    return [
        _side_by_side(number, reading.name, reading.text, computed[number][reading.name], marked)
        for number in computed
        for reading in RANDOM_READINGS
    ]


def _side_by_side(
    number: int, reading: str, text: str, values: Array, marked: float
) -> dict[str, Any]:
    table = printed_ratios(number)
    ratio, low, high = values
    deviation = relative_deviation(table.values, ratio)
    wrong = excluded_cells(number)
    notes: list[str] = []
    rows = []
    for i, name in enumerate(table.labels):
        cells = []
        for j, column in enumerate(table.columns):
            misprint = wrong.get((name, column))
            if misprint is not None:
                cell = f"{table.cell(i, j)}: printed {misprint.printed}, likely {misprint.likely}"
                notes.append(f"{cell} ({misprint.basis}).")
            off = float(deviation[i, j])
            cells.append(
                {
                    "printed": table.text[i][j],
                    "computed": f"{ratio[i, j]:.4f} ± {(high[i, j] - low[i, j]) / 2:.4f}",
                    "deviation": signed(off, 2),
                    "off": abs(off) > marked,
                    "note": len(notes) if misprint is not None else 0,
                }
            )
        rows.append({"value": name, "cells": cells})
    return {
        "number": number,
        "reading": reading,
        "text": text,
        "body": "back-on" if table.back_on else "back-off",
        "parameter": "law, level",
        "heads": [
            {"printed": printed, "meaning": MEANING[output], "unit": "ratio"}
            for printed, (output, _) in zip(table.columns, RATIO_COLUMNS, strict=True)
        ],
        "rows": rows,
        "notes": notes,
    }
