"""Propagators of the ensemble kernel: one step of a system relative to its base."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from seatdyn.analysis.lowering import lower
from seatdyn.analysis.outputs import (
    across,
    body_force,
    incidence,
    motion_of,
    named_outputs,
    output_table,
    pairs,
    suspension_forces,
)
from seatdyn.analysis.run import Samples
from seatdyn.kernels.columns import ELEMENTS
from seatdyn.kernels.ensemble import DERIVATIVES, March
from seatdyn.kernels.jit import lanes_law_address
from seatdyn.kernels.plant import Plant
from seatdyn.model.body import SEAT
from seatdyn.model.excitation import Motion
from seatdyn.model.system import BASE, SeatSystem

Array = NDArray[np.float64]
INVARIANT = 1e-10  # of the stiffness or damping: a sum below it is zero, and motion without effect


class Links(NamedTuple):
    """Equations of motion in q, the motions across links that join every node to the base.

        q'' = own [q, q'] + drive [u, u', u''] - pull f

    A mean square of a small relative motion keeps its digits in q, not in the motions of nodes. The
    first link is the suspension, the only one that begins at the base.
    """

    own: Array  # (N, 2N)
    drive: Array  # (N, 3)
    pull: Array  # (N, m)
    across: Array  # (2N, 2m) from q, q' to displacement and velocity across the channels
    nodes: Array  # (N, N) from q to the motions of the nodes relative to the base


def make_links(system: SeatSystem, plant: Plant) -> Links:
    """Change from the motions of nodes to those across links.

    Where the system is invariant to translation or to velocity the base u or u' has no effect.
    """
    n = plant.linear.shape[0]
    drive = np.empty((n, 3))
    for order in range(2):
        of_free, base = plant.linear[:, order * n : (order + 1) * n], plant.linear[:, 2 * n + order]
        total = of_free.sum(1) + base
        size = np.abs(of_free).sum(1) + np.abs(base)
        drive[:, order] = np.where(np.abs(total) > INVARIANT * size, total, 0.0)
    drive[:, 2] = -1.0
    links = np.array([incidence(system, pair)[:n] for pair in pairs(system)[:n]])
    nodes: Array = np.round(np.linalg.inv(links)).astype(float)  # of numbers 1, 0, -1
    channels = [incidence(system, channel.between)[:n] for channel in system.channels]
    return Links(
        own=links @ plant.linear[:, : 2 * n] @ np.kron(np.eye(2), nodes),
        drive=links @ drive,
        pull=links @ plant.pull,
        across=np.asarray(np.kron(np.eye(2), (np.reshape(channels, (-1, n)) @ nodes).T), float),
        nodes=nodes,
    )


def make_march(
    system: SeatSystem, spacing: float, steps: int, instants: int
) -> tuple[tuple[str, ...], March, Array]:
    """Names of the outputs, the propagators for `steps` steps in `spacing` (s), and the outputs.

    These, (instants, K, s), are seen from the first K rows of the kernel's table at the instants
    of a step; more than one only in a system without channels.
    """
    plant = lower(system, Motion(), address=lanes_law_address)
    links = make_links(system, plant)
    n, m = links.pull.shape
    n2, h = 2 * n, spacing / steps

    # y' = A y + G (u, u', u'') - pull f with u a quintic and every f a parabola in time
    size = n2 + DERIVATIVES + 3 * m
    augmented = np.zeros((size, size))
    augmented[:n, n:n2] = np.eye(n)
    augmented[n:n2, :n2] = links.own
    augmented[n:n2, n2 : n2 + 3] = links.drive
    shift = np.arange(n2, n2 + DERIVATIVES - 1)
    augmented[shift, shift + 1] = 1.0
    force = n2 + DERIVATIVES
    augmented[n:n2, force : force + m] = -links.pull
    chain = np.arange(force, size - m)
    augmented[chain, chain + m] = 1.0
    whole, half = expm(augmented * h)[:n2].T, expm(augmented * (h / 2))[:n2].T  # row a source

    # h phi_k(h A) pull, k = 1, 2, 3: responses to a force 1, t/h, t^2/2h^2; the same for h/2
    constant, linear, square = (whole[force + k * m : force + (k + 1) * m] / h**k for k in range(3))
    short, ramp = (half[force + k * m : force + (k + 1) * m] / (h / 2) ** k for k in range(2))
    weights = [constant - 3 * linear + 4 * square, *[2 * linear - 4 * square] * 2]
    weights.append(4 * square - linear)

    def rows(free: Array, forces: list[Array]) -> Array:
        """One matrix in the order of the kernel's table, from the parts of a stage."""
        parts = [free[:n2], forces[0], free[n2:force], *forces[1:]]
        return np.ascontiguousarray(np.concatenate(parts))

    names, outputs = output_matrix(system, plant, links)
    if m == 0:
        later = (expm(augmented * (h * i / instants))[: n2 + 3].T for i in range(instants))
        seen = np.array([inside @ outputs for inside in later])
    else:
        seen = outputs[None]
    return (
        names,
        March(
            base=np.concatenate([hermite(spacing) @ taylor(k * h) for k in range(steps)]),
            across=links.across,
            second=rows(half, [short]) @ links.across,
            third=rows(half, [short - 2 * ramp, 2 * ramp]) @ links.across,
            fourth=rows(whole, [constant - 2 * linear, np.zeros((m, n2)), 2 * linear])
            @ links.across,
            step=rows(whole, weights),
            channels=plant.channels,
            elements=plant.elements,
            parameters=plant.parameters,
        ),
        seen,
    )


def hermite(spacing: float) -> Array:
    """From x, v, a at both ends of an interval to x and its five derivatives at the start, (6, 6).

    Row a source.
    """
    k = np.arange(DERIVATIVES)
    ends = np.hstack([taylor(0.0)[:, :3], taylor(1.0)[:, :3]])
    scale_sources = np.tile(spacing ** np.arange(3.0), 2)
    return np.asarray(scale_sources[:, None] * np.linalg.inv(ends) / spacing**k)


def taylor(time: float) -> Array:
    """From x and its derivatives at an instant to the same `time` later, (6, 6), row a source."""
    return np.asarray(expm(time * np.eye(DERIVATIVES, k=-1)))


def all_outputs(system: SeatSystem, samples: Samples) -> dict[str, Array]:
    """The outputs of a random response: those of a steady state, and some that only it needs."""
    force = suspension_forces(system, samples)
    return {
        "acc_base": motion_of(system, samples, BASE, 2),
        **named_outputs(system, samples),
        "vel_seat-base": across(system, samples, (BASE, SEAT), 1),
        "F_suspension": force["spring"] + force["damper"] + force["nonlinear"],
        "F_body": body_force(system, samples),
    }


def output_matrix(system: SeatSystem, plant: Plant, links: Links) -> tuple[tuple[str, ...], Array]:
    """Names of the outputs, and their weights (2N + m + 3, s) of state, channel forces and base."""
    n = plant.linear.shape[0]
    names, table = output_table(system, all_outputs)
    base, z, v, a, force = np.split(table.T, np.cumsum([3, n, n, n]))
    motions = links.nodes.T
    acceleration = motions @ a
    state = np.concatenate([motions @ z, motions @ v]) + links.own.T @ acceleration
    # absolute motion is the relative one and that of the base
    base = base + np.array([z.sum(0), v.sum(0), a.sum(0)]) + links.drive.T @ acceleration
    # all elements of a channel have the same weight: they lie between the same nodes
    force = force[plant.channels[:-1, ELEMENTS]] - links.pull.T @ acceleration
    return names, np.concatenate([state, force, base])
