"""One time run: lower, integrate in pieces, and look at the solution anywhere."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.ladder import make_ladder
from seatdyn.analysis.lowering import lower
from seatdyn.errors import RequestError, Status
from seatdyn.kernels import dense, integrate
from seatdyn.kernels.address import placed
from seatdyn.kernels.exponential import AT_LADDER, Ladder
from seatdyn.kernels.jit import notice_for
from seatdyn.kernels.plant import AT_PLANT, FREE, Plant
from seatdyn.kernels.together import compile_together
from seatdyn.model.excitation import Motion
from seatdyn.model.system import SeatSystem

Array = NDArray[np.float64]
logger = logging.getLogger("seatdyn")

LONGEST_LADDER_STEP = 0.1  # s
# times that, with the linear part exact: a period of the input, or half of it where breaks of laws
# are looked for
LADDER_REACH, REACH_WITH_BREAKS = 8, 4
MOST_SEGMENTS = 16  # of an input that the ladder is used for
PIECE = 30.0  # s of a long run between two reports of progress
SHARE_OF_INPUT = 1e-2  # of the input's size: motions below it need no relative accuracy
SHARE_FOR_STICKING = 1e-3  # of the input's velocity: what is stopped has a millionth of its energy
SMALLEST_SCALE = (1e-6, 1e-5)  # m and m/s: the same for a base at rest
STATUS = {
    integrate.OK: Status.OK,
    integrate.CHATTERING: Status.CHATTERING,
    integrate.DIVERGED: Status.DIVERGED,
    integrate.STEP_LIMIT: Status.STEP_LIMIT,
    integrate.STEP_TOO_SMALL: Status.STEP_TOO_SMALL,
}


@dataclass(frozen=True)
class Settings:
    """How a run is integrated.

    rtol : error of a step relative to the largest motion so far
    stick_speed : m/s below which a channel may be held at a jump of its force; a thousandth of the
        base's largest velocity where that is less
    max_events_per_second : more than these end the run with status `chattering`
    max_steps : of one run
    method : "ladder" (linear part exact) or "runge-kutta" (Dormand-Prince alone); a sampled input,
        where every step ends at a sample, is always run by the latter
    """

    rtol: float = 1e-8
    stick_speed: float = 1e-5
    max_events_per_second: int = 100_000
    max_steps: int = 5_000_000
    method: str = "ladder"

    def __post_init__(self) -> None:
        """Check every setting."""
        if not 1e-12 <= self.rtol <= 1e-2:
            raise RequestError(f"rtol = {self.rtol:g} is not allowed; it must be in 1e-12 .. 1e-2.")
        if not self.stick_speed >= 0.0:
            raise RequestError(f"stick_speed = {self.stick_speed} m/s must be >= 0.")
        if self.method not in ("ladder", "runge-kutta"):
            raise RequestError(
                f"method = {self.method!r} is not allowed; use 'ladder' or 'runge-kutta'."
            )


class interruptible:
    """Pass on a KeyboardInterrupt that struck inside a kernel as what it is."""

    def __enter__(self) -> None:
        """Nothing to do: a generator would take longer than a short kernel."""

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Look at what numba made of it."""
        if isinstance(error, SystemError) and isinstance(error.__cause__, KeyboardInterrupt):
            raise KeyboardInterrupt from None


class Samples(NamedTuple):
    """The solution at p instants."""

    time: Array  # (p,)
    base: Array  # (3, p) displacement, velocity, acceleration of the base
    displacement: Array  # (p, N)
    velocity: Array  # (p, N)
    acceleration: Array  # (p, N)
    force: Array  # (p, e) of the non-linear elements, in the order of the channels
    elastic: Array  # (p, e) of the same at zero velocity
    states: Array | None = None  # (p, q) of the elements that have some; their forces come last
    outside: Array | None = None  # (p, N) forces from outside on the free nodes
    past: tuple[Samples, ...] = ()  # one delay earlier, for each delay of the system


@dataclass(frozen=True)
class State:
    """Where a run is: displacements and velocities, and the branch of every law."""

    y: Array
    side: NDArray[np.int64]
    held: NDArray[np.int64]

    @property
    def is_held(self) -> bool:
        """Whether some channel rests on a jump."""
        return bool(np.any(self.held != FREE))


@dataclass(frozen=True)
class Run:
    """A finished run: a row of `record` and `marks` per step, and a last row for the end."""

    problem: Problem
    status: Status
    events: int
    record: Array
    marks: NDArray[np.int64]
    end: State

    @property
    def steps(self) -> int:
        """Number of accepted steps."""
        return int(self.record.shape[0]) - 1

    @property
    def slips(self) -> bool:
        """Whether some channel rests on a jump for a part of the run."""
        first = self.problem.plant.breaks.shape[0]
        held = self.marks[:, first : first + self.end.held.size] != FREE
        return bool(np.any(held.any(0) & ~held.all(0)))

    def places(self, time: Array) -> tuple[NDArray[np.int64], Array]:
        """The steps that these times (s) lie in, and the shares (0..1) of them that have passed."""
        starts = self.record[:, 0]
        index = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, self.steps - 1)
        return index, (time - starts[index]) / (starts[index + 1] - starts[index])

    def at(self, time: Array) -> Samples:
        """The solution at these times (s), inside the run."""
        return self.sample(*self.places(time))._replace(time=time)  # not a rounding beside them

    def states(self, time: Array) -> Array:
        """Displacements and velocities (p, 2N) alone at these times (s): far cheaper than `at`."""
        with notice_for(dense.states):
            found: Array = dense.states(self.record, self.marks, np.asarray(time, dtype=float))
        return found

    def in_steps(self, shares: Array, first: int = 0, last: int | None = None) -> Samples:
        """The solution at the same shares (0..1) of every step (or a range), ends one-sided."""
        steps = np.arange(first, self.steps if last is None else last)
        return self.sample(np.repeat(steps, shares.size), np.tile(shares, steps.size))

    def sample(self, index: NDArray[np.int64], share: Array) -> Samples:
        """The solution at `share` of the steps `index`."""
        plant = self.problem.plant
        share = np.ascontiguousarray(share, dtype=float)
        index = np.ascontiguousarray(index, dtype=np.int64)
        with notice_for(dense.sample):
            return Samples(*dense.sample(plant, self.record, self.marks, index, share))


@dataclass(frozen=True)
class Problem:
    """A system under a base motion, lowered once."""

    system: SeatSystem
    motion: Motion
    settings: Settings
    plant: Plant
    ladder: Ladder | None
    longest_step: float

    @classmethod
    def make(cls, system: SeatSystem, motion: Motion, settings: Settings) -> Problem:
        """Lower `system` and `motion`."""
        if system.delays:
            from seatdyn.analysis.delay_time import LateProblem

            return LateProblem.make(system, motion, settings)
        plant = lower(system, motion, lanes=_takes_ladder_steps(motion, settings))
        longest = min(motion.longest_step, LONGEST_LADDER_STEP)
        reach = REACH_WITH_BREAKS if plant.breaks.size else LADDER_REACH
        ladder = make_ladder(plant, reach * longest)
        return cls(system, motion, settings, plant, ladder, longest)

    @property
    def uses_ladder(self) -> bool:
        """Whether steps with the linear part exact are taken."""
        return _takes_ladder_steps(self.motion, self.settings)

    @cached_property
    def _placed(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Plant and ladder for the kernel; they live as long as this object."""
        return placed(self.plant, AT_PLANT), placed(self.ladder, AT_LADDER)

    def __getstate__(self) -> dict[str, Any]:
        """What a copy gets: not the places of our own arrays."""
        return {name: value for name, value in self.__dict__.items() if name != "_placed"}

    @cached_property
    def floor(self) -> tuple[float, float]:
        """Sizes of displacement (m) and velocity (m/s) below which errors are absolute."""
        x, v = self.motion.scale
        return (
            max(SHARE_OF_INPUT * x, SMALLEST_SCALE[0]),
            max(SHARE_OF_INPUT * v, SMALLEST_SCALE[1]),
        )

    @property
    def state_floor(self) -> Array:
        """Sizes of the elements' own states below which errors are absolute; here none has any."""
        return np.zeros(0)

    @cached_property
    def stick_speed(self) -> float:
        """Speed in m/s below which a channel may be held at a jump of its force."""
        base = self.motion.scale[1]
        asked = self.settings.stick_speed
        return min(asked, SHARE_FOR_STICKING * base) if base > 0.0 else asked

    def start(self, y: Array) -> State:
        """A state whose branches are still to be read from its displacements and velocities."""
        side = np.zeros(self.plant.breaks.shape[0], dtype=np.int64)
        held = np.empty(self.plant.gain.shape[0], dtype=np.int64)
        held.fill(FREE)
        return State(np.array(y, dtype=float), side, held)

    def rest_pulls(self, z: Array, x0: float) -> Array:
        """Forces at rest of what is no part of the plant, (k, N): here nothing."""
        return np.zeros((0, z.size))

    def run(
        self,
        t0: float,
        t1: float,
        start: State,
        progress: Callable[[float], None] | None = None,
    ) -> Run:
        """Integrate from t0 to t1 (s); `progress` is called with the share done."""
        settings, t0, t1 = self.settings, float(t0), float(t1)
        pieces = max(1, math.ceil((t1 - t0) / PIECE))
        times = [t0 + (t1 - t0) * i / pieces for i in range(pieces)] + [t1]
        records, marks = [], []
        events, steps, state = 0, 0, start
        code, scale, n = integrate.OK, self.floor, self.system.linear.size
        for begin, stop in pairwise(times):
            with notice_for(integrate.integrate), interruptible():
                compile_together(integrate.__name__)
                code, count, side, held, record, mark = integrate.integrate(
                    *self._placed,
                    self.uses_ladder,
                    begin,
                    stop,
                    state.y,
                    state.side,
                    state.held,
                    settings.rtol,
                    *scale,
                    self.longest_step,
                    settings.max_steps - steps,
                    self.stick_speed,
                    settings.max_events_per_second,
                )
            if stop < t1:
                sizes = np.abs(record[:, 1 : 2 * n + 1]).max(0)
                scale = (max(scale[0], sizes[:n].max()), max(scale[1], sizes[n:].max()))
            state = State(record[-1, 1 : 2 * n + 1].copy(), side, held)
            events += count
            steps += record.shape[0] - 1
            records.append(record)
            marks.append(mark)
            if code != integrate.OK:
                break
            if progress is not None:
                progress((stop - t0) / (t1 - t0))
        return Run(self, STATUS[code], events, _joined(records), _joined(marks), state)


def _takes_ladder_steps(motion: Motion, settings: Settings) -> bool:
    """Whether steps with the linear part exact are asked for and the input leaves room for them."""
    return settings.method == "ladder" and motion.starts.size <= MOST_SEGMENTS


def _joined(pieces: list[NDArray[Any]]) -> NDArray[Any]:
    """Records of runs that follow each other as one; each begins where the one before ends."""
    if len(pieces) == 1:
        return pieces[0]
    return np.concatenate([*(piece[:-1] for piece in pieces[:-1]), pieces[-1]])
