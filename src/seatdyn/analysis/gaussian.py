"""What a force law is, on average, to a Gaussian motion: the spring and damper nearest to it.

Of a stationary motion, displacement d (mean m) and velocity v are independent. The spring k and
damper c that leave the smallest mean square of F - (F0 + k (d - m) + c v) are

    F0 = E[F],   k = E[F (d - m)]/s_d^2 = E[dF/dd],   c = E[F v]/s_v^2 = E[dF/dv].

The first forms need no derivative, so that any law will do. The integrals are Gauss-Legendre
panels that end at every break of the law and shrink towards it and towards v = 0, where friction
is steep.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import RequestError
from seatdyn.model.elements import Break, NonlinearElement
from seatdyn.units import number

Array = NDArray[np.float64]
REACH = 9.0  # standard deviations: 2e-19 of the probability lies beyond
PANEL = 1.0  # standard deviations, of panels away from any break
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(10)
GRADES = 3.0 ** -np.arange(14)  # standard deviations, of panels towards a break


class Equivalent(NamedTuple):
    """Mean force in N, stiffness in N/m and damping in N s/m, and the r.m.s. force of the law."""

    mean: float
    stiffness: float
    damping: float
    rms: float


def equivalent(
    element: NonlinearElement,
    displacement_rms: float,
    velocity_rms: float,
    *,
    mean: float = 0.0,
) -> Equivalent:
    """Spring and damper that stand for an element under a Gaussian motion.

    Parameters
    ----------
    element : with a force law of displacement and velocity
    displacement_rms : about its mean, m, > 0
    velocity_rms : m/s, > 0
    mean : of the displacement, m

    Returns
    -------
    Equivalent
        `mean` force in N, `stiffness` in N/m, `damping` in N s/m, and `rms`, of the force of the
        law about its mean, in N.

    Examples
    --------
    >>> import math
    >>> import seatdyn as sd
    >>> damper = equivalent(sd.QuadraticDamper(100.0), 0.01, 0.1)
    >>> round(damper.damping / (math.sqrt(8 / math.pi) * 0.1 * 100.0), 9)
    1.0
    """
    from seatdyn.analysis.lowering import forces_at

    if not isinstance(element, NonlinearElement):
        raise RequestError(f"{element!r} has no force law of displacement and velocity.")
    s_d = number(displacement_rms, "displacement_rms", "m", above=0.0, error=RequestError)
    s_v = number(velocity_rms, "velocity_rms", "m/s", above=0.0, error=RequestError)
    mean = number(mean, "mean", "m", error=RequestError)
    law = element.lower()
    d, weight_d = _nodes(mean, s_d, _places(law.breaks, on_displacement=True))
    v, weight_v = _velocities(d, s_v, law.breaks)
    force = forces_at(element, np.repeat(d, v.shape[1]), v.ravel()).reshape(v.shape)
    weighted = weight_v * force
    over_v = weighted.sum(1)
    level = float(weight_d @ over_v)
    square = float(weight_d @ (weighted * force).sum(1))
    return Equivalent(
        mean=level,
        stiffness=float(weight_d @ (over_v * (d - mean))) / s_d**2,
        damping=float(weight_d @ (weighted * v).sum(1)) / s_v**2,
        rms=math.sqrt(max(square - level**2, 0.0)),
    )


def _places(breaks: tuple[Break, ...], *, on_displacement: bool) -> list[float]:
    """Breaks on the displacement alone, or on the velocity alone."""
    found = []
    for spot in breaks:
        first, second = spot.displacement, spot.velocity
        if not on_displacement:
            first, second = second, first
        if first != 0.0 and second == 0.0:
            found.append(spot.value / first)
    return found


def _edges(mean: float, sigma: float, places: list[float]) -> Array:
    """Panel edges over mean -+ 9 sigma, graded towards the places."""
    low, high = mean - REACH * sigma, mean + REACH * sigma
    plain = np.linspace(low, high, round(2 * REACH / PANEL) + 1)
    graded = [place + sigma * np.concatenate([-GRADES, [0.0], GRADES]) for place in places]
    return np.unique(np.clip(np.concatenate([plain, *graded]), low, high))


def _rule(edges: Array, mean: float, sigma: float) -> tuple[Array, Array]:
    """Nodes and weights, Gaussian density included, of panels along the last axis."""
    half = np.diff(edges)[..., None] / 2
    nodes = edges[..., :-1, None] + half * (1.0 + POINTS)
    density = np.exp(-0.5 * ((nodes - mean) / sigma) ** 2) / (sigma * math.sqrt(2 * math.pi))
    shape = (*edges.shape[:-1], -1)
    return nodes.reshape(shape), (half * WEIGHTS * density).reshape(shape)


def _nodes(mean: float, sigma: float, places: list[float]) -> tuple[Array, Array]:
    return _rule(_edges(mean, sigma, places), mean, sigma)


def _velocities(d: Array, sigma: float, breaks: tuple[Break, ...]) -> tuple[Array, Array]:
    """Nodes and weights over v for every d, (D, V): breaks may lie on a line across both."""
    places = [0.0, *_places(breaks, on_displacement=False)]
    edges = np.broadcast_to(_edges(0.0, sigma, places), (d.size, len(_edges(0.0, sigma, places))))
    across = [
        (spot.value - spot.displacement * d) / spot.velocity
        for spot in breaks
        if spot.displacement != 0.0 and spot.velocity != 0.0
    ]
    if across:
        lines = np.clip(np.array(across).T, -REACH * sigma, REACH * sigma)
        edges = np.sort(np.hstack([edges, lines]), axis=1)
    return _rule(edges, 0.0, sigma)
