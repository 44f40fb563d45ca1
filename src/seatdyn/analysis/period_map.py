"""The map of a motion over one period, as numbers that it starts from and gives.

Those are the state; where forces act late they are a piece of history, and a period begins where
the run before it ended, changed to the numbers asked for: what lies between them is filled by that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.delay_orbit import (
    ROWS,
    History,
    late_scales,
    monodromy,
    multipliers_of,
    periods_together,
)
from seatdyn.analysis.delay_time import LateProblem, LateRun, LateState
from seatdyn.analysis.hysteretic import problem_for
from seatdyn.analysis.run import Problem, Run, Settings
from seatdyn.analysis.steady import orbit_scales
from seatdyn.model.excitation import Excitation
from seatdyn.model.system import SeatSystem

Array = NDArray[np.float64]
PERTURBATION = 1e-5  # of differences, relative


def period_map(
    system: SeatSystem, excitation: Excitation, period: float, settings: Settings
) -> Period:
    """The map of a system over one period (s) of its excitation."""
    problem = problem_for(system, excitation, settings)
    if isinstance(problem, LateProblem):
        return LatePeriod(problem, period)
    return Period(problem, period)


def one_sided(moved: Callable[[float], tuple[Run, Array]], run: Run, value: Array) -> Array:
    """Derivative of a value by a share, from a neighbour that meets the same breaks as `run`.

    A motion that touches a break has two derivatives; a difference across the graze is neither.

    moved : gives the run and the value at a share
    """
    for share in (PERTURBATION, -PERTURBATION):
        other, there = moved(share)
        if other.events == run.events:
            break
    return np.asarray((there - value) / share)


class Period:
    """One run of a problem, and the numbers y that it starts from and gives: states."""

    def __init__(self, problem: Problem, length: float) -> None:
        """Keep the problem and the length of the run in s."""
        self.problem, self.length = problem, length

    def run(self, y: Array, like: Run) -> Run:
        """The run that starts from y."""
        return self.problem.run(0.0, self.length, self.problem.start(y))

    def end(self, run: Run) -> Array:
        """The numbers at the end of a run."""
        return run.end.y

    def scales(self, run: Run) -> Array:
        """Their sizes."""
        return orbit_scales(self.problem, run)

    def differences(self, y: Array, run: Run, scales: Array) -> Array:
        """Derivatives (K, K) of the end by the start, both scaled."""

        def along(i: int) -> Array:
            def moved(share: float) -> tuple[Run, Array]:
                start = y.copy()
                start[i] += share * scales[i]
                other = self.run(start, run)
                return other, self.end(other) / scales

            return one_sided(moved, run, self.end(run) / scales)

        return np.column_stack([along(i) for i in range(y.size)])

    def multipliers(self, derivatives: Array) -> NDArray[np.complex128]:
        """Floquet multipliers, largest first."""
        return multipliers_of(derivatives, 1)


class LatePeriod(Period):
    """The same of a system with delayed forces; y is a history, and `like` fills its gaps."""

    def __init__(self, problem: LateProblem, period: float) -> None:
        """Take as many periods as the longest delay lasts."""
        self.together = periods_together(problem, period)
        super().__init__(problem, self.together * period)
        self.late, self.history = problem, History(problem)

    def state(self, y: Array, like: Run) -> LateState:
        """The end of a run with its history changed to these numbers."""
        assert isinstance(like, LateRun)
        assert isinstance(like.end, LateState)
        assert like.end.past is not None
        ahead = like.end.past
        past = replace(ahead, record=like.whole, marks=like.whole_marks, still=0)
        past = past.recent(self.late.longest_delay).refined(self.late.longest_delay / ROWS)
        state = LateState(like.end.y, like.end.side, like.end.held, past)
        return self.history.changed(self.late, state, y - self.history.values(past))

    def run(self, y: Array, like: Run) -> Run:
        """The run that starts from y."""
        return self.problem.run(0.0, self.length, self.state(y, like))

    def end(self, run: Run) -> Array:
        """The numbers at the end of a run."""
        assert isinstance(run.end, LateState)
        assert run.end.past is not None
        return self.history.values(run.end.past)

    def scales(self, run: Run) -> Array:
        """Their sizes; many numbers of one motion count together as much as a state does."""
        sizes = late_scales(self.late, self.history, run)
        return sizes * math.sqrt(sizes.size / run.end.y.size)

    def differences(self, y: Array, run: Run, scales: Array) -> Array:
        """Derivatives (K, K) of the end by the start, both scaled."""
        state = self.state(y, run)
        operator = monodromy(self.late, self.history, state, self.length, scales, run.steps)
        return np.asarray(operator * scales / scales[:, None])

    def multipliers(self, derivatives: Array) -> NDArray[np.complex128]:
        """Floquet multipliers over one period, largest first."""
        return multipliers_of(derivatives, self.together)
