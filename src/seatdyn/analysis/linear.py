"""Poles, mode shapes and state space of the linear part, and what every linear analysis shares.

    M z'' + C z' + K z = p u + q u'

with z the absolute displacements of the free nodes and u that of the driven node: the base under a
seat, the seat under a body alone. Forces that act late add exp(-s tau) (K_tau + s C_tau) to the
characteristic matrix, see `delay`. The matrices are not symmetric where the body is active, so
nothing here may lean on symmetry.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import ModelError, RequestError
from seatdyn.model.body import SeatedBody
from seatdyn.model.system import LinearModel, SeatSystem, linear_model

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.floating[Any]]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
Linearise = Literal["tangent"] | None
Linearisable = SeatSystem | SeatedBody | LinearModel
Variable = tuple[tuple[str, ...], Any, str, str]  # dimensions, values, unit, text

# Real parts below this fraction of the largest pole are rounding, so that an undamped system is
# never called stable by accident.
ON_AXIS = 1e-13
LARGEST = 1e100  # of stiffness or damping over mass: squares and determinants stay finite
NEAR_ZERO = 1e-9  # of the largest pole, as far as one at zero may stray by rounding
SLOW = 1e-4  # a pole this much slower than the fastest is lost in its rounding first


class StateSpace(NamedTuple):
    """x' = A x + B [u, u'], y = C x + D [u, u'] with names; see `state_space`."""

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def as_linear_model(
    system: Linearisable,
    linearise: Linearise = None,
    *,
    delays: bool = False,
    memory: bool = False,
) -> LinearModel:
    """Return the matrices of a system or body; matrices given as such are passed on.

    `delays` says that the caller takes delayed forces into account, `memory` the same for elements
    with states of their own.

    Raises
    ------
    RequestError
        `system` is something else, `linearise` is asked of matrices, or forces are delayed or
        elements have states that the caller has no place for.
    ModelError
        A free node has no mass: the order of the system would depend on it.
    """
    if isinstance(system, LinearModel):
        if linearise is not None:
            raise RequestError(
                f"linearise = {linearise!r} cannot be applied to matrices; give the SeatSystem."
            )
        model = system
    elif isinstance(system, SeatSystem | SeatedBody):
        model = linear_model(system, linearise)
    else:
        raise RequestError(
            f"system = {system!r} is not allowed; it must be a SeatSystem, a SeatedBody or a "
            "LinearModel. Build one with SeatSystem(load_body(...), Seat(...))."
        )
    empty = [node for node, m in zip(model.nodes, np.diag(model.mass), strict=True) if not m > 0.0]
    if empty:
        raise ModelError(
            f"The free nodes {empty} have no mass; give each a mass > 0 kg, or merge it with its "
            "neighbour."
        )
    if not delays:
        model.refuse_delays()
    if not memory:
        model.refuse_relaxing()
    return model


def dynamic_stiffness(model: LinearModel, s: ComplexArray) -> ComplexArray:
    """Characteristic matrix M s^2 + C s + K + sum of exp(-s tau) (K_tau + s C_tau), (..., N, N)."""
    n, z = model.size, np.asarray(s)[..., None, None]
    prompt = model.prompt
    total = prompt.stiffness + z * prompt.damping + z**2 * prompt.mass
    for group in model.delayed:
        late = group.stiffness[:n, :n] + z * group.damping[:n, :n]
        total = total + np.exp(-z * group.delay) * late
    for one in model.relaxing:
        total = total + one.stiffness(s)[..., None, None] * np.outer(*2 * [one.across[:n]])
    return np.asarray(total)


def companion(mass: Array, damping: Array, stiffness: Array) -> Array:
    """A of x' = A x with x = [z, z'], (..., 2N, 2N), from (stacks of) M, C, K, (..., N, N).

    Where C and K have q rows more, of states as in `pencil`, these are the last of x.

    Raises
    ------
    ModelError
        A is not finite.
    """
    n, m = mass.shape[-1], mass.shape[-1] + stiffness.shape[-1]
    shape = np.broadcast_shapes(mass.shape[:-2], damping.shape[:-2], stiffness.shape[:-2])
    a = np.zeros((*shape, m, m))
    a[..., :n, n : 2 * n] = np.eye(n)
    a[..., n : 2 * n, :n] = -np.linalg.solve(mass, stiffness[..., :n, :n])
    a[..., n : 2 * n, n : 2 * n] = -np.linalg.solve(mass, damping[..., :n, :n])
    if m > 2 * n:
        a[..., n : 2 * n, 2 * n :] = -np.linalg.solve(mass, stiffness[..., :n, n:])
        a[..., 2 * n :, :n] = -stiffness[..., n:, :n]
        a[..., 2 * n :, n : 2 * n] = -damping[..., n:, :n]
        a[..., 2 * n :, 2 * n :] = -stiffness[..., n:, n:]
    if not np.all(np.abs(a) < LARGEST):
        raise ModelError(
            f"Stiffness or damping over mass is not finite or beyond {LARGEST:g} 1/s^2, 1/s; no "
            "poles can be computed. Check masses, stiffnesses and dampings and their units."
        )
    return a


def on_left(real: Array, radius: Array | float) -> NDArray[np.bool_]:
    """Whether real parts are negative beyond rounding; `radius` is the largest modulus."""
    return np.asarray(real < -ON_AXIS * np.asarray(radius))


def pole_at_zero(values: ComplexArray, stiffness: Array) -> NDArray[np.bool_]:
    """Whether the slowest of the poles (..., 2N) is zero because the stiffness is singular.

    Asked only where it decides the verdict; False elsewhere.

    Raises
    ------
    RequestError
        The poles are so far apart that rounding of the fastest hides the side of a slow one.
    """
    size = np.abs(values)
    radius = size.max(axis=-1)
    place = np.argmax(values.real, axis=-1)[..., None]
    real = np.take_along_axis(values.real, place, axis=-1)[..., 0]
    slow = np.take_along_axis(size, place, axis=-1)[..., 0] < SLOW * radius
    asked = np.asarray(slow & (np.abs(real) <= NEAR_ZERO * radius))
    zero = np.zeros(asked.shape, dtype=bool)
    springs = np.broadcast_to(stiffness, (*asked.shape, *stiffness.shape[-2:]))[asked]
    if springs.size:
        rows = np.abs(springs).max(axis=-1, keepdims=True)
        zero[asked] = np.linalg.cond(springs / np.where(rows > 0.0, rows, 1.0)) > 1.0 / ON_AXIS
    hidden = slow & (np.abs(real) <= ON_AXIS * radius) & ~zero
    if np.any(hidden):
        raise RequestError(
            f"The fastest pole ({radius[hidden][0]:.3g} 1/s) is so fast that its rounding "
            "hides on which side of the imaginary axis a slow one lies. Use the criterion "
            '"hurwitz" (is_stable, stability_map), a lower damping or stiffness, or more mass.'
        )
    return zero


def poles(system: Linearisable, *, linearise: Linearise = None) -> xr.Dataset:
    """Poles: one row for each conjugate pair and each real pole, sorted by undamped frequency.

    Parameters
    ----------
    system : SeatSystem (base driven), SeatedBody (alone, its seat driven) or LinearModel
    linearise : None leaves non-linear elements out (named in the attribute `ignored`); "tangent"
        takes their tangent at rest

    Returns
    -------
    xarray.Dataset
        Over `mode`: `real`, `imag` (>= 0) in 1/s; `f0` = |s|/2 pi (undamped) and `fd` = imag/2 pi
        (damped) in Hz; `damping_ratio` = -real/|s|; `stable`. Over `root`: `pole`, complex, all
        of them, 2N and one for each state of an element. Attribute `stable`, 1 if every pole has a
        negative real part; one that is zero to rounding counts as unstable. With delayed forces the
        poles are infinitely many: these are the rightmost, at least as many, and all whose real
        part exceeds the attribute `complete_above` in 1/s (-inf without delay).

    Raises
    ------
    RequestError, ModelError
        See `as_linear_model`; no mass that moves by itself; or a pole so fast that its rounding
        hides the side of another.

    Examples
    --------
    >>> import seatdyn as sd
    >>> sd.poles(sd.load_body("ksiazek1997_back_off")).fd.values.round(2).tolist()
    [4.74, 8.25]
    """
    model = as_linear_model(system, linearise, delays=True, memory=True)
    upper, _, every, above = _sorted_modes(model)
    stable = on_left(upper.real, np.max(np.abs(every)))
    stable[0] &= not pole_at_zero(every, dynamic_stiffness(model, np.zeros((), dtype=complex)).real)
    with np.errstate(invalid="ignore"):  # a pole at zero has no damping ratio
        ratio = -upper.real / np.abs(upper)
    mode = ("mode",)
    return labelled(
        {
            "real": (mode, upper.real, "1/s", "real part of the pole"),
            "imag": (mode, upper.imag, "1/s", "imaginary part of the pole"),
            "f0": (mode, np.abs(upper) / (2 * np.pi), "Hz", "undamped natural frequency"),
            "fd": (mode, upper.imag / (2 * np.pi), "Hz", "damped natural frequency"),
            "damping_ratio": (mode, ratio, "1", "damping ratio"),
            "stable": (mode, stable, "1", "negative real part"),
            "pole": (("root",), every, "1/s", "all poles"),
        },
        {"mode": np.arange(1, upper.size + 1)},
        model,
        {"function": "poles", "linearise": linearise},
        stable=int(np.all(stable)),
        complete_above=above,
    )


def modes(system: Linearisable, *, linearise: Linearise = None) -> xr.Dataset:
    """Complex mode shapes in absolute displacements, largest component 1, in the order of `poles`.

    Parameters
    ----------
    system, linearise : as in `poles`

    Returns
    -------
    xarray.Dataset
        `shape` over (`mode`, `node`), complex, dimensionless; `pole` (imag >= 0) in 1/s and `f0`
        in Hz over `mode`.

    Raises
    ------
    RequestError, ModelError
        See `as_linear_model`.

    Examples
    --------
    >>> import seatdyn as sd
    >>> sd.modes(sd.load_body("ksiazek1997_back_off")).sizes["node"]
    2
    """
    model = as_linear_model(system, linearise, delays=True, memory=True)
    upper, shapes, *_ = _sorted_modes(model)
    return labelled(
        {
            "shape": (("mode", "node"), shapes, "1", "mode shape"),
            "pole": (("mode",), upper, "1/s", "pole"),
            "f0": (("mode",), np.abs(upper) / (2 * np.pi), "Hz", "undamped natural frequency"),
        },
        {"mode": np.arange(1, upper.size + 1), "node": list(model.nodes)},
        model,
        {"function": "modes", "linearise": linearise},
    )


def state_space(system: Linearisable, *, linearise: Linearise = None) -> StateSpace:
    """State space as plain arrays, for other tools: ``control.ss(*sd.state_space(system)[:4])``.

    Inputs are displacement u and velocity u' of the driven node; a caller must keep them
    consistent with each other. States are displacements z in m and velocities z' in m/s of the
    free nodes; outputs are their displacements, velocities and accelerations.

    Parameters
    ----------
    system, linearise : as in `poles`

    Returns
    -------
    StateSpace
        `A` (2N, 2N), `B` (2N, 2), `C` (3N, 2N), `D` (3N, 2), and the names `states`, `inputs`,
        `outputs`.

    Raises
    ------
    RequestError, ModelError
        See `as_linear_model`.

    Examples
    --------
    >>> import seatdyn as sd
    >>> sd.state_space(sd.load_body("ksiazek1997_back_off")).states
    ('displacement m1', 'displacement m2', 'velocity m1', 'velocity m2')
    """
    model = as_linear_model(system, linearise)
    n = model.size
    a = companion(model.mass, model.damping, model.stiffness)
    forces = np.column_stack([model.drive_stiffness, model.drive_damping])
    b = np.vstack([np.zeros((n, 2)), np.linalg.solve(model.mass, forces)])
    names = {
        quantity: tuple(f"{quantity} {node}" for node in model.nodes)
        for quantity in ("displacement", "velocity", "acceleration")
    }
    return StateSpace(
        A=a,
        B=b,
        C=np.vstack([np.eye(2 * n), a[n:]]),
        D=np.vstack([np.zeros((2 * n, 2)), b[n:]]),
        states=names["displacement"] + names["velocity"],
        inputs=(f"displacement {model.drive}", f"velocity {model.drive}"),
        outputs=names["displacement"] + names["velocity"] + names["acceleration"],
    )


def quadratic_eigenvalues(second: Array, first: Array, zeroth: Array) -> ComplexArray:
    """Return the finite eigenvalues of E2 s^2 + E1 s + E0; E2 may be singular.

    A singular E2 puts eigenvalues at infinity. Those that rounding makes huge instead come back
    too, so the caller must check what is used.
    """
    from scipy.linalg import eigvals

    n = len(zeroth)
    eye, none = np.eye(n), np.zeros((n, n))
    rate = natural_rate(second, zeroth)
    a = np.block([[none, eye], [-zeroth / rate**2, -first / rate]])
    values = eigvals(a, np.block([[eye, none], [none, second]]))
    return np.asarray(values[np.isfinite(values)] * rate)


def natural_rate(mass: Array, stiffness: Array) -> float:
    """Angular frequency that brings displacements and velocities to one size; 1 without springs."""
    springs, inertia = np.linalg.norm(stiffness), np.linalg.norm(mass)
    return float(np.sqrt(springs / inertia)) if springs > 0.0 and inertia > 0.0 else 1.0


def labelled(
    variables: Mapping[str, Variable],
    coords: Mapping[str, Any],
    model: LinearModel,
    request: Mapping[str, Any],
    **attrs: Any,
) -> xr.Dataset:
    """Dataset with a unit on every variable, and what it is the answer to."""
    import xarray as xr

    from seatdyn import __version__

    data = {
        name: (dims, values, {"units": unit, "long_name": text})
        for name, (dims, values, unit, text) in variables.items()
    }
    provenance = {
        "ignored": json.dumps(list(model.ignored)),
        "seatdyn_version": __version__,
        "request": json.dumps(dict(request)),
    }
    return xr.Dataset(data, dict(coords), {**provenance, **attrs})


def _sorted_modes(model: LinearModel) -> tuple[ComplexArray, ComplexArray, ComplexArray, float]:
    """Upper poles sorted by modulus, their shapes (mode, node), all poles in that order.

    Last comes the real part above which these are all.
    """
    if model.size == 0:
        raise RequestError(
            "No mass moves by itself here: all of it is on the seat, which is driven. Put the body "
            "on a Seat, or give it a mass that a Link carries."
        )
    from seatdyn.analysis.pencil import Pencil

    above, pencil = -np.inf, Pencil.of(model)
    if model.delays:
        from seatdyn.analysis.delay import rightmost_roots

        values, above = rightmost_roots(model)
        vectors = np.linalg.svd(pencil.at(values))[2][:, -1].conj().T
    else:
        values, vectors = np.linalg.eig(pencil.state_matrix())
    values = values.astype(complex)
    order = np.lexsort((-values.imag, values.real, np.abs(values)))
    upper = np.array([i for i in order if values[i].imag >= 0.0])
    shapes = vectors[: model.size, upper].T.astype(complex)
    place = np.argmax(np.abs(shapes), axis=1)[:, None]
    largest: ComplexArray = np.take_along_axis(shapes, place, axis=1)
    shapes[:] /= np.where(largest == 0.0, 1.0, largest)  # a state may relax by itself
    return values[upper], shapes, with_conjugates(values[upper]), above


def with_conjugates(upper: ComplexArray) -> ComplexArray:
    """Each real value once and each pair twice, from the values with imag >= 0 of a real problem.

    LAPACK pairs conjugates by construction, so the sign of the imaginary part tells them apart.
    """
    pairs = [[value] if value.imag == 0.0 else [value, value.conj()] for value in upper]
    return np.array([value for pair in pairs for value in pair], dtype=complex)
