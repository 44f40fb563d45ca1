"""Many sets of parameters as arrays: each lowered without a system of its own.

Masses, springs, dampers and gains enter the matrices, and the outputs, as a number times a matrix.
So two systems tell that matrix, and all members follow at once. Most laws depend on the fields of
their element in that way, too; a law that does not is asked for every member.
"""

from __future__ import annotations

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
from seatdyn.kernels.columns import FIRST, IS_JUMP, OFFSET, ON_DISPLACEMENT, SECOND, VALUE
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
        start, rows = _matrices(system), output_rows(system)[1]
        matrices = [np.tile(a, (self._size,) + (1,) * a.ndim) for a in (*start, rows)]
        for name, values in self._columns.items():
            element = self._elements.get(name.rpartition(".")[0])
            if name != SEAT_MASS and not isinstance(element, LinearElement):
                continue
            here = self._first[name]
            step = here if here else 1.0
            there = with_parameters(system, excitation, {name: here + step})[0]
            for total, a, b in zip(
                matrices, (*start, rows), (*_matrices(there), output_rows(there)[1]), strict=True
            ):
                total += np.multiply.outer((values - here) / step, b - a)
        mass, stiffness, damping, drive_k, drive_c, self._rows = matrices
        known, base = self.known, self._base
        mass[~known] = start[0]
        n, m = base.pull.shape
        incidence = np.zeros((n + 1, m))
        for j in range(m):
            incidence[base.channels[j, SECOND], j] += 1.0
            incidence[base.channels[j, FIRST], j] -= 1.0
        inverse = np.linalg.inv(mass)
        stiff, damped = -(inverse @ stiffness), -(inverse @ damping)
        known &= np.linalg.cond(stiff) <= LOOSE  # others are held by elements that are not springs
        drive = inverse @ np.stack([drive_k, drive_c], axis=2)
        self._linear = np.concatenate([stiff, damped, drive], axis=2)
        self._pull = inverse @ incidence[:n]
        self._gain = incidence[:n].T @ self._pull
        later = (damped @ self._pull, (damped @ damped + stiff) @ self._pull)
        self._later_pull = np.stack(later, axis=1)
        self._later_gain = incidence[:n].T @ self._later_pull

    @property
    def smooth(self) -> bool:
        """Whether no law breaks but, without jump, where a velocity is zero.

        That happens twice a period; a stop may be met between two samples only.
        """
        breaks = self._base.breaks
        return not np.any(breaks[:, [ON_DISPLACEMENT, VALUE, IS_JUMP]])

    def many(self, which: Integers, outputs: Sequence[int]) -> Many:
        """Known members side by side, to be asked for some of their outputs."""
        base, size = self._base, len(which)
        ratio, level = (self._scale(name, which) for name in (FREQUENCY, LEVEL))
        system, motion = self._system, self._excitation.motion
        return Many(
            self._linear[which], self._pull[which],
            base.base * (level / ratio**2)[:, None], base.omega * ratio * np.ones(size),
            self._parameters[which], self._rows[which][:, outputs], base.channels,
            lower(system, motion, address=rows_law_address).elements,
        )  # fmt: skip

    def _scale(self, name: str, which: Integers | int) -> Any:
        """Frequency or level of members in terms of those of the base motion lowered."""
        own = {FREQUENCY: self._excitation.frequency, LEVEL: self._excitation.peak}[name]
        column = self._columns.get(name, np.full(self._size, own))
        return column[which] / own

    def __getitem__(self, p: int) -> tuple[Condensed, Array]:
        """Problem and outputs of a known member."""
        base = self._base
        ratio, level = self._scale(FREQUENCY, p), self._scale(LEVEL, p)
        problem = base._replace(
            linear=self._linear[p],
            pull=self._pull[p],
            gain=self._gain[p],
            later_pull=self._later_pull[p],
            later_gain=self._later_gain[p],
            parameters=self._parameters[p],
            breaks=self._breaks[p],
            base=base.base * (level / ratio**2),
            scale=np.ones(2),
            omega=base.omega * ratio,
        )
        return problem, self._rows[p]


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
    """Mass, stiffness, damping, and forces per displacement and velocity of the base."""
    linear = system.linear.prompt
    return (
        linear.mass,
        linear.stiffness,
        linear.damping,
        linear.drive_stiffness,
        linear.drive_damping,
    )
