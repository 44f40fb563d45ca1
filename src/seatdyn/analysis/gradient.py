"""Exact sensitivities of steady states: amplitudes and their gradients to any parameters."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import seatdyn
from seatdyn.analysis.balance import (
    Array,
    Balanced,
    balance,
    condense,
    output_rows,
)
from seatdyn.analysis.outputs import output_unit
from seatdyn.analysis.parameters import parameters_of, require_known, with_parameters
from seatdyn.analysis.steady_balance import status_of
from seatdyn.analysis.transient import check_request
from seatdyn.errors import ModelError, RequestError, Status
from seatdyn.kernels.jit import BALANCE, CompileNotice
from seatdyn.kernels.orbit import HIGH, HIGH_PHASE, LOW, LOW_PHASE
from seatdyn.kernels.sensitivity import sensitivity
from seatdyn.model.excitation import Sine
from seatdyn.model.system import SeatSystem, refuse_memory
from seatdyn.units import number

if TYPE_CHECKING:
    import xarray as xr

STEP = 1e-5  # of a parameter, relative: of the differences at the motion found
JUMPING = 1e-2  # rad: a peak that moves more over two steps has given way to another


def steady_gradient(
    system: SeatSystem,
    excitation: Sine,
    parameters: Sequence[str],
    *,
    tolerance: float = 1e-6,
) -> xr.Dataset:
    """Steady amplitudes and peaks by harmonic balance, and their derivatives to parameters.

    The derivatives follow from the implicit function theorem: one set of linear equations for each
    parameter, with the tangent of the equations solved, and no further steady state. Where forces
    jump or have kinks, the crossings move with the parameter; that is part of the derivative.

    Parameters
    ----------
    system, excitation : system with elements that harmonic balance takes
    parameters : names: "seat_mass", "delay", "frequency", "base_amplitude"; "NAME.FIELD" of an
        element, such as "Damper.coefficient"; of the body "m1.mass", "m1-seat.stiffness",
        "m1-seat.damping" and its gains, such as "k11". None may be zero.
    tolerance : of the error estimate of the amplitudes, relative; derivatives have fewer digits,
        most of all with steep laws (friction, hard stops)

    Returns
    -------
    xarray.Dataset
        amplitude, maximum, minimum (output); amplitude_gradient, maximum_gradient, minimum_gradient
        (parameter, output), in the unit of the output per unit of the parameter; value and
        parameter_unit (parameter). Attributes: status, error_estimate, stable. A derivative is NaN
        where two peaks are equally high and the higher one changes, where the motion meets other
        breaks on either side of the parameter, and everywhere with status "grazing": a motion that
        touches a jump has no derivative.

    Raises
    ------
    RequestError
        An unknown parameter, or one that is zero or at the end of its range; an element with states
        of its own.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), sd.QuadraticDamper(100.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> names = ["Damper.coefficient", "QuadraticDamper.coefficient"]
    >>> found = sd.steady_gradient(system, sd.Sine(1.55, amplitude=0.8857), names)
    >>> found.amplitude_gradient.sel(output="acc_seat").values.round(5).tolist()
    [-0.01132, -0.00354]
    """
    check_request(system, excitation)
    if not isinstance(excitation, Sine):
        raise RequestError(f"excitation = {excitation!r} must be a Sine here; use steady_state.")
    refuse_memory([element.name for element in system.memory_elements])
    tolerance = number(tolerance, "tolerance", "", above=0.0, error=RequestError)
    names = list(parameters)
    require_known(system, excitation, names)
    found = balance(system, excitation, tolerance)
    assert found is not None
    multipliers, slowest = np.full(1, np.nan, complex), np.inf
    if found.found:
        multipliers, slowest = found.floquet()
    status = status_of(found, slowest)
    shape = (3, len(names), len(found.names))
    extrema, gradients = np.full((2, shape[2]), np.nan), np.full(shape, np.nan)
    if status.valid:
        extrema = found.look.extrema[[HIGH, LOW]].copy()
    if status.valid and status is not Status.GRAZING:
        gradients = _gradients(found, system, excitation, names)
    return _dataset(found, excitation, names, extrema, gradients, status, multipliers, tolerance)


def _gradients(
    found: Balanced, system: SeatSystem, excitation: Sine, names: Sequence[str]
) -> Array:
    """Derivatives of amplitude, maximum and minimum, (3, parameters, outputs)."""
    work, look = found.work, found.look
    known = parameters_of(system, excitation)
    gradients = np.full((3, len(names), len(found.names)), np.nan)
    result = np.empty((2, 4, len(found.names)))
    factors = 0
    for p, name in enumerate(names):
        value = known[name][0]
        step = STEP * abs(value)
        sides = []
        for sign in (1.0, -1.0):
            try:
                there = with_parameters(system, excitation, {name: value + sign * step})
            except ModelError as reason:
                raise RequestError(f"No derivative to {name} = {value:g}: {reason}") from None
            problem = condense(*there)
            assert problem is not None
            own = work._replace(response=np.zeros_like(work.response))
            sides.append((problem, own, look._replace(rows=output_rows(there[0])[1])))
        if step == 0.0 or sides[0][0].delays.size != found.problem.delays.size:
            raise RequestError(
                f"No derivative to {name} = {value:g}: it needs a value other than zero; give a "
                "small one."
            )
        with CompileNotice(BALANCE):
            factors, same = sensitivity(
                found.problem, work, found.samples, step, tuple(sides), factors, result
            )
        if factors == 0 and system.channels:
            break
        slopes = (result[0, :2] - result[1, :2]) / (2 * step)
        moved = np.abs(result[0, 2:] - result[1, 2:])
        moved = np.minimum(moved, 2 * np.pi - moved)
        slopes[moved[[HIGH_PHASE - 2, LOW_PHASE - 2]] > JUMPING] = np.nan
        if same:
            gradients[:, p] = (slopes[HIGH] - slopes[LOW]) / 2, slopes[HIGH], slopes[LOW]
    return gradients


def _dataset(
    found: Balanced,
    excitation: Sine,
    names: Sequence[str],
    extrema: Array,
    gradients: Array,
    status: Status,
    multipliers: NDArray[np.complex128],
    tolerance: float,
) -> xr.Dataset:
    import xarray as xr

    known = parameters_of(found.system, excitation)
    note, per = {"units": "see output_unit"}, {"units": "output_unit per parameter_unit"}
    high, low = extrema
    smooth = status is Status.CONVERGED
    return xr.Dataset(
        {
            "amplitude": ("output", (high - low) / 2, note),
            "maximum": ("output", high, note),
            "minimum": ("output", low, note),
            "amplitude_gradient": (("parameter", "output"), gradients[0], per),
            "maximum_gradient": (("parameter", "output"), gradients[1], per),
            "minimum_gradient": (("parameter", "output"), gradients[2], per),
            "value": ("parameter", [known[n][0] for n in names], {"units": "see parameter_unit"}),
        },
        coords={
            "output": found.names,
            "output_unit": ("output", [output_unit(name) for name in found.names]),
            "parameter": names,
            "parameter_unit": ("parameter", [known[name][1] for name in names]),
        },
        attrs={
            "method": "hb",
            "status": str(status),
            "message": status.message,
            "tolerance": tolerance,
            "error_estimate": found.error,
            "floquet_max": float(np.abs(multipliers[0])) if smooth else float("nan"),
            "stable": int(smooth and np.abs(multipliers[0]) < 1.0),
            "seatdyn_version": seatdyn.__version__,
            "inputs": json.dumps({"system": repr(found.system), "excitation": repr(excitation)}),
        },
    )
