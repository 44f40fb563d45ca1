"""Table 1 (parameters, zero and pole counts) and Table 2 (poles) beside what the model gives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal

from seatdyn.analysis.linear import poles
from seatdyn.analysis.zeros import zeros
from seatdyn.model.body import SeatedBody, load_body
from seatdyn.paper.cases import BODIES, paper_system
from seatdyn.paper.misprints import read_rows

# Stated in the head of Table 1 for both bodies.
COUNTS = {"mass sum": "70.8", "zeros": "3", "poles": "4"}
# Printed numbers of Table 2 that the exact pole does not round to.
EXCEPTIONS = {("back_on+VIS", "pole1_re_Hz"), ("back_on+VIS", "pole1_f0_Hz")}


@dataclass(frozen=True)
class LinearCell:
    """One printed number of Table 1 or 2 and ours."""

    row: str
    column: str
    unit: str
    printed: str
    computed: float

    @property
    def deviation(self) -> float:
        """Computed minus printed, in the unit of the cell."""
        return self.computed - float(self.printed)

    @property
    def within_rounding(self) -> bool:
        """Whether the print is ours rounded to the digits printed."""
        half = 0.5 * 10.0 ** int(Decimal(self.printed).as_tuple().exponent)
        return abs(self.deviation) <= half * (1 + 1e-9)


def table01() -> list[LinearCell]:
    """Parameters of both bodies as the catalogue has them, mass sum, and counts of the body alone.

    The counts are of the transmissibility from the seat to m1, the body on a rigid, moving seat.
    """
    cells = []
    bodies = {"back_off": load_body(BODIES[False]), "back_on": load_body(BODIES[True])}
    carried = {name: body_parameters(body) for name, body in bodies.items()}
    for line in read_rows("table01.csv"):
        for name in bodies:
            value = carried[name][line["parameter"]]
            cells.append(LinearCell(line["parameter"], name, line["unit"], line[name], value))
    for name, body in bodies.items():
        counts = {
            "mass sum": body.total_mass,
            "zeros": float(zeros(body, output="m1").sizes["zero"]),
            "poles": float(poles(body).sizes["root"]),
        }
        for row, value in counts.items():
            unit = "kg" if row == "mass sum" else "1"
            cells.append(LinearCell(row, name, unit, COUNTS[row], value))
    return cells


def body_parameters(body: SeatedBody) -> dict[str, float]:
    """Parameters of one of the paper's bodies under the names of Table 1."""
    first, second = body.links
    gains = {term.name: term.gain for force in body.feedback for term in force.terms}
    return {
        "m1": body.masses["m1"],
        "k1": first.stiffness,
        "alpha1": first.damping,
        "m2": body.masses["m2"],
        "k2": second.stiffness,
        "alpha2": second.damping,
        **gains,
    }


def table02() -> list[LinearCell]:
    """Poles divided by 2 pi, fastest first as in print: both parts, f0 and fd in Hz."""
    cells = []
    for line in read_rows("table02.csv"):
        back_on = line["model"].startswith("back_on")
        alone = not line["model"].endswith("VIS")
        found = poles(load_body(BODIES[back_on]) if alone else paper_system(back_on))
        for i in range(found.sizes["mode"]):
            mode = found.isel(mode=-1 - i)
            fd = float(mode["fd"])
            real = float(mode["real"]) / (2 * math.pi)
            values = {"re": real, "im": fd, "f0": float(mode["f0"]), "fd": fd}
            for key, value in values.items():
                column = f"pole{i + 1}_{key}_Hz"
                cells.append(LinearCell(line["model"], column, "Hz", line[column], value))
    return cells


def outside_rounding(cells: list[LinearCell]) -> list[LinearCell]:
    """Cells whose print is not ours rounded."""
    return [cell for cell in cells if not cell.within_rounding]
