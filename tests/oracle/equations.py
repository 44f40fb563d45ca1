"""Parameters and equations of motion of the seated-operator model, written out by hand.

Nothing here comes from the package under test.  State of the system::

    y = (x, x1, x2, x', x1', x2')          seat, body mass 1, body mass 2; all absolute, SI units

Base motion x0 = -(a/w^2) sin(w t).  Suspension travel d = x - x0, its rate v = x' - x0'.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SEAT_MASS = 35.0  # kg
STIFFNESS = 9950.0  # N/m
DAMPING = 260.0  # N s/m
BASE_ACCELERATION = 0.8857  # m/s2, peak
FREQUENCY = {"back_off": 1.55, "back_on": 1.58}  # Hz
COULOMB_SLOPE = 1000.0  # s/m

OUTPUTS = (
    "acc_x1",
    "acc_x2",
    "acc_x",
    "x1",
    "x2",
    "x",
    "x2_minus_x1",
    "x1_minus_x",
    "x2_minus_x",
    "F_a",
    "F_total_lin",
    "F_c",
    "F_a_plus_F_nl",
    "F_nl",
)


@dataclass(frozen=True)
class Body:
    """Table 1: masses, springs, dampers and the four coefficients of the active force."""

    posture: str
    m1: float
    k1: float
    al1: float
    m2: float
    k2: float
    al2: float
    k11: float
    k12: float
    k13: float
    k14: float

    def active_force(self, y: Array) -> float:
        """F_A [N] on mass 1 (and -F_A on mass 2), formulas (1) back-off and (2) back-on."""
        x, x1, x2, u, u1, u2 = y
        if self.posture == "back_off":
            return float(
                -self.k11 * (x1 - x)
                - self.k12 * (u1 - u)
                - self.k13 * (x2 + x)
                - self.k14 * (u2 + u)
            )
        return float(
            -self.k11 * (x1 + x) - self.k12 * (u1 - u) - self.k13 * (x2 + x) - self.k14 * (u2 - u)
        )


BODIES = {
    "back_off": Body(
        posture="back_off",
        m1=9.1,
        k1=11972.5557,
        al1=3251.9783,
        m2=61.7,
        k2=22456.7485,
        al2=519.0440,
        k11=97323.2354,
        k12=-2226.0653,
        k13=-1960.5176,
        k14=1164.3525,
    ),
    "back_on": Body(
        posture="back_on",
        m1=66.0,
        k1=51189.32,
        al1=1704.17,
        m2=4.8,
        k2=63335.50,
        al2=1262.59,
        k11=123251.32,
        k12=-1781.04,
        k13=-104227.69,
        k14=759.69,
    ),
}


@dataclass(frozen=True)
class Law:
    """Non-linear suspension force N.

    kind is ``jump`` (gamma d outside the free zone, 0 inside), ``quadratic`` (beta1 |s| s) or
    ``coulomb`` ((2/pi) beta2 atan(1000 s)), where s = v + offset.
    """

    kind: str
    coefficient: float
    offset: float = 0.0  # m/s, added to v in the velocity laws
    lower: float = -0.02  # m, free zone of the jump law
    upper: float = 0.01  # m

    def force_of_velocity(self, v: Array | float) -> Array:
        """Quadratic or Coulomb force [N] at relative velocity v [m/s]."""
        s = np.asarray(v, dtype=float) + self.offset
        if self.kind == "quadratic":
            return np.asarray(self.coefficient * np.abs(s) * s)
        return np.asarray((2 / math.pi) * self.coefficient * np.arctan(COULOMB_SLOPE * s))

    def slope_of_velocity(self, v: Array | float) -> Array:
        """Derivative [N s/m] of :meth:`force_of_velocity`."""
        s = np.asarray(v, dtype=float) + self.offset
        if self.kind == "quadratic":
            return np.asarray(2 * self.coefficient * np.abs(s))
        factor = (2 / math.pi) * self.coefficient * COULOMB_SLOPE
        return np.asarray(factor / (1 + (COULOMB_SLOPE * s) ** 2))

    def stiffness_at(self, d: float) -> float:
        """gamma outside the free zone of the jump law, 0 inside [N/m]."""
        return self.coefficient if d > self.upper or d < self.lower else 0.0


@dataclass(frozen=True)
class Case:
    """One row of a table: a body, a frequency and a law."""

    body: Body
    frequency: float
    law: Law

    @property
    def omega(self) -> float:
        """Angular frequency [rad/s]."""
        return 2 * math.pi * self.frequency

    @property
    def period(self) -> float:
        """Excitation period [s]."""
        return 1 / self.frequency

    def base(self, t: float) -> tuple[float, float]:
        """Base displacement x0 [m] and velocity x0' [m/s] at time t."""
        w = self.omega
        a = BASE_ACCELERATION
        return -(a / w**2) * math.sin(w * t), -(a / w) * math.cos(w * t)

    def accelerations(self, y: Array, suspension: float) -> Array:
        """(x'', x1'', x2'') for state y and total suspension force c d + alpha v + N [N]."""
        b = self.body
        x, x1, x2, u, u1, u2 = y
        link1 = b.k1 * (x1 - x) + b.al1 * (u1 - u)
        link2 = b.k2 * (x2 - x) + b.al2 * (u2 - u)
        active = b.active_force(y)
        return np.array(
            [
                (link1 + link2 - suspension) / SEAT_MASS,
                (-link1 + active) / b.m1,
                (-link2 - active) / b.m2,
            ]
        )

    def free_matrix(self) -> Array:
        """6 x 6 matrix A of y' = A y when the suspension transmits nothing, column by column."""
        matrix = np.zeros((6, 6))
        matrix[:3, 3:] = np.eye(3)
        for j, unit in enumerate(np.eye(6)):
            matrix[3:, j] = self.accelerations(unit, 0.0)
        return matrix

    def outputs(self, states: Array, base: Array, force: Array) -> Array:
        """The 14 columns of a table, shape (n, 14).

        states (n, 6), base (n, 2) holding x0 and x0', force (n,) holding N.
        """
        d = states[:, 0] - base[:, 0]
        v = states[:, 3] - base[:, 1]
        spring, damper = STIFFNESS * d, DAMPING * v
        suspension = spring + damper + force
        acc = states @ self.free_matrix()[3:].T
        acc[:, 0] -= suspension / SEAT_MASS
        x, x1, x2 = states[:, 0], states[:, 1], states[:, 2]
        columns = [acc[:, 1], acc[:, 2], acc[:, 0], x1, x2, x, x2 - x1, x1 - x, x2 - x]
        columns += [damper, spring + damper, spring, damper + force, force]
        return np.stack(columns, axis=1)

    def base_array(self, t: Array) -> Array:
        """Base displacement and velocity at times t, shape (n, 2)."""
        w = self.omega
        a = BASE_ACCELERATION
        return np.stack([-(a / w**2) * np.sin(w * t), -(a / w) * np.cos(w * t)], axis=1)
