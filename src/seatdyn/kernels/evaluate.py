"""Force laws at many points."""

from __future__ import annotations

import numpy as np

from seatdyn.kernels.call import call_law
from seatdyn.kernels.jit import kernel
from seatdyn.kernels.memory import call_memory_force, call_memory_rate


@kernel
def evaluate(address, parameters, d, v):
    """Forces (p,) of the law at `address` at displacements d and velocities v (p,)."""
    result = np.empty(d.size)
    for i in range(d.size):
        result[i] = call_law(address, d[i], v[i], parameters, 0)
    return result


@kernel
def evaluate_memory(force, rate, parameters, motion, states):
    """Force and rates (p, 1+q) of a law with states at motions d, v, w, a (p, 4), states (p, q)."""
    count, q = states.shape
    result = np.empty((count, 1 + q))
    now, out = np.empty(q), np.empty(q)
    for i in range(count):
        for j in range(q):
            now[j] = states[i, j]
        d, v, w, a = motion[i, 0], motion[i, 1], motion[i, 2], motion[i, 3]
        result[i, 0] = call_memory_force(force, d, v, now, 0, parameters, 0)
        call_memory_rate(rate, d, v, w, a, now, 0, parameters, 0, out)
        for j in range(q):
            result[i, 1 + j] = out[j]
    return result
