"""Frequency responses to a motion of the driven node, and where a body feeds power into its seat.

With s = i 2 pi f and the driven node appended to the free ones, the dynamic stiffness is
Z(s) = K + s C + s^2 M (its driven row and column included); z/u = -Z_ff^-1 Z_fd, and the force
that must be applied at the driven node is F/u = Z_dd + Z_df z/u.

At low frequency z is nearly u, and these differences of large numbers lose all digits. So the
motion d = z - u is solved for, which only inertia and the active forces (and no passive spring)
excite: Z_ff d = -(s^2 M + Z_active) [1 ... 1] u. And since all forces but F are internal, active
ones too, F is the rate of change of momentum: the apparent mass is the sum of m_i z_i/u.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from seatdyn.analysis.linear import (
    Array,
    ComplexArray,
    Linearisable,
    Linearise,
    Variable,
    as_linear_model,
    dynamic_stiffness,
    labelled,
    quadratic_eigenvalues,
)
from seatdyn.errors import RequestError
from seatdyn.model.body import SEAT, SeatedBody, warn_above_band
from seatdyn.model.elements import LinearElement, NonlinearElement
from seatdyn.model.system import LinearModel, SeatSystem, linear_model
from seatdyn.units import number

if TYPE_CHECKING:
    import xarray as xr

ForceRow = tuple[str, Array, Array, float]  # name, N per m, per m/s of nodes (drive last), delay


def frequency_response(
    system: Linearisable, *, frequency: ArrayLike, linearise: Linearise = None
) -> xr.Dataset:
    """Complex responses to a harmonic motion of the driven node.

    Parameters
    ----------
    system, linearise : as in `poles`
    frequency : Hz, finite, > 0, in any order

    Returns
    -------
    xarray.Dataset
        Over `frequency` in Hz, with the driven node's displacement u and acceleration a:

        * `transmissibility` (node): z/u;
        * `relative_displacement` (pair "m1-seat": motion of m1 less that of seat): m per m of u;
        * `element_force` (element): N per m/s2 of a; links and suspension elements are positive
          in tension, feedback forces positive on their `on` node. Not for a LinearModel, which
          does not know its elements;
        * `apparent_mass` = F/a in kg and `impedance` = F/u' in N s/m, F being the force that
          drives the driven node, mass on it included;
        * `body_apparent_mass` in kg, for a SeatSystem: force of the seat on the body over the
          acceleration of the seat.

    Raises
    ------
    RequestError
        A frequency that is not finite or not > 0, or at which an undamped system resonates.

    Examples
    --------
    >>> import seatdyn as sd
    >>> r = sd.frequency_response(sd.load_body("ksiazek1997_back_on"), frequency=[1e-3])
    >>> round(abs(r.apparent_mass.item()), 3)  # not the sum of the masses: the body is active
    61.663
    """
    model = as_linear_model(system, linearise, delays=True, memory=True)
    f = checked_frequencies(frequency)
    if not isinstance(system, LinearModel):
        person = system.body if isinstance(system, SeatSystem) else system
        warn_above_band(person, float(f.min()), stacklevel=2)
    s: ComplexArray = np.asarray(2j * np.pi * f, dtype=complex)
    motion = _relative_motion(model, s, f)
    apparent_mass = _apparent_mass(model, motion) + _drive_mass(system)
    nodes = (model.drive, *model.nodes)
    order = [model.size, *range(model.size)]
    pairs = [(i, j) for i in range(len(nodes)) for j in range(i + 1, len(nodes))]
    relative = np.array([motion[order[j]] - motion[order[i]] for i, j in pairs])
    along = ("frequency",)
    variables: dict[str, Variable] = {
        "transmissibility": (("node", *along), motion[:-1] + 1.0, "1", "transmissibility"),
        "relative_displacement": (
            ("pair", *along),
            relative.reshape(len(pairs), f.size),
            "m/m",
            "relative displacement",
        ),
        "apparent_mass": (along, apparent_mass, "kg", "apparent mass at the driven node"),
        "impedance": (along, s * apparent_mass, "N s/m", "driving-point impedance"),
    }
    coords: dict[str, Any] = {
        "frequency": (along, f, {"units": "Hz", "long_name": "frequency"}),
        "node": list(model.nodes),
        "pair": [f"{nodes[j]}-{nodes[i]}" for i, j in pairs],
    }
    if not isinstance(system, LinearModel):
        rows = _force_rows(system, model, linearise)
        # springs and dampers do not feel the common motion, feedback forces may
        forces = [
            np.exp(-s * delay) * (k @ motion + s * (c @ motion) + k.sum() + s * c.sum()) / s**2
            for _, k, c, delay in rows
        ]
        forces += [one.stiffness(s) * (one.across @ motion) / s**2 for one in model.relaxing]
        names = [name for name, *_ in rows] + [one.name for one in model.relaxing]
        table = np.array(forces, dtype=complex).reshape(len(names), f.size)
        variables["element_force"] = (("element", *along), table, "N s2/m", "element force")
        coords["element"] = _unique(names)
    if isinstance(system, SeatSystem):
        body = linear_model(system.body)
        seat = model.index(system.contact)
        of_body = motion[[*(model.index(node) for node in body.nodes), seat]]
        on_seat = 1.0 + motion[seat]
        force = _force_on_body(body, s, of_body - motion[seat], of_body + 1.0)
        value = force / (s**2 * on_seat) + _drive_mass(system.body)
        variables["body_apparent_mass"] = (along, value, "kg", "apparent mass of the body")
    request = {"function": "frequency_response", "points": f.size, "linearise": linearise}
    return labelled(variables, coords, model, request, drive=model.drive)


def active_bands(
    system: Linearisable, *, frequency_max: float = 50.0, linearise: Linearise = None
) -> xr.Dataset:
    """Bands where the driven structure feeds power back: Re(driving-point impedance) < 0.

    For the body ask it of the body alone (``active_bands(system.body)``). A passive body has none.

    Parameters
    ----------
    system, linearise : as in `poles`
    frequency_max : upper end of the search, Hz, > 0

    Returns
    -------
    xarray.Dataset
        Over `band`: `low`, `high` in Hz, and `cut_off`, true where the band goes on beyond
        `frequency_max`, which is then its `high`.

    Raises
    ------
    RequestError
        `frequency_max` not finite or not > 0.

    Notes
    -----
    With the driving-point dynamic stiffness D(s), Re Z(i w) = Im D(i w)/w changes sign only where
    D(s) - D(-s) = 0 on the imaginary axis. That is an eigenvalue problem (the Hamiltonian test of
    passivity: Grivet-Talocia, IEEE Trans. Circuits Syst. I 51 (2004) 1755), so no band can fall
    between the points of a grid. Its imaginary parts bracket the crossings for root finding.

    Examples
    --------
    >>> import seatdyn as sd
    >>> sd.active_bands(sd.load_body("ksiazek1997_back_off")).high.values.round(2).tolist()
    [4.54]
    """
    from scipy.optimize import brentq

    top = number(frequency_max, "frequency_max", "Hz", above=0.0, error=RequestError)
    model = as_linear_model(system, linearise)

    def resistance(f: float) -> float:
        s = np.array([2j * np.pi * f])
        z = s * _apparent_mass(model, _relative_motion(model, s, np.array([f])))
        return float(z.real[0]) if abs(z.real[0]) > 1e-13 * abs(z[0]) else 0.0

    edges = np.abs(_sign_change_candidates(model).imag) / (2 * np.pi)
    edges = np.unique(np.concatenate([[0.0, top], edges[edges < top]]))
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-9 * top])]
    middles = (edges[:-1] + edges[1:]) / 2
    negative = np.array([resistance(f) < 0.0 for f in middles])
    bands: list[list[float]] = []
    for i in np.flatnonzero(negative):
        if i == 0 or not negative[i - 1]:
            low = 0.0 if i == 0 else brentq(resistance, middles[i - 1], middles[i], xtol=1e-300)
            bands.append([low, top])
        if i + 1 < len(middles) and not negative[i + 1]:
            bands[-1][1] = brentq(resistance, middles[i], middles[i + 1], xtol=1e-300)
    low_high = np.array(bands).reshape(-1, 2)
    dims = ("band",)
    return labelled(
        {
            "low": (dims, low_high[:, 0], "Hz", "lower end"),
            "high": (dims, low_high[:, 1], "Hz", "upper end"),
            "cut_off": (dims, low_high[:, 1] == top, "1", "goes on beyond frequency_max"),
        },
        {"band": np.arange(1, len(bands) + 1)},
        model,
        {"function": "active_bands", "frequency_max": top, "linearise": linearise},
        drive=model.drive,
    )


def checked_frequencies(frequency: ArrayLike) -> Array:
    """Return frequencies as an array, or refuse them: Hz, finite, > 0."""
    try:
        f = np.atleast_1d(np.asarray(frequency, dtype=float))
    except (TypeError, ValueError):
        raise RequestError("frequency must be an array of numbers in Hz.") from None
    if f.ndim != 1 or f.size == 0:
        raise RequestError(
            f"frequency has the shape {f.shape}; it must be a list of numbers in Hz."
        )
    wrong = ~(np.isfinite(f) & (f > 0.0))
    if np.any(wrong):
        i = int(np.argmax(wrong))
        raise RequestError(
            f"frequency[{i}] = {f[i]:g} Hz is not allowed; it must be a finite number > 0 Hz. "
            "For the static limit ask for a low frequency, e.g. 0.001 Hz."
        )
    return f


def _relative_motion(model: LinearModel, s: ComplexArray, frequency: Array) -> ComplexArray:
    """Motions relative to the driven node per unit motion of it, itself (0) last, (N+1, F)."""
    dynamic = dynamic_stiffness(model, s)
    z = s[:, None]
    k = model.active_stiffness.sum(axis=1)[:-1]
    c = model.active_damping.sum(axis=1)[:-1]
    force = -(k + z * c + z**2 * model.mass.sum(axis=1))
    for group in model.delayed:
        if group.active:
            k, c = group.stiffness.sum(axis=1)[:-1], group.damping.sum(axis=1)[:-1]
            force = force - np.exp(-z * group.delay) * (k + z * c)
    try:
        free = np.linalg.solve(dynamic, force[..., None])[..., 0]
    except np.linalg.LinAlgError:
        singular = int(np.argmin(np.abs(np.linalg.det(dynamic))))
        raise RequestError(
            f"frequency[{singular}] = {frequency[singular]:g} Hz is an undamped natural frequency: "
            "the response is infinite there. Leave it out or add damping."
        ) from None
    return np.vstack([free.T, np.zeros(s.size)])


def _apparent_mass(model: LinearModel, relative: ComplexArray) -> ComplexArray:
    """Apparent mass in kg of all free nodes at the driven one, for motions (N+1, F)."""
    return np.asarray(model.mass.sum(axis=0) @ (1.0 + relative[:-1]))


def _force_on_body(
    body: LinearModel, s: ComplexArray, relative: ComplexArray, absolute: ComplexArray
) -> ComplexArray:
    """Force in N of the seat, last in the motions (N+1, F), on links and active forces of a body.

    Momentum would not do: elements may tie the body to the base past the seat.
    """
    passive = body.passive_stiffness[-1] @ relative + s * (body.passive_damping[-1] @ relative)
    active = body.active_stiffness[-1] @ absolute + s * (body.active_damping[-1] @ absolute)
    for group in body.delayed:
        late = group.stiffness[-1] @ absolute + s * (group.damping[-1] @ absolute)
        active = active + np.exp(-s * group.delay) * late
    return np.asarray(passive + active)


def _drive_mass(system: Linearisable) -> float:
    """Mass that moves rigidly with the driven node; the base of a system has none."""
    return system.masses.get(SEAT, 0.0) if isinstance(system, SeatedBody) else 0.0


def _force_rows(
    system: SeatSystem | SeatedBody, model: LinearModel, linearise: Linearise
) -> list[ForceRow]:
    """Force of every link, feedback and linear (or linearised) element as rows over the nodes."""
    place = {node: i for i, node in enumerate((*model.nodes, model.drive))}

    def row(weights: dict[str, float]) -> Array:
        out = np.zeros(len(place))
        for node, weight in weights.items():
            out[place[node]] += weight
        return out

    body = system.body if isinstance(system, SeatSystem) else system
    elements = system.all_elements if isinstance(system, SeatSystem) else ()
    if isinstance(system, SeatSystem):
        place[SEAT], seat = place[system.contact], place[SEAT]  # what the body sits on
    rows: list[ForceRow] = []
    for link in body.links:
        pull = row({link.between[0]: -1.0, link.between[1]: 1.0})
        name = f"{link.between[0]}-{link.between[1]} link"
        rows.append((name, link.stiffness * pull, link.damping * pull, 0.0))
    for force in body.feedback:
        k, c = np.zeros(len(place)), np.zeros(len(place))
        for term in force.terms:
            target = k if term.of == "displacement" else c
            target -= term.gain * row(dict(term.weights))
        rows.append((f"{force.on}-{force.reaction} feedback", k, c, force.delay))
    if isinstance(system, SeatSystem):
        place[SEAT] = seat
    for element in elements:
        if isinstance(element, LinearElement):
            stiffness, damping = element.linear
        elif linearise == "tangent" and isinstance(element, NonlinearElement):
            stiffness, damping = element.tangent()
        else:
            continue
        pull = row({element.between[0]: -1.0, element.between[1]: 1.0})
        rows.append((element.name, stiffness * pull, damping * pull, element.delay))
    return rows


def _unique(names: list[str]) -> list[str]:
    """Number repeated names: Spring, Spring 2, ..."""
    return [
        name if names.index(name) == i else f"{name} {names[: i + 1].count(name)}"
        for i, name in enumerate(names)
    ]


def _sign_change_candidates(model: LinearModel) -> ComplexArray:
    """Eigenvalues s with D(s) = D(-s), for the motions [z(s), z(-s), u]."""
    n = model.size
    k = model.passive_stiffness + model.active_stiffness
    c = model.passive_damping + model.active_damping

    def both_ways(extended: Array, mirror: float) -> Array:
        e = np.zeros((2 * n + 1, 2 * n + 1))
        e[:n, :n], e[n:-1, n:-1] = extended[:n, :n], mirror * extended[:n, :n]
        e[:n, -1], e[n:-1, -1] = extended[:n, n], mirror * extended[:n, n]
        e[-1, :n], e[-1, n:-1] = extended[n, :n], -mirror * extended[n, :n]
        e[-1, -1] = (1.0 - mirror) * extended[n, n]
        return e

    mass = np.zeros((n + 1, n + 1))
    mass[:n, :n] = model.mass
    return quadratic_eigenvalues(both_ways(mass, 1.0), both_ways(c, -1.0), both_ways(k, 1.0))
