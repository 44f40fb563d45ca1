"""From the transmissibility of a seat with one occupant to that with another.

A seat of dynamic stiffness S(f) carries the mass m of its frame and an occupant of apparent mass
M(f). The force in the seat is S (u - z) = -w^2 (m + M) z, with w = 2 pi f, u the motion of the base
and z that of the seat, so that

    T = z/u = S / (S - w^2 (m + M)),    or    (1 - 1/T) / (m + M) = w^2 / S.

The right side belongs to the seat alone: it is the same for every occupant. (Wei L, Griffin MJ.
The prediction of seat transmissibility from measures of seat impedance. J Sound Vib 214 (1998)
121-137.)
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from seatdyn.analysis.linear import Array, ComplexArray
from seatdyn.analysis.response import checked_frequencies, frequency_response
from seatdyn.errors import RequestError, Status
from seatdyn.model.body import SeatedBody
from seatdyn.units import MASS, number

if TYPE_CHECKING:
    import xarray as xr

Occupant = SeatedBody | ArrayLike


def swap_occupant(
    transmissibility: ArrayLike,
    *,
    frequency: ArrayLike,
    before: Occupant,
    after: Occupant,
    seat_mass: float,
) -> xr.Dataset:
    """Transmissibility of a linear seat with another occupant than the one it was found with.

    So a seat is measured once, with a dummy or one person, and predicted for others. It holds for a
    seat whose forces are linear and an occupant whose only support is the seat.

    Parameters
    ----------
    transmissibility : seat over base, complex (with its phase), (n,); measured, or from
        `frequency_response`
    frequency : Hz, > 0, (n,)
    before, after : occupants: a SeatedBody, or apparent masses in kg, complex, (n,)
    seat_mass : mass of the frame that moves with the seat surface, kg, 0 .. 1e6; 0 for a cushion

    Returns
    -------
    xarray.Dataset
        Over `frequency` in Hz, all complex: `transmissibility` seat over base with the other
        occupant; `dynamic_stiffness` S of the seat in N/m; `apparent_mass_before` and
        `apparent_mass_after` of the occupants in kg. S is infinite where the transmissibility is 1.

    Raises
    ------
    RequestError
        A transmissibility without phase, or zero; arrays of different lengths; a mass that is not
        finite; no mass at all on the seat.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(20.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    >>> dummy, person = sd.load_body("wei1998_1b"), sd.load_body("boileau1998")
    >>> f = [1.5, 3.0, 6.0]
    >>> measured = sd.frequency_response(sd.SeatSystem(dummy, seat), frequency=f)
    >>> found = sd.swap_occupant(
    ...     measured.transmissibility.sel(node="seat"),
    ...     frequency=f, before=dummy, after=person, seat_mass=20.0,
    ... )
    >>> direct = sd.frequency_response(sd.SeatSystem(person, seat), frequency=f)
    >>> bool(abs(found.transmissibility - direct.transmissibility.sel(node="seat")).max() < 1e-12)
    True
    """
    import xarray as xr

    from seatdyn import __version__

    f = checked_frequencies(frequency)
    frame = number(
        seat_mass, "seat_mass", "kg", minimum=0.0, maximum=MASS["maximum"], error=RequestError
    )
    t = _complex("transmissibility", transmissibility, f)
    if not np.iscomplexobj(np.asarray(transmissibility)):
        raise RequestError(
            "transmissibility has no phase; give complex values, such as H1 = G_xy/G_xx of a "
            "measurement, or magnitude * exp(i phase)."
        )
    if np.any(t == 0.0):
        raise RequestError(
            f"transmissibility[{int(np.argmax(t == 0.0))}] is zero: the seat does not move there, "
            "so nothing can be said of another occupant. Leave that frequency out."
        )
    masses = {name: _apparent_mass(name, who, f) for name, who in _named(before, after)}
    load = frame + masses["before"]
    if np.any(load == 0.0):
        raise RequestError(
            f"before: no mass moves on the seat at {f[int(np.argmax(load == 0.0))]:g} Hz, so the "
            "transmissibility does not know the stiffness of the seat."
        )
    compliance = (1.0 - 1.0 / t) / load  # w^2 / S
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffness = (2 * np.pi * f) ** 2 / compliance
        other = 1.0 / (1.0 - compliance * (frame + masses["after"]))
    units = {"units": "kg"}
    return xr.Dataset(
        {
            "transmissibility": ("frequency", other, {"units": "1", "long_name": "seat/base"}),
            "dynamic_stiffness": ("frequency", stiffness, {"units": "N/m"}),
            "apparent_mass_before": ("frequency", masses["before"], units),
            "apparent_mass_after": ("frequency", masses["after"], units),
        },
        {"frequency": ("frequency", f, {"units": "Hz", "long_name": "frequency"})},
        {
            "status": str(Status.OK),
            "seatdyn_version": __version__,
            "request": json.dumps(
                {"function": "swap_occupant", "seat_mass": frame}
                | {
                    name: who.name if isinstance(who, SeatedBody) else "apparent mass as given"
                    for name, who in _named(before, after)
                }
            ),
        },
    )


def _named(before: Occupant, after: Occupant) -> tuple[tuple[str, Occupant], ...]:
    return ("before", before), ("after", after)


def _apparent_mass(name: str, occupant: Occupant, f: Array) -> ComplexArray:
    """Apparent mass in kg of an occupant, (n,)."""
    if isinstance(occupant, SeatedBody):
        return np.asarray(frequency_response(occupant, frequency=f).apparent_mass.values)
    return _complex(name, occupant, f)


def _complex(name: str, values: ArrayLike, f: Array) -> ComplexArray:
    """Finite complex values, one for each frequency."""
    try:
        array = np.atleast_1d(np.asarray(values)).astype(complex)
    except (TypeError, ValueError):
        raise RequestError(
            f"{name} = {values!r} is of the wrong kind; give one complex number for each frequency"
            f"{'' if name == 'transmissibility' else ', or a SeatedBody'}."
        ) from None
    if array.shape != f.shape:
        raise RequestError(
            f"{name} has the shape {array.shape}, frequency {f.shape}; give one value for each."
        )
    if not np.all(np.isfinite(array)):
        i = int(np.argmin(np.isfinite(array)))
        raise RequestError(f"{name}[{i}] is not finite; leave {f[i]:g} Hz out.")
    return array
