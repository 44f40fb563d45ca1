"""Ensembles of systems with delayed forces or elements with states: a time run for every member.

The kernel that marches members side by side knows neither pasts nor states. The engines behind
`simulate` do; they cost more and choose their steps themselves. All else is that of the other
ensembles: the base motions, the blocks, the moments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.ensemble import (
    LONGEST_STEP,
    TRIAL,
    Block,
    Ensemble,
    Members,
    choose_steps,
    fewest_steps,
    require_room,
)
from seatdyn.analysis.hysteretic import problem_for
from seatdyn.analysis.march import all_outputs
from seatdyn.analysis.outputs import output_table
from seatdyn.analysis.run import Settings
from seatdyn.errors import Status
from seatdyn.model.excitation import DEGREES, Excitation, Motion
from seatdyn.model.noise import quintic_segments
from seatdyn.model.system import SeatSystem
from seatdyn.signals.synthesis import Synthesis

Array = NDArray[np.float64]
TOLERANCE, SHARPER = 1e-6, 1e-8  # of a step, and of the runs that show its error
TRIED = 2  # members run twice for that


@dataclass(frozen=True)
class Nodes(Excitation):
    """Base motion through displacement, velocity and acceleration at nodes `step` s apart."""

    step: float
    motions: tuple[Array, Array, Array]

    def lower(self) -> Motion:
        """A quintic segment per interval; it ends with the last."""
        rows = quintic_segments(self.step, *self.motions)
        rows = np.vstack([rows, np.zeros(DEGREES)])
        starts = self.step * np.arange(float(len(rows)))
        return Motion(starts, rows, np.zeros((len(rows), 3)))


@dataclass(frozen=True)
class RunEnsemble(Members):
    """Members that are run one after the other, with steps as short as each needs."""

    rtol: float = TOLERANCE

    @classmethod
    def make(
        cls,
        system: SeatSystem,
        synthesis: Synthesis,
        settle: int,
        seed: int,
        *,
        spacing: float = LONGEST_STEP,
        peaks: Sequence[str] | None = None,
        level: float | None = None,
    ) -> RunEnsemble:
        """Name the outputs."""
        names, _ = output_table(system, all_outputs)
        steps = fewest_steps(synthesis, spacing)
        watched = names if peaks is None else tuple(peaks)
        return cls(system, synthesis, settle, seed, names, steps, 1, watched, level=level)

    @property
    def step(self) -> float:
        """None that all share."""
        return math.nan

    @property
    def spacing(self) -> float:
        """Time in s between the instants that are gathered."""
        return self.synthesis.step / self.steps

    def respond(self, x: Array, v: Array, a: Array, wanted: Sequence[str], settle: int) -> Block:
        """Response of a block to base displacement, velocity and acceleration, (L, nodes)."""
        count = (x.shape[1] - 1 - settle) * self.steps
        require_room(x.shape[0], len(wanted), count)
        series = np.full((x.shape[0], len(wanted), count), np.nan)
        moments = np.full((len(self.names), 5, x.shape[0]), np.nan)
        watched = [self.names.index(name) for name in {*wanted, *self.peaks}]
        time = self.synthesis.step * settle + self.spacing * np.arange(count)
        for member in range(x.shape[0]):
            found = self._outputs(x[member], v[member], a[member], time)
            if found is None:
                continue
            for k, name in enumerate(wanted):
                series[member, k] = found[name]
            values = np.array(list(found.values()))
            moments[:, 0, member] = values.mean(1)
            moments[:, 1, member] = np.mean(values**2, axis=1)
            part = values[watched]
            extremes = [np.mean(part**4, axis=1), part.min(1), part.max(1)]
            moments[watched, 2:, member] = np.transpose(extremes)
        return Block(moments, series)

    def _outputs(self, x: Array, v: Array, a: Array, time: Array) -> dict[str, Array] | None:
        """Outputs of one member at these times, None where its run failed."""
        motion = Nodes(self.synthesis.step, (x, v, a))
        problem = problem_for(self.system, motion, Settings(rtol=self.rtol))
        end = self.synthesis.step * (x.size - 1)
        start = np.repeat([x[0], v[0]], self.system.linear.size)  # at rest relative to the base
        run = problem.run(0.0, end, problem.start(start))
        if run.status is not Status.OK:
            return None
        return all_outputs(self.system, run.at(np.minimum(time, end)))


def needs_runs(system: SeatSystem) -> bool:
    """Whether the members of a system cannot march side by side."""
    return bool(system.delays or system.memory_elements)


def ensemble_for(
    system: SeatSystem,
    synthesis: Synthesis,
    settle: int,
    seed: int,
    steps: int,
    *,
    spacing: float = LONGEST_STEP,
    peaks: Sequence[str] | None = None,
    level: float | None = None,
) -> Members:
    """The ensemble that a system needs, see `Ensemble.make`."""
    if needs_runs(system):
        return RunEnsemble.make(
            system, synthesis, settle, seed, spacing=spacing, peaks=peaks, level=level
        )
    return Ensemble.make(
        system, synthesis, settle, seed, steps, spacing=spacing, peaks=peaks, level=level
    )


def steps_for(
    system: SeatSystem,
    synthesis: Synthesis,
    seed: int,
    tolerance: float,
    *,
    level: float | None = None,
) -> tuple[int, float]:
    """Steps per interval of the grid and their error, as `choose_steps`.

    Runs choose their own steps; the error is then what a hundredth of their tolerance changes.
    """
    if not needs_runs(system):
        return choose_steps(system, synthesis, seed, tolerance, level=level)
    nodes = min(synthesis.nodes, max(2, math.ceil(TRIAL / synthesis.step)) + 1)
    ensemble = RunEnsemble.make(system, synthesis, 0, seed, peaks=(), level=level)
    x, v, a = (motion[:TRIED, :nodes] for motion in ensemble.base(0))
    plain, sharp = (
        np.sqrt(one.respond(x, v, a, (), nodes // 3).moments[:, 1])
        for one in (ensemble, replace(ensemble, rtol=SHARPER))
    )
    size = np.where(sharp > 0.0, sharp, 1.0)
    return ensemble.steps, float(np.max(np.abs(plain / size - sharp / size)))
