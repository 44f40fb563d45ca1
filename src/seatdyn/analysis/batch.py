"""Many steady states in one call: harmonic balance over arrays of parameters."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from seatdyn.analysis.balance import (
    MOST_SAMPLES,
    Array,
    balance,
    output_names,
    solve,
    spaces,
)
from seatdyn.analysis.balance_many import balance_many
from seatdyn.analysis.members import Members
from seatdyn.analysis.outputs import output_unit
from seatdyn.analysis.parameters import require_known, with_parameters
from seatdyn.analysis.run import interruptible
from seatdyn.analysis.steady_balance import status_of
from seatdyn.analysis.transient import check_request
from seatdyn.errors import RequestError, SeatdynError, Status
from seatdyn.kernels.jit import BALANCE, CompileNotice
from seatdyn.kernels.orbit import HIGH, LOW
from seatdyn.model.excitation import Sine
from seatdyn.model.system import SeatSystem
from seatdyn.units import number, suggestion

if TYPE_CHECKING:
    import xarray as xr

ALL = slice(None)
UNKNOWN = np.array([np.nan])  # multipliers that are not asked for
FEWEST_TOGETHER = 16  # sets from which on it pays to compile what solves several at once


def steady_states(
    system: SeatSystem,
    excitation: Sine,
    parameters: Mapping[str, ArrayLike],
    *,
    tolerance: float = 1e-6,
    stability: bool = True,
    outputs: Sequence[str] | None = None,
) -> xr.Dataset:
    """Steady states by harmonic balance for many sets of parameters.

    A set that fails is a row with its status; its numbers are NaN. Sets of smooth laws whose
    stability is not asked for are solved several at once, and those that this leaves one by one.

    Parameters
    ----------
    system, excitation : what all sets have in common
    parameters : name -> values (p,), the same number of each: "seat_mass" in kg, "frequency" in Hz
        and "base_amplitude" in m/s2 peak, or "NAME.FIELD" of an element, such as
        "QuadraticDamper.coefficient"; those of the body and the delay as in `steady_gradient`
    tolerance : of the error estimate, relative to the amplitude of each output
    stability : work out the largest Floquet multiplier, too; without it a motion that sticks at a
        jump, or grazes it, is not found out
    outputs : names of those wanted, all if None; few take less time

    Returns
    -------
    xarray.Dataset
        amplitude (member, output), half of maximum minus minimum over the period; status,
        error_estimate, floquet_max (member); and the parameters.

    Raises
    ------
    RequestError
        An unknown parameter or output, or arrays of different lengths.

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
    columns = _columns(system, excitation, parameters)
    size = len(next(iter(columns.values())))
    names = output_names(system)
    wanted = _places(names, outputs)
    names = [names[o] for o in wanted]
    amplitude = np.full((size, len(wanted)), np.nan)
    error, largest = np.full(size, np.nan), np.full(size, np.nan)
    status = np.full(size, str(Status.CONVERGED), dtype=object)
    message = np.full(size, Status.CONVERGED.message, dtype=object)
    members = Members(system, excitation, columns)
    with CompileNotice(BALANCE), interruptible():
        together = np.nonzero(members.known)[0]
        if not stability and len(together) >= FEWEST_TOGETHER and members.smooth:
            many = members.many(together, wanted)
            amplitude[together], error[together] = balance_many(many, tolerance)
        alone = np.nonzero(np.isnan(error))[0]
        if members.known[alone].any():
            rows = members.rows(ALL, wanted)
            space = spaces(system, rows[0], MOST_SAMPLES)
        for p in map(int, alone):
            try:
                if members.known[p]:
                    found = solve(system, members[p], rows[p], names, *space, tolerance)
                    those: Any = ALL
                else:
                    values = {name: float(column[p]) for name, column in columns.items()}
                    own = balance(*with_parameters(system, excitation, values), tolerance)
                    assert own is not None
                    found, those = own, wanted
            except SeatdynError as reason:
                status[p], message[p] = "refused", str(reason)
                continue
            multipliers, slowest = UNKNOWN, np.inf
            if stability and found.found:
                multipliers, slowest = found.floquet()
            how = status_of(found, slowest)
            status[p], message[p] = str(how), how.message
            error[p] = found.error
            if how.valid:
                swing = (found.look.extrema[HIGH] - found.look.extrema[LOW]) / 2
                amplitude[p] = swing[those]
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


def _places(names: list[str], outputs: Sequence[str] | None) -> list[int]:
    """Places of the outputs wanted among all names."""
    if outputs is None:
        return list(range(len(names)))
    for output in outputs:
        if output not in names:
            raise RequestError(f"No output is called {output!r}. {suggestion(output, names)}")
    return [names.index(output) for output in outputs]


def _columns(
    system: SeatSystem, excitation: Sine, parameters: Mapping[str, ArrayLike]
) -> dict[str, Array]:
    """The parameters as arrays of one length, every name known."""
    require_known(system, excitation, list(parameters))
    columns = {
        name: np.atleast_1d(np.asarray(values, dtype=float)) for name, values in parameters.items()
    }
    lengths = {name: len(column) for name, column in columns.items()}
    if not columns or len(set(lengths.values())) != 1:
        raise RequestError(
            f"parameters must hold arrays of one length, but have {lengths}; give each parameter "
            "as many values."
        )
    return columns
