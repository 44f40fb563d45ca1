"""Harmonic balance of systems whose elements have states of their own.

The forces of such elements at a given periodic motion are those on the periodic orbit of their
states along it (`kernels.history`), so that the unknowns are the harmonics of the channels' motion
as ever. A small motion changes these forces for the rest of the period; the tangent is therefore
not built but applied, by differences of the residual, inside GMRES (Newton-Krylov), and its lowest
harmonics alone are inverted as preconditioner.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.balance import (
    Balanced,
    condense,
    highest_driven,
    output_names,
    places_of,
)
from seatdyn.analysis.delay_time import LateProblem
from seatdyn.analysis.hysteretic import HystereticProblem, problem_for
from seatdyn.analysis.outputs import named_outputs
from seatdyn.analysis.periodic import sorted_multipliers
from seatdyn.analysis.run import Samples, Settings, interruptible
from seatdyn.errors import Status
from seatdyn.kernels import history as kernels
from seatdyn.kernels.balance import CONVERGED, NOT_CONVERGED
from seatdyn.kernels.columns import IS_JUMP, ON_DISPLACEMENT, ON_VELOCITY
from seatdyn.kernels.condensed import (
    CHANNEL,
    LEVEL,
    MOST_EVENTS,
    PRESENT,
    RESIDUAL,
    ROW,
    SERIES,
    STRENGTH,
    VELOCITY,
    make_work,
)
from seatdyn.kernels.history import FINER, START, History, make_history
from seatdyn.kernels.jit import BALANCE, CompileNotice
from seatdyn.kernels.levels import NOT_ACCURATE, SMALLEST_STRIDE, STRIDE, estimate_of
from seatdyn.kernels.memory import HELD, STATES, Memory
from seatdyn.kernels.orbit import HIGH, LOW, make_look
from seatdyn.model.excitation import Excitation
from seatdyn.model.system import BASE, SeatSystem

Array = NDArray[np.float64]
FEWEST_SAMPLES, MOST_SAMPLES = 128, 4096
TOGETHER = 8  # harmonics of the preconditioner
STEP = 1e-7  # relative, of differences
KRYLOV, FORCING = 30, 1e-2
MOST_STEPS, SMALLEST_STEP = 25, 1.0 / 64.0
NEWTON_SHARE, SMALLEST_RESIDUAL = 0.03, 1e-11  # of the tolerance; what Newton's method may leave
STALLED = 1e-7  # residual, relative, at which no further progress is no failure
MULTIPLIERS = Settings(rtol=1e-10, max_steps=500_000)
MOST_PARTS = 256  # times as many steps of the states as their fastest rate asks for
WINDOW = np.linspace(-1.0, 1.0, 17)  # samples around an extremum, looked at again


@dataclass(frozen=True)
class BalancedWithStates(Balanced):
    """A periodic motion with the states of elements."""

    memory: Memory
    history: History

    @property
    def count(self) -> int:
        """Number of harmonics, the mean included."""
        return self.samples // FINER

    def sample(
        self, phases: Array, rows: NDArray[np.int64] | None = None, sides: Array | None = None
    ) -> Samples:
        """The motion at phases in rad, on one side of the breaks `rows` (-1: none).

        Elements that act late do so with their states of then.
        """
        phases = np.ascontiguousarray(phases)
        columns, n = self.at(phases, rows, sides), self.system.linear.size
        states, forces = self._along(phases)
        first = self.memory.laws[:, STATES]
        for e, element in enumerate(self.system.memory_elements):
            if element.delay:
                then = self._along(phases - self.problem.omega * element.delay)
                own = slice(first[e], first[e + 1])
                states[:, own], forces[:, e] = then[0][:, own], then[1][:, e]
        columns[:, 2 * n : 3 * n] -= forces @ self.memory.pull.T
        samples = self.as_samples(columns, phases)
        force = np.column_stack([samples.force, forces])
        return samples._replace(
            states=states,
            force=force,
            elastic=np.column_stack([samples.elastic, np.zeros_like(forces)]),
            past=tuple(then._replace(force=force) for then in samples.past),
        )

    def carried(self, phases: Array) -> Samples:
        """The motion at phases in rad, with the states that go with the motion of the moment."""
        return self.sample(phases)._replace(states=self._along(phases)[0])

    def _along(self, phases: Array) -> tuple[Array, Array]:
        """States (p, q) that go with the motion at phases in rad, and the forces of both (p, e)."""
        states = np.empty((phases.size, self.history.size.size))
        forces = np.empty((phases.size, len(self.history.place)))
        arguments = (self.problem, self.memory, self.history, self.samples)
        with CompileNotice(BALANCE):
            kernels.states_at(*arguments, np.ascontiguousarray(phases), states, forces)
        return states, forces

    def outputs(self, phases: Array, *sided: Any) -> Array:
        """Every output at phases in rad, (o, p)."""
        return np.array(list(named_outputs(self.system, self.sample(phases, *sided)).values()))

    def start(self) -> Array:
        """State at t = 0: displacements, velocities, states of elements."""
        at = self.sample(np.zeros(1))
        assert at.states is not None
        return np.concatenate([at.displacement[0], at.velocity[0], at.states[0]])

    def find_extrema(self) -> None:
        """Fill the extrema of every output, both sides of every event included."""
        with CompileNotice(BALANCE):
            kernels.look_with_states(self.problem, self.work, self.look, self.samples)
        step = 2 * math.pi / self.samples
        grid = np.linspace(0.0, 2 * math.pi, self.samples, endpoint=False)
        values = self.outputs(grid)
        tops = np.concatenate([values.argmax(1), values.argmin(1)])
        around = grid[tops][:, None] + step * WINDOW
        near = self.outputs(around.ravel() % (2 * math.pi))
        events, count = self.work.events[PRESENT], self.crossing_phases.size
        rows = events[:count, ROW].astype(np.int64)
        beside = [
            self.outputs(self.event_phases, rows, np.full(count, side)) for side in (-1.0, 1.0)
        ]
        gaps = np.abs(np.angle(np.exp(1j * (grid[tops][:, None] - self.event_phases))))
        smooth = np.all(gaps > 1.01 * step, axis=1)  # a jump or corner is no parabola
        for o, series in enumerate(values):
            sides = np.concatenate([b[o] for b in beside]) if count else series[:1]
            for way, sign in ((HIGH, 1.0), (LOW, -1.0)):
                place = o + way * len(values)
                window = sign * near[o].reshape(-1, WINDOW.size)[place]
                top = max(window.max(), (sign * series).max(), (sign * sides).max())
                top = max(top, _vertex(window)) if smooth[place] else top
                self.look.extrema[way, o] = sign * top

    def floquet(self) -> tuple[NDArray[np.complex128], float]:
        """Floquet multipliers, by differences of the map over one period in time.

        And the slowest crossing of a jump, as `Balanced.floquet`.
        """
        from seatdyn.analysis.steady import orbit_scales, period_map

        if self.system.delays:
            return super().floquet()
        problem = HystereticProblem.prepare(self.system, self.motion, self.forces, MULTIPLIERS)
        start, period = self.start(), 2 * math.pi / self.problem.omega
        run = problem.run(0.0, period, problem.start(start))
        if run.status is not Status.OK or np.any(run.marks == HELD):
            return np.full(start.size, np.nan, dtype=complex), -1.0
        scales = orbit_scales(problem, run)
        matrix = period_map(problem, period, run, start, scales)
        return sorted_multipliers(matrix), self._slowest()

    def _slowest(self) -> float:
        """Smallest rate at which a jump is crossed, relative to the largest velocity."""
        events, phases = self.work.events[PRESENT], self.crossing_phases
        rows, channels = events[: phases.size, [ROW, CHANNEL]].astype(np.int64).T
        sides = [self.sample(phases, rows, np.full(phases.size, side)) for side in (-1.0, 1.0)]
        slowest = math.inf
        for e, (r, j) in enumerate(zip(rows, channels, strict=True)):
            p, q = self.problem.breaks[r, [ON_DISPLACEMENT, ON_VELOCITY]]
            if self.problem.breaks[r, IS_JUMP] == 0.0:
                continue
            before, after = (
                p * self._across(s.velocity, s.base[1], j)[e]
                + q * self._across(s.acceleration, s.base[2], j)[e]
                for s in sides
            )
            fastest = np.abs(self.work.samples[VELOCITY, j, : self.samples]).max()
            scale = (abs(p) + abs(q) * self.problem.omega) * fastest
            slowest = min(
                slowest, min(before * after / max(abs(before), 1e-300), abs(before)) / scale
            )
        return slowest


def _vertex(values: Array) -> float:
    """Maximum of equidistant values, by the parabola through the highest and its neighbours."""
    k = min(max(int(np.argmax(values)), 1), values.size - 2)
    left, centre, right = values[k - 1 : k + 2]
    bend = left - 2 * centre + right
    return float(centre - (right - left) ** 2 / (8 * bend) if bend < 0.0 else centre)


class Solver:
    """Newton-Krylov on the harmonics of the channels' motion, one level after the other."""

    def __init__(self, *arrays: Any) -> None:
        """Keep the arrays of the problem."""
        self.problem, self.work, self.memory, self.history = arrays
        self.samples, self.evaluations = FEWEST_SAMPLES, 0
        self.near: NDArray[Any] | None = None  # inverse of the tangent, lowest harmonics
        self.good = True
        self.kept: tuple[Array, Array] = (np.zeros(0), np.zeros(0))

    @property
    def count(self) -> int:
        """Harmonics of the present level, the mean included."""
        return self.samples // FINER

    def vector(self, place: int) -> Array:
        """A series as a real vector, harmonic by harmonic, so that its norm weighs speeds, too."""
        series = self.work.series[place, : self.count] * self.weights[:, None]
        return np.asarray(np.column_stack([series.real, series.imag]).ravel())

    @property
    def weights(self) -> Array:
        """Weights of the harmonics."""
        return np.asarray(np.hypot(1.0, np.arange(self.count)))

    def keep(self) -> None:
        """Remember events and states, that evaluations begin with."""
        self.kept = self.work.events[PRESENT].copy(), self.history.space[START].copy()

    def residual(self, x: Array) -> Array:
        """The residual of a motion."""
        pairs = x.reshape(self.count, 2, -1)
        self.work.series[SERIES, : self.count] = (pairs[:, 0] + 1j * pairs[:, 1]) / self.weights[
            :, None
        ]
        self.work.events[PRESENT], self.history.space[START] = self.kept
        self.evaluations += 1
        with CompileNotice(BALANCE), interruptible():
            self.good = kernels.evaluate_with_states(
                self.problem, self.work, self.memory, self.history, self.samples
            )
        return self.vector(RESIDUAL) if self.good else np.full(x.size, np.inf)

    def precondition(self, x: Array, r: Array) -> None:
        """Invert the tangent of the lowest harmonics."""
        channels = self.problem.lag.size
        size = 2 * channels * min(TOGETHER + 1, self.count)
        tangent, step = np.eye(size), STEP * np.linalg.norm(x)
        for i in range(size):
            if channels <= i < 2 * channels:  # the mean has no imaginary part
                continue
            moved = x.copy()
            moved[i] += step
            tangent[:, i] = (self.residual(moved) - r)[:size] / step
        self.near = np.linalg.inv(tangent) if np.all(np.isfinite(tangent)) else np.eye(size)

    def direction(self, x: Array, r: Array) -> Array:
        """Newton's step, nearly."""
        from scipy.sparse.linalg import LinearOperator, gmres

        assert self.near is not None
        near, size = self.near, len(self.near)

        def nearly(v: Array) -> Array:
            return np.concatenate([near @ v[:size], v[size:]])

        def apply(v: Array) -> Array:
            length = max(float(np.linalg.norm(v)), 1e-300)
            step = STEP * float(np.linalg.norm(x)) / length
            change = (self.residual(x + step * v) - r) / step
            return change if np.all(np.isfinite(change)) else v

        tangent = LinearOperator((x.size, x.size), matvec=lambda v: apply(nearly(v)), dtype=float)
        found, _ = gmres(tangent, -r, rtol=FORCING, restart=KRYLOV, maxiter=1)
        return nearly(found)

    def solve(self, tolerance: float, *, final: bool = True) -> tuple[int, float]:
        """Newton's method from the present series; code, and what is left relative to its size.

        final : False on the way of a continuation, where the steps of the states may be rough
        """
        x = self.vector(SERIES)
        self.keep()
        r = self.residual(x)
        if not np.all(np.isfinite(r)):
            return NOT_CONVERGED, math.inf
        for _ in range(MOST_STEPS):
            self.keep()
            r = self.residual(x)  # with the events of this motion
            size, norm = float(np.linalg.norm(x)) + 1e-300, float(np.linalg.norm(r))
            if not np.isfinite(norm):  # of too many events, say: no step leads on from there
                return NOT_CONVERGED, math.inf
            if norm <= tolerance * size and not final:
                return CONVERGED, norm / size
            if norm <= tolerance * size:
                # steps of the states are halved while that matters: the estimate compares levels,
                # whose steps may be the same
                self.history.parts[0] *= 2
                finer = self.residual(x)
                if np.linalg.norm(finer - r) <= tolerance * size:
                    self.history.parts[0] //= 2
                    return CONVERGED, max(norm, float(np.linalg.norm(finer))) / size
                if self.history.parts[0] < MOST_PARTS:
                    continue
                self.history.parts[0] //= 2
                return NOT_CONVERGED, norm / size
            if self.near is None:
                self.precondition(x, r)
            step, share = self.direction(x, r), 1.0
            while share >= SMALLEST_STEP:
                trial = self.residual(x + share * step)
                if np.linalg.norm(trial) <= (1.0 - 0.1 * share) * norm:
                    break
                share *= 0.5
            else:
                self.residual(x)
                return (CONVERGED if norm <= STALLED * size else NOT_CONVERGED), norm / size
            if np.linalg.norm(trial) > 0.1 * norm:
                self.near = None
            x = x + share * step
        return NOT_CONVERGED, math.inf

    def begin(self) -> None:
        """Responses of this level, and the motion without channel forces."""
        with CompileNotice(BALANCE):
            kernels.begin(self.problem, self.work, self.count)

    def continue_in(self, which: int, tolerance: float) -> int:
        """Raise the strength of the channel forces, or the level of the excitation, from zero."""
        reached, stride, series = 0.0, STRIDE, np.zeros_like(self.work.series[SERIES])
        code = NOT_CONVERGED
        while reached < 1.0 and stride >= SMALLEST_STRIDE:
            target = min(1.0, reached + stride)
            self.problem.scale[which] = target
            self.begin()
            if reached > 0.0:
                grown = target / reached if which == LEVEL else 1.0
                self.work.series[SERIES] = series * grown
            code, _ = self.solve(tolerance, final=target == 1.0)
            if code == CONVERGED:
                reached, stride = target, 2.0 * stride
                series = self.work.series[SERIES].copy()
            else:
                stride *= 0.25
        self.problem.scale[which] = 1.0
        return code if reached == 1.0 else NOT_CONVERGED


def balance_with_states(
    system: SeatSystem, excitation: Excitation, tolerance: float, most: int = MOST_SAMPLES
) -> Balanced | None:
    """Motion with the period of the excitation; None where the base motion is no sum of sines."""
    in_time = problem_for(system, excitation, MULTIPLIERS)
    assert isinstance(in_time, HystereticProblem | LateProblem)
    elements, across = system.memory_elements, places_of(system)
    known = len(across)
    travels = [(e.between, e.delay) for e in elements]
    nodes = [((BASE, e.between[1]), 0.0) for e in elements]
    across += dict.fromkeys(p for p in (*travels, *nodes) if p not in across and len(set(p[0])) > 1)
    problem = condense(system, excitation, across[known:])
    if problem is None:
        return None
    place = [
        (
            across.index(travel),
            across.index(node) if node in across else -1,
            int(bool(e.lower().breaks)),
        )
        for e, travel, node in zip(elements, travels, nodes, strict=True)
    ]
    first = FEWEST_SAMPLES
    while first // FINER <= 2 * highest_driven(problem):
        first *= 2
    most = max(most, 4 * first)
    names, n = output_names(system), system.linear.size
    work = make_work(n, len(across), most)
    history = make_history(np.array(place, dtype=np.int64), in_time.state_scale, most)
    settled = [s for e in elements for s in e.settled(0.0)]
    history.space[START] = settled
    columns = 3 * n + sum(len(channel.elements) for channel in system.channels) + 3
    columns += len(system.delays) * (2 * n + 2)
    look = make_look(np.zeros((len(names), columns)), n, most)
    solver = Solver(problem, work, in_time.memory, history)
    solver.samples = first

    def result(code: int, error: float) -> BalancedWithStates:
        return BalancedWithStates(
            system, in_time.forces, problem, work, look, names, code, error, solver.samples,
            solver.evaluations, in_time.memory, history,
        )  # fmt: skip

    return _ascend(solver, result, tolerance, most)


def _ascend(
    solver: Solver,
    result: Callable[[int, float], BalancedWithStates],
    tolerance: float,
    most: int,
) -> BalancedWithStates:
    """Levels with twice the samples each, until the extrema of the outputs do not change."""
    newton = max(NEWTON_SHARE * tolerance, SMALLEST_RESIDUAL)
    solver.begin()
    settled = solver.history.space[START].copy()
    code, left = solver.solve(newton)
    for which in (STRENGTH, LEVEL):
        if code != CONVERGED:
            solver.near, solver.history.space[START] = None, settled
            solver.work.events[PRESENT, MOST_EVENTS, 0] = 0.0
            code, left = solver.continue_in(which, newton), newton
    if code != CONVERGED:
        return result(code, math.inf)
    change, before, past = math.inf, math.inf, None
    while True:
        found = result(code, math.inf)
        found.find_extrema()
        extrema = found.look.extrema[[HIGH, LOW]].copy()
        if past is not None:
            half = np.maximum((extrema[0] - extrema[1]) / 2, 1e-300)
            moved = np.abs(extrema - past).max(0)
            moved[moved <= 1e-13 * np.abs(extrema).max(0)] = 0.0
            before, change = change, float((moved / half).max())
            estimate = float(estimate_of.py_func(change, before, False, left))
            if estimate <= tolerance:
                return result(CONVERGED, estimate)
            if 2 * solver.samples > most:
                return result(NOT_ACCURATE, estimate)
        past = extrema
        old = solver.count
        solver.samples *= 2
        with CompileNotice(BALANCE):
            kernels.refine(solver.problem, solver.work, old, solver.count)
        code, left = solver.solve(newton)
        if code != CONVERGED:
            return result(code, math.inf)
