"""How the paper is read, and every row of Tables 3 to 8 computed under a reading."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from seatdyn.analysis.steady import steady_state
from seatdyn.errors import RequestError
from seatdyn.model.body import load_body
from seatdyn.model.elements import (
    CoulombFriction,
    Damper,
    NonlinearElement,
    PiecewiseSpring,
    QuadraticDamper,
    Spring,
)
from seatdyn.model.excitation import Sine
from seatdyn.model.seat import Seat
from seatdyn.model.system import SeatSystem
from seatdyn.paper.laws import offset_coulomb, offset_quadratic
from seatdyn.paper.tables import OUTPUTS, Array, group_columns, printed_table

if TYPE_CHECKING:
    import xarray as xr

BODIES = ("ksiazek1997_back_off", "ksiazek1997_back_on")
SEAT_MASS = 35.0  # m_0, kg
STIFFNESS = 9950.0  # c_m, N/m
DAMPING = 260.0  # alpha_m, N s/m
SLOPE = 1000.0  # s/m, of formula (5)
FREQUENCY = {False: 1.55, True: 1.58}  # Hz, Table 2, by back-on
AMPLITUDE = 0.8857  # m/s2 peak, from the linear rows; the paper states 0.686 r.m.s.
STATED_RMS = 0.686  # m/s2
PRINTED_ZONE = (0.02, 0.01)  # b_1, b_2 of formula (3), m
READ_ZONE = (0.01, 0.01)  # m, that fits Tables 3 and 4
TOLERANCE = 1e-9  # of the steady state, relative
ENERGY_RESIDUAL = 1e-6  # of the throughput
# Groups of Table 6 that carry the velocity offset; those of Table 5 do not.
OFFSET_GROUPS = {6: ("displacement", "relative"), 7: None, 8: None}


@dataclass(frozen=True)
class Reading:
    """One way to read the paper's sinusoidal study.

    name : key in the summary
    text : one line for people
    amplitude : peak acceleration of the base, m/s2
    frequency_on : Hz, of the back-on tables
    zone : bump and rebound clearance of formula (3), m
    offset : whether the velocity offset a/w stands where Tables 6 to 8 show it
    """

    name: str
    text: str
    amplitude: float = AMPLITUDE
    frequency_on: float = FREQUENCY[True]
    zone: tuple[float, float] = PRINTED_ZONE
    offset: bool = False

    def frequency(self, back_on: bool) -> float:
        """Excitation frequency in Hz."""
        return self.frequency_on if back_on else FREQUENCY[False]


AS_PRINTED = Reading("as_printed", "formulas and free zone as printed, 0.8857 m/s² peak")
AS_READ = Reading(
    "as_read",
    "free zone −0.01 … +0.01 m; velocity offset A/ω in (5), and in (4) for the displacements of "
    "Table 6; 0.8857 m/s² peak",
    zone=READ_ZONE,
    offset=True,
)
LITERAL = Reading(
    "literal_0.686_rms",
    "formulas and free zone as printed, 0.686 m/s² r.m.s. = 0.970 m/s² peak",
    amplitude=STATED_RMS * math.sqrt(2.0),
)
NEAR = tuple(
    replace(r, name=f"{r.name}_1.579_hz", text=f"{r.text}, 1.579 Hz", frequency_on=1.579)
    for r in (AS_PRINTED, AS_READ)
)


def readings(back_on: bool) -> tuple[Reading, ...]:
    """All readings under which a table is computed."""
    return (AS_PRINTED, AS_READ, LITERAL, *(NEAR if back_on else ()))


def paper_system(
    back_on: bool,
    element: NonlinearElement | None = None,
    *,
    damping: float = DAMPING,
    stiffness: float = STIFFNESS,
) -> SeatSystem:
    """The paper's body on its seat, with one non-linear element or none."""
    elements = (Spring(stiffness), Damper(damping), *((element,) if element else ()))
    return SeatSystem(load_body(BODIES[back_on]), Seat(SEAT_MASS, elements))


def law(parameter: str, value: float, zone: tuple[float, float], offset: float) -> NonlinearElement:
    """Formula (3), (4) or (5) with this value of "gamma", "beta1" or "beta2".

    zone : clearances of (3), m
    offset : added to the velocity in (4) and (5), m/s
    """
    if parameter == "gamma":
        return PiecewiseSpring(value, *zone)
    if parameter == "beta1":
        if offset:
            return offset_quadratic(coefficient=value, offset=offset)
        return QuadraticDamper(value)
    if offset:
        return offset_coulomb(friction=value, slope=SLOPE, offset=offset)
    return CoulombFriction(value, SLOPE)


@dataclass(frozen=True)
class Case:
    """One steady state: all that the amplitudes of a row depend on."""

    back_on: bool
    parameter: str
    value: float
    frequency: float
    amplitude: float
    zone: tuple[float, float] = PRINTED_ZONE
    offset: float = 0.0
    damping: float = DAMPING
    stiffness: float = STIFFNESS

    @property
    def system(self) -> SeatSystem:
        """Body, seat and law; the linear system where the parameter is zero."""
        element = law(self.parameter, self.value, self.zone, self.offset) if self.value else None
        return paper_system(self.back_on, element, damping=self.damping, stiffness=self.stiffness)

    @property
    def excitation(self) -> Sine:
        """Motion of the base."""
        return Sine(self.frequency, amplitude=self.amplitude)


def solve(system: SeatSystem, excitation: Sine, *, tolerance: float = TOLERANCE) -> xr.Dataset:
    """Steady state that may be compared with the print.

    Raises
    ------
    RequestError
        There is no steady state, or its energy does not balance.
    """
    data = steady_state(system, excitation, method="time", tolerance=tolerance)
    if data.attrs["status"] != "converged":
        raise RequestError(f"{system} at {excitation}: {data.attrs['message']}")
    residual = data.attrs["energy_residual"]
    if not residual <= ENERGY_RESIDUAL:  # NaN must not pass
        raise RequestError(
            f"{system} at {excitation}: the energy balance has a residual of {residual:.2g} of the "
            f"throughput (at most {ENERGY_RESIDUAL:g}); the result is not to be used. Report it."
        )
    return data


@cache
def amplitudes(case: Case) -> tuple[float, ...]:
    """Steady amplitudes of the 14 columns; computed once for each case of a run."""
    data = solve(case.system, case.excitation)
    return tuple(data.amplitude.sel(output=list(OUTPUTS)).values.tolist())


def row_case(number: int, value: float, reading: Reading, *, offset: bool) -> Case:
    """The case of one row of a table, with or without the velocity offset."""
    table = printed_table(number)
    f = reading.frequency(table.back_on)
    return Case(
        table.back_on,
        table.parameter,
        value,
        f,
        reading.amplitude,
        # what has no influence is kept equal, so that equal cases are known as such
        zone=reading.zone if table.parameter == "gamma" and value else PRINTED_ZONE,
        offset=reading.amplitude / (2 * math.pi * f) if offset and value else 0.0,
    )


def row_amplitudes(number: int, value: float, reading: Reading, *, offset: bool) -> Array:
    """One row of a table, (14,), with or without the velocity offset."""
    return np.array(amplitudes(row_case(number, value, reading, offset=offset)))


def compute_table(
    number: int, reading: Reading, *, progress: Callable[[float], None] | None = None
) -> Array:
    """All rows of a table under a reading, (rows, 14), SI.

    Raises
    ------
    RequestError
        A row has no steady state.
    """
    rows = printed_table(number).rows.tolist()
    shifted = reading.offset and number in OFFSET_GROUPS
    groups = OFFSET_GROUPS.get(number)
    values = np.empty((len(rows), len(OUTPUTS)))
    for i, value in enumerate(rows):
        values[i] = row_amplitudes(number, value, reading, offset=shifted and groups is None)
        if shifted and groups is not None:
            columns = [c for group in groups for c in group_columns(group)]
            values[i, columns] = row_amplitudes(number, value, reading, offset=True)[columns]
        if progress is not None:
            progress((i + 1) / len(rows))
    return values
