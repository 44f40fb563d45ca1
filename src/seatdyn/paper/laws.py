"""The paper's laws (4) and (5) with a constant added to the velocity.

Integrating a sin(w t) from zero gives (a/w)(1 - cos(w t)), not -(a/w) cos(w t): a base velocity
made in that way carries the constant a/w into the argument of every law of the relative velocity.
"""

from __future__ import annotations

import math
from typing import Any

from seatdyn.model.custom import force_law


@force_law({"coefficient": "N s2/m2", "offset": "m/s"}, kinks_at={"velocity": ["-offset"]})
def offset_quadratic(d: float, v: float, p: Any) -> float:
    """Formula (4) at the velocity v + offset."""
    u = v + p[1]
    return float(p[0] * abs(u) * u)


@force_law({"friction": "N", "slope": "s/m", "offset": "m/s"})
def offset_coulomb(d: float, v: float, p: Any) -> float:
    """Formula (5) at the velocity v + offset."""
    return float(2.0 / math.pi * p[0] * math.atan(p[1] * (v + p[2])))


# Rivals of the offset: other ways to make friction weaker at small velocities.


@force_law(
    {"friction": "N", "slope": "s/m", "width": "m/s"}, kinks_at={"velocity": ["width", "-width"]}
)
def dead_zone_coulomb(d: float, v: float, p: Any) -> float:
    """Formula (5) of the velocity beyond a dead zone of half this width."""
    u = v - min(max(v, -p[2]), p[2])
    return float(2.0 / math.pi * p[0] * math.atan(p[1] * u))


@force_law({"friction": "N", "width": "m/s"}, kinks_at={"velocity": ["width", "-width"]})
def saturating_coulomb(d: float, v: float, p: Any) -> float:
    """Friction that grows in proportion up to this velocity."""
    return float(p[0] * min(max(v / p[1], -1.0), 1.0))


@force_law({"friction": "N", "width": "m/s"})
def tanh_coulomb(d: float, v: float, p: Any) -> float:
    """Friction smoothed by a hyperbolic tangent over this velocity."""
    return float(p[0] * math.tanh(v / p[1]))
