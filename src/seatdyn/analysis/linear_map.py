"""A seat system with springs and dampers in place of its non-linear elements, as matrices.

    x' = A x + B [u, u'],   y = C x + D [u, u', u'']

with x = [z, z'] the absolute motions of the free nodes, u that of the base and y the outputs that
have names (`outputs.named_outputs`). Random, tangent and statistical linearisation share this.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.linear import companion
from seatdyn.analysis.outputs import named_outputs
from seatdyn.analysis.run import Samples
from seatdyn.model.elements import NonlinearElement
from seatdyn.model.system import BASE, SeatSystem, linear_model

Array = NDArray[np.float64]
Gain = tuple[float, float]  # stiffness in N/m and damping in N s/m


class LinearMap(NamedTuple):
    """Matrices of N free nodes, o outputs and m channels."""

    names: tuple[str, ...]
    a: Array  # (2N, 2N)
    b: Array  # (2N, 2)
    c: Array  # (o, 2N)
    d: Array  # (o, 3)
    across: Array  # (m, 2, 2N) to displacement and velocity across each channel
    across_base: Array  # (m, 2, 3)


def channel_elements(system: SeatSystem) -> tuple[NonlinearElement, ...]:
    """Non-linear elements in the order of the channels, as the kernels have them."""
    return tuple(element for channel in system.channels for element in channel.elements)


def tangents(system: SeatSystem) -> list[Gain]:
    """Tangents at rest of the non-linear elements, in the order of the channels."""
    return [element.tangent() for element in channel_elements(system)]


def linear_map(system: SeatSystem, gains: Sequence[Gain] | None = None) -> LinearMap:
    """Matrices of a system whose non-linear elements are springs and dampers `gains`.

    Parameters
    ----------
    gains : stiffness and damping of each non-linear element, in the order of the channels; None
        leaves them out. Elements with states of their own are left out.

    Raises
    ------
    RequestError
        Some force is delayed.
    """
    linear_model(system, "tangent").refuse_delays()
    model, n = system.linear, system.linear.size
    elements = (*channel_elements(system), *system.memory_elements)
    known = [] if gains is None else list(gains)
    gains = known + [(0.0, 0.0)] * (len(elements) - len(known))
    rows = np.array([_incidence(system, element.between) for element in elements])
    rows = rows.reshape(len(elements), n + 1)
    k, c = np.array(gains, dtype=float).reshape(-1, 2).T
    # to the free nodes and the base, last
    stiffness = rows.T @ (k[:, None] * rows)
    damping = rows.T @ (c[:, None] * rows)
    total = model.stiffness + stiffness[:n, :n]
    a = np.asarray(companion(model.mass, model.damping + damping[:n, :n], total), dtype=float)
    forces = np.column_stack(
        [model.drive_stiffness - stiffness[:n, n], model.drive_damping - damping[:n, n]]
    )
    b = np.vstack([np.zeros((n, 2)), np.linalg.solve(model.mass, forces)])

    # everything that outputs are made of: u, u', u'', z, z', z'', forces of the elements
    of_states = np.vstack(
        [
            np.zeros((3, 2 * n)),
            np.eye(2 * n),
            a[n:],
            np.hstack([k[:, None] * rows[:, :n], c[:, None] * rows[:, :n]]),
        ]
    )
    of_base = np.vstack(
        [
            np.eye(3),
            np.zeros((2 * n, 3)),
            np.column_stack([b[n:], np.zeros(n)]),
            np.column_stack([k * rows[:, n], c * rows[:, n], np.zeros(len(elements))]),
        ]
    )
    names, table = _output_table(system)
    pairs = np.array([_incidence(system, channel.between) for channel in system.channels])
    pairs = pairs.reshape(len(system.channels), n + 1)
    across = np.zeros((len(pairs), 2, 2 * n))
    across_base = np.zeros((len(pairs), 2, 3))
    across[:, 0, :n] = across[:, 1, n:] = pairs[:, :n]
    across_base[:, 0, 0] = across_base[:, 1, 1] = pairs[:, n]
    return LinearMap(names, a, b, table @ of_states, table @ of_base, across, across_base)


def _incidence(system: SeatSystem, between: tuple[str, str]) -> Array:
    """Row over the free nodes and the base, last: second node minus first."""
    row = np.zeros(system.linear.size + 1)
    for node, sign in zip(between, (-1.0, 1.0), strict=True):
        row[-1 if node == BASE else system.linear.index(node)] += sign
    return row


def _output_table(system: SeatSystem) -> tuple[tuple[str, ...], Array]:
    """Names of the outputs, and how they depend on u, u', u'', z, z', z'' and element forces.

    Outputs are linear in these, so each column is what they are for a unit of one of them.
    """
    n, e = system.linear.size, len(channel_elements(system)) + len(system.memory_elements)
    units = np.eye(3 + 3 * n + e)
    base, z, v, a, force = np.split(units, np.cumsum([3, n, n, n]), axis=1)
    samples = Samples(np.zeros(len(units)), base.T, z, v, a, force, np.zeros_like(force))
    outputs = named_outputs(system, samples)
    return tuple(outputs), np.array(list(outputs.values()))
