"""The paper's back-off seat for heyoka: Taylor series, every break of a law as an event."""

from __future__ import annotations

import math

import numpy as np


def integrator(case, omega, level, tolerance):
    """Compiled integrator of a case of `time_response`, and its start parameters.

    The parameters are the branch of the law: the sign of the velocity for quadratic damping; in
    contact (1) or free (0) and the end of the free zone for the stops.
    """
    import heyoka as hy

    x, x1, x2, v, v1, v2 = hy.make_vars("x", "x1", "x2", "v", "v1", "v2")
    d = x + level / omega**2 * hy.sin(omega * hy.time)
    s = v + level / omega * hy.cos(omega * hy.time)

    def sign(integrator, direction):
        integrator.pars[0] = direction
        return True

    def stop(edge, outward):
        def contact(integrator, direction):
            integrator.pars[0] = float(direction == outward)
            if len(integrator.pars) > 1:
                integrator.pars[1] = edge
            return True

        return hy.t_event(d - edge, callback=contact)

    law, events, start = 0.0, [], []
    if case.startswith("quadratic"):
        law, events, start = 1000.0 * hy.par[0] * s * s, [hy.t_event(s, callback=sign)], [1.0]
    elif case.startswith("Coulomb"):
        law = 50.0 * 2 / math.pi * hy.atan(1000.0 * s)
    elif case.startswith("gap"):
        law, start = 1000.0 * hy.par[0] * (d - hy.par[1]), [0.0, 0.0]
        events = [stop(0.01, 1), stop(-0.02, -1)]
    elif case.startswith("jump"):
        law, start = 1000.0 * hy.par[0] * d, [0.0]
        events = [stop(0.01, 1), stop(-0.02, -1)]

    e1, w1, e2, w2 = x1 - x, v1 - v, x2 - x, v2 - v
    active = -97323.2354 * e1 + 2226.0653 * w1 + 1960.5176 * (x2 + x) - 1164.3525 * (v2 + v)
    f1, f2 = 11972.5557 * e1 + 3251.9783 * w1, 22456.7485 * e2 + 519.0440 * w2
    rates = {x: v, x1: v1, x2: v2}
    rates |= {v: (f1 + f2 - 9950.0 * d - 260.0 * s - law) / 35.0}
    rates |= {v1: (active - f1) / 9.1, v2: (-active - f2) / 61.7}
    options = {"t_events": events} if events else {}
    made = hy.taylor_adaptive(
        list(rates.items()), np.zeros(6), tol=tolerance, pars=start, **options
    )
    return made, start


def travel(made, start, base, grid):
    """Travel on the grid, where the base is at `base`, from rest at time 0."""
    made.time = 0.0
    made.state[:] = 0.0
    made.pars[:] = start
    if made.with_events:
        made.reset_cooldowns()
    made.propagate_until(grid[0])
    return made.propagate_grid(grid)[-1][:, 0] - base


LANES = 4  # sets that heyoka's batch mode runs at once: the doubles of a vector register


def batch_integrator(case, omega, level, tolerance):
    """Compiled batch integrator of a case of `many_runs`, and the start of what its law remembers.

    Parameters of every lane: mass, stiffness, damping, strength of the law; then the branch as in
    `integrator`.
    """
    import heyoka as hy

    x, x1, x2, v, v1, v2 = hy.make_vars("x", "x1", "x2", "v", "v1", "v2")
    d = x + level / omega**2 * hy.sin(omega * hy.time)
    s = v + level / omega * hy.cos(omega * hy.time)

    def sign(integrator, direction, lane):
        integrator.pars[4, lane] = direction
        return True

    def stop(edge, outward):
        def contact(integrator, direction, lane):
            integrator.pars[4, lane] = float(direction == outward)
            if len(integrator.pars) > 5:
                integrator.pars[5, lane] = edge
            return True

        return hy.t_event_batch(d - edge, callback=contact)

    events, start = [], []
    if case.startswith("quadratic"):
        law, events, start = hy.par[4] * s * s, [hy.t_event_batch(s, callback=sign)], [1.0]
    elif case.startswith("Coulomb"):
        law = 2 / math.pi * hy.atan(1000.0 * s)
    else:
        gap = case.startswith("gap")
        law = hy.par[4] * (d - hy.par[5] if gap else d)
        start = [0.0, 0.0] if gap else [0.0]
        events = [stop(0.01, 1), stop(-0.02, -1)]
    e1, w1, e2, w2 = x1 - x, v1 - v, x2 - x, v2 - v
    active = -97323.2354 * e1 + 2226.0653 * w1 + 1960.5176 * (x2 + x) - 1164.3525 * (v2 + v)
    f1, f2 = 11972.5557 * e1 + 3251.9783 * w1, 22456.7485 * e2 + 519.0440 * w2
    rates = {x: v, x1: v1, x2: v2}
    rates |= {v: (f1 + f2 - hy.par[1] * d - hy.par[2] * s - hy.par[3] * law) / hy.par[0]}
    rates |= {v1: (active - f1) / 9.1, v2: (-active - f2) / 61.7}
    options = {"t_events": events} if events else {}
    pars = np.zeros((4 + len(start), LANES))
    pars[0] = 1.0
    made = hy.taylor_adaptive_batch(
        list(rates.items()), np.zeros((6, LANES)), tol=tolerance, pars=pars, **options
    )
    return made, start


def batch_seats(made, start, sets, grid):
    """Motion of the seat on the grid, from rest at time 0, for sets of parameters (p, 4)."""
    rows = []
    for first in range(0, len(sets), LANES):
        lanes = np.resize(sets[first : first + LANES], (LANES, 4))
        made.set_time(0.0)
        made.state[:] = 0.0
        made.pars[:4] = lanes.T
        made.pars[4:] = np.reshape(start, (-1, 1))
        if made.with_events:
            made.reset_cooldowns()
        made.propagate_until(grid[0])
        motion = made.propagate_grid(np.repeat(grid[:, None], LANES, axis=1))[-1]
        rows += list(motion[:, 0, : len(sets) - first].T)
    return np.array(rows)
