"""SEAT factor of a linear system from spectra.

    SEAT = [int G |T|^2 |W|^2 df / int G |W|^2 df]^(1/2)

with G the acceleration density of the base, T the transmissibility from base to seat and W the
weighting Wk on both (ISO 10326-1, ISO 2631-1). There is no cushion in the model: the seat surface,
where a SEAT factor is taken, is the node "seat", the frame.
"""

from __future__ import annotations

import numpy as np

from seatdyn.analysis.linear import Linearise, poles
from seatdyn.analysis.response import frequency_response
from seatdyn.model.body import SEAT
from seatdyn.model.system import SeatSystem
from seatdyn.signals.spectrum import Array, Spectrum, integrate
from seatdyn.standards.weighting import weighting

WEIGHTING = "Wk"  # vertical, on a seat
AROUND = np.array([-8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 8.0])  # half-widths of a resonance


def seat_factor(system: SeatSystem, spectrum: Spectrum, *, linearise: Linearise = None) -> float:
    """SEAT factor of the linear part of a stable system under a base motion of this spectrum.

    Parameters
    ----------
    system : stable; what its non-linear elements add is left out, or their tangent taken
    spectrum : of the acceleration of the base, in its band
    linearise : as in `poles`

    Returns
    -------
    float
        R.m.s. acceleration of the seat over that of the base, both weighted by Wk; 1.

    Notes
    -----
    Gauss quadrature between the knots of the spectrum and points around every resonance, so that a
    lightly damped one cannot fall between.
    """
    wk = weighting(WEIGHTING)

    def base(f: Array) -> Array:
        return np.asarray(spectrum.density(f) * np.abs(wk.factor(f)) ** 2)

    def seat(f: Array) -> Array:
        flat = frequency_response(system, frequency=f.ravel(), linearise=linearise)
        t = flat.transmissibility.sel(node=SEAT).values.reshape(f.shape)
        return np.asarray(base(f) * np.abs(t) ** 2)

    found = poles(system, linearise=linearise)
    width = np.abs(found["real"].values) / (2 * np.pi)
    near = (found.fd.values[:, None] + width[:, None] * AROUND).ravel()
    inside = near[(near > spectrum.low) & (near < spectrum.high)]
    points = np.union1d(spectrum.knots, inside)
    return float(np.sqrt(integrate(seat, points).sum() / integrate(base, points).sum()))
