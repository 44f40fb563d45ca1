"""Body, seat and suspension assembled into matrices and a table of non-linear channels.

    M z'' + C z' + K z + sum_j b_j F_j(d_j, v_j) = p u + q u'

with z the absolute displacements of the free nodes, u that of the driven node ("base" under a
seat, "seat" under a body alone), and d_j = b_j z (minus u, where the channel starts at the base).
A channel is one pair of nodes across which non-linear elements act.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import ModelError, RequestError
from seatdyn.model.body import SEAT, SeatedBody
from seatdyn.model.elements import Element, LinearElement, NonlinearElement
from seatdyn.model.seat import Seat
from seatdyn.units import suggestion

BASE = "base"
Array = NDArray[np.float64]


@dataclass(frozen=True)
class RankOne:
    """How a parameter enters the pencil M s^2 + C s + K: value * s^order * left right^T."""

    order: int
    left: Array
    right: Array
    value: float
    unit: str


@dataclass(frozen=True)
class LinearModel:
    """The linear part as arrays; N free nodes, the driven node last in the extended matrices.

    mass, damping, stiffness : (N, N), kg, N s/m, N/m; not symmetric where the body is active
    drive_stiffness, drive_damping : (N,), forces per displacement and velocity of the driven node
    passive_stiffness, passive_damping : (N+1, N+1), springs and dampers only, symmetric
    active_stiffness, active_damping : (N+1, N+1), feedback forces only
    parameters : named parameters that enter by a rank-one term
    """

    nodes: tuple[str, ...]
    drive: str
    mass: Array
    passive_stiffness: Array
    passive_damping: Array
    active_stiffness: Array
    active_damping: Array
    parameters: dict[str, RankOne] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number N of free nodes."""
        return len(self.nodes)

    @cached_property
    def stiffness(self) -> Array:
        """K, (N, N), N/m."""
        n = self.size
        return (self.passive_stiffness + self.active_stiffness)[:n, :n]

    @cached_property
    def damping(self) -> Array:
        """C, (N, N), N s/m."""
        n = self.size
        return (self.passive_damping + self.active_damping)[:n, :n]

    @cached_property
    def drive_stiffness(self) -> Array:
        """Force on the free nodes per displacement of the driven node, (N,), N/m."""
        n = self.size
        return -(self.passive_stiffness + self.active_stiffness)[:n, n]

    @cached_property
    def drive_damping(self) -> Array:
        """Force on the free nodes per velocity of the driven node, (N,), N s/m."""
        n = self.size
        return -(self.passive_damping + self.active_damping)[:n, n]

    def index(self, node: str) -> int:
        """Position of a free node."""
        if node not in self.nodes:
            raise RequestError(f"No free node {node!r} here. {suggestion(node, self.nodes)}")
        return self.nodes.index(node)


@dataclass(frozen=True)
class Channel:
    """A pair of nodes (d = second - first) and the non-linear elements across it."""

    between: tuple[str, str]
    elements: tuple[NonlinearElement, ...]


@dataclass(frozen=True)
class SeatSystem:
    """A body on a seat on a suspension.

    Parameters
    ----------
    body : SeatedBody
    seat : Seat; its suspension acts between base and seat unless an element says otherwise
    elements : further elements, each with `between` naming its nodes

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    >>> sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat).nodes
    ('seat', 'm1', 'm2')
    """

    body: SeatedBody
    seat: Seat
    elements: tuple[Element, ...] = ()

    def __post_init__(self) -> None:
        """Check types and that every element ends on a node that exists."""
        if not isinstance(self.body, SeatedBody):
            raise ModelError(f"SeatSystem.body = {self.body!r} is no SeatedBody; use load_body.")
        if not isinstance(self.seat, Seat):
            raise ModelError(f"SeatSystem.seat = {self.seat!r} is no Seat; use Seat(mass, [...]).")
        object.__setattr__(self, "elements", tuple(self.elements))
        known = (BASE, *self.nodes)
        for element in self.all_elements:
            for node in element.between:
                if node not in known:
                    raise ModelError(
                        f"{element.name}.between names the unknown node {node!r}. "
                        + suggestion(node, known)
                    )

    @property
    def nodes(self) -> tuple[str, ...]:
        """Free nodes: the seat, then the masses of the body."""
        return (SEAT, *self.body.nodes)

    @property
    def all_elements(self) -> tuple[Element, ...]:
        """Suspension elements, then further elements."""
        return self.seat.suspension + self.elements

    @property
    def nonlinear_elements(self) -> tuple[NonlinearElement, ...]:
        """Elements with a force law of their own, in the order given."""
        return tuple(e for e in self.all_elements if isinstance(e, NonlinearElement))

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """Non-linear elements gathered by the pair of nodes that they act across."""
        pairs = dict.fromkeys(element.between for element in self.nonlinear_elements)
        return tuple(
            Channel(pair, tuple(e for e in self.nonlinear_elements if e.between == pair))
            for pair in pairs
        )

    @cached_property
    def linear(self) -> LinearModel:
        """Springs and dampers only; non-linear elements are named in `ignored`."""
        return linear_model(self)


def linear_model(
    system: SeatSystem | SeatedBody, linearise: Literal["tangent"] | None = None
) -> LinearModel:
    """Assemble the linear part of a system, or of a body alone on a rigid, moving seat.

    Parameters
    ----------
    system : SeatSystem (driven at "base") or SeatedBody (driven at "seat")
    linearise : None leaves non-linear elements out and names them in `ignored`; "tangent" puts
        their tangent at rest in
    """
    if linearise not in (None, "tangent"):
        raise RequestError(f"linearise = {linearise!r} is not allowed; use None or 'tangent'.")
    body = system.body if isinstance(system, SeatSystem) else system
    drive = BASE if isinstance(system, SeatSystem) else SEAT
    nodes = system.nodes
    order = {node: i for i, node in enumerate((*nodes, drive))}
    n = len(nodes)

    def incidence(first: str, second: str) -> Array:
        b = np.zeros(n + 1)
        b[order[second]] += 1.0
        b[order[first]] -= 1.0
        return b

    mass = np.diag([body.masses.get(node, 0.0) for node in nodes])
    stiffness, damping = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    active_stiffness, active_damping = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    parameters: dict[str, RankOne] = {}
    ignored: list[str] = []

    def add_pair(between: tuple[str, str], k: float, c: float) -> None:
        b = incidence(*between)
        stiffness[...] += k * np.outer(b, b)
        damping[...] += c * np.outer(b, b)

    for link in body.links:
        add_pair(link.between, link.stiffness, link.damping)
    for force in body.feedback:
        left = incidence(force.reaction, force.on)
        for term in force.terms:
            right = np.zeros(n + 1)
            for node, weight in term.weights.items():
                right[order[node]] += weight
            target = active_stiffness if term.of == "displacement" else active_damping
            target += term.gain * np.outer(left, right)
            rank = 0 if term.of == "displacement" else 1
            unit = "N/m" if rank == 0 else "N s/m"
            parameters[term.name] = RankOne(rank, left[:n], right[:n], term.gain, unit)

    if isinstance(system, SeatSystem):
        mass[0, 0] += system.seat.mass
        for element in system.all_elements:
            if isinstance(element, LinearElement):
                add_pair(element.between, *element.linear)
            elif linearise == "tangent" and isinstance(element, NonlinearElement):
                add_pair(element.between, *element.tangent())
            else:
                ignored.append(element.name)
        b = incidence(BASE, SEAT)
        unit = np.eye(n)[0]
        k, c = suspension_totals(system, linearise)
        parameters["seat_mass"] = RankOne(2, unit, unit, system.seat.mass, "kg")
        parameters["damping"] = RankOne(1, b[:n], b[:n], c, "N s/m")
        parameters["stiffness"] = RankOne(0, b[:n], b[:n], k, "N/m")

    return LinearModel(
        nodes=nodes,
        drive=drive,
        mass=mass,
        passive_stiffness=stiffness,
        passive_damping=damping,
        active_stiffness=active_stiffness,
        active_damping=active_damping,
        parameters=parameters,
        ignored=tuple(ignored),
    )


def suspension_totals(
    system: SeatSystem, linearise: Literal["tangent"] | None = None
) -> tuple[float, float]:
    """Total stiffness N/m and damping N s/m of the linear elements between base and seat."""
    k = c = 0.0
    for element in system.all_elements:
        if set(element.between) != {BASE, SEAT}:
            continue
        if isinstance(element, LinearElement):
            dk, dc = element.linear
        elif linearise == "tangent" and isinstance(element, NonlinearElement):
            dk, dc = element.tangent()
        else:
            continue
        k, c = k + dk, c + dc
    return k, c
