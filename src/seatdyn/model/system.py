"""Body, seat and suspension assembled into matrices and a table of non-linear channels.

    M z'' + C z' + K z + sum_j b_j F_j(d_j, v_j) = p u + q u'

with z the absolute displacements of the free nodes, u that of the driven node ("base" under a
seat, "seat" under a body alone), and d_j = b_j z (minus u, where the channel starts at the base).
A channel is one pair of nodes across which non-linear elements act.

A force with a delay tau acts at t with its value of t - tau. Delayed linear forces are kept apart
from M, C, K, one `DelayedForces` for each delay; a delayed non-linear force has its own channel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import ModelError, RequestError
from seatdyn.model.body import SEAT, SeatedBody
from seatdyn.model.elements import Element, LinearElement, NonlinearElement
from seatdyn.model.memory import LinearMemory, MemoryElement
from seatdyn.model.seat import CUSHION, SEAT_SURFACE, Seat
from seatdyn.units import suggestion

BASE = "base"
Array = NDArray[np.float64]


@dataclass(frozen=True)
class RankOne:
    """How a parameter enters the pencil: value * s^order * exp(-s delay) * left right^T."""

    order: int
    left: Array
    right: Array
    value: float
    unit: str
    delay: float = 0.0


@dataclass(frozen=True)
class DelayedForces:
    """Linear forces with one delay in s: (stiffness + s damping) exp(-s delay), (N+1, N+1).

    `active` ones are feedback forces, which may feel the common motion of all nodes.
    """

    delay: float
    active: bool
    stiffness: Array
    damping: Array


@dataclass(frozen=True)
class Relaxing:
    """A linear element with states of its own across one pair of nodes, `across` (N+1,).

    Its force acts `delay` s late; its states go with the motion of the moment.
    """

    name: str
    across: Array
    element: LinearMemory
    delay: float = 0.0

    def stiffness(self, s: ArrayLike) -> NDArray[np.complex128]:
        """Force per displacement at the Laplace variable s (1/s), in N/m, same shape."""
        points = np.asarray(s, dtype=complex)
        return np.asarray(np.exp(-points * self.delay) * self.element.stiffness(points))


@dataclass(frozen=True)
class LinearModel:
    """The linear part as arrays; N free nodes, the driven node last in the extended matrices.

    The matrices hold what acts at once. Where forces are delayed, or elements relax, the four
    properties below refuse: they are not the system. Who adds `delayed` and `relaxing` himself
    takes them from `prompt`.

    mass, damping, stiffness : (N, N), kg, N s/m, N/m; not symmetric where the body is active
    drive_stiffness, drive_damping : (N,), forces per displacement and velocity of the driven node
    passive_stiffness, passive_damping : (N+1, N+1), springs and dampers only, symmetric
    active_stiffness, active_damping : (N+1, N+1), feedback forces only
    parameters : named parameters that enter by a rank-one term
    delayed : forces that act late
    relaxing : elements with states of their own
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
    delayed: tuple[DelayedForces, ...] = ()
    relaxing: tuple[Relaxing, ...] = ()

    @property
    def size(self) -> int:
        """Number N of free nodes."""
        return len(self.nodes)

    @cached_property
    def prompt(self) -> LinearModel:
        """The same without its delayed forces and relaxing elements."""
        return replace(self, delayed=(), relaxing=())

    @property
    def delays(self) -> tuple[float, ...]:
        """The different delays in s > 0 of its forces, sorted."""
        late = {group.delay for group in self.delayed} | {one.delay for one in self.relaxing}
        return tuple(sorted(late - {0.0}))

    @cached_property
    def undelayed(self) -> LinearModel:
        """The same with all forces at once."""
        return replace(
            self,
            delayed=(),
            relaxing=tuple(replace(one, delay=0.0) for one in self.relaxing),
            passive_stiffness=self.passive_stiffness + sum(g.stiffness for g in self.delayed),
            passive_damping=self.passive_damping + sum(g.damping for g in self.delayed),
        )

    def refuse_delays(self) -> None:
        """Raise a RequestError where forces are delayed: for who has no place for them."""
        refuse_delays(self.delays)
        self.refuse_relaxing()

    def refuse_relaxing(self) -> None:
        """Raise a RequestError where elements have states of their own."""
        refuse_memory([element.name for element in self.relaxing])

    @cached_property
    def stiffness(self) -> Array:
        """K, (N, N), N/m."""
        self.refuse_delays()
        n = self.size
        return (self.passive_stiffness + self.active_stiffness)[:n, :n]

    @cached_property
    def damping(self) -> Array:
        """C, (N, N), N s/m."""
        self.refuse_delays()
        n = self.size
        return (self.passive_damping + self.active_damping)[:n, :n]

    @cached_property
    def drive_stiffness(self) -> Array:
        """Force on the free nodes per displacement of the driven node, (N,), N/m."""
        self.refuse_delays()
        n = self.size
        return -(self.passive_stiffness + self.active_stiffness)[:n, n]

    @cached_property
    def drive_damping(self) -> Array:
        """Force on the free nodes per velocity of the driven node, (N,), N s/m."""
        self.refuse_delays()
        n = self.size
        return -(self.passive_damping + self.active_damping)[:n, n]

    def index(self, node: str) -> int:
        """Position of a free node."""
        if node not in self.nodes:
            raise RequestError(f"No free node {node!r} here. {suggestion(node, self.nodes)}")
        return self.nodes.index(node)


@dataclass(frozen=True)
class Channel:
    """A pair of nodes (d = second - first) and the non-linear elements across it.

    All of them act with the same `delay` in s.
    """

    between: tuple[str, str]
    elements: tuple[NonlinearElement, ...]
    delay: float = 0.0


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
        if self.seat.cushion and not self.seat.cushion_mass + self.body.support_mass > 0.0:
            raise ModelError(
                f"The node {SEAT_SURFACE!r} between cushion and SeatedBody({self.body.name!r}) has "
                "no mass; give Seat.cushion_mass, such as 1 kg, or a body with mass at its seat."
            )
        if SEAT_SURFACE in self.body.nodes:
            raise ModelError(
                f"SeatedBody({self.body.name!r}) names a mass {SEAT_SURFACE!r}, which is the node "
                "between a cushion and the occupant; rename the mass."
            )
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
        """Free nodes: the seat, its surface if there is a cushion, the masses of the body."""
        return (SEAT, *self.body.nodes) if self.contact == SEAT else (*CUSHION, *self.body.nodes)

    @property
    def contact(self) -> str:
        """Node that the occupant sits on: "seat_surface" on a cushion, else "seat"."""
        return SEAT_SURFACE if self.seat.cushion else SEAT

    @cached_property
    def all_elements(self) -> tuple[Element, ...]:
        """Suspension, cushion, then further elements, each with its whole delay."""
        late = self.seat.delay
        suspension = tuple(
            replace(element, delay=element.delay + late) if late else element
            for element in self.seat.suspension
        )
        return suspension + self.seat.cushion + self.elements

    @property
    def delays(self) -> tuple[float, ...]:
        """The different delays in s > 0 of its forces, sorted."""
        delays = {element.delay for element in self.all_elements}
        delays |= {force.delay for force in self.body.feedback}
        return tuple(sorted(delays - {0.0}))

    def delayed(self, delay: float, of: str = "suspension") -> SeatSystem:
        """The same system with a reaction delay.

        Parameters
        ----------
        delay : s, 0 .. 10
        of : "suspension" (all its elements), "feedback" (the forces of an active body), or the name
            of an element

        Examples
        --------
        >>> import seatdyn as sd
        >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
        >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
        >>> system.delayed(0.02, of="Damper").delays
        (0.02,)
        """
        if of == "suspension":
            return replace(self, seat=replace(self.seat, delay=delay))
        if of == "feedback":
            return replace(self, body=self.body.delayed(delay))
        names = [element.name for element in self.all_elements]
        if of not in names:
            hint = suggestion(of, ["suspension", "feedback", *names])
            raise RequestError(f"Nothing here is called {of!r} that could be delayed. {hint}")

        def late(elements: tuple[Element, ...]) -> tuple[Element, ...]:
            return tuple(replace(e, delay=delay) if e.name == of else e for e in elements)

        seat = replace(self.seat, suspension=late(self.seat.suspension))
        return replace(self, seat=seat, elements=late(self.elements))

    @property
    def nonlinear_elements(self) -> tuple[NonlinearElement, ...]:
        """Elements with a force law of their own, in the order given."""
        return tuple(e for e in self.all_elements if isinstance(e, NonlinearElement))

    @property
    def is_linear(self) -> bool:
        """Whether every element is linear, at any amplitude; delays do not matter."""
        return not self.nonlinear_elements and all(e.is_linear for e in self.memory_elements)

    @property
    def memory_elements(self) -> tuple[MemoryElement, ...]:
        """Elements with states of their own, in the order given."""
        return tuple(e for e in self.all_elements if isinstance(e, MemoryElement))

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """Non-linear elements gathered by the pair of nodes that they act across, and by delay."""
        places: dict[tuple[tuple[str, str], float], list[NonlinearElement]] = {}
        for element in self.nonlinear_elements:
            places.setdefault((element.between, element.delay), []).append(element)
        return tuple(Channel(pair, tuple(e), delay) for (pair, delay), e in places.items())

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
    contact = system.contact if isinstance(system, SeatSystem) else SEAT

    def of_body(node: str) -> str:
        """Node of the system that a body's node is: its seat is what it sits on."""
        return contact if node == SEAT else node

    def incidence(first: str, second: str) -> Array:
        b = np.zeros(n + 1)
        b[order[second]] += 1.0
        b[order[first]] -= 1.0
        return b

    mass = np.zeros((n, n))
    for node, value in body.masses.items():
        if of_body(node) != drive:
            mass[order[of_body(node)], order[of_body(node)]] += value
    stiffness, damping = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    active_stiffness, active_damping = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    parameters: dict[str, RankOne] = {}
    ignored: list[str] = []
    late: dict[tuple[float, bool], DelayedForces] = {}
    relaxing: list[Relaxing] = []

    def matrices(delay: float, active: bool) -> tuple[Array, Array]:
        """Where forces with this delay are summed."""
        if delay == 0.0:
            return (active_stiffness, active_damping) if active else (stiffness, damping)
        blank = DelayedForces(delay, active, *np.zeros((2, n + 1, n + 1)))
        group = late.setdefault((delay, active), blank)
        return group.stiffness, group.damping

    def add_pair(between: tuple[str, str], k: float, c: float, delay: float = 0.0) -> None:
        b = incidence(*between)
        springs, dampers = matrices(delay, False)
        springs += k * np.outer(b, b)
        dampers += c * np.outer(b, b)

    for link in body.links:
        first, second = link.between
        add_pair((of_body(first), of_body(second)), link.stiffness, link.damping)
    for force in body.feedback:
        left = incidence(of_body(force.reaction), of_body(force.on))
        for term in force.terms:
            right = np.zeros(n + 1)
            for node, weight in term.weights.items():
                right[order[of_body(node)]] += weight
            rank = 0 if term.of == "displacement" else 1
            target = matrices(force.delay, True)[rank]
            target += term.gain * np.outer(left, right)
            unit = "N/m" if rank == 0 else "N s/m"
            parameters[term.name] = RankOne(rank, left[:n], right[:n], term.gain, unit, force.delay)

    if isinstance(system, SeatSystem):
        mass[order[SEAT], order[SEAT]] += system.seat.mass
        mass[order[contact], order[contact]] += system.seat.cushion_mass
        for element in system.all_elements:
            if isinstance(element, LinearElement):
                add_pair(element.between, *element.linear, element.delay)
            elif linearise == "tangent" and isinstance(element, NonlinearElement):
                add_pair(element.between, *element.tangent(), element.delay)
            elif isinstance(element, MemoryElement) and (element.is_linear or linearise):
                across = incidence(*element.between)
                linear = element.linearised()
                relaxing.append(Relaxing(element.name, across, linear, element.delay))
            else:
                ignored.append(element.name)
        b = incidence(BASE, SEAT)
        unit = np.eye(n)[0]
        parameters["seat_mass"] = RankOne(2, unit, unit, system.seat.mass, "kg")
        for power, name, dimension in ((1, "damping", "N s/m"), (0, "stiffness", "N/m")):
            total, delays = suspension_total(system, power, linearise)
            if len(delays) == 1:  # else it is no single parameter
                parameters[name] = RankOne(power, b[:n], b[:n], total, dimension, *delays)

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
        delayed=tuple(late.values()),
        relaxing=tuple(relaxing),
    )


def suspension_total(
    system: SeatSystem, order: int, linearise: Literal["tangent"] | None = None
) -> tuple[float, set[float]]:
    """Total stiffness N/m (order 0) or damping N s/m (1) between base and seat, and its delays.

    Where there is none, the delay is that of the seat.
    """
    total, delays = 0.0, set()
    for element in system.all_elements:
        if set(element.between) != {BASE, SEAT}:
            continue
        if isinstance(element, LinearElement):
            part = element.linear[order]
        elif linearise == "tangent" and isinstance(element, NonlinearElement):
            part = element.tangent()[order]
        else:
            continue
        if part != 0.0:
            total += part
            delays.add(element.delay)
    return total, delays or {system.seat.delay}


def refuse_delays(delays: tuple[float, ...]) -> None:
    """Raise a RequestError that names the delays, if there are any."""
    if delays:
        times = ", ".join(f"{delay:g} s" for delay in delays)
        raise RequestError(
            f"This analysis does not take delayed forces into account, and forces of this system "
            f"act {times} late. Use poles, frequency_response, is_stable, stability_map, "
            "stability_boundary, delay_margin, simulate or steady_state; or set the delay to 0."
        )


def refuse_memory(names: Sequence[str]) -> None:
    """Raise a RequestError that names the elements with states of their own, if there are any."""
    if names:
        raise RequestError(
            "This analysis does not know elements with states of their own, such as "
            f"{', '.join(names)} here. Use simulate or steady_state; of "
            "linear ones poles, frequency_response, is_stable or delay_margin."
        )
