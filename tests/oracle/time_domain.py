"""Time integration with DOP853 and Newton shooting, for all laws.

The periodic orbit is the fixed point of the map over one period.  The monodromy matrix comes from
central differences of the map; it is kept while the gap keeps shrinking (chord Newton), so only
the map itself needs full accuracy.

Jump law: the integration stops at each crossing of an edge of the free zone.  The crossing time is
found on the dense output, then corrected by integrating up to it again, so that the interpolation
error does not enter.  Smooth laws: one run over the period.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from equations import COULOMB_SLOPE, DAMPING, SEAT_MASS, STIFFNESS, Array, Case
from peaks import Segment, amplitudes
from scipy.integrate import solve_ivp

RTOL = 1e-13
ATOL = 1e-16
STEPS_PER_PERIOD = 400  # at least; the interpolant is of order 7
GRID_PER_STEP = 4  # points per solver step in the search for peaks
MONODROMY_STEP = 1e-6


def scalar_force(case: Case, stiffness: float) -> Callable[[float, float], float]:
    """N(d, v) as a plain Python function; stiffness is the jump law's in the current zone."""
    law = case.law
    coefficient, offset = law.coefficient, law.offset
    if law.kind == "jump":
        return lambda d, v: stiffness * d
    if law.kind == "quadratic":
        return lambda d, v: coefficient * abs(v + offset) * (v + offset)
    factor = 2 * coefficient / math.pi
    return lambda d, v: factor * math.atan(COULOMB_SLOPE * (v + offset))


@dataclass(frozen=True)
class Run:
    """A stretch of the motion without a jump inside, with its dense output."""

    start: float
    end: float
    stiffness: float
    step_times: Array
    dense: Callable[[Array], Array]


class TimeDomain:
    """Numerical integration of one case."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.free = case.free_matrix()

    def _rhs(self, stiffness: float) -> Callable[[float, Array], Array]:
        case, free = self.case, self.free
        force = scalar_force(case, stiffness)

        def rhs(t: float, y: Array) -> Array:
            x0, u0 = case.base(t)
            d, v = y[0] - x0, y[3] - u0
            slope: Array = free @ y
            slope[3] -= (STIFFNESS * d + DAMPING * v + force(d, v)) / SEAT_MASS
            return slope

        return rhs

    def _edge_event(self, edge: float) -> Callable[[float, Array], float]:
        def event(t: float, y: Array) -> float:
            return float(y[0] - self.case.base(t)[0] - edge)

        event.terminal = True  # type: ignore[attr-defined]
        return event

    def _integrate(
        self, y: Array, start: float, end: float, stiffness: float, edges: tuple[float, ...] = ()
    ) -> Any:
        return solve_ivp(
            self._rhs(stiffness),
            (start, end),
            y,
            method="DOP853",
            rtol=RTOL,
            atol=ATOL,
            max_step=self.case.period / STEPS_PER_PERIOD,
            dense_output=True,
            events=[self._edge_event(edge) for edge in edges] or None,
        )

    def run_period(self, y: Array) -> tuple[Array, list[Run]]:
        """State after one period from t = 0, and the runs on the way."""
        if self.case.law.kind == "jump":
            return self._run_with_jumps(y)
        result = self._integrate(y, 0.0, self.case.period, 0.0)
        run = Run(0.0, self.case.period, 0.0, result.t, result.sol)
        return result.y[:, -1], [run]

    def _run_with_jumps(self, y: Array) -> tuple[Array, list[Run]]:
        case, law = self.case, self.case.law
        time, runs = 0.0, []
        d = y[0] - case.base(0.0)[0]
        while True:
            stiffness = law.stiffness_at(d)
            # the edges that bound the present region
            if d > law.upper:
                edges: tuple[float, ...] = (law.upper,)
            elif d < law.lower:
                edges = (law.lower,)
            else:
                edges = (law.lower, law.upper)
            # step off the edge just crossed before watching for events
            lead = min(1e-5 * case.period, 0.5 * (case.period - time))
            first = self._integrate(y, time, time + lead, stiffness)
            result = self._integrate(first.y[:, -1], time + lead, case.period, stiffness, edges)
            if result.status == 0:
                runs.append(self._joined(first, result, time, case.period, stiffness))
                return result.y[:, -1], runs
            hit = next(i for i, found in enumerate(result.t_events) if len(found))
            edge, crossing = edges[hit], float(result.t_events[hit][0])
            state = result.y_events[hit][0]
            for _ in range(3):
                result = self._integrate(first.y[:, -1], time + lead, crossing, stiffness)
                state = result.y[:, -1]
                x0, u0 = case.base(crossing)
                error = state[0] - x0 - edge
                if abs(error) < 1e-16:
                    break
                crossing -= error / (state[3] - u0)
            runs.append(self._joined(first, result, time, result.t[-1], stiffness))
            speed = state[3] - case.base(crossing)[1]
            d = edge + math.copysign(1e-9, speed)
            time, y = float(result.t[-1]), state

    @staticmethod
    def _joined(first: Any, rest: Any, start: float, end: float, stiffness: float) -> Run:
        border = float(first.t[-1])

        def dense(t: Array) -> Array:
            return np.asarray(np.where(t < border, first.sol(t), rest.sol(t)))

        return Run(start, end, stiffness, np.concatenate([first.t[:-1], rest.t]), dense)

    def monodromy(self, y: Array) -> Array:
        """Derivative of the period map by central differences."""
        scale = np.array([1.0, 1.0, 1.0, 10.0, 10.0, 10.0]) * MONODROMY_STEP
        columns = []
        for step in np.diag(scale):
            ahead, _ = self.run_period(y + step)
            behind, _ = self.run_period(y - step)
            columns.append((ahead - behind) / (2 * step.sum()))
        return np.stack(columns, axis=1)

    def periodic_orbit(self, guess: Array) -> tuple[Array, Array, list[Run]]:
        """Fixed point of the period map, its monodromy matrix and its runs."""
        y = guess
        monodromy: Array | None = None
        last = np.inf
        for _ in range(25):
            after, runs = self.run_period(y)
            gap = after - y
            size = float(np.max(np.abs(gap)))
            if monodromy is not None and (size < 2e-14 or (size < 1e-12 and size > 0.3 * last)):
                return y, monodromy, runs
            if monodromy is None or size > 0.1 * last:
                monodromy = self.monodromy(y)
            last = size
            y = y + np.linalg.solve(np.eye(6) - monodromy, gap)
        raise RuntimeError(f"no periodic orbit, gap {last:.2e}")

    def segments(self, runs: list[Run]) -> list[Segment]:
        """Outputs along the runs; accelerations follow from the equations of motion."""
        result = []
        for run in runs:

            def values(times: Array, run: Run = run) -> Array:
                states = run.dense(times).T
                base = self.case.base_array(times)
                if self.case.law.kind == "jump":
                    force = run.stiffness * (states[:, 0] - base[:, 0])
                else:
                    force = self.case.law.force_of_velocity(states[:, 3] - base[:, 1])
                return self.case.outputs(states, base, force)

            fractions = np.arange(GRID_PER_STEP) / GRID_PER_STEP
            steps = run.step_times
            inner = (steps[:-1, None] + np.diff(steps)[:, None] * fractions).ravel()
            times = np.append(inner, steps[-1])
            result.append(Segment(times, values))
        return result


def solve(case: Case, guess: Array) -> tuple[Array, Array, float]:
    """Amplitudes (14), state at t = 0, largest Floquet multiplier in modulus."""
    system = TimeDomain(case)
    y, monodromy, runs = system.periodic_orbit(guess)
    multiplier = float(np.max(np.abs(np.linalg.eigvals(monodromy))))
    return amplitudes(system.segments(runs)), y, multiplier


def settle(case: Case, start: Array, periods: int = 45) -> Array:
    """Amplitudes of the motion reached from a given state after many periods."""
    system = TimeDomain(case)
    y, runs = system.run_period(start)
    for _ in range(periods - 1):
        y, runs = system.run_period(y)
    return amplitudes(system.segments(runs))
