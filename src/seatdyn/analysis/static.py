"""Static equilibrium of a seat under the weight of its occupant, and ride-height adjustment.

Motions are measured from rest. Where that is under another occupant, and what clearance is left to
the stops there, follows from the elements in series: the suspension bears the frame and all above
it, the cushion what is above the frame. At d = 0 an element bears its `load`, that of a preloaded
spring or of the pressure of an air spring.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

import seatdyn
from seatdyn.errors import RequestError
from seatdyn.model.body import SEAT
from seatdyn.model.elements import Element, Spring
from seatdyn.model.seat import CUSHION
from seatdyn.model.springs import AirSpring, AirSpringWithTank
from seatdyn.model.system import BASE, SeatSystem
from seatdyn.units import LENGTH, either_sign, number, suggestion

if TYPE_CHECKING:
    import xarray as xr

GRAVITY = 9.80665  # m/s2, standard gravity
SUSPENSION = (BASE, SEAT)
Adjustable = Spring | AirSpring | AirSpringWithTank
FARTHEST = 10.0  # m, of the search for an equilibrium
FIRST = 1e-4  # m, its first step
DIFFERENCE = 1e-6  # m, for the stiffness there
BALANCED = 1e-9  # of the weight


def static_equilibrium(system: SeatSystem, *, gravity: float = GRAVITY) -> xr.Dataset:
    """Where the weight of frame and occupant brings the seat, from the elements' d = 0.

    Friction is left out: with it the seat may rest anywhere near.

    Parameters
    ----------
    system : SeatSystem whose elements act across base and seat, or seat and cushion
    gravity : m/s2, 0 .. 100

    Returns
    -------
    xarray.Dataset
        Over `pair` ("seat-base", and "seat_surface-seat" with a cushion): `weight` borne in N;
        `travel` in m, negative where it sinks; `stiffness` there in N/m; `bump_clearance` and
        `rebound_clearance` in m, to the nearest stop from there, inf without one.

    Raises
    ------
    RequestError
        No equilibrium, one inside a stop, or elements that bear weight past the seat.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(20.0, [sd.Spring(9500.0, preload=800.0), sd.EndStop(6e4, 0.04, 0.04)])
    >>> rest = sd.static_equilibrium(sd.SeatSystem(sd.load_body("fairley1989"), seat))
    >>> round(float(rest.travel[0]), 5), round(float(rest.bump_clearance[0]), 5)
    (0.0103, 0.0503)
    """
    import xarray as xr

    gravity = number(gravity, "gravity", "m/s2", minimum=0.0, maximum=100.0, error=RequestError)
    rows = []
    for pair, elements in members(system).items():
        weight = weight_on(system, pair, gravity)
        travel = balance(pair, elements, weight)
        h = DIFFERENCE
        slope = (rest_force(elements, travel + h) - rest_force(elements, travel - h)) / (2 * h)
        rows.append((weight, travel, slope, *clearances(pair, elements, travel)))
    columns = np.array(rows).T
    units = {"weight": "N", "travel": "m", "stiffness": "N/m"}
    units |= {"bump_clearance": "m", "rebound_clearance": "m"}
    return xr.Dataset(
        {
            name: ("pair", values, {"units": unit})
            for (name, unit), values in zip(units.items(), columns, strict=True)
        },
        coords={"pair": [f"{pair[1]}-{pair[0]}" for pair in members(system)]},
        attrs={
            "status": "ok",
            "gravity": gravity,
            "seatdyn_version": seatdyn.__version__,
            "inputs": json.dumps({"system": repr(system)}),
        },
    )


def adjust_ride_height(
    system: SeatSystem,
    *,
    mass: float | None = None,
    travel: float = 0.0,
    element: str | None = None,
    gravity: float = GRAVITY,
) -> SeatSystem:
    """The system with its ride height adjusted to the occupant: the seat rests at `travel`.

    A spring gets another preload, an air spring another pressure, and with it another stiffness.

    Parameters
    ----------
    system : SeatSystem
    mass : sitting mass in kg that it is adjusted for, 0 .. 1e6; default that of the body
    travel : m from the elements' d = 0, within +-1000
    element : name of the spring or air spring to adjust, where the suspension has several
    gravity : m/s2, 0 .. 100

    Raises
    ------
    RequestError
        Nothing or too much that could be adjusted.
    ModelError
        A pressure out of range.

    Examples
    --------
    >>> import seatdyn as sd
    >>> air = sd.AirSpring(pressure=4e5, area=4e-3, volume=8e-4, exponent=1.3)
    >>> system = sd.SeatSystem(sd.load_body("fairley1989"), sd.Seat(20.0, [air, sd.Damper(500.0)]))
    >>> adjusted = sd.adjust_ride_height(system)
    >>> round(adjusted.seat.suspension[0].pressure)
    276864
    >>> abs(float(sd.static_equilibrium(adjusted).travel[0])) < 1e-12
    True
    """
    travel = number(travel, "travel", "m", **either_sign(LENGTH), error=RequestError)
    chosen = adjustable(system, element)
    weight = weight_on(system, SUSPENSION, gravity)
    if mass is not None:
        sitting = number(mass, "mass", "kg", minimum=0.0, maximum=1e6, error=RequestError)
        weight += gravity * (sitting - system.body.total_mass)
    rest = [one for one in members(system)[SUSPENSION] if one is not chosen]
    needed = weight + rest_force(rest, travel)  # push that is left for the chosen one
    if isinstance(chosen, Spring):
        new: Element = replace(chosen, preload=needed + chosen.stiffness * travel)
    else:
        there = chosen.about(travel)
        pressure = chosen.ambient + needed / there.area
        new = replace(chosen, pressure=chosen.pressure * pressure / there.pressure)
    suspension = tuple(new if one is chosen else one for one in system.seat.suspension)
    return replace(system, seat=replace(system.seat, suspension=suspension))


def settled(system: SeatSystem, *, gravity: float = GRAVITY) -> SeatSystem:
    """The system with all travels measured from its static equilibrium: what moves about rest.

    Clearances of stops are what is left of them there, air springs have the pressure and volume
    that they have there, and other laws are shifted. Ask `static_equilibrium` of the system as it
    is built, not of this one.

    Parameters
    ----------
    system, gravity : as in `static_equilibrium`, and with its errors

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(20.0, [sd.Spring(9500.0, preload=800.0), sd.EndStop(6e4, 0.04, 0.04)])
    >>> rested = sd.settled(sd.SeatSystem(sd.load_body("fairley1989"), seat))
    >>> round(rested.seat.suspension[1].bump_clearance, 5)
    0.0503
    """
    rest = static_equilibrium(system, gravity=gravity)
    down = dict(zip(members(system), rest.travel.values.tolist(), strict=True))

    def moved(elements: Iterable[Element]) -> tuple[Element, ...]:
        return tuple(
            one.about(down[one.between] if one.between in down else -down[one.between[::-1]])
            for one in elements
        )

    seat = replace(
        system.seat, suspension=moved(system.seat.suspension), cushion=moved(system.seat.cushion)
    )
    return replace(system, seat=seat, elements=moved(system.elements))


def members(system: SeatSystem) -> dict[tuple[str, str], list[Element]]:
    """Elements of the suspension and, if there is one, of the cushion."""
    pairs = [SUSPENSION, *([CUSHION] if system.seat.cushion else [])]
    found: dict[tuple[str, str], list[Element]] = {pair: [] for pair in pairs}
    for element in (*system.seat.suspension, *system.seat.cushion, *system.elements):
        if element.between in found:
            found[element.between].append(element)
        elif element.between[::-1] in found:
            raise RequestError(
                f"{element.name} acts across {element.between}; name its nodes from below upwards, "
                f"{element.between[::-1]}, for a static equilibrium."
            )
        else:
            raise RequestError(
                f"{element.name} acts across {element.between}, beside the suspension: what it "
                "bears of the weight depends on how far the body itself sinks. Take it out."
            )
    return found


def weight_on(system: SeatSystem, pair: tuple[str, str], gravity: float) -> float:
    """Weight in N that the suspension or the cushion bears."""
    above = system.body.total_mass + system.seat.cushion_mass
    return gravity * (above if pair == CUSHION else above + system.seat.mass)


def rest_force(elements: Iterable[Element], d: float) -> float:
    """Force in N, positive in tension, of elements at rest at d, loads included."""
    return sum(one.rest_force(d) - one.load for one in elements)


def balance(pair: tuple[str, str], elements: list[Element], weight: float) -> float:
    """Travel in m at which the elements bear the weight; the nearest to zero on its side."""
    from scipy.optimize import brentq

    def unbalanced(d: float) -> float:
        return rest_force(elements, d) + weight

    start = unbalanced(0.0)
    if abs(start) <= BALANCED * weight:
        return 0.0
    down = -np.sign(start)  # the seat sinks where the weight exceeds the push
    near, far = 0.0, down * FIRST
    while np.sign(unbalanced(far)) == np.sign(start):
        near, far = far, 1.5 * far
        if abs(far) > FARTHEST:
            raise RequestError(
                f"No static equilibrium within {FARTHEST:g} m: the elements between {pair[0]!r} "
                f"and {pair[1]!r} do not bear {weight:.4g} N. Give them a spring, or a preload."
            )
    travel = float(brentq(unbalanced, near, far, xtol=1e-15, rtol=1e-14))
    for one in elements:
        bump = getattr(one, "bump_clearance", np.inf)
        rebound = getattr(one, "rebound_clearance", np.inf)
        if not -bump <= travel <= rebound:
            side, clearance = ("bump", bump) if travel < 0 else ("rebound", rebound)
            raise RequestError(
                f"The static equilibrium lies in the {side} stop of {one.name}: travel "
                f"{1e3 * travel:.4g} mm, clearance {1e3 * clearance:.4g} mm. Adjust the ride "
                "height (adjust_ride_height), or change spring or preload."
            )
    return travel


def clearances(
    pair: tuple[str, str], elements: Iterable[Element], travel: float
) -> tuple[float, float]:
    """Free travel in m from `travel` to the nearest stop in bump and in rebound."""
    bump = [getattr(one, "bump_clearance", np.inf) + travel for one in elements]
    rebound = [getattr(one, "rebound_clearance", np.inf) - travel for one in elements]
    return min(bump, default=np.inf), min(rebound, default=np.inf)


def adjustable(system: SeatSystem, name: str | None) -> Adjustable:
    """The spring or air spring of the suspension to adjust: the one there is, or the one named."""
    can = [one for one in system.seat.suspension if isinstance(one, Adjustable)]
    air = [one for one in can if not isinstance(one, Spring)]
    if name is not None:
        named = [one for one in can if one.name == name]
        if len(named) != 1:
            raise RequestError(
                f"element = {name!r} names {len(named)} springs of the suspension; it must name "
                "one. " + suggestion(name, [one.name for one in can])
            )
        return named[0]
    choice = air or can
    if len(choice) != 1:
        names = ", ".join(one.name for one in choice) or "none"
        raise RequestError(
            f"The ride height is adjusted by one spring or air spring, and the suspension has: "
            f"{names}. Name one with element=..., by its label."
        )
    return choice[0]
