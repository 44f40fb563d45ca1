"""Force laws at many points."""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.call import call_law
from seatdyn.kernels.jit import kernel


@kernel
def evaluate(address, parameters, d, v):
    """Forces (p,) of the law at `address` at displacements d and velocities v (p,)."""
    result = np.empty(d.size)
    for i in range(d.size):
        result[i] = call_law(address, d[i], v[i], parameters, 0)
    return result
