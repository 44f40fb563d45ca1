"""A seat system with springs and dampers in place of its non-linear elements, as matrices.

    x' = A x + B [u, u'],   y = C x + D [u, u', u'']

with x = [z, z', s] the absolute motions of the free nodes and the states that linear elements such
as a Zener element have of their own, u the motion of the base and y the outputs that
have names (`outputs.named_outputs`). Random, tangent and statistical linearisation share this.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from seatdyn.analysis.linear import Linearise, as_linear_model, companion
from seatdyn.analysis.outputs import incidence, output_table
from seatdyn.model.elements import NonlinearElement
from seatdyn.model.memory import LinearMemory
from seatdyn.model.system import SeatSystem, refuse_delays

Array = NDArray[np.float64]
Gain = tuple[float, float]  # stiffness in N/m and damping in N s/m


class LinearMap(NamedTuple):
    """Matrices of S states, o outputs and m channels."""

    names: tuple[str, ...]
    a: Array  # (S, S)
    b: Array  # (S, 2)
    c: Array  # (o, S)
    d: Array  # (o, 3)
    across: Array  # (m, 2, S) to displacement and velocity across each channel
    across_base: Array  # (m, 2, 3)
    forces: Array  # (e, S) to the forces of all elements that are not springs and dampers


def channel_elements(system: SeatSystem) -> tuple[NonlinearElement, ...]:
    """Non-linear elements in the order of the channels, as the kernels have them."""
    return tuple(element for channel in system.channels for element in channel.elements)


def tangents(system: SeatSystem) -> list[Gain]:
    """Tangents at rest of the non-linear elements, in the order of the channels."""
    return [element.tangent() for element in channel_elements(system)]


def linear_map(
    system: SeatSystem,
    gains: Sequence[Gain] | None = None,
    *,
    linearise: Linearise = None,
) -> LinearMap:
    """Matrices of a system whose non-linear elements are springs and dampers `gains`.

    Parameters
    ----------
    gains : stiffness and damping of each non-linear element, in the order of the channels; None
        leaves them out
    linearise : "tangent" takes elements with states of their own for small motions about rest;
        None leaves them out unless they are linear

    Raises
    ------
    RequestError
        Some force is delayed.
    """
    refuse_delays(system.delays)
    model = as_linear_model(system, delays=True, memory=True).prompt
    n, springs = model.size, channel_elements(system)
    known = [(0.0, 0.0)] * len(springs) if gains is None else gains
    forms = [LinearMemory.without_states(k, c) for k, c in known]
    for element in system.memory_elements:
        kept = element.is_linear or linearise is not None
        forms.append(element.linearised() if kept else LinearMemory.without_states(0.0, 0.0))
    rows = np.array([incidence(system, e.between) for e in (*springs, *system.memory_elements)])
    rows = rows.reshape(len(forms), n + 1)
    free, base = rows[:, :n], rows[:, n:]
    k, c = np.array([[form.k, form.g] for form in forms]).reshape(-1, 2, 1).transpose(1, 0, 2)
    own = block_diag(np.zeros((0, 0)), *(form.a for form in forms))
    pull = block_diag(np.zeros((0, 0)), *(form.c[None] for form in forms))
    count = [len(form.b) for form in forms]
    feel_d = np.concatenate([np.zeros(0), *(form.b for form in forms)])[:, None]
    feel_v = np.concatenate([np.zeros(0), *(form.e for form in forms)])[:, None]
    of_own = np.repeat(rows, count, axis=0)
    # forces of the elements by states and by u, u'; states of their own come last
    of_states = np.hstack([k * free, c * free, pull])
    of_base = np.hstack([k * base, c * base])
    a = np.zeros((2 * n + len(own),) * 2)
    a[: 2 * n, : 2 * n] = companion(model.mass, model.damping, model.stiffness)
    a[n : 2 * n] -= np.linalg.solve(model.mass, free.T @ of_states)
    a[2 * n :] = np.hstack([feel_d * of_own[:, :n], feel_v * of_own[:, :n], own])
    drive = np.column_stack([model.drive_stiffness, model.drive_damping])
    b = np.zeros((len(a), 2))
    b[n : 2 * n] = np.linalg.solve(model.mass, drive - free.T @ of_base)
    b[2 * n :] = np.hstack([feel_d, feel_v]) * of_own[:, n:]

    # everything that outputs are made of: u, u', u'', z, z', z'', forces of the elements
    motion = np.eye(2 * n, len(a))
    all_states = np.vstack([np.zeros((3, len(a))), motion, a[n : 2 * n], of_states])
    all_base = np.zeros((len(all_states), 3))
    all_base[:3] = np.eye(3)
    all_base[3 + 2 * n : 3 + 3 * n, :2] = b[n : 2 * n]
    all_base[3 + 3 * n :, :2] = of_base
    names, table = output_table(system)
    pairs = np.array([incidence(system, channel.between) for channel in system.channels])
    pairs = pairs.reshape(len(system.channels), n + 1)
    across = np.zeros((len(pairs), 2, len(a)))
    across_base = np.zeros((len(pairs), 2, 3))
    across[:, 0, :n] = across[:, 1, n : 2 * n] = pairs[:, :n]
    across_base[:, 0, 0] = across_base[:, 1, 1] = pairs[:, n]
    return LinearMap(
        names, a, b, table @ all_states, table @ all_base, across, across_base, of_states
    )
