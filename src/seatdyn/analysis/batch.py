"""Many steady states in one call: harmonic balance over arrays of parameters."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from seatdyn.analysis.balance import Array, balance, output_names
from seatdyn.analysis.outputs import output_unit, unique_names
from seatdyn.analysis.steady_balance import status_of
from seatdyn.analysis.transient import check_request
from seatdyn.errors import RequestError, SeatdynError, Status
from seatdyn.kernels.orbit import HIGH, LOW
from seatdyn.model.excitation import Sine
from seatdyn.model.system import SeatSystem
from seatdyn.units import number, suggestion

if TYPE_CHECKING:
    import xarray as xr

SEAT_MASS, FREQUENCY, LEVEL = "seat_mass", "frequency", "base_amplitude"


def steady_states(
    system: SeatSystem,
    excitation: Sine,
    parameters: Mapping[str, ArrayLike],
    *,
    tolerance: float = 1e-6,
    stability: bool = True,
) -> xr.Dataset:
    """Steady states by harmonic balance for many sets of parameters.

    A set that fails is a row with its status; its numbers are NaN.

    Parameters
    ----------
    system, excitation : what all sets have in common
    parameters : name -> values (p,), the same number of each: "seat_mass" in kg, "frequency" in Hz
        and "base_amplitude" in m/s2 peak, or "NAME.FIELD" of an element, such as
        "QuadraticDamper.coefficient"
    tolerance : of the error estimate, relative to the amplitude of each output
    stability : work out the largest Floquet multiplier, too; without it a motion that sticks at a
        jump, or grazes it, is not found out

    Returns
    -------
    xarray.Dataset
        amplitude (member, output), half of maximum minus minimum over the period; status,
        error_estimate, floquet_max (member); and the parameters.

    Raises
    ------
    RequestError
        An unknown parameter, or arrays of different lengths.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), sd.QuadraticDamper(0.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> beta = {"QuadraticDamper.coefficient": [0.0, 100.0]}
    >>> states = sd.steady_states(system, sd.Sine(1.55, amplitude=0.8857), beta)
    >>> states.amplitude.sel(output="acc_seat").values.round(4).tolist()
    [4.0163, 3.5688]
    """
    import xarray as xr

    import seatdyn

    check_request(system, excitation)
    if not isinstance(excitation, Sine):
        raise RequestError(f"excitation = {excitation!r} must be a Sine here; use steady_state.")
    tolerance = number(tolerance, "tolerance", "", above=0.0, error=RequestError)
    columns = _columns(system, parameters)
    members = len(next(iter(columns.values())))
    names = output_names(system)
    amplitude = np.full((members, len(names)), np.nan)
    error, largest = np.full(members, np.nan), np.full(members, np.nan)
    status = np.full(members, str(Status.CONVERGED), dtype=object)
    message = np.full(members, "", dtype=object)
    for p in range(members):
        values = {name: float(column[p]) for name, column in columns.items()}
        try:
            found = balance(*_member(system, excitation, values), tolerance)
        except SeatdynError as reason:
            status[p], message[p] = "refused", str(reason)
            continue
        assert found is not None
        multipliers, slowest = np.array([np.nan]), np.inf
        if stability and found.found:
            multipliers, slowest = found.floquet()
        how = status_of(found, slowest)
        status[p], message[p] = str(how), how.message
        error[p] = found.error
        if how.valid:
            amplitude[p] = (found.look.extrema[HIGH] - found.look.extrema[LOW]) / 2
            largest[p] = abs(multipliers[0]) if how is Status.CONVERGED else np.nan
    data = xr.Dataset(
        {
            "amplitude": (("member", "output"), amplitude, {"units": "see output_unit"}),
            "status": ("member", status.astype(str), {"units": "1"}),
            "message": ("member", message.astype(str), {"units": "1"}),
            "error_estimate": ("member", error, {"units": "1"}),
            "floquet_max": ("member", largest, {"units": "1"}),
        },
        coords={
            "output": names,
            "output_unit": ("output", [output_unit(name) for name in names]),
            **{name: ("member", column) for name, column in columns.items()},
        },
    )
    data.attrs = {
        "method": "hb",
        "tolerance": tolerance,
        "seatdyn_version": seatdyn.__version__,
        "inputs": json.dumps({"system": repr(system), "excitation": repr(excitation)}),
    }
    return data


def _columns(system: SeatSystem, parameters: Mapping[str, ArrayLike]) -> dict[str, Array]:
    """The parameters as arrays of one length, every name known."""
    known = [SEAT_MASS, FREQUENCY, LEVEL]
    for name, element in zip(unique_names(system.all_elements), system.all_elements, strict=True):
        fields = [key for key, f in type(element).__dataclass_fields__.items() if f.metadata]
        known += [f"{name}.{field}" for field in fields]
    columns = {}
    for name, values in parameters.items():
        if name not in known:
            raise RequestError(f"Nothing here is called {name!r}. {suggestion(name, known)}")
        columns[name] = np.atleast_1d(np.asarray(values, dtype=float))
    lengths = {name: len(column) for name, column in columns.items()}
    if not columns or len(set(lengths.values())) != 1:
        raise RequestError(
            f"parameters must hold arrays of one length, but have {lengths}; give each parameter "
            "as many values."
        )
    return columns


def _member(
    system: SeatSystem, excitation: Sine, values: Mapping[str, float]
) -> tuple[SeatSystem, Sine]:
    """System and excitation with one set of parameters."""
    names = unique_names(system.all_elements)
    changes: dict[int, dict[str, Any]] = {}
    for name, value in values.items():
        if "." in name:
            element, field = name.rsplit(".", 1)
            changes.setdefault(names.index(element), {})[field] = value
    own = (*system.seat.suspension, *system.elements)
    elements = tuple(replace(e, **changes[i]) if i in changes else e for i, e in enumerate(own))
    count = len(system.seat.suspension)
    mass = values.get(SEAT_MASS, system.seat.mass)
    seat = replace(system.seat, mass=mass, suspension=elements[:count])
    level = values.get(LEVEL, excitation.peak)
    frequency = values.get(FREQUENCY, excitation.frequency)
    motion = replace(excitation, frequency=frequency, amplitude=level, rms=None)
    return replace(system, seat=seat, elements=elements[count:]), motion
