"""An element behind a lever: it sees another travel than the seat, and its force comes back scaled.

With the travel D(d) of the element and the ratio r = dD/dd, the force on the seat is
r f(D, r v): the element's power f D' is the seat's power F v, so that the lever neither makes nor
loses energy. Outside its range a lever goes on with the ratio that it has at the end.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from seatdyn.errors import ModelError
from seatdyn.kernels import laws
from seatdyn.model.elements import (
    Break,
    Element,
    Law,
    LinearElement,
    NonlinearElement,
    coefficients,
)
from seatdyn.units import LENGTH, quantity

Path = Callable[[float, Any, int], tuple[float, float]]
RANGE = 0.98  # of the arm: a scissor is neither flatter than 2 % of it nor steeper than 98 %
POINTS = 101  # at which a ratio is checked


@dataclass(frozen=True)
class Levered(NonlinearElement):
    """Base of the levers: an element, and the path of the travel that it sees."""

    element: Element

    def __post_init__(self) -> None:
        """Check that there is an element with a force law behind the lever."""
        super().__post_init__()
        if not isinstance(self.element, LinearElement | NonlinearElement):
            raise ModelError(
                f"{self.name}.element = {self.element!r} is not allowed; it must be an element "
                "without states of its own, such as Spring(20000.0)."
            )
        if self.element.delay:
            raise ModelError(
                f"{self.name}.element has a delay of {self.element.delay:g} s; what is behind a "
                "lever acts at once. Give the delay to the lever."
            )

    @abstractmethod
    def _path(self) -> tuple[Path, tuple[float, ...]]:
        """Function (D, r) = g(d, p, begin of its parameters in p), and these parameters."""

    def ratio(self, d: float) -> float:
        """Ratio r at the travel d (m)."""
        path, parameters = self._path()
        return path(d, parameters, 0)[1]

    def lower(self) -> Law:
        """The law behind the lever; its breaks are carried over to the travel of the seat."""
        from seatdyn.kernels.jit import levered

        law = behind(self.element)
        path, parameters = self._path()
        function = levered(law.function, path, len(law.parameters))
        breaks = [self._moved(spot) for spot in law.breaks]
        ends = [Break(1.0, 0.0, end, jumps=False) for end in self._ends()]
        kept = tuple(spot for spot in (*breaks, *ends) if spot is not None)
        return Law(function, (*law.parameters, *parameters), kept)

    @abstractmethod
    def _ends(self) -> tuple[float, float]:
        """Travels beyond which the ratio stays as it is there, m."""

    def _moved(self, spot: Break) -> Break | None:
        """A break of the element as the seat sees it; a kink that is no line there is left out."""
        if spot.velocity == 0.0:
            return Break(1.0, 0.0, self._seat_travel(spot.value / spot.displacement), spot.jumps)
        if spot.displacement == 0.0 and spot.value == 0.0:
            return spot
        if spot.jumps:
            raise ModelError(
                f"{self.name}: {self.element.name} jumps at a speed other than zero, which a lever "
                "cannot carry over. Use it without a lever."
            )
        return None

    def _seat_travel(self, travel: float) -> float:
        """Travel d at which the element's travel is `travel`; the ratio is nowhere zero."""
        from scipy.optimize import brentq

        path, parameters = self._path()
        reach = 1e-3
        while not path(-reach, parameters, 0)[0] <= travel <= path(reach, parameters, 0)[0]:
            reach *= 2.0
        root = brentq(
            lambda d: path(d, parameters, 0)[0] - travel, -reach, reach, xtol=1e-16, rtol=1e-15
        )
        return float(root)

    def tangent(self) -> tuple[float, float]:
        """Stiffness r^2 k + r' f(0, 0) and damping r^2 c."""
        law = behind(self.element)
        if isinstance(self.element, LinearElement):
            k, c = self.element.linear
        else:
            assert isinstance(self.element, NonlinearElement)
            k, c = self.element.tangent()
        r = self.ratio(0.0)
        return (r * r * k + self._bend() * law.function(0.0, 0.0, law.parameters), r * r * c)

    @abstractmethod
    def _bend(self) -> float:
        """Slope dr/dd at d = 0, 1/m."""


@dataclass(frozen=True)
class Lever(Levered):
    """An element behind a lever whose ratio is a polynomial of the travel: r = r0 + r1 d + ...

    Parameters
    ----------
    element : without internal states; its own `between` is not used
    polynomial : r0 ... r4 in 1, 1/m, ... (up to five numbers); positive over the whole travel
    bump_travel, rebound_travel : m, 1e-6 .. 1000, beyond which the ratio stays as it is there

    Examples
    --------
    >>> import seatdyn as sd
    >>> lever = sd.Lever(sd.Spring(20000.0), (0.5, 1.0), bump_travel=0.1, rebound_travel=0.1)
    >>> lever.tangent()
    (5000.0, 0.0)
    """

    polynomial: tuple[float, ...]
    bump_travel: float = quantity("m", minimum=1e-6, maximum=LENGTH["maximum"])
    rebound_travel: float = quantity("m", minimum=1e-6, maximum=LENGTH["maximum"])

    def __post_init__(self) -> None:
        """Check and pad the polynomial, and that the ratio stays positive."""
        super().__post_init__()
        padded = coefficients(self.polynomial, 5, f"{self.name}.polynomial")
        object.__setattr__(self, "polynomial", padded)
        d = np.linspace(-self.bump_travel, self.rebound_travel, POINTS)
        values = np.polynomial.Polynomial(padded)(d)
        if not np.all(values > 0.0):
            worst = float(d[np.argmin(values)])
            raise ModelError(
                f"{self.name}.polynomial gives the ratio {values.min():g} at a travel of "
                f"{worst:g} m; it must be positive over the whole travel."
            )

    def _path(self) -> tuple[Path, tuple[float, ...]]:
        return laws.polynomial_lever, (*self._ends(), *self.polynomial)

    def _ends(self) -> tuple[float, float]:
        return (-self.bump_travel, self.rebound_travel)

    def _bend(self) -> float:
        return self.polynomial[1]


@dataclass(frozen=True)
class ScissorLever(Levered):
    """An element that lies horizontally between the feet of a scissor mechanism.

    With arms of length L (pin to pin) and the height h = h0 + d of the platform, the feet are
    w = sqrt(L^2 - h^2) apart. The element is mounted so that it extends in rebound:
    D = w(h0) - w(h), r = h/w.
    A flat scissor has a small ratio: the same spring is softer in bump.

    Parameters
    ----------
    element : without internal states; its own `between` is not used
    arm : L in m, 1e-6 .. 1000
    height : h0 at d = 0 in m, 0.02 L .. 0.98 L; beyond these the ratio stays as it is there

    Examples
    --------
    >>> import seatdyn as sd
    >>> round(sd.ScissorLever(sd.Spring(20000.0), arm=0.5, height=0.3).ratio(0.0), 9)
    0.75
    """

    arm: float = quantity("m", minimum=1e-6, maximum=LENGTH["maximum"])
    height: float = quantity("m", minimum=0.0, maximum=LENGTH["maximum"])

    def __post_init__(self) -> None:
        """Check that the arms reach the platform."""
        super().__post_init__()
        low, high = (1.0 - RANGE) * self.arm, RANGE * self.arm
        if not low < self.height < high:
            raise ModelError(
                f"{self.name}.height = {self.height:g} m is not allowed; with arms of "
                f"{self.arm:g} m it must be in {low:g} .. {high:g} m."
            )

    def _path(self) -> tuple[Path, tuple[float, ...]]:
        return laws.scissor_lever, (self.arm, self.height, *self._ends())

    def _ends(self) -> tuple[float, float]:
        return ((1.0 - RANGE) * self.arm - self.height, RANGE * self.arm - self.height)

    def _bend(self) -> float:
        return float(self.arm**2 / (self.arm**2 - self.height**2) ** 1.5)


def behind(element: Element) -> Law:
    """The force law of an element behind a lever, linear or not."""
    if isinstance(element, NonlinearElement):
        return element.lower()
    assert isinstance(element, LinearElement)
    return Law(laws.linear, element.linear)
