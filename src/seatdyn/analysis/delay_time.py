"""Time runs of a system with delayed forces.

Unless a run goes on from another one, everything stood still before it: each mass at its initial
displacement, the base where its motion begins. So the delayed forces begin with their values there,
and a base that starts with a velocity is felt one delay later.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.lowering import lower
from seatdyn.analysis.run import (
    LONGEST_LADDER_STEP,
    PIECE,
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
from seatdyn.kernels.columns import FIRST, SECOND
from seatdyn.kernels.jit import CompileNotice
from seatdyn.kernels.plant import FREE
from seatdyn.model.excitation import Motion
from seatdyn.model.system import SeatSystem

Array = NDArray[np.float64]
SHORTEST = 1e-9  # s, of a delay
START = 2  # derivative of the displacements that may jump at the start of a run
SAME = 1e-9  # relative, of derivatives of the base motion on both sides of a segment's begin
DERIVATIVES = 4  # of the base motion that are compared there


@dataclass(frozen=True)
class Past:
    """Rows of a run and its marks up to now, the last row for now, and the breaks to come.

    still : number of rows in which the base stands still at `place`, m
    """

    record: Array
    marks: NDArray[np.int64]
    times: Array
    orders: NDArray[np.int64]
    still: int = 0
    place: float = 0.0

    @property
    def now(self) -> float:
        """Time of the last row in s."""
        return float(self.record[-1, 0])

    def moved(self, shift: float) -> Past:
        """The same `shift` s later, for a periodic base motion."""
        if shift == 0.0:
            return self
        record = self.record.copy()
        record[:, 0] += shift
        return Past(record, self.marks, self.times + shift, self.orders, self.still, self.place)

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Displacements, velocities and accelerations (p, N) at times (p,) in s."""
        record, n = self.record, (self.record.shape[1] - 1) // 4
        row = np.searchsorted(record[:, 0], times, side="right") - 1
        row = np.clip(row, 0, record.shape[0] - 2)
        start, end = record[row], record[row + 1]
        h = (end[:, 0] - start[:, 0])[:, None]
        s = (times[:, None] - start[:, :1]) / h
        z0, v0, k0 = start[:, 1 : n + 1], h * start[:, n + 1 : 2 * n + 1], start[:, 2 * n + 1 :]
        z1, v1 = end[:, 1 : n + 1], h * end[:, n + 1 : 2 * n + 1]
        k0, k1 = h * h * k0[:, :n], h * h * start[:, 3 * n + 1 :]
        # the quintic of `dense.quintic`
        rise = z1 - z0
        p3 = 10 * rise - 6 * v0 - 4 * v1 - 1.5 * k0 + 0.5 * k1
        p4 = -15 * rise + 8 * v0 + 7 * v1 + 1.5 * k0 - k1
        p5 = 6 * rise - 3 * v0 - 3 * v1 - 0.5 * k0 + 0.5 * k1
        z = z0 + s * (v0 + s * (0.5 * k0 + s * (p3 + s * (p4 + s * p5))))
        v = (v0 + s * (k0 + s * (3 * p3 + s * (4 * p4 + s * 5 * p5)))) / h
        return z, v, (k0 + s * (6 * p3 + s * (12 * p4 + s * 20 * p5))) / h**2

    def refined(self, longest: float) -> Past:
        """The same with rows of at most `longest` s, so that it can be changed in between."""
        starts, ends = self.record[:-1, 0], self.record[1:, 0]
        parts = np.maximum(np.ceil((ends - starts) / longest), 1).astype(int)
        row = np.repeat(np.arange(parts.size), parts)
        share = np.arange(row.size) - np.repeat(np.cumsum(parts) - parts, parts)
        times = starts[row] + (ends - starts)[row] * share / parts[row]
        record = self.record[np.append(row, len(parts))].copy()
        n = (record.shape[1] - 1) // 4
        inside = np.flatnonzero(share > 0)
        record[inside, 0] = times[inside]
        record[inside, 1 : 3 * n + 1] = np.concatenate(self.at(times[inside]), axis=1)
        before = inside - 1  # rows that now end inside an old one
        record[before, 3 * n + 1 :] = record[inside, 2 * n + 1 : 3 * n + 1]
        marks = self.marks[np.append(row, len(parts))]
        still = int(np.sum(row < self.still))
        return Past(record, marks, self.times, self.orders, still, self.place)

    def recent(self, span: float) -> Past:
        """Cut to the last `span` s."""
        begin = self.now - span
        first = int(np.searchsorted(self.record[1:, 0], begin, side="right"))
        record = self.record[first:].copy()
        n = (record.shape[1] - 1) // 4
        if record[0, 0] < begin:
            record[0, 0] = begin
            record[0, 1 : 3 * n + 1] = np.concatenate(self.at(np.array([begin])), axis=1)
        return Past(
            record,
            self.marks[first:],
            self.times,
            self.orders,
            max(self.still - first, 0),
            self.place,
        )


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
        with CompileNotice():
            found: Array = dense.states(self.record, single, np.asarray(time, dtype=float))
        return found

    def sample(self, index: NDArray[np.int64], share: Array) -> Samples:
        """The solution at `share` of the steps `index`, with what the delayed forces saw."""
        problem = self.problem
        assert isinstance(problem, LateProblem)
        first = self.whole.shape[0] - self.record.shape[0]
        share = np.ascontiguousarray(share, dtype=float)
        index = np.ascontiguousarray(index + first, dtype=np.int64)
        late = problem.late._replace(still=self.still, place=self.place)
        with CompileNotice():
            time, base, z, v, force, elastic, a = kernel.sample_late(
                problem.plant, late, self.whole, self.whole_marks, index, share
            )
        views = [
            Samples(time[w], base[w], z[w], v[w], np.full_like(a, np.nan), force[w], elastic[w])
            for w in range(time.shape[0])
        ]
        return views[0]._replace(acceleration=a, past=tuple(views[1:]))


@dataclass(frozen=True)
class LateProblem(Problem):
    """A system with delayed forces under a base motion, lowered once."""

    @classmethod
    def make(cls, system: SeatSystem, motion: Motion, settings: Settings) -> LateProblem:
        """Lower `system` and `motion`.

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
        longest = min(motion.longest_step, LONGEST_LADDER_STEP)
        plant = lower(system, motion, delays=True)
        return cls(system, motion, settings, plant, None, longest)

    @property
    def uses_ladder(self) -> bool:
        """Never: the delayed forces are not known at the points of a ladder step."""
        return False

    @cached_property
    def late(self) -> kernel.Late:
        """What acts late, as arrays."""
        system, delays = self.system, self.system.delays
        group_of = [
            delays.index(channel.delay) if channel.delay else kernel.AT_ONCE
            for channel in system.channels
        ]
        plant, n = self.plant, system.linear.size
        table = late_forces(system)[:, :, [*range(n), 2 * n, *range(n, 2 * n), 2 * n + 1]]
        where = np.argwhere(table)
        ends = plant.channels[:-1][np.array(group_of, dtype=int) != kernel.AT_ONCE]
        seen = {*ends[:, [FIRST, SECOND]].ravel().tolist(), *(where[:, 2] % (n + 1)).tolist()}
        angle = plant.sines[:, 1] * np.array(delays)[:, None]
        return kernel.Late(
            delay=np.array(delays),
            begin=np.searchsorted(where[:, 0], np.arange(len(delays) + 1)),
            where=np.ascontiguousarray(where[:, 1:]),
            gain=table[tuple(where.T)],
            seen=np.array(sorted(seen - {-1, n}), dtype=np.int64),
            turn=np.stack([np.cos(angle), np.sin(angle)], axis=-1),
            group=np.array(group_of, dtype=np.int64),
            still=0,
            place=0.0,
        )

    @property
    def longest_delay(self) -> float:
        """In s."""
        return self.system.delays[-1]

    def at_rest(self, t: float, y: Array) -> Past:
        """A past in which all stood still where it is at time t."""
        n, marks = self.system.linear.size, self._no_marks(3)
        record = np.zeros((3, 1 + 4 * n))
        record[:, 0] = t - 2.0 * self.longest_delay, t, t
        record[:, 1 : n + 1] = y[:n]
        record[2, n + 1 : 2 * n + 1] = y[n:]
        breaks = sorted((t + delay, START) for delay in self.system.delays)
        place = float(self.motion.evaluate(t))
        times, orders = zip(*breaks, strict=True)
        return Past(record, marks, np.array(times), np.array(orders, dtype=np.int64), 2, place)

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

    def breaks_of_base(self, t0: float, t1: float) -> list[tuple[float, int]]:
        """Where corners of the base motion are felt through the delayed forces."""
        starts = self.motion.starts[1:]
        starts = starts[(t0 <= starts) & (starts < t1)]
        smooth = np.full(starts.size, True)
        found = []
        for order in range(DERIVATIVES):
            times = (np.nextafter(starts, -np.inf), starts)
            left, right = (self.motion.evaluate(t, order) for t in times)
            size = np.maximum(np.abs(left), np.abs(right))
            jumps = smooth & (np.abs(left - right) > SAME * size + 1e-300)
            smooth &= ~jumps
            for delay in self.system.delays:
                found += [(float(start + delay), order + 1) for start in starts[jumps]]
        return found

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
        extra = self.breaks_of_base(t0, t1)
        order = np.argsort(np.concatenate([past.times, [t for t, _ in extra]]), kind="stable")
        times = np.concatenate([past.times, [t for t, _ in extra]])[order]
        orders = np.concatenate([past.orders, [q for _, q in extra]])[order].astype(np.int64)
        first = past.record.shape[0] - 1
        record, marks, side, held = past.record, past.marks, start.side, start.held
        late = self.late._replace(still=past.still, place=past.place)
        scale, n, events, code = self.floor, self.system.linear.size, 0, integrate.OK
        pieces = max(1, math.ceil((t1 - t0) / PIECE))
        for _, stop in pairwise(np.linspace(t0, t1, pieces + 1)):
            with CompileNotice(), interruptible():
                code, count, side, held, record, marks, times, orders = kernel.integrate_late(
                    self.plant,
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
                    self.longest_step,
                    settings.max_steps - (record.shape[0] - 1 - first),
                    settings.stick_speed,
                    settings.max_events_per_second,
                )
            sizes = np.abs(record[first:, 1 : 2 * n + 1]).max(0)
            scale = (max(scale[0], sizes[:n].max()), max(scale[1], sizes[n:].max()))
            events += count
            if code != integrate.OK:
                break
            if progress is not None:
                progress((stop - t0) / (t1 - t0))
        all_past = Past(record, marks, times, orders, past.still, past.place)
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


def late_forces(system: SeatSystem) -> Array:
    """Accelerations (G, N, 2N+2) by the linear forces of each delay, as in `Plant.linear`."""
    linear, delays = system.linear, system.delays
    n, inverse = linear.size, np.linalg.inv(linear.mass)
    table = np.zeros((len(delays), n, 2 * n + 2))
    for group in linear.delayed:
        k, c = -(inverse @ group.stiffness[:n]), -(inverse @ group.damping[:n])
        table[delays.index(group.delay)] += np.column_stack([k[:, :n], c[:, :n], k[:, n], c[:, n]])
    return table
