"""Harmonic balance of a seat system: from model objects to the kernels and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.delay_orbit import late_multipliers, late_state
from seatdyn.analysis.delay_time import LateProblem, LateState, late_forces
from seatdyn.analysis.lowering import lower
from seatdyn.analysis.outputs import named_outputs
from seatdyn.analysis.periodic import PER_PERIOD, sorted_multipliers
from seatdyn.analysis.run import Samples, Settings, interruptible
from seatdyn.errors import ModelError, RequestError
from seatdyn.kernels import floquet, levels, orbit
from seatdyn.kernels.balance import CONVERGED
from seatdyn.kernels.columns import BREAKS, ELEMENTS, FIRST, SECOND
from seatdyn.kernels.condensed import (
    CHANNEL,
    KEPT,
    MOST_EVENTS,
    OVERSAMPLING,
    PHASE,
    PRESENT,
    Condensed,
    Work,
    make_work,
)
from seatdyn.kernels.dense import element_forces
from seatdyn.kernels.jit import BALANCE, CompileNotice
from seatdyn.kernels.levels import NOT_ACCURATE
from seatdyn.kernels.orbit import Look, make_look
from seatdyn.kernels.together import compile_together
from seatdyn.model.elements import NonlinearElement
from seatdyn.model.excitation import DEGREES, Excitation, Motion
from seatdyn.model.force import ExternalForce, base_and_forces
from seatdyn.model.memory import MemoryElement
from seatdyn.model.system import BASE, SeatSystem

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
FEWEST_SAMPLES, GUESSED_SAMPLES, MOST_SAMPLES = 64, 128, 4096  # of a period
DELAYED = Settings(rtol=1e-9)  # of the runs for the multipliers of a system with delays
LOOSE = 1e12  # condition of the stiffness from which on springs alone do not hold the seat
SAME_FREQUENCY = 1e-9  # relative: how near a sine must be to a multiple of 1/period


def harmonics_of(motion: Motion, period: float) -> NDArray[np.complex128] | None:
    """Complex harmonics of a base displacement in m, or of a force in N.

    None where it is not a sum of sines.
    """
    omega = 2 * math.pi / period
    steady = motion.starts.size == 1 and not np.any(motion.polynomials[0, 1:])
    sines = [row for row in (*motion.sines, *motion.segment_sines) if row[0] != 0.0]
    multiples = [row[1] / omega for row in sines]
    if not steady or any(abs(k - round(k)) > SAME_FREQUENCY * k for k in multiples):
        return None
    base = np.zeros(max([1, *(round(k) for k in multiples)]) + 1, complex)
    base[0] = motion.polynomials[0, 0]
    for (amplitude, _, phase), k in zip(sines, multiples, strict=True):
        # a sin(theta + phase) = Re[-i a exp(i phase) exp(i theta)]
        base[round(k)] += -1j * amplitude * np.exp(1j * phase)
    return base


Place = tuple[tuple[str, str], float]  # a pair of nodes, and the delay of what acts across it


def condense(
    system: SeatSystem, excitation: Excitation, watched: Sequence[Place] = ()
) -> Condensed | None:
    """Arrays of the periodic problem, or None where what drives it is not a sum of sines.

    watched : further pairs of nodes whose relative motion is to be known, as channels without laws,
        and the delays of the forces that others find for them
    """
    if excitation.period is None:
        raise RequestError(f"{type(excitation).__name__} has no period.")
    moving, forces = base_and_forces(excitation)
    base = harmonics_of(moving.motion, excitation.period)
    push = _push(system, forces, excitation.period)
    if base is None or push is None:
        return None
    plant = lower(system, moving.motion, delays=True, memory=bool(system.memory_elements))
    n, across = system.linear.size, [*places_of(system), *watched]
    places = [[place_of(system, node) for node in pair] for pair, _ in across]
    ends = np.array(places, dtype=np.int64).reshape(-1, 2)
    last = np.repeat(plant.channels[-1:, [ELEMENTS, BREAKS]], len(watched), axis=0)
    laws = np.vstack([plant.channels[:, [ELEMENTS, BREAKS]], last])
    unit = np.eye(n + 1)  # the base is the last
    incidence = unit[ends[:, 1]] - unit[ends[:, 0]]
    linear = plant.linear.copy()
    pull = np.linalg.solve(system.linear.prompt.mass, incidence[:, :n].T)
    shift = np.zeros(len(across))
    if np.linalg.cond(linear[:, :n]) > LOOSE:
        shift = bearing_stiffness(system, across)
        linear[:, [*range(n), 2 * n]] -= (pull * shift) @ incidence
    pull = np.ascontiguousarray(pull)
    stiff, damped = linear[:, :n], linear[:, n : 2 * n]
    later = np.stack([damped @ pull, (damped @ damped + stiff) @ pull])
    return Condensed(
        linear, pull, incidence[:, :n] @ pull, later, incidence[:, :n] @ later,
        np.column_stack([np.vstack([ends, [[0, 0]]]), laws]), plant.elements, plant.parameters,
        plant.breaks, base, shift,
        np.array([delay for _, delay in across]), np.ones(2),
        2 * math.pi / excitation.period, np.array(system.delays), late_forces(system),
        push,
    )  # fmt: skip


def _push(
    system: SeatSystem, forces: Sequence[ExternalForce], period: float
) -> NDArray[np.complex128] | None:
    """Harmonics (P, N) of the accelerations by forces from outside, or None, see `harmonics_of`."""
    inverse = np.linalg.inv(system.linear.mass)
    push: NDArray[np.complex128] = np.zeros((0, len(inverse)), dtype=complex)
    for force in forces:
        series = harmonics_of(force.history, period)
        if series is None:
            return None
        if len(push) < series.size:
            push = np.pad(push, ((0, series.size - len(push)), (0, 0)))
        push[: series.size] += np.outer(series, inverse[:, system.linear.index(force.node)])
    return push


def places_of(system: SeatSystem) -> list[Place]:
    """Where the channels of a system are, in their order."""
    return [(channel.between, channel.delay) for channel in system.channels]


def place_of(system: SeatSystem, node: str) -> int:
    """Place of a node among the free ones, -1 for the base."""
    return -1 if node == BASE else system.linear.index(node)


def bearing_stiffness(system: SeatSystem, across: Sequence[Place]) -> Array:
    """Stiffness at rest in N/m of each place, of elements that have one and act at once."""
    total = np.zeros(len(across))
    for element in (*system.nonlinear_elements, *system.memory_elements):
        with suppress(ModelError, np.linalg.LinAlgError):
            if isinstance(element, MemoryElement):
                stiffness = float(element.linearised().stiffness(0.0).real)
            else:
                assert isinstance(element, NonlinearElement)
                stiffness = element.tangent()[0]
            if element.delay == 0.0 and np.isfinite(stiffness):
                total[across.index((element.between, 0.0))] += stiffness
    return total


def output_rows(system: SeatSystem) -> tuple[list[str], Array]:
    """Names of the outputs, and each as a combination of the C columns of a sample, (o, C)."""
    n, e = system.linear.size, sum(len(channel.elements) for channel in system.channels)
    unit = np.eye(3 * n + e + 3 + len(system.delays) * (2 * n + 2))
    outputs = named_outputs(system, samples_of(system, unit, np.zeros(len(unit))))
    return list(outputs), np.array(list(outputs.values()))


def output_names(system: SeatSystem) -> list[str]:
    """Names of the outputs."""
    n, q = system.linear.size, len(system.memory_elements)
    none = np.zeros((0, sum(len(channel.elements) for channel in system.channels) + q))
    still = np.zeros((0, n))
    empty = Samples(np.zeros(0), np.zeros((3, 0)), still, still, still, none, none)
    return list(named_outputs(system, empty._replace(past=(empty,) * len(system.delays))))


def samples_of(system: SeatSystem, columns: Array, time: Array) -> Samples:
    """Columns (p, C) of the kernels as samples, what delayed forces see included.

    Forces are those that act, also in the samples of the past, whose forces act now.
    """
    n, e = system.linear.size, sum(len(channel.elements) for channel in system.channels)
    z, v, a, force = np.split(columns[:, : 3 * n + e], [n, 2 * n, 3 * n], axis=1)
    base, unknown = 3 * n + e, np.full_like(z, np.nan)
    past = []
    for g, delay in enumerate(system.delays):
        first = base + 3 + g * (2 * n + 2)
        then = columns[:, first : first + 2 * n + 2].T
        still = np.stack([then[2 * n], then[2 * n + 1], np.zeros(len(columns))])
        past.append(
            Samples(time - delay, still, then[:n].T, then[n : 2 * n].T, unknown, force, force)
        )
    present = columns[:, base : base + 3].T
    return Samples(time, present, z, v, a, force, np.zeros_like(force), past=tuple(past))


@dataclass(frozen=True)
class Balanced:
    """A periodic motion found by harmonic balance, or why there is none.

    forces : from outside
    code : of the kernels; `message` says it in words
    error : estimate, relative to the amplitude of each output
    """

    system: SeatSystem
    forces: tuple[ExternalForce, ...]
    problem: Condensed
    work: Work
    look: Look
    names: list[str]
    code: int
    error: float
    samples: int
    evaluations: int

    @property
    def count(self) -> int:
        """Number of harmonics, the mean included."""
        return self.samples // OVERSAMPLING

    @property
    def found(self) -> bool:
        """Whether the equations are solved (to whatever accuracy)."""
        return self.code in (CONVERGED, NOT_ACCURATE)

    def at(self, phases: Array, rows: Integers | None = None, sides: Array | None = None) -> Array:
        """Columns (p, 3N + e + 3) of the motion at phases in rad."""
        rows = np.full(phases.size, -1, dtype=np.int64) if rows is None else rows
        sides = np.zeros(phases.size) if sides is None else sides
        result = np.empty((phases.size, self.look.rows.shape[1]))
        arguments = (self.problem, self.work, self.look, self.count, phases, rows, sides)
        with CompileNotice(BALANCE):
            orbit.states(*arguments, result)
        return result

    @property
    def crossing_phases(self) -> Array:
        """Phases of the breaks of laws that the motion meets, rad."""
        events = self.work.events[PRESENT]
        return np.asarray(events[: int(events[MOST_EVENTS, 0]), PHASE])

    @property
    def event_phases(self) -> Array:
        """Phases at which forces jump or have a corner, rad."""
        phases = self.crossing_phases
        channels = self.work.events[PRESENT, : phases.size, CHANNEL].astype(int)
        return np.asarray(phases + self.problem.omega * self.problem.lag[channels])

    def sample(self, phases: Array) -> Samples:
        """The motion at phases in rad, as a time run gives it."""
        return self.as_samples(self.at(np.ascontiguousarray(phases)), phases)

    def as_samples(self, columns: Array, phases: Array) -> Samples:
        """Columns at phases in rad as samples, with the elastic part of the forces."""
        samples = samples_of(self.system, columns, phases / self.problem.omega)
        z, base, linear = samples.displacement, samples.base, self.system.linear
        if self.forces:
            outside = np.zeros_like(z)
            for force in self.forces:
                outside[:, linear.index(force.node)] += force.force(samples.time)
            samples = samples._replace(outside=outside)
        elastic = [
            element_forces(self.problem, j, self._across(z, base[0], j), np.zeros(len(z)))
            for j in range(len(self.system.channels))
        ]
        return samples._replace(elastic=np.column_stack([*elastic, z[:, :0]]))

    def in_period(self) -> Samples:
        """The motion at many phases of its period."""
        return self.sample(2 * np.pi * np.arange(PER_PERIOD) / PER_PERIOD)

    def _across(self, z: Array, base: Array, j: int) -> Array:
        extended = np.column_stack([z, base])
        first, second = self.problem.channels[j, [FIRST, SECOND]]
        return np.ascontiguousarray(extended[:, second] - extended[:, first])

    def floquet(self) -> tuple[NDArray[np.complex128], float]:
        """Floquet multipliers, largest first, and the slowest crossing of a jump.

        The latter is relative to the fastest motion; negative where the motion would stick, and
        infinite, that is not looked at, with delays.
        """
        if self.system.delays:
            late = LateProblem.make(self.system, self.motion, DELAYED, self.forces)
            period = 2 * math.pi / self.problem.omega
            return late_multipliers(late, self.late_start(late), period), math.inf
        n, m = self.problem.pull.shape
        space, slopes = np.zeros((6, 2 * n, 2 * n)), np.zeros((3, 4, m))
        with CompileNotice(BALANCE):
            slowest = floquet.monodromy(self.problem, self.work, self.samples, 1, space, slopes)
        return sorted_multipliers(space[0]), float(slowest)

    @property
    def motion(self) -> Motion:
        """The base motion."""
        base, omega = self.problem.base, self.problem.omega
        sines = [(abs(x), k * omega, np.angle(x) + np.pi / 2) for k, x in enumerate(base) if k]
        constant = np.zeros((1, DEGREES))
        constant[0, 0] = base[0].real
        return Motion(polynomials=constant, sines=np.array(sines).reshape(-1, 3))

    def late_start(self, problem: LateProblem) -> LateState:
        """State at t = 0 of a system with delays, with the past that it needs."""
        omega = self.problem.omega
        breaks = self.event_phases % (2 * np.pi)
        turns = np.arange(-1.0 - problem.longest_delay * omega // (2 * np.pi), 1.0)
        times = (breaks[:, None] + 2 * np.pi * turns) / omega
        return late_state(problem, lambda t: self.carried(omega * t), times.ravel())

    def carried(self, phases: Array) -> Samples:
        """The motion at phases in rad, with the states that go with the motion of the moment."""
        return self.sample(phases)

    def start(self) -> Array:
        """State at t = 0: displacements, then velocities, (2N,)."""
        return self.at(np.zeros(1))[0, : 2 * self.system.linear.size]


def balance(
    system: SeatSystem,
    excitation: Excitation,
    tolerance: float,
    *,
    guess: NDArray[np.complex128] | None = None,
    most: int = MOST_SAMPLES,
) -> Balanced | None:
    """Motion with the period of the excitation by harmonic balance.

    None where base motion or forces are no sums of sines.

    Parameters
    ----------
    tolerance : of the error estimate, relative to the amplitude of each output
    guess : harmonics of the relative motion of the channels to start from, (h, m); else the linear
        response is the start
    most : samples of a period, a power of two
    """
    if system.memory_elements:
        from seatdyn.analysis.balance_states import balance_with_states

        return balance_with_states(system, excitation, tolerance)
    problem = condense(system, excitation)
    if problem is None:
        return None
    names, rows = output_rows(system)
    work, look = spaces(system, rows, max(most, 4 * _first_samples(problem, guess)))
    with CompileNotice(BALANCE), interruptible():
        return solve(
            system, problem, rows, names, work, look, tolerance, guess=guess,
            forces=base_and_forces(excitation)[1],
        )  # fmt: skip


def _first_samples(problem: Condensed, guess: NDArray[np.complex128] | None) -> int:
    """Samples of the coarsest level."""
    first = FEWEST_SAMPLES
    while first // OVERSAMPLING <= 2 * highest_driven(problem):
        first *= 2
    return first if guess is None else max(first, GUESSED_SAMPLES)


def highest_driven(problem: Condensed) -> int:
    """Highest harmonic of what drives from outside."""
    return max(problem.base.size, len(problem.push)) - 1


def spaces(system: SeatSystem, rows: Array, most: int) -> tuple[Work, Look]:
    """Space for solutions of up to so many samples."""
    nodes = system.linear.size
    return make_work(nodes, len(system.channels), most), make_look(rows, nodes, most)


def solve(
    system: SeatSystem,
    problem: Condensed,
    rows: Array,
    names: list[str],
    work: Work,
    look: Look,
    tolerance: float,
    *,
    guess: NDArray[np.complex128] | None = None,
    forces: tuple[ExternalForce, ...] = (),
) -> Balanced:
    """Motion of a problem, in spaces given: it is lost when these are used again."""
    first, look = _first_samples(problem, guess), look._replace(rows=rows)
    if guess is not None:
        known = min(len(guess), first // OVERSAMPLING)
        work.series[KEPT, :known] = guess[:known]
    compile_together(levels.__name__)
    code, error, samples, evaluations = levels.ascend(
        problem, work, look, tolerance, first, work.lines.shape[1], guess is not None
    )
    return Balanced(system, forces, problem, work, look, names, code, error, samples, evaluations)
