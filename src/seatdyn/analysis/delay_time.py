"""Time runs of a system with delayed forces.

Unless a run goes on from another one, everything stood still before it: each mass at its initial
displacement, the base where its motion begins. So the delayed forces begin with their values there,
and a base that starts with a velocity is felt one delay later. Elements with states of their own
had settled; their states go with the motion of the moment, and what acts late is their force.
Forces from outside are never late.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.delay_past import Past
from seatdyn.analysis.hysteretic import lower_memory, rest_pulls, settled_states
from seatdyn.analysis.lowering import lower
from seatdyn.analysis.run import (
    LONGEST_LADDER_STEP,
    PIECE,
    SHARE_OF_INPUT,
    STATUS,
    Problem,
    Run,
    Samples,
    Settings,
    State,
    interruptible,
)
from seatdyn.errors import RequestError
from seatdyn.kernels import delay as kernel
from seatdyn.kernels import dense, integrate
from seatdyn.kernels.columns import BREAKS, FIRST, SECOND
from seatdyn.kernels.jit import CompileNotice
from seatdyn.kernels.late import sample_late
from seatdyn.kernels.memory import STATES, Memory
from seatdyn.kernels.past import AT_ONCE, Late
from seatdyn.kernels.plant import FREE, Plant
from seatdyn.model.excitation import Motion
from seatdyn.model.force import ExternalForce
from seatdyn.model.system import SeatSystem

Array = NDArray[np.float64]
SHORTEST = 1e-9  # s, of a delay
START = 2  # derivative of the displacements that may jump at the start of a run
SAME = 1e-9  # relative, of derivatives of an input on both sides of a segment's begin
DERIVATIVES = 4  # of it that are compared there
FORCED = 2  # derivative of the displacements that jumps where a force from outside does


@dataclass(frozen=True)
class LateState(State):
    """A state with its past."""

    past: Past | None = None


@dataclass(frozen=True)
class LateRun(Run):
    """A run with the past that its delayed forces look back into."""

    whole: Array
    whole_marks: NDArray[np.int64]
    still: int
    place: float

    def states(self, time: Array) -> Array:
        """Displacements and velocities (p, 2N) alone at these times (s)."""
        single = np.full((self.record.shape[0], 1), dense.SINGLE)
        motion = self.record[:, : 4 * self.problem.system.linear.size + 1]
        with CompileNotice():
            found: Array = dense.states(
                np.ascontiguousarray(motion), single, np.asarray(time, dtype=float)
            )
        return found

    def sample(self, index: NDArray[np.int64], share: Array) -> Samples:
        """The solution at `share` of the steps `index`, with what the delayed forces saw."""
        problem = self.problem
        assert isinstance(problem, LateProblem)
        first = self.whole.shape[0] - self.record.shape[0]
        share = np.ascontiguousarray(share, dtype=float)
        index = np.ascontiguousarray(index + first, dtype=np.int64)
        late = problem.late._replace(still=self.still, place=self.place)
        memory = problem.memory
        with CompileNotice():
            time, base, z, v, force, elastic, x, a, pushes = sample_late(
                problem.plant, memory, late, self.whole, self.whole_marks, index, share
            )
        views = [
            Samples(time[w], base[w], z[w], v[w], np.full_like(a, np.nan), force[w], elastic[w])
            for w in range(time.shape[0])
        ]
        # an element that acts late acts with its states of then
        acting = late.group[late.group.size - memory.nodes.shape[0] :] + 1
        states = [
            x[w, :, first:last]
            for w, (first, last) in zip(acting, pairwise(memory.laws[:, STATES]), strict=True)
        ]
        outside = None
        if problem.forces:
            outside = np.zeros_like(a)
            np.add.at(outside.T, memory.pushed, pushes.T)
        return views[0]._replace(
            acceleration=a,
            states=np.hstack(states) if states else None,
            outside=outside,
            past=tuple(views[1:]),
        )


@dataclass(frozen=True)
class LateProblem(Problem):
    """A system with delayed forces under a base motion and outside forces, lowered once.

    Elements with states are channels without laws, after the others: they have their breaks.
    """

    memory: Memory
    state_scale: Array
    forces: tuple[ExternalForce, ...]

    @classmethod
    def make(
        cls,
        system: SeatSystem,
        motion: Motion,
        settings: Settings,
        forces: tuple[ExternalForce, ...] = (),
    ) -> LateProblem:
        """Lower `system`, `motion` and `forces`.

        Raises
        ------
        RequestError
            A delay so short that its rounding in time matters.
        """
        if system.delays[0] < SHORTEST:
            raise RequestError(
                f"A delay of {system.delays[0]:g} s is too short for a run in time; it must be at "
                f"least {SHORTEST:g} s. Set it to 0."
            )
        steps = [motion.longest_step, *(force.history.longest_step for force in forces)]
        longest = min(*steps, LONGEST_LADDER_STEP)
        plant = lower(system, motion, delays=True, memory=True)
        memory, scale = lower_memory(system, plant, forces)
        plant = with_elements(plant, memory, system)
        return cls(system, motion, settings, plant, None, longest, memory, scale, forces)

    @property
    def uses_ladder(self) -> bool:
        """Never: the delayed forces are not known at the points of a ladder step."""
        return False

    @cached_property
    def late(self) -> Late:
        """What acts late, as arrays."""
        system, delays = self.system, self.system.delays
        group_of = [
            delays.index(delay) if delay else AT_ONCE
            for delay in (
                *(channel.delay for channel in system.channels),
                *(element.delay for element in system.memory_elements),
            )
        ]
        plant, n = self.plant, system.linear.size
        table = late_forces(system)[:, :, [*range(n), 2 * n, *range(n, 2 * n), 2 * n + 1]]
        where = np.argwhere(table)
        ends = plant.channels[:-1][np.array(group_of, dtype=int) != AT_ONCE]
        seen = {*ends[:, [FIRST, SECOND]].ravel().tolist(), *(where[:, 2] % (n + 1)).tolist()}
        angle = plant.sines[:, 1] * np.array(delays)[:, None]
        return Late(
            delay=np.array(delays),
            begin=np.searchsorted(where[:, 0], np.arange(len(delays) + 1)),
            where=np.ascontiguousarray(where[:, 1:]),
            gain=table[tuple(where.T)],
            seen=np.array(sorted(seen - {-1, n}), dtype=np.int64),
            turn=np.stack([np.cos(angle), np.sin(angle)], axis=-1),
            group=np.array(group_of, dtype=np.int64),
            bare=plant.segments.shape[0] == 1 and not np.any(plant.segments[0, 1:8]),
            still=0,
            place=0.0,
        )

    @cached_property
    def late_states(self) -> NDArray[np.int64]:
        """Which states belong to elements that act late."""
        elements = self.system.memory_elements
        late = [bool(element.delay) for element in elements for _ in element.states]
        return np.flatnonzero(late)

    @property
    def longest_delay(self) -> float:
        """In s."""
        return self.system.delays[-1]

    def at_rest(self, t: float, y: Array) -> Past:
        """A past in which all stood still where it is at time t, elements settled."""
        n, marks, x = self.system.linear.size, self._no_marks(3), self.state_scale.size
        record = np.zeros((3, 1 + 4 * n + 5 * x))
        record[:, 0] = t - 2.0 * self.longest_delay, t, t
        record[:, 1 : n + 1] = y[:n]
        record[2, n + 1 : 2 * n + 1] = y[n : 2 * n]
        place = float(self.motion.evaluate(t))
        record[:, 4 * n + 1 :: 5] = settled_states(self.system, y[:n], place)
        breaks = sorted((t + delay, START) for delay in self.system.delays)
        times, orders = zip(*breaks, strict=True)
        return Past(record, marks, np.array(times), np.array(orders, dtype=np.int64), 2, place, x)

    def rest_pulls(self, z: Array, x0: float) -> Array:
        """Forces in N, downwards, on the nodes at rest at `z` (m), (elements and forces, N)."""
        return rest_pulls(self.system, self.forces, z, x0)

    def rest(self, y: Array) -> LateState:
        """A start at t = 0 from displacements and velocities, with nothing having moved before."""
        fresh = self.start(y)
        return LateState(fresh.y, fresh.side, fresh.held, self.at_rest(0.0, fresh.y))

    def _no_marks(self, rows: int) -> NDArray[np.int64]:
        """Marks of rows on the upper side of all breaks, nothing held, in the first segment."""
        b, m = self.plant.breaks.shape[0], self.plant.gain.shape[0]
        marks = np.full((rows, b + m + 1), FREE, dtype=np.int64)
        marks[:, :b], marks[:, -1] = 1, 0
        return marks

    def breaks_of_input(self, t0: float, t1: float) -> list[tuple[float, int]]:
        """Where corners of the base motion are felt through the delayed forces, and those of forces
        from outside at once.
        """
        felt = [
            (start + delay, order + 1)
            for start, order in corners(self.motion, t0, t1)
            for delay in self.system.delays
            if order < DERIVATIVES
        ]
        return felt + [
            (start, order + FORCED)
            for force in self.forces
            for start, order in corners(force.history, t0, t1)
        ]

    def run(
        self,
        t0: float,
        t1: float,
        start: State,
        progress: Callable[[float], None] | None = None,
    ) -> Run:
        """Integrate from t0 to t1 (s); `progress` is called with the share done."""
        settings = self.settings
        past = start.past if isinstance(start, LateState) else None
        past = self.at_rest(t0, start.y) if past is None else past.moved(t0 - past.now)
        extra = self.breaks_of_input(t0, t1)
        order = np.argsort(np.concatenate([past.times, [t for t, _ in extra]]), kind="stable")
        times = np.concatenate([past.times, [t for t, _ in extra]])[order]
        orders = np.concatenate([past.orders, [q for _, q in extra]])[order].astype(np.int64)
        first = past.record.shape[0] - 1
        record, marks, side, held = past.record, past.marks, start.side, start.held
        late = self.late._replace(still=past.still, place=past.place)
        scale, n, events, code = self.floor, self.system.linear.size, 0, integrate.OK
        state_scale = SHARE_OF_INPUT * self.state_scale
        pieces = max(1, math.ceil((t1 - t0) / PIECE))
        for _, stop in pairwise(np.linspace(t0, t1, pieces + 1)):
            with CompileNotice(), interruptible():
                code, count, side, held, record, marks, times, orders = kernel.integrate_late(
                    self.plant,
                    self.memory,
                    late,
                    float(stop),
                    record,
                    marks,
                    side,
                    held,
                    times,
                    orders,
                    settings.rtol,
                    *scale,
                    state_scale,
                    self.longest_step,
                    settings.max_steps - (record.shape[0] - 1 - first),
                    self.stick_speed,
                    settings.max_events_per_second,
                )
            sizes = np.abs(record[first:, 1 : 2 * n + 1]).max(0)
            scale = (max(scale[0], sizes[:n].max()), max(scale[1], sizes[n:].max()))
            events += count
            if code != integrate.OK:
                break
            if progress is not None:
                progress((stop - t0) / (t1 - t0))
        all_past = replace(past, record=record, marks=marks, times=times, orders=orders)
        state = LateState(
            record[-1, 1 : 2 * n + 1].copy(), side, held, all_past.recent(self.longest_delay)
        )
        return LateRun(
            self,
            STATUS[code],
            events,
            record[first:],
            marks[first:],
            state,
            record,
            marks,
            past.still,
            past.place,
        )


def with_elements(plant: Plant, memory: Memory, system: SeatSystem) -> Plant:
    """The plant with a channel more for each element with states, which has its breaks, no laws."""
    breaks = [element.lower().breaks for element in system.memory_elements]
    rows = [(spot.displacement, spot.velocity, spot.value, 1.0) for own in breaks for spot in own]
    channels = np.repeat(plant.channels[-1:], len(breaks) + 1, axis=0)
    channels[:-1, [FIRST, SECOND]] = memory.nodes
    channels[:, BREAKS] += np.cumsum([0, *(len(own) for own in breaks)])
    channels = np.vstack([plant.channels[:-1], channels])
    pull = np.hstack([plant.pull, memory.pull])
    moved = np.vstack([pull, np.zeros(pull.shape[1])])  # -1 is the base, which no force moves
    return plant._replace(
        pull=pull,
        gain=moved[channels[:-1, SECOND]] - moved[channels[:-1, FIRST]],
        channels=channels,
        breaks=np.vstack([plant.breaks, np.array(rows).reshape(-1, 4)]),
    )


def corners(motion: Motion, t0: float, t1: float) -> list[tuple[float, int]]:
    """Where an input goes over to its next segment, and the lowest of its derivatives that jumps.

    Where none is seen to jump, that is `DERIVATIVES`.
    """
    starts = motion.starts[1:]
    starts = starts[(t0 <= starts) & (starts < t1)]
    lowest = np.full(starts.size, DERIVATIVES)
    for order in reversed(range(DERIVATIVES)):
        times = (np.nextafter(starts, -np.inf), starts)
        left, right = (motion.evaluate(t, order) for t in times)
        size = np.maximum(np.abs(left), np.abs(right))
        lowest[np.abs(left - right) > SAME * size + 1e-300] = order
    return [(float(start), int(order)) for start, order in zip(starts, lowest, strict=True)]


def late_forces(system: SeatSystem) -> Array:
    """Accelerations (G, N, 2N+2) by the linear forces of each delay, as in `Plant.linear`."""
    linear, delays = system.linear, system.delays
    n, inverse = linear.size, np.linalg.inv(linear.mass)
    table = np.zeros((len(delays), n, 2 * n + 2))
    for group in linear.delayed:
        k, c = -(inverse @ group.stiffness[:n]), -(inverse @ group.damping[:n])
        table[delays.index(group.delay)] += np.column_stack([k[:, :n], c[:, :n], k[:, n], c[:, n]])
    return table
