"""From model objects to the arrays that the kernels read. This happens once per run."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import ModelError
from seatdyn.kernels.jit import CompileNotice, lanes_law_address, law_address
from seatdyn.kernels.plant import Plant
from seatdyn.model.elements import NonlinearElement
from seatdyn.model.excitation import Motion
from seatdyn.model.system import BASE, SeatSystem, refuse_delays, refuse_memory

Array = NDArray[np.float64]


def lower(
    system: SeatSystem,
    motion: Motion,
    *,
    delays: bool = False,
    memory: bool = False,
    address: Callable[..., int] = law_address,
    lanes: bool = False,
) -> Plant:
    """Arrays of a system under a base motion.

    With `delays` the caller adds delayed forces himself: linear ones are left out, and all
    channels are listed as if they acted at once. With `memory` the caller adds elements with states
    of their own himself. `address` compiles a law; with `lanes` it is compiled for many points at
    once, too.

    Raises
    ------
    ModelError
        A free node without mass.
    RequestError
        Forces are delayed, or elements have states, and the caller has no place for them.
    """
    if not delays:
        refuse_delays(system.delays)
    if not memory:
        refuse_memory([element.name for element in system.memory_elements])
    linear = system.linear.prompt
    n = linear.size
    masses = np.diag(linear.mass)
    if np.any(masses <= 0.0):
        node = linear.nodes[int(np.argmin(masses))]
        raise ModelError(f"Node {node!r} has no mass; give it one to simulate the system.")
    inverse = np.linalg.inv(linear.mass)

    def node_index(name: str) -> int:
        return -1 if name == BASE else linear.index(name)

    channels = system.channels
    first = np.array([node_index(c.between[0]) for c in channels], dtype=np.int64)
    second = np.array([node_index(c.between[1]) for c in channels], dtype=np.int64)
    incidence = np.zeros((n, len(channels)))
    for j in range(len(channels)):
        if first[j] >= 0:
            incidence[first[j], j] -= 1.0
        if second[j] >= 0:
            incidence[second[j], j] += 1.0
    pull = inverse @ incidence

    laws = [[element.lower() for element in channel.elements] for channel in channels]
    flat = [law for channel in laws for law in channel]
    names = [element.name for channel in channels for element in channel.elements]
    lengths = [len(law.parameters) for law in flat]
    offsets = np.concatenate([[0], np.cumsum(lengths)])[:-1] if flat else np.zeros(0)
    # two elements may break at the same place; it is one event
    breaks = [
        list(dict.fromkeys(spot for law in channel for spot in law.breaks)) for channel in laws
    ]
    rows = [spot for channel in breaks for spot in channel]
    parameters = [p for law in flat for p in law.parameters]
    return Plant(
        linear=np.column_stack(
            [
                -(inverse @ linear.stiffness),
                -(inverse @ linear.damping),
                inverse @ linear.drive_stiffness,
                inverse @ linear.drive_damping,
            ]
        ),
        pull=np.ascontiguousarray(pull),
        gain=np.ascontiguousarray(incidence.T @ pull),
        channels=np.column_stack(
            [np.append(first, 0), np.append(second, 0), _starts(laws), _starts(breaks)]
        ),
        elements=np.array(
            [
                (
                    address(law.function, name),
                    offset,
                    lanes_law_address(law.function, name) if lanes else 0,
                )
                for law, offset, name in zip(flat, offsets, names, strict=True)
            ],
            dtype=np.int64,
        ).reshape(-1, 3),
        parameters=np.array([*parameters, 0.0]),
        breaks=np.array(
            [(spot.displacement, spot.velocity, spot.value, spot.jumps) for spot in rows],
            dtype=float,
        ).reshape(-1, 4),
        segments=np.column_stack([motion.starts, motion.polynomials, motion.segment_sines]),
        sines=np.ascontiguousarray(motion.sines),
    )


def forces_at(element: NonlinearElement, d: Array, v: Array) -> Array:
    """Forces in N of the compiled law at many displacements (m) and velocities (m/s), (p,)."""
    from seatdyn.kernels.evaluate import evaluate

    law = element.lower()
    with CompileNotice():
        address = law_address(law.function, element.name)
        return np.asarray(evaluate(address, np.array([*law.parameters, 0.0]), d, v))


def _starts(lists: list[list]) -> np.ndarray:  # type: ignore[type-arg]
    """Begin of each list in their concatenation, and the end."""
    return np.concatenate([[0], np.cumsum([len(items) for items in lists])]).astype(np.int64)
