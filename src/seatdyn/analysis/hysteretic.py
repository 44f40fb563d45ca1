"""Time runs of systems whose elements have states of their own, or with forces on their nodes.

The exact steps of the linear part (`ladder`) know motion only, so that such runs are made by
Dormand-Prince steps that carry the states along. Everything else asks a `Problem` and its `Run`,
and does not see the difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

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
from seatdyn.kernels import hysteretic, integrate
from seatdyn.kernels.columns import (
    BREAKS,
    FIRST,
    ON_DISPLACEMENT,
    ON_VELOCITY,
    SECOND,
    VALUE,
)
from seatdyn.kernels.jit import MEMORY_FORCE, MEMORY_RATE, CompileNotice, law_address
from seatdyn.kernels.memory import HELD, Memory
from seatdyn.kernels.plant import FREE, Plant
from seatdyn.model.excitation import Excitation, Motion
from seatdyn.model.force import ConstantForce, ExternalForce, base_and_forces
from seatdyn.model.system import BASE, SeatSystem

Array = NDArray[np.float64]


def problem_for(system: SeatSystem, excitation: Excitation, settings: Settings) -> Problem:
    """The problem of a system under an excitation, with the engine that it needs."""
    from seatdyn.analysis.delay_time import LateProblem

    base, forces = base_and_forces(excitation)
    if system.delays:
        return LateProblem.make(system, base.motion, settings, forces)
    if system.memory_elements or forces:
        return HystereticProblem.prepare(system, base.motion, forces, settings)
    return Problem.make(system, base.motion, settings)


@dataclass(frozen=True)
class HystereticRun(Run):
    """A run whose record has the states beside the motion."""

    @property
    def slips(self) -> bool:
        """Whether some jump is rested on for a part of the run."""
        held = self.marks == HELD
        return bool(np.any(held.any(0) & ~held.all(0)))

    def states(self, time: Array) -> Array:
        """Displacements and velocities (p, 2N) alone at these times (s)."""
        samples = self.at(time)
        return np.hstack([samples.displacement, samples.velocity])

    def sample(self, index: NDArray[np.int64], share: Array) -> Samples:
        """The solution at `share` of the steps `index`."""
        problem = self.problem
        assert isinstance(problem, HystereticProblem)
        share = np.ascontiguousarray(share, dtype=float)
        index = np.ascontiguousarray(index, dtype=np.int64)
        with CompileNotice():
            arrays = hysteretic.sample(
                problem.plant, problem.memory, self.record, self.marks, index, share
            )
        samples = Samples(*arrays[:-1])
        outside = np.zeros_like(samples.displacement)
        for column, place in zip(arrays[-1].T, problem.memory.pushed, strict=True):
            outside[:, place] += column
        return samples._replace(outside=outside)


@dataclass(frozen=True)
class HystereticProblem(Problem):
    """A system with states beside its motion, lowered once."""

    memory: Memory
    state_scale: Array
    forces: tuple[ExternalForce, ...]

    @classmethod
    def prepare(
        cls,
        system: SeatSystem,
        motion: Motion,
        forces: tuple[ExternalForce, ...],
        settings: Settings,
    ) -> HystereticProblem:
        """Lower `system`, `motion` and `forces`."""
        plant = lower(system, motion, memory=True)
        memory, scale = lower_memory(system, plant, forces)
        steps = [motion.longest_step, *(force.history.longest_step for force in forces)]
        longest = min(*steps, LONGEST_LADDER_STEP)
        return cls(system, motion, settings, plant, None, longest, memory, scale, forces)

    @property
    def uses_ladder(self) -> bool:
        """Never."""
        return False

    @property
    def state_floor(self) -> Array:
        """Sizes of the states below which errors are absolute."""
        return SHARE_OF_INPUT * self.state_scale

    def start(self, y: Array) -> State:
        """A state of motion (2N,), elements settled there; or motion and states."""
        y = np.array(y, dtype=float)
        if y.size == 2 * self.system.linear.size:
            y = np.concatenate(
                [y, settled_states(self.system, y, float(self.motion.evaluate(0.0)))]
            )
        sides = np.zeros(self.memory.edges.shape[0], dtype=np.int64)
        return State(y, sides, np.zeros(0, dtype=np.int64))

    def rest_pulls(self, z: Array, x0: float) -> Array:
        """Forces in N, downwards, on the nodes at rest at `z` (m), (elements and forces, N)."""
        return rest_pulls(self.system, self.forces, z, x0)

    def run(
        self,
        t0: float,
        t1: float,
        start: State,
        progress: Callable[[float], None] | None = None,
    ) -> Run:
        """Integrate from t0 to t1 (s); `progress` is called with the share done."""
        settings, n = self.settings, self.system.linear.size
        pieces = max(1, math.ceil((t1 - t0) / PIECE))
        records, marks = [], []
        events, steps, state, code = 0, 0, start, integrate.OK
        floor = np.repeat(self.floor, n)
        scale = np.concatenate([floor, self.state_floor])
        stops = np.unique(np.concatenate([self.motion.starts, self.memory.waves[:, 1]]))
        times = np.linspace(t0, t1, pieces + 1)
        for begin, stop in pairwise(times):
            with CompileNotice(), interruptible():
                code, count, side, record, mark = hysteretic.integrate(
                    self.plant,
                    self.memory,
                    float(begin),
                    float(stop),
                    state.y,
                    state.side,
                    stops,
                    settings.rtol,
                    scale,
                    self.longest_step,
                    settings.max_steps - steps,
                    self.stick_speed,
                    settings.max_events_per_second,
                )
            held = np.where(side == HELD, 0, FREE)
            state = State(record[-1, 1:].copy(), side, held)
            events += count
            steps += record.shape[0] - 1
            records.append(record)
            marks.append(mark)
            if code != integrate.OK:
                break
            if progress is not None:
                progress((stop - t0) / (t1 - t0))
        joined = np.concatenate([*(r[:-1] for r in records), records[-1][-1:]])
        joined_marks = np.concatenate([*(m[:-1] for m in marks), marks[-1][-1:]])
        return HystereticRun(self, STATUS[code], events, joined, joined_marks, state)


def settled_states(system: SeatSystem, z: Array, x0: float) -> Array:
    """States (q,) of the elements after a long rest at displacements `z` (m), the base at `x0`."""
    motion = dict(zip(system.linear.nodes, z, strict=False))
    motion[BASE] = x0
    states: list[float] = []
    for element in system.memory_elements:
        first, second = element.between
        states += element.settled(motion[second] - motion[first])
    return np.array(states)


def rest_pulls(system: SeatSystem, forces: tuple[ExternalForce, ...], z: Array, x0: float) -> Array:
    """Forces in N, downwards, on the nodes at rest at `z` (m), a row (N,) for each element with
    states, settled, and for each constant force from outside.
    """
    motion = np.append(z, x0)
    place = {node: i for i, node in enumerate((*system.linear.nodes, BASE))}
    rows: list[Array] = []
    for element in system.memory_elements:
        row = np.zeros(motion.size)
        row[[place[node] for node in element.between]] = -1.0, 1.0
        law, d = element.lower(), float(row @ motion)
        rows.append(row * law.force(d, 0.0, element.settled(d), law.parameters))
    for outside in forces:
        row = np.zeros(motion.size)
        row[place[outside.node]] = -1.0
        rows += [row * outside.level] if isinstance(outside, ConstantForce) else []
    return np.array(rows).reshape(-1, motion.size)[:, :-1]


def lower_memory(
    system: SeatSystem, plant: Plant, forces: tuple[ExternalForce, ...]
) -> tuple[Memory, Array]:
    """Arrays of the elements with states and of the forces, and the size of each state."""
    elements = system.memory_elements
    laws = [element.lower() for element in elements]
    n = plant.linear.shape[0]
    inverse = np.linalg.inv(system.linear.mass)

    def index(node: str) -> int:
        return -1 if node == BASE else system.linear.index(node)

    pairs = [[index(node) for node in element.between] for element in elements]
    nodes = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    incidence = np.zeros((n, len(elements)))
    for column, (first, second) in enumerate(nodes):
        if first >= 0:
            incidence[first, column] -= 1.0
        if second >= 0:
            incidence[second, column] += 1.0
    rows = [
        (law_address(law.force, element.name, MEMORY_FORCE),
         law_address(law.rate, element.name, MEMORY_RATE))
        for law, element in zip(laws, elements, strict=True)
    ]  # fmt: skip
    begins = np.column_stack(
        [_starts([law.parameters for law in laws]), _starts([law.scale for law in laws])]
    )
    edges = _edges(plant)
    for law, pair in zip(laws, nodes, strict=True):
        edges += [(*pair, b.displacement, b.velocity, b.value) for b in law.breaks]
    pushed = [system.linear.index(force.node) for force in forces]
    memory = Memory(
        nodes=nodes,
        laws=np.column_stack([np.array([*rows, (0, 0)], dtype=np.int64), begins]),
        parameters=np.array([*(p for law in laws for p in law.parameters), 0.0]),
        pull=np.ascontiguousarray(inverse @ incidence),
        edges=np.array(edges, dtype=float).reshape(-1, 5),
        push=np.ascontiguousarray(inverse[:, pushed]),
        pushed=np.array(pushed, dtype=np.int64),
        waves=_with_number([_segments(force.history) for force in forces], 11),
        sines=_with_number([force.history.sines for force in forces], 4),
    )
    return memory, np.array([size for law in laws for size in law.scale])


def _segments(motion: Motion) -> Array:
    """Start, polynomial and sine of every segment."""
    return np.column_stack([motion.starts, motion.polynomials, motion.segment_sines])


def _with_number(tables: list[Array], columns: int) -> Array:
    """The rows of all tables, each with the number of its table in front."""
    rows = [np.column_stack([np.full(len(t), i), t]) for i, t in enumerate(tables)]
    return np.concatenate([*rows, np.zeros((0, columns))])


def _edges(plant: Plant) -> list[tuple[float, ...]]:
    """The breaks of the plant's laws with their nodes, in its order."""
    return [
        (
            *plant.channels[j, [FIRST, SECOND]],
            *plant.breaks[r, [ON_DISPLACEMENT, ON_VELOCITY]],
            plant.breaks[r, VALUE],
        )
        for j in range(plant.gain.shape[0])
        for r in range(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS])
    ]


def _starts(lists: list[tuple[float, ...]]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum([len(items) for items in lists])]).astype(np.int64)
