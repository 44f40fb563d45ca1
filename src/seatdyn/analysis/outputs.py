"""What a solution is asked for: named motions and forces from samples of a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.run import Samples
from seatdyn.model.body import SEAT
from seatdyn.model.elements import Damper, Element, LinearElement, Spring
from seatdyn.model.system import BASE, SeatSystem

Array = NDArray[np.float64]
SUSPENSION = {BASE, SEAT}
KIND: dict[type[Element], str] = {Spring: "spring", Damper: "damper"}


def unique_names(elements: Sequence[Element]) -> list[str]:
    """Names of elements, numbered where the same name occurs again."""
    names: list[str] = []
    for element in elements:
        name, count = element.name, 2
        while name in names:
            name, count = f"{element.name} {count}", count + 1
        names.append(name)
    return names


def motion_of(system: SeatSystem, samples: Samples, node: str, order: int) -> Array:
    """Displacement (order 0), velocity (1) or acceleration (2) of a node, (p,)."""
    if node == BASE:
        return np.asarray(samples.base[order])
    motion = (samples.displacement, samples.velocity, samples.acceleration)[order]
    return np.asarray(motion[:, system.linear.index(node)])


def across(system: SeatSystem, samples: Samples, between: tuple[str, str], order: int) -> Array:
    """Motion of the second node relative to the first, (p,)."""
    first, second = (motion_of(system, samples, node, order) for node in between)
    return second - first


def incidence(system: SeatSystem, between: tuple[str, str]) -> Array:
    """Row over the free nodes and the base, last: second node minus first."""
    row = np.zeros(system.linear.size + 1)
    for node, sign in zip(between, (-1.0, 1.0), strict=True):
        row[-1 if node == BASE else system.linear.index(node)] += sign
    return row


def pairs(system: SeatSystem) -> list[tuple[str, str]]:
    """Node pairs of the relative displacements: suspension, cushion, masses to what they sit on,
    masses to masses.
    """
    masses, contact = system.body.nodes, system.contact
    cushion = [(SEAT, contact)] if contact != SEAT else []
    on_seat = [(contact, node) for node in masses]
    return [(BASE, SEAT), *cushion, *on_seat, *combinations(masses, 2)]


def pair_name(pair: tuple[str, str]) -> str:
    """Second minus first: ("seat", "m1") is "m1-seat"."""
    return f"{pair[1]}-{pair[0]}"


def element_forces(system: SeatSystem, samples: Samples) -> dict[str, Array]:
    """Force of every element in N, positive in tension, name -> (p,)."""
    order: list[Element] = [e for channel in system.channels for e in channel.elements]
    order += system.memory_elements
    column = {id(element): i for i, element in enumerate(order)}
    forces = {}
    for name, element in zip(unique_names(system.all_elements), system.all_elements, strict=True):
        seen = seen_by(system, samples, element.delay)
        if isinstance(element, LinearElement):
            k, c = element.linear
            d = across(system, seen, element.between, 0)
            v = across(system, seen, element.between, 1)
            forces[name] = k * d + c * v
        else:
            forces[name] = seen.force[:, column[id(element)]]
    return forces


def state_names(system: SeatSystem) -> tuple[list[str], list[str]]:
    """Names and units of the states of elements that have some."""
    names = unique_names(system.memory_elements)
    pairs = [
        (f"{name}: {state}", unit)
        for name, element in zip(names, system.memory_elements, strict=True)
        for state, unit in element.states
    ]
    return [name for name, _ in pairs], [unit for _, unit in pairs]


def seen_by(system: SeatSystem, samples: Samples, delay: float) -> Samples:
    """What a force with this delay (s) answers to: the samples themselves, or those of the past."""
    return samples.past[system.delays.index(delay)] if delay else samples


def suspension_forces(system: SeatSystem, samples: Samples) -> dict[str, Array]:
    """Sums over the suspension, positive in tension: springs, dampers, non-linear elements."""
    total = {key: np.zeros(samples.time.size) for key in ("spring", "damper", "nonlinear")}
    forces = element_forces(system, samples)
    for force, element in zip(forces.values(), system.all_elements, strict=True):
        if set(element.between) != SUSPENSION:
            continue
        sign = 1.0 if element.between == (BASE, SEAT) else -1.0
        kind = KIND.get(type(element), "nonlinear")
        total[kind] += sign * force
    return total


def named_outputs(system: SeatSystem, samples: Samples) -> dict[str, Array]:
    """Everything that has an amplitude, by the names that the command line prints.

    acc_<node> (m/s2), <node> (m), <node>-<node> (m), F_damper, F_spring, F_linear (their sum),
    F_nonlinear, F_damper+nonlinear (N).
    """
    nodes = (*system.body.nodes, *dict.fromkeys((system.contact, SEAT)))
    result = {f"acc_{node}": motion_of(system, samples, node, 2) for node in nodes}
    result |= {node: motion_of(system, samples, node, 0) for node in nodes}
    for pair in pairs(system):
        result[pair_name(pair)] = across(system, samples, pair, 0)
    force = suspension_forces(system, samples)
    return result | {
        "F_damper": force["damper"],
        "F_spring": force["spring"],
        "F_linear": force["damper"] + force["spring"],
        "F_nonlinear": force["nonlinear"],
        "F_damper+nonlinear": force["damper"] + force["nonlinear"],
    }


Outputs = Callable[[SeatSystem, Samples], dict[str, Array]]


def output_table(
    system: SeatSystem, outputs: Outputs = named_outputs
) -> tuple[tuple[str, ...], Array]:
    """Names of the outputs, and how they depend on what they are made of.

    That is u, u', u'', z, z', z'', the element forces and, for every delay, u, u', z, z' as they
    were then. Outputs are linear in these: each column is what they are for a unit of one of them.
    """
    n = system.linear.size
    e = sum(len(channel.elements) for channel in system.channels) + len(system.memory_elements)
    parts = [3, n, n, n, e, *([2, n, n] * len(system.delays))]
    units = np.eye(sum(parts))
    base, z, v, a, force, *past = np.split(units, np.cumsum(parts)[:-1], axis=1)
    none, time = np.zeros_like(force), np.zeros(len(units))
    before = tuple(
        Samples(time, np.column_stack([u, time]).T, x, w, 0.0 * a, force, none)
        for u, x, w in zip(*(past[i::3] for i in range(3)), strict=True)
    )
    found = outputs(system, Samples(time, base.T, z, v, a, force, none, past=before))
    return tuple(found), np.array(list(found.values()))


def output_unit(name: str) -> str:
    """Unit of an output, from the beginning of its name."""
    units = {"acc_": "m/s2", "vel_": "m/s", "F_": "N"}
    return next((unit for start, unit in units.items() if name.startswith(start)), "m")


def body_force(system: SeatSystem, samples: Samples) -> Array:
    """Force of the body on what it sits on, N, positive upwards.

    It is what accelerates the frame beside the suspension, or the cushion's mass beside the
    cushion.
    """
    contact = system.contact
    mass = system.seat.mass if contact == SEAT else system.seat.cushion_mass
    total = mass * motion_of(system, samples, contact, 2)
    if samples.outside is not None:
        total = total - samples.outside[:, system.linear.index(contact)]
    forces = element_forces(system, samples)
    for force, element in zip(forces.values(), system.all_elements, strict=True):
        if element.between[1] == contact:
            total = total + force
        elif element.between[0] == contact:
            total = total - force
    return total
