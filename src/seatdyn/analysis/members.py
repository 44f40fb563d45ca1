"""Many sets of parameters as arrays: each lowered without a system of its own.

Masses, springs, dampers and gains enter the matrices, and the outputs, as a number times a matrix.
So two systems tell that matrix, and all members follow at once; only the laws are asked for every
member, for they turn their fields into parameters and breaks themselves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.balance import LOOSE, condense, output_rows
from seatdyn.analysis.outputs import unique_names
from seatdyn.analysis.parameters import FREQUENCY, LEVEL, SEAT_MASS, with_parameters
from seatdyn.errors import ModelError
from seatdyn.kernels.columns import FIRST, OFFSET, SECOND
from seatdyn.kernels.condensed import Condensed
from seatdyn.model.elements import LinearElement, NonlinearElement
from seatdyn.model.excitation import Sine
from seatdyn.model.seat import Seat
from seatdyn.model.system import SeatSystem
from seatdyn.units import ACCELERATION
from seatdyn.units import FREQUENCY as FREQUENCIES

Array = NDArray[np.float64]


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
        self._base, self._excitation = base, pair[1]
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
        for p in np.nonzero(self.known)[0]:
            for element, i, own in changing:
                try:
                    changed = replace(element, **{k: float(v[p]) for k, v in own.items()})
                except ModelError:
                    self.known[p] = False
                    continue
                law, before = changed.lower(), element.lower()
                same = law.function is before.function and len(law.breaks) == len(before.breaks)
                kept = len(law.parameters) == len(before.parameters) and (
                    alone or law.breaks == before.breaks
                )
                if not (same and kept):
                    self.known[p] = False
                    continue
                start = int(base.elements[i, OFFSET])
                self._parameters[p, start : start + len(law.parameters)] = law.parameters
                if alone and law.breaks:
                    self._breaks[p] = [
                        (b.displacement, b.velocity, b.value, b.jumps) for b in law.breaks
                    ]

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

    def __getitem__(self, p: int) -> tuple[Condensed, Array]:
        """Problem and outputs of a known member."""
        base, columns = self._base, self._columns
        frequency = self._excitation.frequency
        ratio = columns[FREQUENCY][p] / frequency if FREQUENCY in columns else 1.0
        level = columns[LEVEL][p] / self._excitation.peak if LEVEL in columns else 1.0
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
