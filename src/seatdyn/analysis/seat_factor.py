"""SEAT factor of a linear system from spectra.

    SEAT = [int G |T|^2 |W|^2 df / int G |W|^2 df]^(1/2)

with G the acceleration density of the base, T the transmissibility from base to seat and W the
weighting Wk on both (ISO 10326-1, ISO 2631-1). There is no cushion in the model: the seat surface,
where a SEAT factor is taken, is the node "seat", the frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.linear import Linearise
from seatdyn.analysis.random_linear import linear_response
from seatdyn.model.system import SeatSystem
from seatdyn.signals.spectrum import Derived, Spectrum
from seatdyn.standards.weighting import Weighting, weighting

Array = NDArray[np.float64]
WEIGHTING = "Wk"  # vertical, on a seat


def seat_factor(system: SeatSystem, spectrum: Spectrum, *, linearise: Linearise = None) -> float:
    """SEAT factor of the linear part of a system under a base motion of this spectrum.

    Parameters
    ----------
    system : what its non-linear elements add is left out, or their tangent taken
    spectrum : of the acceleration of the base, in its band
    linearise : as in `poles`

    Returns
    -------
    float
        R.m.s. acceleration of what the occupant sits on over that of the base, both weighted by
        Wk; 1. NaN for an unstable system, which has none.
    """
    weighted = Weighted(spectrum, weighting(WEIGHTING))
    response = linear_response(system, weighted, linearise=linearise)
    return float(response.rms.sel(output=f"acc_{system.contact}")) / weighted.acceleration_rms()


@dataclass(frozen=True)
class Weighted(Derived):
    """A spectrum times the square of a weighting: filters of a linear system may change places."""

    weighting: Weighting

    def inside(self, frequency: Array) -> Array:
        """Weighted density."""
        return np.asarray(
            self.spectrum.density(frequency) * np.abs(self.weighting.factor(frequency)) ** 2
        )
