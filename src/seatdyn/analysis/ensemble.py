"""Ensembles: many realisations of a random base motion through the same system, in blocks.

A block is a fixed set of members (16 to a block), so that a result depends on the seed only: not
on the number of threads, nor on where a run was interrupted and taken up again.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.march import make_march
from seatdyn.analysis.run import interruptible
from seatdyn.errors import RequestError
from seatdyn.kernels.ensemble import March, march_block
from seatdyn.kernels.jit import CompileNotice
from seatdyn.kernels.lanes import LANES
from seatdyn.model.system import SeatSystem
from seatdyn.signals.synthesis import Synthesis

Array = NDArray[np.float64]
FORGETTING = 7.0  # time constants of the slowest pole until the start is forgotten (1e-3)
LONGEST_SETTLE = 120.0  # s
LONGEST_STEP = 0.01  # s; also the widest spacing of the instants that are gathered
SHORTEST_STEP = 2e-5  # s
TRIAL = 30.0  # s of the first block, on which the step is chosen
MOST_SERIES = 4e9  # bytes


class Block(NamedTuple):
    """What a block of members gives."""

    moments: Array  # (s, 5, L): means of x, x^2, x^4; lowest; highest; the last three may be NaN
    series: Array  # (L, q, instants)


@dataclass(frozen=True)
class Members(ABC):
    """A system and a family of base motions, ready to run in blocks.

    synthesis : the grid of the base motion, `settle` included
    settle : intervals of the grid that are passed over
    seed : of all members
    names : of the outputs
    steps : in every interval of the grid
    every : steps from one that is gathered to the next
    peaks : outputs whose extremes and fourth powers are gathered; means and mean squares of all
        outputs cost next to nothing
    drift : m/s added to the velocity of the base, and the system starts at rest then; the base of
        the paper's random runs moves like this
    level : r.m.s. acceleration in m/s2 that the base of every member is corrected to
    """

    system: SeatSystem
    synthesis: Synthesis
    settle: int
    seed: int
    names: tuple[str, ...]
    steps: int
    every: int
    peaks: tuple[str, ...]
    drift: float | None = field(default=None, kw_only=True)
    level: float | None = field(default=None, kw_only=True)

    @property
    def step(self) -> float:
        """Step in s, NaN where every run chooses its own."""
        return self.synthesis.step / self.steps

    @property
    @abstractmethod
    def spacing(self) -> float:
        """Time in s between the instants that are gathered."""

    @abstractmethod
    def respond(self, x: Array, v: Array, a: Array, wanted: Sequence[str], settle: int) -> Block:
        """Response of a block to base displacement, velocity and acceleration, (L, nodes)."""

    def base(self, block: int) -> tuple[Array, Array, Array]:
        """Displacement, velocity and acceleration of the base, (L, nodes)."""
        x, v, a = (np.empty((LANES, self.synthesis.nodes)) for _ in range(3))
        self.synthesis.fill(self.seed, x.T, v.T, a.T, first=block * LANES)
        if self.drift is not None:
            v += self.drift
            x += self.drift * self.synthesis.step * np.arange(self.synthesis.nodes)
        if self.level is not None:
            found = np.sqrt(np.mean(a[:, self.settle :] ** 2, axis=1))
            for motion in (x, v, a):
                motion *= (self.level / found)[:, None]
        return x, v, a

    def run(
        self, block: int, wanted: Sequence[str] = (), nodes: int | None = None, settle: int = -1
    ) -> Block:
        """Run one block, or only its first `nodes`."""
        x, v, a = self.base(block)
        if nodes is not None:
            x, v, a = (np.ascontiguousarray(motion[:, :nodes]) for motion in (x, v, a))
        return self.respond(x, v, a, wanted, self.settle if settle < 0 else settle)

    def blocks(
        self, numbers: Iterator[int], workers: int, wanted: Sequence[str] = ()
    ) -> Iterator[tuple[int, Block]]:
        """Run blocks on `workers` threads, in order, no more than `workers` ahead."""
        with ThreadPoolExecutor(workers) as pool:
            waiting: list[tuple[int, Future[Block]]] = []
            try:
                for number in numbers:
                    waiting.append((number, pool.submit(self.run, number, wanted)))
                    if len(waiting) >= workers + 1:
                        first, future = waiting.pop(0)
                        yield first, future.result()
                for first, future in waiting:
                    yield first, future.result()
            finally:
                for _, future in waiting:
                    future.cancel()


def require_room(members: int, outputs: int, instants: int) -> None:
    """Refuse series of a block that would not fit into memory."""
    if members * outputs * instants * 8 > MOST_SERIES:
        raise RequestError(
            f"series of {outputs} outputs over {instants} instants need more than "
            f"{MOST_SERIES:.0e} bytes a block; keep fewer, or shorten the duration."
        )


@dataclass(frozen=True)
class Ensemble(Members):
    """Members that march side by side, for systems without delays and states of elements.

    outputs : (instants, K, s) weights of the outputs at the instants of a step, see `make_march`
    """

    march: March
    outputs: Array

    @classmethod
    def make(
        cls,
        system: SeatSystem,
        synthesis: Synthesis,
        settle: int,
        seed: int,
        steps: int,
        *,
        spacing: float = LONGEST_STEP,
        peaks: Sequence[str] | None = None,
        drift: float | None = None,
        level: float | None = None,
    ) -> Ensemble:
        """Work the propagators out; instants are gathered at most `spacing` (s) apart.

        `peaks` are those of all outputs unless given.
        """
        coarsest = fewest_steps(synthesis, spacing)
        steps = max(steps, coarsest)
        every = max(k for k in range(1, steps + 1) if steps % k == 0 and steps >= k * coarsest)
        instants = 1
        if not system.channels:  # exact from node to node, and in between
            instants, steps, every = steps // every, 1, 1
        names, march, outputs = make_march(system, synthesis.step, steps, instants)
        watched = names if peaks is None else tuple(peaks)
        return cls(
            system, synthesis, settle, seed, names, steps, every, watched, march, outputs,
            drift=drift, level=level,
        )  # fmt: skip

    @property
    def spacing(self) -> float:
        """Time in s between the instants that are gathered."""
        return self.synthesis.step * self.every / (self.steps * len(self.outputs))

    def respond(self, x: Array, v: Array, a: Array, wanted: Sequence[str], settle: int) -> Block:
        """Response of a block to base displacement, velocity and acceleration, (L, nodes)."""
        size = self.march.across.shape[0]
        start = np.zeros((size, LANES))  # at rest relative to the base
        if self.drift is not None:  # at rest: only the suspension moves
            start[0], start[size // 2] = -x[:, 0], -v[:, 0]
        gathered = (x.shape[1] - 1 - settle) * self.steps // self.every
        instants, sources, s = self.outputs.shape
        require_room(LANES, len(wanted), gathered * instants)
        others = (name for name in self.peaks if name not in wanted)
        watched = [self.names.index(name) for name in (*wanted, *others)]
        outputs = self.outputs[:, :, watched].reshape(instants * sources, len(watched))
        series = np.empty((LANES, len(wanted), gathered * instants))
        gram = np.zeros((sources, sources + 1, LANES))
        with CompileNotice(), interruptible():
            extremes = march_block(
                self.march, x, v, a, settle, self.every, start, np.ascontiguousarray(outputs),
                series, gram,
            )  # fmt: skip
        moments = np.full((s, 5, LANES), np.nan)
        moments[:, :2] = self.means(gram / gathered)
        extremes[:, 0] /= gathered * instants
        moments[watched, 2:] = extremes
        return Block(moments, series)

    def means(self, gram: Array) -> Array:
        """Means and mean squares of all outputs, (s, 2, L), from those of their sources.

        A mean square has about 10 digits, and 7 where the base drifts by metres: an acceleration is
        a small difference of large sources then.

        gram : (K, K + 1, L) mean products, below the diagonal, and last the means
        """
        count = gram.shape[0]
        lower = np.tri(count, k=-1, dtype=bool)[:, :, None]
        below = np.where(lower, gram[:, :count], 0.0)
        products = below + np.swapaxes(below, 0, 1)
        products[np.arange(count), np.arange(count)] = gram[np.arange(count), np.arange(count)]
        weights = self.outputs / math.sqrt(self.outputs.shape[0])
        with np.errstate(invalid="ignore", over="ignore"):  # of a motion without bound
            partial = np.tensordot(weights, products, axes=(1, 0))  # (instants, s, K, L)
            squares = np.einsum("iskl,iks->sl", partial, weights)
            mean = self.outputs.mean(0).T @ gram[:, count]
        return np.stack([mean, np.maximum(squares, 0.0)], axis=1)


def fewest_steps(synthesis: Synthesis, spacing: float = LONGEST_STEP) -> int:
    """Steps in an interval of the grid that keep instants `spacing` (s) apart or less."""
    return max(1, math.ceil(synthesis.step / spacing))


def settling_time(poles: NDArray[np.complex128]) -> float:
    """Time in s after which a start is forgotten, from the poles of the linear part (1/s)."""
    slowest = float(-np.max(np.real(poles), initial=-np.inf))
    if slowest <= FORGETTING / LONGEST_SETTLE:
        return LONGEST_SETTLE
    return FORGETTING / slowest


def choose_steps(
    system: SeatSystem,
    synthesis: Synthesis,
    seed: int,
    tolerance: float,
    *,
    drift: float | None = None,
    level: float | None = None,
) -> tuple[int, float]:
    """Steps per interval of the grid, and the error that they make of r.m.s. values.

    The error is the relative change of any output's r.m.s. over the first block when every step
    is halved, on its first seconds; steps are halved until it is below `tolerance` or the step is
    the shortest allowed.
    """
    steps = fewest_steps(synthesis)
    nodes = min(synthesis.nodes, max(2, math.ceil(TRIAL / synthesis.step)) + 1)

    def levels(count: int) -> Array:
        ensemble = Ensemble.make(
            system, synthesis, 0, seed, count, peaks=(), drift=drift, level=level
        )
        mean_squares = ensemble.run(0, nodes=nodes, settle=nodes // 3).moments[:, 1]
        return np.sqrt(mean_squares)

    if not system.channels:
        return steps, 0.0
    coarse = levels(steps)
    while True:
        fine = levels(2 * steps)
        size = np.where(fine > 0.0, fine, 1.0)
        with np.errstate(invalid="ignore", over="ignore"):  # of a motion without bound
            error = float(np.max(np.sqrt(np.mean(((coarse - fine) / size) ** 2, axis=1))))
        if not np.isfinite(error) or error <= tolerance:
            return steps, error
        if synthesis.step / (2 * steps) < SHORTEST_STEP:
            return steps, error
        steps, coarse = 2 * steps, fine
