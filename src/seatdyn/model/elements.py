"""Suspension elements: small frozen classes, each one force law.

An element acts between two nodes. With d the displacement of the second node minus that of the
first (suspension travel, positive in rebound) and v its rate, it pulls its ends together with
F(d, v), positive in tension. Elements with a linear law enter the stiffness and damping matrices;
the others become rows of a table that the compiled kernels read (`lower`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import ModelError
from seatdyn.kernels import laws
from seatdyn.model.body import node_pair
from seatdyn.units import (
    DAMPING,
    DELAY,
    FORCE,
    LENGTH,
    STIFFNESS,
    Limits,
    either_sign,
    number,
    quantity,
    validated,
)

COEFFICIENT = Limits(minimum=-1e24, maximum=1e24)  # of a polynomial, in the unit of its power


@dataclass(frozen=True)
class Break:
    """Where a law jumps or has a kink: on the line displacement*d + velocity*v = value."""

    displacement: float
    velocity: float
    value: float
    jumps: bool


@dataclass(frozen=True)
class Law:
    """A force law as the kernels see it: its function F(d, v, p), parameters p and breaks.

    `limits` is the range of a measured table (on d or v) outside which the law extrapolates.
    """

    function: Callable[[float, float, Any], float]
    parameters: tuple[float, ...]
    breaks: tuple[Break, ...] = ()
    limits: tuple[str, float, float] | None = None


@dataclass(frozen=True)
class Element(ABC):
    """Base of all elements.

    Its force may act `delay` seconds (0 .. 10) late: at t with its value of t - delay.
    """

    between: tuple[str, str] = field(default=("base", "seat"), kw_only=True)
    label: str = field(default="", kw_only=True)
    delay: float = field(default=0.0, kw_only=True, metadata=quantity("s", **DELAY).metadata)

    def __post_init__(self) -> None:
        """Check nodes and every quantity."""
        pair = node_pair(self.between, f"{type(self).__name__}.between")
        object.__setattr__(self, "between", pair)
        validated(self)

    @property
    def name(self) -> str:
        """The label given by the user, or the name of the class."""
        return self.label or type(self).__name__

    @property
    def load(self) -> float:
        """Weight in N that it bears at d = 0, which the motion about rest does not show."""
        return 0.0

    @abstractmethod
    def rest_force(self, d: float) -> float:
        """Force in N, positive in tension, while it rests at d (m), less that at d = 0."""

    @abstractmethod
    def about(self, travel: float) -> Element:
        """The same element with its travel measured from `travel` (m)."""


@dataclass(frozen=True)
class LinearElement(Element):
    """An element that is a constant stiffness and a constant damping."""

    @property
    def linear(self) -> tuple[float, float]:
        """Stiffness in N/m and damping in N s/m."""
        return (getattr(self, "stiffness", 0.0), getattr(self, "coefficient", 0.0))

    def rest_force(self, d: float) -> float:
        """The spring's force."""
        return self.linear[0] * d

    def about(self, travel: float) -> LinearElement:
        """Itself: a line is the same everywhere."""
        return self


@dataclass(frozen=True)
class NonlinearElement(Element, ABC):
    """An element with a force law of its own."""

    @abstractmethod
    def lower(self) -> Law:
        """The law for the kernels."""

    def rest_force(self, d: float) -> float:
        """The law at no velocity."""
        return float(self.force_at(d) - self.force_at(0.0))

    @property
    def load(self) -> float:
        """What it pushes with at d = 0 in rest."""
        return -float(self.force_at(0.0))

    def about(self, travel: float) -> NonlinearElement:
        """Itself, if its law does not feel the travel and rests without force; else `Shifted`."""
        from seatdyn.model.shift import Shifted

        v = np.linspace(-1.0, 1.0, 5)
        places = np.linspace(-abs(travel), abs(travel), 5)[:, None]
        same = self.force_at(places + travel, v) == self.force_at(places, v)
        if self.load == 0.0 and np.all(same):
            return self
        return Shifted(self, travel, between=self.between, label=self.name, delay=self.delay)

    @abstractmethod
    def tangent(self) -> tuple[float, float]:
        """Derivatives dF/dd in N/m and dF/dv in N s/m at d = 0, v = 0."""

    def force_at(self, d: ArrayLike, v: ArrayLike = 0.0) -> NDArray[np.float64]:
        """Force in N at displacements d (m) and velocities v (m/s), which are broadcast."""
        law = self.lower()
        evaluate = np.frompyfunc(lambda x, y: law.function(x, y, law.parameters), 2, 1)
        return np.asarray(evaluate(np.asarray(d, float), np.asarray(v, float)), dtype=float)


@dataclass(frozen=True)
class Spring(LinearElement):
    """Linear spring F = k d.

    Parameters
    ----------
    stiffness : k in N/m, 0 .. 1e12
    preload : weight in N, within +-1e9, that it bears at d = 0 by its compression there; it matters
        to `static_equilibrium` only, for motions are measured from rest
    """

    stiffness: float = quantity("N/m", **STIFFNESS)
    preload: float = quantity("N", default=0.0, **either_sign(FORCE))

    @property
    def load(self) -> float:
        """Its preload."""
        return self.preload

    def about(self, travel: float) -> Spring:
        """With the preload that it has there."""
        return replace(self, preload=self.preload - self.stiffness * travel)


@dataclass(frozen=True)
class Damper(LinearElement):
    """Linear viscous damper F = c v.

    Parameters
    ----------
    coefficient : c in N s/m, 0 .. 1e9
    """

    coefficient: float = quantity("N s/m", **DAMPING)


@dataclass(frozen=True)
class QuadraticDamper(NonlinearElement):
    """Quadratic damping F = beta |v| v (formula (4) of the paper).

    Parameters
    ----------
    coefficient : beta in N s2/m2, 0 .. 1e9
    """

    coefficient: float = quantity("N s2/m2", **DAMPING)

    def lower(self) -> Law:
        """The law; its second derivative jumps at v = 0."""
        return Law(laws.quadratic, (self.coefficient,), (Break(0.0, 1.0, 0.0, jumps=False),))

    def tangent(self) -> tuple[float, float]:
        """Zero at rest."""
        return (0.0, 0.0)


@dataclass(frozen=True)
class CoulombFriction(NonlinearElement):
    """Smoothed Coulomb friction F = (2/pi) F_c atan(slope v) (formula (5) of the paper).

    Parameters
    ----------
    force : F_c in N, 0 .. 1e9
    slope : in s/m, 1e-6 .. 1e9; the paper uses 1000. Below about 1/slope the element creeps.
    """

    force: float = quantity("N", **FORCE)
    slope: float = quantity("s/m", default=1000.0, minimum=1e-6, maximum=1e9)

    def lower(self) -> Law:
        """The law, smooth."""
        return Law(laws.coulomb, (self.force, self.slope))

    def tangent(self) -> tuple[float, float]:
        """Damping (2/pi) F_c slope of the smoothed law at rest."""
        return (0.0, 0.6366197723675814 * self.force * self.slope)


@dataclass(frozen=True)
class PiecewiseSpring(NonlinearElement):
    """Piecewise restoring force with a free zone (formula (3) of the paper).

    Zero while -bump_clearance < d < rebound_clearance. Outside, with `jumping` (the paper's form)
    F = gamma d, which jumps by gamma times the clearance at the threshold; else F = gamma (d - b),
    continuous.

    Parameters
    ----------
    stiffness : gamma in N/m, 0 .. 1e12
    bump_clearance : free travel in compression, m, 0 .. 1000 (paper: 0.02)
    rebound_clearance : free travel in extension, m, 0 .. 1000 (paper: 0.01)
    jumping : the paper's jumping form, or the continuous one
    """

    stiffness: float = quantity("N/m", **STIFFNESS)
    bump_clearance: float = quantity("m", **LENGTH)
    rebound_clearance: float = quantity("m", **LENGTH)
    jumping: bool = field(default=True, kw_only=True)

    def lower(self) -> Law:
        """The law with a break at either end of the free zone."""
        law = laws.jump if self.jumping else laws.gap
        edges = (-self.bump_clearance, self.rebound_clearance)
        breaks = tuple(
            Break(1.0, 0.0, edge, jumps=self.jumping and edge != 0.0) for edge in sorted(set(edges))
        )
        return Law(law, (self.stiffness, *edges), breaks if self.stiffness else ())

    def about(self, travel: float) -> NonlinearElement:
        """With the clearances that are left, where its free zone is left as it is."""
        if self.jumping:
            return super().about(travel)
        stop: NonlinearElement = with_clearances(self, travel)
        return stop

    def tangent(self) -> tuple[float, float]:
        """Zero inside the free zone; its stiffness (mean of both sides) where there is none."""
        closed = (self.bump_clearance == 0.0) + (self.rebound_clearance == 0.0)
        return (self.stiffness * closed / 2, 0.0)


@dataclass(frozen=True)
class EndStop(NonlinearElement):
    """End-stop buffers with stiffness and damping in contact; they push and never pull.

    With the compression delta > 0 of the buffer touched, the push is max(0, k delta + c delta').

    Parameters
    ----------
    stiffness : k in N/m, 0 .. 1e12
    bump_clearance : free travel in compression, m, 0 .. 1000
    rebound_clearance : free travel in extension, m, 0 .. 1000
    damping : c in N s/m, 0 .. 1e9
    """

    stiffness: float = quantity("N/m", **STIFFNESS)
    bump_clearance: float = quantity("m", **LENGTH)
    rebound_clearance: float = quantity("m", **LENGTH)
    damping: float = quantity("N s/m", default=0.0, **DAMPING)

    def lower(self) -> Law:
        """The law: damping makes it jump at contact; it has a kink where the push ends."""
        k, c, b, r = self.stiffness, self.damping, self.bump_clearance, self.rebound_clearance
        breaks = [Break(1.0, 0.0, edge, jumps=c > 0.0) for edge in sorted({-b, r})]
        if c > 0.0:
            breaks += [Break(k, c, edge, jumps=False) for edge in sorted({-k * b, k * r})]
        return Law(laws.end_stop, (k, -b, r, c), tuple(breaks))

    def about(self, travel: float) -> NonlinearElement:
        """With the clearances that are left."""
        stop: NonlinearElement = with_clearances(self, travel)
        return stop

    def tangent(self) -> tuple[float, float]:
        """Zero inside the free travel; mean of both sides where there is none."""
        closed = (self.bump_clearance == 0.0) + (self.rebound_clearance == 0.0)
        return (self.stiffness * closed / 2, self.damping * closed / 2)


@dataclass(frozen=True)
class TangentPolynomialSpring(NonlinearElement):
    """Tangent plus fifth-degree polynomial stiffness, as cited in the paper's introduction.

    F = k_t (2 L/pi) tan(pi d/(2 L)) + a1 d + a2 d^2 + ... + a5 d^5. The tangent stands for stops at
    d = +-L; beyond 0.999 L it goes on along its slope, so that the law stays finite.

    Parameters
    ----------
    tangent_stiffness : k_t in N/m, 0 .. 1e12
    travel : L in m, 1e-6 .. 1000
    polynomial : a1 ... a5 in N/m, N/m2, ... (up to five numbers within +-1e24)
    """

    tangent_stiffness: float = quantity("N/m", **STIFFNESS)
    travel: float = quantity("m", minimum=1e-6, maximum=LENGTH["maximum"])
    polynomial: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check and pad the polynomial."""
        super().__post_init__()
        padded = coefficients(self.polynomial, 5, "TangentPolynomialSpring.polynomial")
        object.__setattr__(self, "polynomial", padded)

    def lower(self) -> Law:
        """The law, smooth inside the travel."""
        parameters = (self.tangent_stiffness, self.travel, *self.polynomial)
        return Law(laws.tangent_polynomial, parameters)

    def tangent(self) -> tuple[float, float]:
        """Sum k_t + a1."""
        return (self.tangent_stiffness + self.polynomial[0], 0.0)


@dataclass(frozen=True)
class PolynomialDamper(NonlinearElement):
    """Damping coefficient as fourth-degree polynomial of the displacement: F = c(d) v.

    Parameters
    ----------
    polynomial : c0 ... c4 in N s/m, N s/m2, ... (up to five numbers within +-1e24)
    """

    polynomial: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check and pad the polynomial."""
        super().__post_init__()
        padded = coefficients(self.polynomial, 5, "PolynomialDamper.polynomial")
        object.__setattr__(self, "polynomial", padded)

    def lower(self) -> Law:
        """The law, smooth."""
        return Law(laws.polynomial_damper, self.polynomial)

    def tangent(self) -> tuple[float, float]:
        """The coefficient c0."""
        return (0.0, self.polynomial[0])


@dataclass(frozen=True)
class AsymmetricDamper(NonlinearElement):
    """Damper with different branches in bump (v < 0) and rebound (v > 0).

    Parameters
    ----------
    bump : coefficient in compression, N s/m, 0 .. 1e9
    rebound : coefficient in extension, N s/m, 0 .. 1e9
    """

    bump: float = quantity("N s/m", **DAMPING)
    rebound: float = quantity("N s/m", **DAMPING)

    def lower(self) -> Law:
        """The law with its kink at v = 0."""
        kink = (Break(0.0, 1.0, 0.0, jumps=False),)
        return Law(laws.asymmetric_damper, (self.bump, self.rebound), kink)

    def tangent(self) -> tuple[float, float]:
        """Mean of both branches (the law has a kink at rest)."""
        return (0.0, (self.bump + self.rebound) / 2)


@dataclass(frozen=True)
class Preload(NonlinearElement):
    """Constant force, such as the gas preload of a damper; positive pulls the ends together.

    Displacements are measured from the equilibrium of the weight on the springs without it, so it
    shifts the mean position of a seat on a spring k by -force/k.

    Parameters
    ----------
    force : N, -1e9 .. 1e9
    """

    force: float = quantity("N", **either_sign(FORCE))

    def lower(self) -> Law:
        """The law, constant."""
        return Law(laws.constant, (self.force,))

    def tangent(self) -> tuple[float, float]:
        """Zero."""
        return (0.0, 0.0)


def with_clearances(element: Any, travel: float) -> Any:
    """A stop with its clearances measured from `travel`, inside its free travel."""
    bump, rebound = element.bump_clearance + travel, element.rebound_clearance - travel
    if bump < 0.0 or rebound < 0.0:
        raise ModelError(
            f"{element.name} has no clearance left at a travel of {travel:g} m: it is free between "
            f"-{element.bump_clearance:g} and {element.rebound_clearance:g} m."
        )
    return replace(element, bump_clearance=bump, rebound_clearance=rebound)


def coefficients(values: tuple[float, ...], count: int, label: str) -> tuple[float, ...]:
    """Return 1 to `count` finite coefficients, padded with zeros to `count`."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise ModelError(f"{label} = {values!r} must be a list of 1 to {count} numbers.")
    given = tuple(
        number(value, f"{label}[{i}]", "", **COEFFICIENT) for i, value in enumerate(values)
    )
    if not 1 <= len(given) <= count:
        raise ModelError(f"{label} has {len(given)} coefficients; it must have 1 to {count}.")
    return given + (0.0,) * (count - len(given))
