"""What the HTML report says, as data for its template."""

from __future__ import annotations

import math
from typing import Any

from seatdyn.output.report import render_report
from seatdyn.paper.cases import readings
from seatdyn.paper.claims_text import Claim
from seatdyn.paper.deviations import DEFINITIONS, TARGET, TARGETS, relative_deviation
from seatdyn.paper.explanations import EXPLANATIONS
from seatdyn.paper.figures import FIGURES
from seatdyn.paper.figures_delay import OWN_FIGURES
from seatdyn.paper.linear_tables import EXCEPTIONS, LinearCell
from seatdyn.paper.misprints import excluded_cells, load_misprints
from seatdyn.paper.presentation_random import random_overview, random_views
from seatdyn.paper.random_cases import RANDOM_READINGS
from seatdyn.paper.tables import (
    COLUMNS,
    GROUPS,
    TABLES,
    UNITS,
    Array,
    PrintedTable,
    printed_table,
)

MARKED = 0.01  # cells that deviate by more are marked
GROUP_NAMES = {
    "acceleration": "accelerations",
    "displacement": "displacements",
    "relative": "relative displacements",
    "force": "F_a, total, F_c",
    "nonlinear_force": "F_nl, F_a + F_nl",
}
MEANING = {
    "acc_m1": "acc. m1",
    "acc_m2": "acc. m2",
    "acc_seat": "acc. seat",
    "seat": "seat",
    "m1-seat": "m1 − seat",
    "m2-seat": "m2 − seat",
    "m2-m1": "m2 − m1",
    "F_damper": "damper F_a",
    "F_linear": "F_c + F_a",
    "F_spring": "spring F_c",
    "F_damper+nonlinear": "F_a + F_nl",
    "F_nonlinear": "F_nl",
}


def report_html(
    summary: dict[str, Any],
    linear: dict[str, list[LinearCell]],
    computed: dict[int, dict[str, Array]],
    ratios: dict[int, dict[str, Array]],
    claims: list[Claim],
    images: dict[str, bytes],
) -> str:
    """The report as one HTML document."""
    figures = [
        {"number": f.number, "caption": f.caption, "image": images[f.key]}
        for f in FIGURES
        if f.key in images
    ]
    own = [{"caption": f.caption, "image": images[f.key]} for f in OWN_FIGURES if f.key in images]
    return render_report(
        "report.html",
        {
            "overview": _overview(summary),
            "met": _targets_met(summary),
            "statistics": [_statistics(number, summary) for number in computed],
            "linear": [_linear(key, cells) for key, cells in linear.items()],
            "claims": claims,
            "tables": [view for number in computed for view in _views(number, computed[number])],
            "random": random_overview(summary),
            "ratios": random_views(ratios, MARKED),
            "random_readings": {r.name: r.text for r in RANDOM_READINGS},
            "figures": figures,
            "own_figures": own,
            "misprints": load_misprints(),
            "open": [claim for claim in claims if claim.verdict in ("open", "not confirmed")],
            "definitions": DEFINITIONS,
            "provenance": summary["provenance"],
            "target": percent(TARGET, 1),
            "marked": percent(MARKED, 0),
            "poles": summary["table02"],
            "parameters": summary["table01"],
        },
    )


def percent(value: float, digits: int = 2) -> str:
    """A fraction as per cent, with a true minus sign."""
    return f"{100 * value:.{digits}f} %".replace("-", "−")


def _overview(summary: dict[str, Any]) -> list[dict[str, Any]]:
    """One line per table: r.m.s. of every group under both readings."""
    lines = []
    for number in TABLES:
        table = printed_table(number)
        for reading in ("as_printed", "as_read"):
            found = summary[table.key][reading]
            cells = []
            for group in GROUPS:
                set_here = reading == "as_read" and group in TARGETS.get(number, ())
                rms = found[group]["rms"]
                state = ("met" if rms <= TARGET else "missed") if set_here else ""
                cells.append(
                    {
                        "rms": percent(rms),
                        "worst": percent(found[group]["worst"], 1),
                        "state": state,
                    }
                )
            lines.append({"table": number, "reading": reading, "cells": cells})
    return lines


def _targets_met(summary: dict[str, Any]) -> dict[str, Any]:
    """How many of the set targets are met, and which are not, with what they are at 1.579 Hz."""
    missed, count = [], 0
    for number, groups in TARGETS.items():
        found = summary[printed_table(number).key]
        for group in groups:
            count += 1
            rms = found["as_read"][group]["rms"]
            if rms <= TARGET:
                continue
            near = found.get("as_read_1.579_hz", {}).get(group, {}).get("rms")
            text = f"Table {number}, {GROUP_NAMES[group]}: {percent(rms)}"
            missed.append(text + (f" ({percent(near)} at 1.579 Hz)" if near is not None else ""))
    return {"count": count, "met": count - len(missed), "missed": missed}


def _statistics(number: int, summary: dict[str, Any]) -> dict[str, Any]:
    """All readings and groups of one table."""
    table = printed_table(number)
    lines = []
    for reading in readings(table.back_on):
        for group in GROUPS:
            found = summary[table.key][reading.name][group]
            set_here = reading.name == "as_read" and group in TARGETS.get(number, ())
            met = found["rms"] <= TARGET
            lines.append(
                {
                    "reading": reading.name,
                    "group": GROUP_NAMES[group],
                    "rms": percent(found["rms"]),
                    "rounding": percent(found["rounding"]),
                    "worst": percent(found["worst"]),
                    "cell": found["worst_cell"],
                    "excluded": ", ".join(found["excluded"]),
                    "verdict": ("met" if met else "missed") if set_here else "",
                }
            )
    return {
        "number": number,
        "lines": lines,
        "why": {GROUP_NAMES[g]: text for (n, g), text in EXPLANATIONS.items() if n == number},
        "readings": {r.name: r.text for r in readings(table.back_on)},
    }


def _linear(key: str, cells: list[LinearCell]) -> dict[str, Any]:
    """Table 1 or 2 as rows and columns; None where a row has no such cell."""
    columns = list(dict.fromkeys(cell.column for cell in cells))
    rows: dict[str, list[dict[str, Any] | None]] = {}
    units: dict[str, str] = {}
    for cell in cells:
        row = rows.setdefault(cell.row, [None] * len(columns))
        units[cell.row] = "" if cell.unit == "1" else cell.unit
        row[columns.index(cell.column)] = {
            "printed": cell.printed,
            "computed": f"{cell.computed:.9g}",
            "within": cell.within_rounding,
            "known": (cell.row, cell.column) in EXCEPTIONS,
        }
    return {"number": int(key[-2:]), "columns": columns, "rows": rows, "units": units}


def _views(number: int, computed: dict[str, Array]) -> list[dict[str, Any]]:
    """One table side by side with both readings; once where they agree."""
    table = printed_table(number)
    views = [_side_by_side(table, "as_read", computed["as_read"])]
    if not (computed["as_read"] == computed["as_printed"]).all():
        views.append(_side_by_side(table, "as_printed", computed["as_printed"]))
    return views


def _side_by_side(table: PrintedTable, reading: str, values: Array) -> dict[str, Any]:
    """Cells with print, result and deviation, marked and with footnotes."""
    deviation = relative_deviation(table.values, values)
    wrong = excluded_cells(table.number)
    notes: list[str] = []
    rows = []
    for i, value in enumerate(table.rows.tolist()):
        cells = []
        for j, column in enumerate(table.columns):
            misprint = wrong.get((table.labels[i], column))
            if misprint is not None:
                text = f"{table.cell(i, j)}: printed {misprint.printed}, likely {misprint.likely}"
                notes.append(f"{text} ({misprint.basis}).")
            off = float(deviation[i, j])
            decimals = max(0, -round(math.log10(2 * table.rounding[i, j])))
            cells.append(
                {
                    "printed": table.text[i][j],
                    "computed": f"{values[i, j]:.{decimals + 1}f}",
                    "deviation": "" if math.isnan(off) else f"{100 * off:+.2f}".replace("-", "−"),
                    "off": abs(off) > MARKED,
                    "note": len(notes) if misprint is not None else 0,
                }
            )
        rows.append({"value": f"{value:g}", "cells": cells})
    return {
        "number": table.number,
        "reading": reading,
        "text": next(r.text for r in readings(table.back_on) if r.name == reading),
        "body": "back-on" if table.back_on else "back-off",
        "parameter": table.parameter,
        "heads": [
            {"printed": printed, "meaning": MEANING.get(output, output), "unit": UNITS[group]}
            for printed, (output, group) in zip(table.columns, COLUMNS, strict=True)
        ],
        "rows": rows,
        "notes": notes,
    }
