"""A seat system with springs and dampers in place of its non-linear elements, as matrices.

    x' = A x + B [u, u'],   y = C x + D [u, u', u'']

with x = [z, z', s] the absolute motions of the free nodes and the states that elements such as a
Zener element have of their own, u the motion of the base and y the outputs that have names
(`outputs.named_outputs`). What acts late has matrices of its own for every delay. Random, tangent
and statistical linearisation share this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from seatdyn.analysis.covariance import LinearSystem, Matrices
from seatdyn.analysis.delay import rightmost_roots
from seatdyn.analysis.linear import Linearise, as_linear_model, companion
from seatdyn.analysis.outputs import incidence, output_table
from seatdyn.errors import RequestError
from seatdyn.model.elements import NonlinearElement
from seatdyn.model.memory import LinearMemory
from seatdyn.model.system import BASE, DelayedForces, LinearModel, SeatSystem

Array = NDArray[np.float64]
Gain = tuple[float, float]  # stiffness in N/m and damping in N s/m


class LinearMap(NamedTuple):
    """Matrices of S states, o outputs, m channels and e elements that are no springs and dampers.

    Of the elements with states of their own, `memory` has rows to what they feel: displacement and
    velocity across them, absolute velocity and acceleration of their second node, their states.
    """

    names: tuple[str, ...]
    system: LinearSystem
    across: Array  # (m, 2, S) to displacement and velocity across each channel
    across_base: Array  # (m, 2, 3)
    memory: tuple[tuple[Array, Array], ...]  # (4 + q, S) and (4 + q, 3)
    forces: Array  # (e, S)
    balance: Array  # (S, S) A with all forces at once


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
    memory: Sequence[LinearMemory] | None = None,
) -> LinearMap:
    """Matrices of a system whose non-linear elements are springs and dampers `gains`.

    Parameters
    ----------
    gains : stiffness and damping of each non-linear element, in the order of the channels; None
        leaves them out
    linearise : "tangent" takes elements with states of their own for small motions about rest;
        None leaves them out unless they are linear
    memory : linear forms of the elements with states of their own, in their order, instead

    Raises
    ------
    RequestError
        Delays beside elements with states of their own.
    """
    if system.delays and system.memory_elements:
        raise RequestError(
            f"{system.memory_elements[0].name} has states of its own, and forces of this system "
            f"act {system.delays[0]:g} s late: not possible together yet. Set the delay to 0."
        )
    springs = channel_elements(system)
    known = [(0.0, 0.0)] * len(springs) if gains is None else gains
    given = _memory_forms(system, linearise) if memory is None else list(memory)
    forms = [*(LinearMemory.without_states(k, c) for k, c in known), *given]
    elements = (*springs, *system.memory_elements)
    model = as_linear_model(system, delays=True, memory=True)
    n, first = model.size, len(springs)
    parts = _Parts(
        system,
        model,
        np.array([incidence(system, e.between) for e in elements]).reshape(-1, n + 1),
        np.array([(form.k, form.g) for form in forms]).reshape(-1, 2),
        block_diag(np.zeros((0, 0)), *(form.c[None] for form in forms)),
        np.array([element.delay for element in elements]),
        output_table(system),
    )
    prompt, *late = (parts.at(delay) for delay in (0.0, *system.delays))
    states = 2 * n
    feels = []
    for element, form in zip(system.memory_elements, given, strict=True):
        count = len(form.b)
        feel = _felt(system, element.between, prompt, slice(states, states + count))
        feels.append(feel)
        h = np.zeros((count, 2)) if form.h is None else form.h
        rates = np.column_stack([form.b, form.e, h, form.a])
        own = slice(states, states + count)
        prompt.a[own], on_base = rates @ feel[0], rates @ feel[1]
        if np.any(on_base[:, 2]):
            raise RequestError(
                f"{element.name} feels the acceleration of the base, its second node; turn its "
                "`between` round."
            )
        prompt.b[own] = on_base[:, :2]
        states += count
    pairs = np.array([incidence(system, channel.between) for channel in system.channels])
    pairs = pairs.reshape(len(system.channels), n + 1)
    across = np.zeros((len(pairs), 2, states))
    across_base = np.zeros((len(pairs), 2, 3))
    across[:, 0, :n] = across[:, 1, n : 2 * n] = pairs[:, :n]
    across_base[:, 0, 0] = across_base[:, 1, 1] = pairs[:, n]
    together = prompt.a + sum(part.a for part in late)
    whole = _with_gains(model, parts.rows[:first], known, parts.delay)
    roots = rightmost_roots(whole)[0] if whole.delayed else np.linalg.eigvals(prompt.a)
    return LinearMap(
        parts.table[0],
        LinearSystem(prompt, tuple(zip(system.delays, late, strict=True)), roots.astype(complex)),
        across,
        across_base,
        tuple(feels),
        parts.of_states,
        together,
    )


class _Parts(NamedTuple):
    """What the matrices are put together from, e elements and N nodes."""

    system: SeatSystem
    model: LinearModel
    rows: Array  # (e, N+1) motion across each, of free nodes and base
    gains: Array  # (e, 2) stiffness and damping
    pull: Array  # (e, q) forces by states of their own
    delay: Array  # (e,)
    table: tuple[tuple[str, ...], Array]

    @property
    def of_states(self) -> Array:
        """Forces of the elements by the states, (e, S)."""
        free = self.rows[:, :-1]
        return np.hstack([self.gains[:, :1] * free, self.gains[:, 1:] * free, self.pull])

    def at(self, delay: float) -> Matrices:
        """What acts with this delay."""
        model, table = self.model, self.table[1]
        n, e = model.size, len(self.rows)
        inverse, now = np.linalg.inv(model.mass), (self.delay == delay)[:, None]
        of_states = now * self.of_states
        of_base = now * self.gains * self.rows[:, -1:]
        size = of_states.shape[1]
        a, b = np.zeros((size, size)), np.zeros((size, 2))
        if delay == 0.0:
            prompt = model.prompt
            a[: 2 * n, : 2 * n] = companion(prompt.mass, prompt.damping, prompt.stiffness)
            b[n : 2 * n, 0] = inverse @ prompt.drive_stiffness
            b[n : 2 * n, 1] = inverse @ prompt.drive_damping
        for group in model.delayed:
            if group.delay == delay:
                k, c = inverse @ group.stiffness[:n], inverse @ group.damping[:n]
                a[n : 2 * n, : 2 * n] -= np.hstack([k[:, :n], c[:, :n]])
                b[n : 2 * n] -= np.column_stack([k[:, n], c[:, n]])
        free = self.rows[:, :-1]
        a[n : 2 * n] -= inverse @ free.T @ of_states
        b[n : 2 * n] -= inverse @ free.T @ of_base
        # everything that outputs are made of, in the order of `output_table`
        by_states, by_base = np.zeros((table.shape[1], size)), np.zeros((table.shape[1], 3))
        motion = np.eye(2 * n, size)
        force = 3 + 3 * n
        if delay == 0.0:
            by_base[:3], by_states[3 : 3 + 2 * n] = np.eye(3), motion
        else:
            place = force + e + self.system.delays.index(delay) * (2 + 2 * n)
            by_base[place : place + 2, :2] = np.eye(2)
            by_states[place + 2 : place + 2 + 2 * n] = motion
        by_states[3 + 2 * n : force], by_base[3 + 2 * n : force, :2] = a[n : 2 * n], b[n : 2 * n]
        by_states[force : force + e], by_base[force : force + e, :2] = of_states, of_base
        return Matrices(a, b, table @ by_states, table @ by_base)


def _memory_forms(system: SeatSystem, linearise: Linearise) -> list[LinearMemory]:
    """Linear elements with states as they are, others by their tangent or left out."""
    return [
        element.linearised()
        if element.is_linear or linearise is not None
        else LinearMemory.without_states(0.0, 0.0)
        for element in system.memory_elements
    ]


def _with_gains(
    model: LinearModel, rows: Array, gains: Sequence[Gain], delay: Array
) -> LinearModel:
    """The model with springs and dampers across pairs of nodes, for its characteristic roots."""
    stiffness, damping = model.passive_stiffness.copy(), model.passive_damping.copy()
    delayed = list(model.delayed)
    for row, (k, c), late in zip(rows, gains, delay[: len(rows)], strict=True):
        both = np.outer(row, row)
        if late and (k or c):
            delayed.append(DelayedForces(float(late), False, k * both, c * both))
        elif not late:
            stiffness += k * both
            damping += c * both
    return replace(
        model, passive_stiffness=stiffness, passive_damping=damping, delayed=tuple(delayed)
    )


def _felt(
    system: SeatSystem, between: tuple[str, str], prompt: Matrices, own: slice
) -> tuple[Array, Array]:
    """Rows to what an element with states of its own feels, see `LinearMap.memory`."""
    n, size = system.linear.size, len(prompt.a)
    row = incidence(system, between)
    states, base = np.zeros((4, size)), np.zeros((4, 3))
    states[0, :n] = states[1, n : 2 * n] = row[:n]
    base[0, 0] = base[1, 1] = row[n]
    if between[1] == BASE:
        base[2, 1] = base[3, 2] = 1.0
    else:
        second = n + system.linear.index(between[1])
        states[2, second] = 1.0
        states[3], base[3, :2] = prompt.a[second], prompt.b[second]
    count = own.stop - own.start
    return np.vstack([states, np.eye(size)[own]]), np.vstack([base, np.zeros((count, 3))])
