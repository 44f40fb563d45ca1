"""Linear response to a harmonic force on a node, the base at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from seatdyn.analysis.linear import (
    ComplexArray,
    Linearisable,
    Linearise,
    as_linear_model,
    dynamic_stiffness,
    labelled,
)
from seatdyn.analysis.response import checked_frequencies

if TYPE_CHECKING:
    import xarray as xr


def receptance(
    system: Linearisable, *, node: str, frequency: ArrayLike, linearise: Linearise = None
) -> xr.Dataset:
    """Displacement of every node per harmonic force on one node.

    Parameters
    ----------
    system, linearise : as in `poles`
    node : free node that the force acts on, upwards
    frequency : Hz, finite, > 0, in any order

    Returns
    -------
    xarray.Dataset
        Over `node` and `frequency` in Hz, complex: `receptance` z/F in m/N and `accelerance` z''/F
        in m/s2 per N. They are z = (K + i w C - w^2 M)^-1 F, delayed forces and elements with
        states included.

    Raises
    ------
    RequestError
        An unknown node, or a frequency that is not finite or not > 0.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(20.0, [sd.Spring(9500.0), sd.Damper(600.0)])
    >>> system = sd.SeatSystem(sd.load_body("fairley1989"), seat)
    >>> static = sd.receptance(system, node="seat", frequency=[1e-4]).receptance[0, 0]
    >>> round(float(abs(static)) * 9500.0, 6)
    1.0
    """
    model = as_linear_model(system, linearise, delays=True, memory=True)
    f = checked_frequencies(frequency)
    s: ComplexArray = np.asarray(2j * np.pi * f, dtype=complex)
    unit = np.zeros((f.size, model.size, 1))
    unit[:, model.index(node)] = 1.0
    motion = np.linalg.solve(dynamic_stiffness(model, s), unit)[..., 0].T
    dims = ("node", "frequency")
    return labelled(
        {
            "receptance": (dims, motion, "m/N", "displacement per force"),
            "accelerance": (dims, s**2 * motion, "m/s2/N", "acceleration per force"),
        },
        {"frequency": ("frequency", f, {"units": "Hz"}), "node": list(model.nodes)},
        model,
        {"function": "receptance", "node": node, "linearise": linearise},
    )
