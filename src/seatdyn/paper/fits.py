"""Least-squares fits of single constants to printed cells: how the readings were tried."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from seatdyn.model.elements import NonlinearElement
from seatdyn.paper.cases import (
    AMPLITUDE,
    DAMPING,
    FREQUENCY,
    PRINTED_ZONE,
    STIFFNESS,
    Case,
    paper_system,
    solve,
)
from seatdyn.paper.deviations import relative_deviation
from seatdyn.paper.tables import OUTPUTS, Array, printed_table

FIT_TOLERANCE = 1e-7  # of the steady state; the print has four digits at most
STEP = 1e-4  # relative, for the derivatives


@dataclass(frozen=True)
class Fit:
    """Fitted constants, their standard errors, and what is left.

    values, errors : name -> value, in the units of the start values
    rms : of the relative deviations
    cells : number of printed cells used
    """

    values: dict[str, float]
    errors: dict[str, float]
    rms: float
    cells: int

    def text(self, name: str, digits: int = 4) -> str:
        """One constant with its error."""
        return f"{self.values[name]:.{digits}f} ± {self.errors[name]:.{digits}f}"


def solve_roughly(case: Case, element: NonlinearElement | None = None) -> Array:
    """Steady amplitudes, (14,), as accurate as a fit needs; `element` in place of the case's."""
    system = case.system
    if element is not None:
        system = paper_system(case.back_on, element, damping=case.damping, stiffness=case.stiffness)
    data = solve(system, case.excitation, tolerance=FIT_TOLERANCE)
    return np.asarray(data.amplitude.sel(output=list(OUTPUTS)).values)


def fit(
    number: int,
    start: dict[str, float],
    *,
    columns: Sequence[int],
    rows: Sequence[int],
    fixed: dict[str, float] | None = None,
    element: Callable[[float, float], NonlinearElement] | None = None,
) -> Fit:
    """Fit constants to some printed cells of a table; excluded cells and zeros do not count.

    Parameters
    ----------
    number : of the table
    start : constants to fit with start values: amplitude (m/s2), frequency (Hz), offset (m/s),
        drift (offset in units of a/w), factor (on the row's parameter), stiffness (N/m), damping
        (N s/m), bump and rebound (m, free zone), width (m/s, of `element`)
    columns, rows : positions of the columns and rows used
    fixed : the same constants, held
    element : law made from the row's parameter and `width`, in place of the printed one
    """
    from scipy.optimize import least_squares

    table = printed_table(number)
    places = np.ix_(list(rows), list(columns))
    printed, counted = table.values[places], ~table.excluded[places] & (table.values[places] != 0.0)
    names = list(start)

    def residuals(x: Array) -> Array:
        constants = {**(fixed or {}), **dict(zip(names, x.tolist(), strict=True))}
        computed = []
        for value in table.rows[list(rows)].tolist():
            own = element(value, constants["width"]) if element is not None else None
            computed.append(solve_roughly(fit_case(number, value, constants), own))
        deviation = relative_deviation(printed, np.array(computed)[:, list(columns)])
        return np.asarray(deviation[counted])

    x0 = np.array(list(start.values()))
    found = least_squares(
        residuals,
        x0,
        bounds=(0.0, np.inf),
        x_scale=np.abs(x0),
        diff_step=STEP,
        xtol=1e-6,
        ftol=1e-6,
    )
    cells = int(counted.sum())
    variance = 2 * found.cost / max(cells - x0.size, 1)
    errors = np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac)) * variance)
    return Fit(
        dict(zip(names, found.x.tolist(), strict=True)),
        dict(zip(names, errors.tolist(), strict=True)),
        math.sqrt(2 * found.cost / cells),
        cells,
    )


def fit_case(number: int, value: float, constants: dict[str, float]) -> Case:
    """The case of a row with some of its constants replaced."""
    table = printed_table(number)
    c = {"amplitude": AMPLITUDE, "frequency": FREQUENCY[table.back_on], **constants}
    drift = c.get("drift", 0.0) * c["amplitude"] / (2 * math.pi * c["frequency"])
    case = Case(
        table.back_on,
        table.parameter,
        value * c.get("factor", 1.0),
        c["frequency"],
        c["amplitude"],
        zone=(c.get("bump", PRINTED_ZONE[0]), c.get("rebound", PRINTED_ZONE[1])),
        offset=c.get("offset", 0.0) + drift,
    )
    return replace(case, damping=c.get("damping", DAMPING), stiffness=c.get("stiffness", STIFFNESS))
