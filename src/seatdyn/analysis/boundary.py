"""Where stability ends: boundaries in closed form, and all critical values of one parameter.

The suspension as a whole enters by one rank-one term: with S(s) the dynamic stiffness of seat and
body seen by it, a pole lies at s where k + s c = -S(s). At s = i w the two parts of this equation
give stiffness and damping at once. This is Neimark's D-decomposition (Gryazina and Polyak,
Automatica 42 (2006) 13), with no root to find. For one parameter see `crossings`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.analysis.characteristic import (
    GAIN_LIMITS,
    LIMITS,
    parameter,
    parameter_values,
    substituted,
)
from seatdyn.analysis.crossings import crossings
from seatdyn.analysis.delay_loop import loop_crossings, loop_of
from seatdyn.analysis.linear import (
    Array,
    ComplexArray,
    Linearisable,
    Linearise,
    Variable,
    as_linear_model,
    companion,
    dynamic_stiffness,
    labelled,
    on_left,
)
from seatdyn.analysis.response import checked_frequencies
from seatdyn.errors import RequestError
from seatdyn.model.body import SEAT
from seatdyn.model.system import LinearModel
from seatdyn.units import number

if TYPE_CHECKING:
    import xarray as xr

SUSPENSION = ("seat_mass", "damping", "stiffness")
JUST = 1e-7  # relative step off a delay with a pole on the axis, to either side


def critical_values(
    system: Linearisable,
    *,
    vary: str,
    low: float,
    high: float,
    linearise: Linearise = None,
) -> xr.Dataset:
    """All values of one parameter at which a pole crosses the imaginary axis.

    Parameters
    ----------
    system, linearise : as in `poles`
    vary : "seat_mass", "damping", "stiffness" or the name of a feedback gain
    low, high : open range searched, in the unit of the parameter, low < high; 0 .. 1e6 kg, 0 .. 1e9
        N s/m, 0 .. 1e12 N/m, a gain within +-1e12

    Returns
    -------
    xarray.Dataset
        Over `crossing`, sorted: `value`; `frequency` in Hz of the crossing poles (0: a real pole);
        `unstable_below`, `unstable_above`, numbers of poles not in the left half plane on either
        side; `stable_below`, `stable_above`; `verdict_changes`, true where these differ: the
        critical values. Attributes `vary`, `stable_at_low`, `stable_at_high`.

    Raises
    ------
    RequestError
        Unknown parameter (with a suggestion), a range that is reversed, not finite or not
        admissible, or values that cannot be told from rounding.

    Notes
    -----
    The frequencies where theta(i w) is real are those with theta(s) = theta(-s): an eigenvalue
    problem, so that none can slip through a grid. Each is then polished by Newton's method in
    (w, theta) on the matrices at theta itself, where nothing cancels. The verdicts are counts of
    eigenvalues inside each interval, and are held against the values found: none is missing
    silently.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> sd.critical_values(system, vary="damping", low=0, high=1000).value.values.round(4).tolist()
    [27.4466]
    """
    model = as_linear_model(system, linearise)
    term = parameter(model, vary)
    unit = term.unit
    limits = LIMITS.get(vary, GAIN_LIMITS)
    limits = limits | {"minimum": min(limits["minimum"], 0.0)}  # the range is open
    bottom = number(low, f"{vary} (low)", unit, **limits, error=RequestError)
    top = number(high, f"{vary} (high)", unit, **limits, error=RequestError)
    if not bottom < top:
        raise RequestError(
            f"The range of {vary} from {bottom:g} to {top:g} {unit} is empty; "
            "low must be less than high. Exchange the ends."
        )
    values, rates, unstable = crossings(substituted(model, {}), term, bottom, top)
    stable = unstable == 0
    dims = ("crossing",)
    return labelled(
        {
            "value": (dims, values, unit, vary),
            "frequency": (dims, rates / (2 * np.pi), "Hz", "frequency of the crossing pole"),
            "unstable_below": (dims, unstable[:-1], "1", "unstable poles below the value"),
            "unstable_above": (dims, unstable[1:], "1", "unstable poles above the value"),
            "stable_below": (dims, stable[:-1], "1", "stable below the value"),
            "stable_above": (dims, stable[1:], "1", "stable above the value"),
            "verdict_changes": (dims, stable[:-1] != stable[1:], "1", "critical value"),
        },
        {"crossing": np.arange(1, values.size + 1)},
        model,
        {"function": "critical_values", "vary": vary, "low": bottom, "high": top},
        vary=vary,
        stable_at_low=int(stable[0]),
        stable_at_high=int(stable[-1]),
    )


def stability_boundary(
    system: Linearisable,
    *,
    frequency: ArrayLike | None = None,
    seat_mass: ArrayLike | None = None,
    stiffness: ArrayLike | None = None,
    linearise: Linearise = None,
) -> xr.Dataset:
    """Curves in (seat mass, damping, stiffness) on which a pole lies on the imaginary axis.

    Three forms, by what is given:

    * `frequency` and `seat_mass` (default: that of the system): `stiffness` and `damping` over
      (seat_mass, frequency), closed form;
    * `frequency` and `stiffness`: `seat_mass` and `damping` over (stiffness, frequency), closed
      form: the curves of a map of damping over seat mass;
    * `seat_mass` and `stiffness`: all dampings >= 0 with a pole on the axis, over (stiffness,
      seat_mass, branch), filled up with NaN, with their `frequency` in Hz. Not with delays.

    Parameters
    ----------
    system, linearise : as in `poles`; must have a seat on a suspension
    frequency : of the pole on the axis, Hz, > 0
    seat_mass : kg, > 0
    stiffness : N/m, >= 0

    Returns
    -------
    xarray.Dataset
        The above, with `stable_edge`: the values are admissible and all other poles stable, so
        that the curve is the edge of the stable region there. Attribute `static_stiffness` in
        N/m: below it a real pole is unstable, whatever the damping and seat mass.

    Raises
    ------
    RequestError
        A body alone, a frequency or value out of range, or all three given.

    Notes
    -----
    With S_0(s) the dynamic stiffness at the seat of all but seat mass and suspension,
    damping = -Im S_0(i w)/w, which neither seat mass nor stiffness changes, and
    stiffness = w^2 m_0 - Re S_0(i w). With a delay tau of the suspension, both from
    (stiffness + i w damping) exp(-i w tau) = w^2 m_0 - S_0(i w), two real linear equations.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_on"), seat)
    >>> edge = sd.stability_boundary(system, seat_mass=[25.0, 35.0], stiffness=[9950.0])
    >>> edge.damping.values[0, :, 0].round(2).tolist()  # at 35 kg no damper makes it unstable
    [2287.82, nan]
    """
    model = as_linear_model(system, linearise, delays=True)
    if not set(SUSPENSION) <= set(model.parameters):
        raise RequestError(
            "stability_boundary needs a seat on a suspension, whose dampers share one delay and "
            "whose springs share one; put the body on a Seat in a SeatSystem. For a body alone "
            "use critical_values with one of its gains."
        )
    request = {"function": "stability_boundary", "linearise": linearise}
    static = 0.0 - float(_body_stiffness(model, np.zeros(1, dtype=complex))[0].real)
    if frequency is None or (seat_mass is not None and stiffness is not None):
        if frequency is not None or seat_mass is None or stiffness is None:
            raise RequestError(
                "stability_boundary takes two of frequency, seat_mass and stiffness "
                "(or frequency alone)."
            )
        model.refuse_delays()
        masses = parameter_values(model, "seat_mass", seat_mass)
        springs = parameter_values(model, "stiffness", stiffness)
        variables = _branches(model, masses, springs)
        coords = {"stiffness": springs, "seat_mass": masses}
    else:
        f = checked_frequencies(frequency)
        given = "seat_mass" if stiffness is None else "stiffness"
        chosen = stiffness if stiffness is not None else seat_mass
        values = parameter_values(
            model, given, model.parameters[given].value if chosen is None else chosen
        )
        variables = _curves(model, given, values, 2 * np.pi * f)
        coords = {given: values, "frequency": f}
    units = {"seat_mass": "kg", "stiffness": "N/m", "frequency": "Hz"}
    labels = {name: ((name,), axis, {"units": units[name]}) for name, axis in coords.items()}
    return labelled(variables, labels, model, request, static_stiffness=static)


def _curves(model: LinearModel, given: str, values: Array, rate: Array) -> dict[str, Variable]:
    """Damping and the parameter that is not given, over (given, frequency)."""
    other = "stiffness" if given == "seat_mass" else "seat_mass"
    dims = (given, "frequency")
    entry = {name: _entry(model, name, 1j * rate) for name in SUSPENSION}
    # two real equations: damping entry_d + other entry_o = rest
    rest = -_body_stiffness(model, 1j * rate) - values[:, None] * entry[given]
    across = np.conj(entry[other])
    damping = np.imag(across * rest) / np.imag(across * entry["damping"])
    wanted = np.imag(np.conj(entry["damping"]) * rest) / np.imag(
        np.conj(entry["damping"]) * entry[other]
    )
    point = {given: np.broadcast_to(values[:, None], wanted.shape), other: wanted}
    point["damping"] = damping
    edge = _others_stable(model, point, np.broadcast_to(rate, wanted.shape))
    unit = model.parameters[other].unit
    return {
        other: (dims, wanted, unit, f"{other} on the boundary"),
        "damping": (dims, damping, "N s/m", "damping on the boundary"),
        "stable_edge": (dims, edge, "1", "all other poles stable"),
    }


def _branches(model: LinearModel, masses: Array, springs: Array) -> dict[str, Variable]:
    """All critical dampings over (stiffness, seat_mass, branch)."""
    found: list[tuple[Array, Array, NDArray[np.bool_]]] = []
    for k in springs:
        for m in masses:
            matrices = substituted(model, {"stiffness": k, "seat_mass": m})
            damping_term = model.parameters["damping"]
            values, rates, unstable = crossings(matrices, damping_term, 0.0, np.inf)
            found.append((values, rates, (unstable[:-1] == 0) != (unstable[1:] == 0)))
    most = max(values.size for values, _, _ in found)
    shape = (springs.size, masses.size, most)
    damping, rate = np.full(shape, np.nan), np.full(shape, np.nan)
    edge = np.zeros(shape, dtype=bool)
    for i, (values, rates, changes) in enumerate(found):
        row, column = divmod(i, masses.size)
        place = (row, column, slice(0, values.size))
        damping[place], rate[place], edge[place] = values, rates, changes
    dims = ("stiffness", "seat_mass", "branch")
    return {
        "damping": (dims, damping, "N s/m", "damping on the boundary"),
        "frequency": (dims, rate / (2 * np.pi), "Hz", "frequency of the pole on the axis"),
        "stable_edge": (dims, edge, "1", "stable on one side only"),
    }


def _body_stiffness(model: LinearModel, s: ComplexArray) -> ComplexArray:
    """S_0(s) in N/m, (F,): the body condensed on the seat, without seat mass and suspension."""
    dynamic = dynamic_stiffness(model, s)
    for name in SUSPENSION:
        term = model.parameters[name]
        weight = term.value * _entry(model, name, s)
        dynamic = dynamic - weight[:, None, None] * np.outer(term.left, term.right)
    seat = model.index(SEAT)
    body = [i for i in range(model.size) if i != seat]
    inner = dynamic[:, body][:, :, body]
    moved = np.linalg.solve(inner, dynamic[:, body, seat][..., None])[..., 0]
    return np.asarray(dynamic[:, seat, seat] - np.sum(dynamic[:, seat, body] * moved, axis=1))


def _entry(model: LinearModel, name: str, s: ComplexArray) -> ComplexArray:
    """What multiplies a parameter in the dynamic stiffness, (F,)."""
    term = model.parameters[name]
    return np.asarray(s**term.order * np.exp(-s * term.delay))


def _others_stable(model: LinearModel, point: dict[str, Array], rate: Array) -> NDArray[np.bool_]:
    """Whether all poles but the pair at +-i rate are stable, where the point is admissible."""
    good = (point["seat_mass"] > 0.0) & (point["damping"] >= 0.0) & (point["stiffness"] >= 0.0)
    values = {name: value[good] for name, value in point.items()}
    if model.delayed:
        loop = loop_crossings(loop_of(model, values))
        either_side = model.delayed[0].delay * np.array([1.0 - JUST, 1.0 + JUST])
        edge = np.zeros(good.shape, dtype=bool)
        edge[good] = loop.count(either_side).min(axis=1) == 0
        return edge
    poles = np.linalg.eigvals(companion(*substituted(model, values)))
    if values["damping"].size == 0:
        return good
    # +i rate and -i rate are as far from |imag| = rate on the axis; the others keep their distance
    distance = np.abs(np.abs(poles.imag) - rate[good][:, None]) + np.abs(poles.real)
    others = np.take_along_axis(poles.real, np.argsort(distance, axis=1)[:, 2:], axis=1)
    edge = np.zeros(good.shape, dtype=bool)
    edge[good] = np.all(on_left(others, np.abs(poles).max(axis=1, keepdims=True)), axis=1)
    return edge
