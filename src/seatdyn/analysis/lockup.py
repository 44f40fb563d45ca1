"""Lock-up of a suspension with dry friction: the level below which it does not move.

Locked, seat and base move as one, so that the suspension carries M(f) a, with M the apparent mass
of seat and body together. It breaks away where that reaches the force at which its friction gives
way, F: a = F / |M(f)|. For one mass this is Den Hartog's condition F < m a (1931, Trans. ASME 53).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

import seatdyn
from seatdyn.analysis.response import checked_frequencies, frequency_response
from seatdyn.analysis.transient import check_request
from seatdyn.errors import RequestError, Status
from seatdyn.model.body import SEAT
from seatdyn.model.excitation import Still
from seatdyn.model.system import BASE, SeatSystem, refuse_delays

if TYPE_CHECKING:
    import xarray as xr


def lockup_boundary(system: SeatSystem, frequency: ArrayLike) -> xr.Dataset:
    """Peak base acceleration of a sine below which the suspension sticks.

    Parameters
    ----------
    system : with dry friction between base and seat: an element whose force jumps at zero velocity
    frequency : Hz, > 0

    Returns
    -------
    xarray.Dataset
        level (m/s2 peak) over frequency. Attribute break_away_N.

    Raises
    ------
    RequestError
        A system without dry friction between base and seat (smooth friction creeps at any level),
        or a non-linear element that acts with a delay.

    Examples
    --------
    >>> import seatdyn as sd
    >>> dry = sd.StribeckFriction(30.0, 30.0, 0.1, dry=True)
    >>> mass = sd.SeatedBody("inert", {"seat": 40.0}, ())
    >>> system = sd.SeatSystem(mass, sd.Seat(20.0, [sd.Spring(9000.0), dry]))
    >>> sd.lockup_boundary(system, [2.0]).level.values.round(6).tolist()
    [0.5]
    """
    import xarray as xr

    check_request(system, Still())
    f = np.asarray(checked_frequencies(frequency), dtype=float)
    hold = break_away(system)
    # what is locked sees no travel, so that only laws may be late in it
    refuse_delays(tuple(sorted({e.delay for e in system.nonlinear_elements} - {0.0})))
    if not hold > 0.0:
        raise RequestError(
            "lockup_boundary needs dry friction between base and seat: an element whose force "
            "jumps at zero velocity, such as StribeckFriction(..., dry=True). Smooth friction "
            "creeps at any level."
        )
    body = np.full(f.shape, system.body.support_mass, dtype=complex)
    if system.body.nodes:
        body = frequency_response(system.body, frequency=f)["apparent_mass"].to_numpy()
    level = hold / np.abs(system.seat.mass + body)
    return xr.Dataset(
        {"level": (("frequency",), level, {"units": "m/s2", "long_name": "peak acceleration"})},
        coords={"frequency": ("frequency", f, {"units": "Hz"})},
        attrs={
            "status": str(Status.OK),
            "break_away_N": hold,
            "system": repr(system),
            "seatdyn_version": seatdyn.__version__,
        },
    )


def break_away(system: SeatSystem) -> float:
    """Force in N up to which the elements between base and seat hold it at rest."""
    total = 0.0
    for element in system.nonlinear_elements:
        law = element.lower()
        dry = any(b.jumps and b.velocity != 0.0 and b.value == 0.0 for b in law.breaks)
        if dry and set(element.between) == {BASE, SEAT}:
            tiny = np.nextafter(0.0, 1.0)
            up, down = (law.function(0.0, sign * tiny, law.parameters) for sign in (1.0, -1.0))
            total += min(up, -down)
    return float(total)
