"""A periodic motion that is found from that of a neighbour: the same seat, shaken more or less.

A motion may be out of reach of the straight ways to it, from the linear motion and from smaller
levels of the excitation, as where the branch that begins at level zero ends or folds before the
level that is asked for. Other levels lie on other parts of the branches. From the motion found at
one of them the level is led to the one asked for in steps, each motion predicted by the secant
through the two before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.balance import (
    MOST_SAMPLES,
    Balanced,
    condense,
    output_rows,
    solve,
    spaces,
)
from seatdyn.analysis.run import interruptible
from seatdyn.kernels.condensed import SERIES
from seatdyn.kernels.jit import BALANCE, CompileNotice
from seatdyn.model.excitation import Excitation
from seatdyn.model.force import base_and_forces
from seatdyn.model.system import SeatSystem

Series = NDArray[np.complex128]
# where a neighbour is looked for, shares of the level; quarters of an octave and octaves
LEVELS = 2.0 ** np.array([-0.25, 0.25, -0.5, 0.5, -1.0, 1.0])
FIRST, SHORTEST = 0.25, 1.0 / 64.0  # steps, shares of the way
GROWTH = 1.5  # of a step after one that led on


def from_neighbour(system: SeatSystem, excitation: Excitation, tolerance: float) -> Balanced | None:
    """Motion with the period of the excitation, led there from another level; None if none is.

    system : with elements that have states of their own there is none
    tolerance : as of `balance`
    """
    problem = None if system.memory_elements else condense(system, excitation)
    if problem is None:
        return None
    forces = base_and_forces(excitation)[1]
    names, rows = output_rows(system)
    work, look = spaces(system, rows, MOST_SAMPLES)

    def at(level: float, guess: Series | None) -> Balanced:
        scaled = problem._replace(base=level * problem.base, push=level * problem.push)
        with CompileNotice(BALANCE), interruptible():
            return solve(
                system, scaled, rows, names, work, look, tolerance, guess=guess, forces=forces
            )

    for level in LEVELS:
        found, here, step = at(level, None), level, FIRST * (1.0 - level)
        before, motion = None, found.work.series[SERIES, : found.count].copy()
        while found.found and here != 1.0:
            last = abs(step) >= abs(1.0 - here)
            there = 1.0 if last else here + step
            guess = motion if before is None else _beyond(before, (here, motion), there)
            trial = at(there, guess)
            if trial.found:
                found, before, here, step = trial, (here, motion), there, GROWTH * step
                motion = found.work.series[SERIES, : found.count].copy()
            elif abs(step := 0.5 * step) < SHORTEST * abs(1.0 - level):
                break
        if found.found and here == 1.0:
            return found
    return None


def _beyond(before: tuple[float, Series], now: tuple[float, Series], level: float) -> Series:
    """Motion at a level by the secant through those at two levels."""
    (first, a), (second, b) = before, now
    both = np.zeros((2, max(len(a), len(b)), a.shape[1]), dtype=complex)
    both[0, : len(a)], both[1, : len(b)] = a, b
    return np.asarray(both[1] + (level - second) / (second - first) * (both[1] - both[0]))
