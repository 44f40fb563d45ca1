"""Many sets of parameters as arrays: each lowered without a system of its own.

Masses, springs, dampers and gains enter the matrices, and the outputs, as a number times a matrix.
So two systems tell that matrix, and all members follow at once. Most laws depend on the fields of
their element in that way, too; a law that does not is asked for every member.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.balance import LOOSE, condense, output_rows
from seatdyn.analysis.balance_many import Many
from seatdyn.analysis.lowering import lower
from seatdyn.analysis.outputs import unique_names
from seatdyn.analysis.parameters import FREQUENCY, LEVEL, SEAT_MASS, with_parameters
from seatdyn.errors import ModelError
from seatdyn.kernels.columns import ELEMENTS, FIRST, IS_JUMP, OFFSET, ON_DISPLACEMENT, SECOND, VALUE
from seatdyn.kernels.condensed import Condensed
from seatdyn.kernels.jit import rows_law_address
from seatdyn.model.elements import LinearElement, NonlinearElement
from seatdyn.model.excitation import Sine
from seatdyn.model.seat import Seat
from seatdyn.model.system import SeatSystem
from seatdyn.units import ACCELERATION
from seatdyn.units import FREQUENCY as FREQUENCIES

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]
ALL = slice(None)
MOST_FIELDS = 3  # of an element whose law is looked at in the corners of their ranges
AFFINE = 1e-13  # of a parameter, by which it may miss


class Numbers(NamedTuple):
    """What a law says of itself in numbers: parameters, the values of its breaks, if it is known.

    Of several members with a leading axis.
    """

    parameters: Array
    breaks: Array
    known: Any


class Members:
    """The periodic problems of many members; `known` says which are lowered here.

    The others have a value out of range, a delay, elements with states, or a parameter of the body:
    they need a system of their own.
    """

    def __init__(self, system: SeatSystem, excitation: Sine, columns: Mapping[str, Array]) -> None:
        """Lower all members that can be."""
        own = (*system.seat.suspension, *system.seat.cushion, *system.elements)
        self._elements = dict(zip(unique_names(own), own, strict=True))
        self._size = len(next(iter(columns.values())))
        self._columns = columns
        simple = not system.delays and not system.memory_elements
        self.known = np.full(self._size, simple and all(map(self._is_simple, columns)))
        for name, values in columns.items():
            low, high = self._range(name)
            self.known &= (values >= low) & (values <= high)
        if not self.known.any():
            return
        first = int(np.argmax(self.known))
        self._first = {name: float(values[first]) for name, values in columns.items()}
        pair = with_parameters(system, excitation, self._first)
        base = condense(*pair)
        assert base is not None
        if np.any(base.shift):
            self.known[:] = False
            return
        self._base, self._system, self._excitation = base, *pair
        self._ratio, self._level = self._scale(FREQUENCY), self._scale(LEVEL)
        self._set_laws(pair[0])
        self._set_matrices(*pair)

    def _is_simple(self, name: str) -> bool:
        element, _, field = name.rpartition(".")
        if element in self._elements:
            return field != "delay"
        return name in (SEAT_MASS, FREQUENCY, LEVEL)

    def _range(self, name: str) -> tuple[float, float]:
        """Least and greatest value allowed; the laws look at the rest."""
        element, _, key = name.rpartition(".")
        kind: Any = type(self._elements[element]) if element in self._elements else Seat
        if name == FREQUENCY:
            return FREQUENCIES["minimum"], FREQUENCIES["maximum"]
        if name == LEVEL:
            return math.ulp(0.0), ACCELERATION["maximum"]  # none is no measure of the others
        for field in fields(kind):
            if field.name == (key if element else "mass") and field.metadata:
                limits = field.metadata["limits"]
                return limits["minimum"], limits["maximum"]
        return -math.inf, math.inf

    def _set_laws(self, system: SeatSystem) -> None:
        """Parameters and breaks of the laws of every member."""
        base, names = self._base, unique_names(system.all_elements)
        order = [e for channel in system.channels for e in channel.elements]
        place = {id(element): i for i, element in enumerate(order)}
        self._parameters = np.tile(base.parameters, (self._size, 1))
        self._breaks = np.tile(base.breaks, (self._size, 1, 1))
        changing: list[tuple[Any, int, dict[str, Array]]] = []
        for name, element in zip(names, system.all_elements, strict=True):
            own = {
                key.rpartition(".")[2]: values
                for key, values in self._columns.items()
                if key.rpartition(".")[0] == name
            }
            if own and isinstance(element, NonlinearElement):
                changing.append((element, place[id(element)], own))
        alone = len(order) == 1 or not base.breaks.size
        for element, i, own in changing:
            known = np.nonzero(self.known)[0]
            found = member_numbers(element, {key: values[known] for key, values in own.items()})
            same = np.all(found.breaks == numbers_of(element).breaks, axis=1)
            self.known[known] = found.known & (same | alone)
            start = int(base.elements[i, OFFSET])
            self._parameters[known, start : start + found.parameters.shape[1]] = found.parameters
            if alone and found.breaks.size:
                self._breaks[known, :, VALUE] = found.breaks

    def _set_matrices(self, system: SeatSystem, excitation: Sine) -> None:
        """Matrices of every member, as in `lower` and `condense`."""
        start = _matrices(system)
        changes, shares = [], []
        for name, values in self._columns.items():
            element = self._elements.get(name.rpartition(".")[0])
            if name != SEAT_MASS and not isinstance(element, LinearElement):
                continue
            here = self._first[name]
            step = here if here else 1.0
            there = _matrices(with_parameters(system, excitation, {name: here + step})[0])
            changes.append([b - a for a, b in zip(start, there, strict=True)])
            shares.append((values - here) / step)
        shares.append(np.ones(self._size))
        self._shares = np.array(shares).T
        self._shares[~self.known, :-1] = 0.0
        parts = [np.stack(each) for each in zip(*changes, start, strict=True)]
        mass, known = self._sum(parts[0], ALL), self.known
        *stiff_damped_drive, self._row_parts = parts[1:]
        base = self._base
        n, m = base.pull.shape
        incidence = np.zeros((n + 1, m))
        for j in range(m):
            incidence[base.channels[j, SECOND], j] += 1.0
            incidence[base.channels[j, FIRST], j] -= 1.0
        self._incidence = incidence[:n]
        signs = (-1.0, -1.0, 1.0, 1.0)  # stiffness and damping on the right, then the base
        forces = [
            sign * part.reshape(len(part), n, -1)
            for sign, part in zip(signs, stiff_damped_drive, strict=True)
        ]
        pulls = np.zeros((len(shares), n, m))
        pulls[-1] = self._incidence
        right = self._sum(np.concatenate([*forces, pulls], axis=2), ALL)
        moved = np.linalg.inv(mass) @ right
        self._linear, self._pull = moved[..., : 2 * n + 2], moved[..., 2 * n + 2 :]
        # others are held by elements that are not springs
        known &= are_stiff(self._linear[:, :, :n])

    def _sum(self, parts: Array, which: Any) -> Array:
        """Matrices of members from what they have in common and what changes with each column."""
        flat: Array = self._shares[which] @ parts.reshape(len(parts), -1)
        return flat.reshape(*flat.shape[:-1], *parts.shape[1:])

    @functools.cached_property
    def _of_channels(self) -> tuple[Array, Array, Array]:
        """Gain, and what forces do later, of every member, see `condense`."""
        n, across = self._incidence.shape[0], self._incidence.T
        stiff, damped = self._linear[..., :n], self._linear[..., n : 2 * n]
        first = damped @ self._pull
        later = np.stack([first, damped @ first + stiff @ self._pull], axis=1)
        return across @ self._pull, later, across @ later

    @property
    def smooth(self) -> bool:
        """Whether no law breaks but, without jump, where a velocity is zero.

        That happens twice a period; a stop may be met between two samples only.
        """
        breaks = self._base.breaks
        return not np.any(breaks[:, [ON_DISPLACEMENT, VALUE, IS_JUMP]])

    def many(self, which: Integers, outputs: Sequence[int] | slice) -> Many:
        """Known members side by side, to be asked for some of their outputs."""
        base, ratio, level = self._base, self._ratio[which], self._level[which]
        system, motion = self._system, self._excitation.motion
        linear, pull = self._linear[which], self._pull[which]
        channel = np.repeat(np.arange(len(base.channels) - 1), np.diff(base.channels[:, ELEMENTS]))
        weights = without_accelerations(self.rows(which, outputs), linear, pull, channel)
        drive = np.multiply.outer(level / ratio**2, base.base)
        return Many(
            linear, pull, drive, base.omega * ratio,
            self._parameters[which], weights, base.channels,
            lower(system, motion, address=rows_law_address).elements,
        )  # fmt: skip

    def rows(self, which: Integers | slice, outputs: Sequence[int] | slice) -> Array:
        """Outputs of known members as combinations of the columns of a sample, (p, o, C)."""
        return self._sum(self._row_parts[:, outputs], which)

    def _scale(self, name: str) -> Array:
        """Frequency or level of every member in terms of those of the base motion lowered."""
        own = {FREQUENCY: self._excitation.frequency, LEVEL: self._excitation.peak}[name]
        return np.broadcast_to(self._columns.get(name, own), self._size) / own

    def __getitem__(self, p: int) -> Condensed:
        """Problem of a known member."""
        base, ratio, level = self._base, self._ratio[p], self._level[p]
        gain, later_pull, later_gain = self._of_channels
        return base._replace(
            linear=np.ascontiguousarray(self._linear[p]),
            pull=np.ascontiguousarray(self._pull[p]),
            gain=gain[p],
            later_pull=later_pull[p],
            later_gain=later_gain[p],
            parameters=self._parameters[p],
            breaks=self._breaks[p],
            base=base.base * (level / ratio**2),
            scale=np.ones(2),
            omega=base.omega * ratio,
        )


def are_stiff(matrices: Array) -> Flags:
    """Whether the condition of matrices (p, n, n) is not above LOOSE, by a bound where that does.

    Of the determinant D and the root of the sum of squares S, 2/D (S/sqrt n)^n (H. W. Guggenheimer,
    A. S. Edelman and C. R. Johnson, A simple estimate of the condition number of a linear system,
    College Math. J. 26 (1995) 2-5).
    """
    n = matrices.shape[1]
    size = np.sqrt(np.square(matrices).sum(axis=(1, 2)) / n)
    bound = 2.0 * size**n < LOOSE * np.abs(np.linalg.det(matrices))
    rest = np.nonzero(~bound)[0]
    bound[rest] = np.linalg.cond(matrices[rest]) <= LOOSE
    return np.asarray(bound)


def without_accelerations(rows: Array, linear: Array, pull: Array, channel: Integers) -> Array:
    """Outputs (p, o, C) in the columns z, v, forces and u, u', u'' alone: a follows from the rest.

    channel : (e,) of every element
    """
    nodes, e = linear.shape[1], len(channel)
    cuts = np.cumsum([2 * nodes, nodes, e])
    state, acceleration, force, drive = np.split(rows, cuts, axis=2)
    if np.any(acceleration):
        moved = acceleration @ linear
        state, drive = state + moved[..., : 2 * nodes], drive.copy()
        drive[..., :2] += moved[..., 2 * nodes :]
        force = force - (acceleration @ pull)[..., channel]
    return np.concatenate([state, force, drive], axis=2)


def numbers_of(element: NonlinearElement) -> Numbers:
    """Numbers of the law of an element."""
    law = element.lower()
    breaks = np.array([spot.value for spot in law.breaks])
    return Numbers(np.array(law.parameters), breaks, np.bool_(True))


def changed_numbers(element: NonlinearElement, values: Mapping[str, float]) -> Numbers | None:
    """The same with other fields; None where these are refused or make another law of it."""
    try:
        changed = replace(element, **dict[str, Any](values))
    except ModelError:
        return None
    law, before = changed.lower(), element.lower()
    kinds = [[(b.displacement, b.velocity, b.jumps) for b in each.breaks] for each in (law, before)]
    same = law.function is before.function and len(law.parameters) == len(before.parameters)
    return numbers_of(changed) if same and kinds[0] == kinds[1] else None


def member_numbers(element: NonlinearElement, values: Mapping[str, Array]) -> Numbers:
    """Numbers (p, .) of the law of an element with fields (p,)."""
    found = affine_numbers(element, values)
    if found is not None:
        return found
    sets = [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]
    changed = [changed_numbers(element, {k: float(v) for k, v in own.items()}) for own in sets]
    before = numbers_of(element)._replace(known=np.bool_(False))
    return Numbers(*(np.array(each) for each in zip(*(c or before for c in changed), strict=True)))


def affine_numbers(element: NonlinearElement, values: Mapping[str, Array]) -> Numbers | None:
    """The same where every number is a sum of multiples of the fields, else None.

    A law of ours is asked in the corners and in the middle of the ranges of its fields.
    """
    if len(values) > MOST_FIELDS or not type(element).__module__.startswith("seatdyn."):
        return None
    ends = {key: (float(column.min()), float(column.max())) for key, column in values.items()}
    spots = [dict(zip(ends, spot, strict=True)) for spot in itertools.product(*ends.values())]
    spots.append({key: (low + high) / 2 for key, (low, high) in ends.items()})
    asked = [changed_numbers(element, spot) for spot in spots]
    found = [numbers for numbers in asked if numbers is not None]
    if len(found) < len(spots):
        return None

    def terms(fields: Mapping[str, Array]) -> Array:
        """One, and how far every field is on its way from end to end."""
        rows = [np.ones_like(next(iter(fields.values())))]
        rows += [(fields[k] - low) / (high - low) for k, (low, high) in ends.items() if high > low]
        return np.array(rows).T

    known = terms({key: np.array([spot[key] for spot in spots]) for key in ends})
    result = []
    for exact in (np.array([n.parameters for n in found]), np.array([n.breaks for n in found])):
        weights = np.linalg.lstsq(known, exact, rcond=None)[0]
        if np.any(np.abs(known @ weights - exact) > AFFINE * np.abs(exact).max(axis=0)):
            return None
        own = terms(values) @ weights
        result.append(np.where(np.ptp(exact, axis=0) > 0.0, own, exact[0]))
    return Numbers(result[0], result[1], np.full(len(result[0]), True))


def _matrices(system: SeatSystem) -> tuple[Array, ...]:
    """Mass, stiffness, damping, forces per displacement and velocity of the base, and outputs."""
    linear = system.linear.prompt
    return (
        linear.mass,
        linear.stiffness,
        linear.damping,
        linear.drive_stiffness,
        linear.drive_damping,
        output_rows(system)[1],
    )
