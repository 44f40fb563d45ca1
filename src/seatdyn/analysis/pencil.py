"""The characteristic matrix of a linear system, the states of its elements included.

    D(s) = M s^2 + C s + K + sum over delays of exp(-s tau) (K_tau + s C_tau)

over the nodes, then the states. A state that follows the travel d of its element, dx/dt = A x + b d
+ e d', is a node without mass: a row of C with 1 and -e, a row of K with -A and -b. What it adds to
the force of the element, c x, stands in the rows of the nodes, in K if that acts at once, else in
K_tau. So D has no poles, whatever the element's complex stiffness has.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from seatdyn.analysis.linear import Array, ComplexArray, companion
from seatdyn.model.system import LinearModel

RANK = 1e-12  # singular values of a delayed force below this share of the largest are rounding


class Late(NamedTuple):
    """Linear forces with one delay in s."""

    delay: float
    stiffness: Array
    damping: Array

    def signals(self, nodes: int) -> tuple[Array, Array]:
        """They are left (N, r) times right (r, 2N+q) of the state [z, z', x]."""
        both = state_columns(self.stiffness, self.damping, nodes)
        left, values, right = np.linalg.svd(both, full_matrices=False)
        rank = int(np.sum(values > RANK * values[0])) if values[0] > 0.0 else 0
        return left[:, :rank], values[:rank, None] * right[:rank]


@dataclass(frozen=True)
class Pencil:
    """Mass (N, N), damping and stiffness (N+q, N+q) of what acts at once, and what acts late."""

    mass: Array
    damping: Array
    stiffness: Array
    late: tuple[Late, ...]

    @classmethod
    def of(cls, model: LinearModel) -> Pencil:
        """The matrices of a model."""
        n, prompt = model.size, model.prompt
        q = sum(len(one.element.b) for one in model.relaxing)
        groups: dict[float, tuple[Array, Array]] = {}  # stiffness and damping by delay

        def acting(delay: float) -> tuple[Array, Array]:
            blank = (np.zeros((n + q, n + q)), np.zeros((n + q, n + q)))
            return groups.setdefault(delay, blank)

        at_once = acting(0.0)
        for total, part in zip(at_once, (prompt.stiffness, prompt.damping), strict=True):
            total[:n, :n] = part
        for group in model.delayed:
            for total, part in zip(
                acting(group.delay), (group.stiffness, group.damping), strict=True
            ):
                total[:n, :n] += part[:n, :n]
        place = n
        for one in model.relaxing:
            across, form = one.across[:n], one.element
            own = slice(place, place + len(form.b))
            stiffness, damping = acting(one.delay)
            stiffness[:n, :n] += form.k * np.outer(across, across)
            damping[:n, :n] += form.g * np.outer(across, across)
            stiffness[:n, own] += np.outer(across, form.c)
            stiffness, damping = at_once
            stiffness[own, :n] = -np.outer(form.b, across)
            stiffness[own, own] = -form.a
            damping[own, :n] = -np.outer(form.e, across)
            damping[own, own] = np.eye(len(form.b))
            place = own.stop
        stiffness, damping = groups.pop(0.0)
        late = tuple(Late(delay, *parts) for delay, parts in groups.items())
        return cls(prompt.mass, damping, stiffness, late)

    @property
    def nodes(self) -> int:
        """Number N of nodes; what follows are states."""
        return len(self.mass)

    @property
    def degree(self) -> int:
        """Number 2N + q of roots without delays."""
        return self.nodes + len(self.stiffness)

    @cached_property
    def _inertia(self) -> Array:
        """The mass, and none of the states."""
        whole = np.zeros_like(self.stiffness)
        whole[: self.nodes, : self.nodes] = self.mass
        return whole

    def at(self, s: ComplexArray) -> ComplexArray:
        """D(s), (..., N+q, N+q)."""
        z = np.asarray(s)[..., None, None]
        total = self.stiffness + z * self.damping + z**2 * self._inertia
        for delay, stiffness, damping in self.late:
            total = total + np.exp(-z * delay) * (stiffness + z * damping)
        return np.asarray(total)

    def slope(self, s: ComplexArray) -> ComplexArray:
        """dD/ds, (..., N+q, N+q)."""
        z = np.asarray(s)[..., None, None]
        total = self.damping + 2.0 * z * self._inertia
        for delay, k, c in self.late:
            total = total + np.exp(-z * delay) * (c - delay * (k + z * c))
        return np.asarray(total)

    def state_matrix(self) -> Array:
        """A of y' = A y with y = [z, z', x], of what acts at once, (2N+q, 2N+q)."""
        return companion(self.mass, self.damping, self.stiffness)


def state_columns(stiffness: Array, damping: Array, nodes: int) -> Array:
    """Forces on the nodes by displacements, velocities and states, (N, 2N+q)."""
    k, c = stiffness[:nodes], damping[:nodes]
    return np.hstack([k[:, :nodes], c[:, :nodes], k[:, nodes:]])
