"""The energy balance of a run: a check that no force law, event or active force is wrong.

    dE/dt = -F_s x0' - dissipation + power of the feedback forces

E is the kinetic energy plus the elastic energy of links, springs and elements. An element's force
is split into its value at zero velocity, which is elastic (its energy is the integral of the law
over the displacement, whatever the run did), and the rest, which dissipates.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.outputs import seen_by
from seatdyn.analysis.run import Run, Samples
from seatdyn.kernels import dense
from seatdyn.kernels.columns import BREAKS, ELEMENTS, FIRST, ON_VELOCITY, SECOND, VALUE
from seatdyn.kernels.plant import Plant
from seatdyn.model.system import BASE, SeatSystem

Array = NDArray[np.float64]
WORST_RESIDUAL = 1e-4  # of the throughput, beyond which a result is not to be used
CHUNK = 20_000  # steps looked at together
GAUSS = np.polynomial.legendre.leggauss(5)
GAUSS_POTENTIAL = np.polynomial.legendre.leggauss(20)


@dataclass(frozen=True)
class EnergyBalance:
    """Works in J over the run; `residual` is what does not add up, relative to the throughput.

    The throughput is the integral of the absolute powers, or the energy stored at the begin or the
    end where that is more (free vibration).
    """

    change: float
    base_work: float
    dissipated: float
    feedback_work: float
    throughput: float
    force_work: float = 0.0

    @property
    def residual(self) -> float:
        """|change - work of base, feedback and outside forces + dissipation| / throughput."""
        put_in = self.base_work + self.feedback_work + self.force_work
        defect = self.change - put_in + self.dissipated
        return abs(defect) / max(self.throughput, 1e-300)

    def closes(self, rtol: float) -> bool:
        """Whether the residual is what the tolerance of the run lets expect."""
        return self.residual <= max(WORST_RESIDUAL, 100 * rtol)


def energy_balance(run: Run) -> EnergyBalance:
    """Energy balance of a run, each power integrated by Gauss quadrature over its steps."""
    shares, weights = (GAUSS[0] + 1) / 2, GAUSS[1] / 2
    sizes = np.diff(run.record[:, 0])
    works = np.zeros(5)
    for first in range(0, run.steps, CHUNK):
        last = min(first + CHUNK, run.steps)
        samples = run.in_steps(shares, first, last)
        inside = powers(run.problem.system, run.problem.plant, samples)
        flows = np.array([*inside, outside_power(samples)])
        measure = (sizes[first:last, None] * weights).ravel()
        works += np.vstack([flows, np.abs(flows).sum(0)]) @ measure
    ends = run.sample(np.array([0, run.steps - 1]), np.array([0.0, 1.0]))
    energies = stored_energy(run, ends)
    return EnergyBalance(
        change=float(energies[1] - energies[0]),
        base_work=float(works[0]),
        dissipated=float(works[1]),
        feedback_work=float(works[2]),
        force_work=float(works[3]),
        throughput=max(float(works[4]), float(np.abs(energies).max())),
    )


def outside_power(samples: Samples) -> Array:
    """Power put in by forces from outside, (p,), W."""
    if samples.outside is None:
        return np.zeros(samples.time.size)
    return np.asarray(np.einsum("pi,pi->p", samples.outside, samples.velocity))


def _extended(samples: Samples) -> tuple[Array, Array]:
    """Displacements and velocities with the base as last node, (p, N+1)."""
    z = np.column_stack([samples.displacement, samples.base[0]])
    v = np.column_stack([samples.velocity, samples.base[1]])
    return z, v


def powers(system: SeatSystem, plant: Plant, samples: Samples) -> tuple[Array, Array, Array]:
    """Power put in by the base, dissipated, and put in by the feedback forces, each (p,), W.

    Delayed forces count among the feedback forces: they may put in power too.
    """
    linear = system.linear.prompt
    z, v = _extended(samples)
    dissipation = np.einsum("pi,ij,pj->p", v, linear.passive_damping, v)
    active = z @ linear.active_stiffness.T + v @ linear.active_damping.T
    feedback = -np.einsum("pi,pi->p", v, active)
    # force that the base exerts: the base row of all passive and active forces
    on_base = z @ linear.passive_stiffness[-1] + v @ linear.passive_damping[-1] + active[:, -1]
    for group in system.linear.delayed:
        z_then, v_then = _extended(seen_by(system, samples, group.delay))
        force = z_then @ group.stiffness.T + v_then @ group.damping.T
        feedback = feedback - np.einsum("pi,pi->p", v, force)
        on_base = on_base + force[:, -1]
    for j, channel in enumerate(system.channels):
        elements = slice(plant.channels[j, ELEMENTS], plant.channels[j + 1, ELEMENTS])
        seen = seen_by(system, samples, channel.delay)
        force, elastic = seen.force[:, elements], seen.elastic[:, elements]
        speed = v[:, plant.channels[j, SECOND]] - v[:, plant.channels[j, FIRST]]
        if channel.delay:
            feedback = feedback - force.sum(1) * speed
        else:
            dissipation = dissipation + (force - elastic).sum(1) * speed
        if plant.channels[j, FIRST] < 0:
            on_base = on_base - force.sum(1)
        if plant.channels[j, SECOND] < 0:
            on_base = on_base + force.sum(1)
    first_with_states = plant.elements.shape[0]
    for e, element in enumerate(system.memory_elements):
        # what such an element stores counts as dissipated until it gives it back
        force = seen_by(system, samples, element.delay).force[:, first_with_states + e]
        ends = [linear.size if node == BASE else linear.index(node) for node in element.between]
        power = force * (v[:, ends[1]] - v[:, ends[0]])
        if element.delay:
            feedback = feedback - power
        else:
            dissipation = dissipation + power
        on_base = on_base + force * (float(ends[1] == linear.size) - float(ends[0] == linear.size))
    return on_base * samples.base[1], dissipation, feedback


def stored_energy(run: Run, samples: Samples) -> Array:
    """Kinetic and elastic energy in J, (p,)."""
    linear, plant = run.problem.system.linear.prompt, run.problem.plant
    z, v = _extended(samples)
    moving = v[:, :-1]
    energy = 0.5 * np.einsum("pi,ij,pj->p", moving, linear.mass, moving)
    energy = energy + 0.5 * np.einsum("pi,ij,pj->p", z, linear.passive_stiffness, z)
    for j, channel in enumerate(run.problem.system.channels):
        if channel.delay:
            continue
        d = z[:, plant.channels[j, SECOND]] - z[:, plant.channels[j, FIRST]]
        energy = energy + np.array([_potential(run, j, float(x)) for x in d])
    return np.asarray(energy)


def _potential(run: Run, j: int, d: float) -> float:
    """Integral of the elastic force of channel j from 0 to d, split at its breaks and knots."""
    plant = run.problem.plant
    rows = slice(plant.channels[j, BREAKS], plant.channels[j + 1, BREAKS])
    on_d = plant.breaks[rows, ON_VELOCITY] == 0.0
    edges = plant.breaks[rows, VALUE][on_d]
    low, high = min(0.0, d), max(0.0, d)
    inside = edges[(edges > low) & (edges < high)]
    places = np.unique(np.concatenate([[low], inside, np.linspace(low, high, 9), [high]]))
    total = 0.0
    for a, b in pairwise(places):
        x = 0.5 * (a + b) + 0.5 * (b - a) * GAUSS_POTENTIAL[0]
        force = dense.element_forces(plant, j, x, np.zeros_like(x)).sum(1)
        total += 0.5 * (b - a) * float(GAUSS_POTENTIAL[1] @ force)
    return total if d >= 0.0 else -total
