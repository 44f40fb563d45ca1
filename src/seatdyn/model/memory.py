"""Elements whose force depends on what happened before: they have states of their own.

Beside the force F(d, v, s) such an element says how fast its states s change. Its rates may depend
on the absolute motion of its second node too, which is what a controller of the seat measures.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.model.elements import Break, Element

AT_REST = (Break(0.0, 1.0, 0.0, jumps=False),)  # where the direction of the motion changes


@dataclass(frozen=True)
class MemoryLaw:
    """A law with states as the kernels see it; see `kernels.memory_laws` for the functions.

    scale : size of each state that matters, for the error of a step
    breaks : where the rates have a kink or jump
    """

    force: Callable[..., float]
    rate: Callable[..., None]
    parameters: tuple[float, ...]
    scale: tuple[float, ...]
    breaks: tuple[Break, ...] = ()


@dataclass(frozen=True)
class LinearMemory:
    """An element that is linear: ds/dt = A s + b d + e v + h (w, a), F = c s + k d + g v.

    w and a are the absolute velocity and acceleration of its second node; h (q, 2) or None.
    """

    a: NDArray[np.float64]
    b: NDArray[np.float64]
    e: NDArray[np.float64]
    c: NDArray[np.float64]
    k: float
    g: float
    h: NDArray[np.float64] | None = None

    @classmethod
    def without_states(cls, stiffness: float, damping: float) -> LinearMemory:
        """A spring and a damper."""
        none = np.zeros(0)
        return cls(np.zeros((0, 0)), none, none, none, stiffness, damping)

    def stiffness(self, s: ArrayLike) -> NDArray[np.complex128]:
        """Force per displacement at the Laplace variable s (1/s), in N/m, same shape."""
        points = np.asarray(s, dtype=complex)
        z = points[..., None]
        drive = self.b + z * self.e
        states = np.linalg.solve(z[..., None] * np.eye(len(self.b)) - self.a, drive[..., None])
        return np.asarray((states[..., 0] @ self.c) + self.k + points * self.g)


@dataclass(frozen=True)
class MemoryElement(Element, ABC):
    """Base of the elements with states of their own."""

    states: ClassVar[tuple[tuple[str, str], ...]]  # names and units
    is_linear: ClassVar[bool] = False  # exactly, at any amplitude

    @property
    def feels(self) -> tuple[int, ...]:
        """Which of d, v, w, a (0 .. 3) its force and rates depend on."""
        return (0, 1)

    @abstractmethod
    def lower(self) -> MemoryLaw:
        """The law for the kernels."""

    def rest_force(self, d: float) -> float:
        """Force when it has settled at d."""
        law = self.lower()
        at, rest = (law.force(x, 0.0, self.settled(x), law.parameters) for x in (d, 0.0))
        return float(at - rest)

    def about(self, travel: float) -> MemoryElement:
        """Itself, if its law is linear in the travel."""
        return self

    @abstractmethod
    def settled(self, d: float) -> tuple[float, ...]:
        """States after a long rest at the displacement d (m), reached without friction."""

    def linearised(self) -> LinearMemory:
        """The element for small motions about rest, by differences of its law.

        Raises
        ------
        ModelError
            A law that has no linear form even at the smallest motion.
        """
        law = self.lower()
        start = self.settled(0.0)
        count = len(start)
        steps = np.array([1e-7, 1e-7, *(1e-7 * scale for scale in law.scale)])

        def both(x: NDArray[np.float64]) -> NDArray[np.float64]:
            out = np.zeros(count)
            law.rate(x[0], x[1], 0.0, 0.0, x[2:], law.parameters, out)
            return np.array([law.force(x[0], x[1], x[2:], law.parameters), *out])

        rest = np.array([0.0, 0.0, *start])
        slopes = np.array(
            [(both(rest + h) - both(rest - h)) / (2 * h.sum()) for h in np.diag(steps)]
        ).T
        return LinearMemory(
            slopes[1:, 2:], slopes[1:, 0], slopes[1:, 1], slopes[0, 2:], slopes[0, 0], slopes[0, 1]
        )

    def response(
        self, time: ArrayLike, d: ArrayLike, *, w: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Force in N under a prescribed travel d (m) over time (s); for drawings of loops.

        The travel is the cubic spline through its points. `w` is the absolute velocity of the
        second node in m/s, for elements that feel it (default: that of the travel, the base at
        rest).
        """
        from scipy.integrate import solve_ivp
        from scipy.interpolate import CubicSpline

        t, law = np.asarray(time, dtype=float), self.lower()
        travel = CubicSpline(t, np.asarray(d, dtype=float))
        speed = travel.derivative()
        sprung = speed if w is None else CubicSpline(t, np.asarray(w, dtype=float))
        acceleration = sprung.derivative()
        size = np.array(law.scale)

        def rate(now: float, s: Any) -> NDArray[np.float64]:
            out = np.zeros(size.size)
            motion = (float(f(now)) for f in (travel, speed, sprung, acceleration))
            law.rate(*motion, s * size, law.parameters, out)
            return np.asarray(out / size)

        start = np.array(self.settled(float(travel(t[0])))) / size
        solution = solve_ivp(
            rate, (t[0], t[-1]), start, "LSODA", t_eval=t, rtol=1e-9, atol=1e-9,
            max_step=float(np.diff(t).max()),
        )  # fmt: skip
        states = (solution.y.T * size).tolist()
        rows = zip(travel(t), speed(t), states, strict=True)
        return np.array([law.force(float(x), float(v), s, law.parameters) for x, v, s in rows])
