"""Where a system with a delayed force is stable: maps over its delay and other parameters.

"crossings" counts the poles that cross the imaginary axis on the way from no delay (`delay_loop`):
one eigenvalue problem for all delays at once. "poles" finds the rightmost roots (`delay`) at every
point. They share no step after the matrices.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.analysis.characteristic import parameter_values
from seatdyn.analysis.delay import rightmost_roots
from seatdyn.analysis.delay_loop import loop_crossings, loop_of
from seatdyn.analysis.delay_margin import delayed_model, with_delay
from seatdyn.analysis.linear import (
    Array,
    ComplexArray,
    Linearisable,
    Linearise,
    Variable,
    as_linear_model,
    labelled,
    on_left,
)
from seatdyn.analysis.pencil import Pencil
from seatdyn.errors import RequestError
from seatdyn.model.system import DelayedForces, LinearModel, SeatSystem
from seatdyn.units import DELAY, number

if TYPE_CHECKING:
    import xarray as xr

Progress = Callable[[float], None]
# Of a map, some minutes; with "crossings" points without the axis of delay
MOST = {"crossings": 500_000, "poles": 20_000}
MOST_POINTS = 20_000_000
MOST_PARAMETERS = 3


def delayed_map(
    system: Linearisable,
    parameters: Mapping[str, ArrayLike],
    method: str | None,
    linearise: Linearise,
    progress: Progress | None,
) -> xr.Dataset:
    """`stability_map` of a system with a delayed force, or over its delay."""
    method = "crossings" if method is None else method
    if method not in MOST:
        raise RequestError(
            f"method = {method!r} is not allowed with a delayed force; use 'crossings' or 'poles'."
        )
    if len(parameters) > MOST_PARAMETERS:
        raise RequestError(
            f"stability_map got {len(parameters)} parameters ({', '.join(parameters)}); with a "
            f"delay it takes at most {MOST_PARAMETERS}."
        )
    model = as_linear_model(system, linearise, delays=True, memory=True)
    own = list(model.delays)
    if not own and isinstance(system, SeatSystem):
        model = delayed_model(system, "suspension", linearise)
    if len(own) > 1 or not model.delays:
        raise RequestError(
            f"The delayed forces of this system have the delays {own} s; a map takes one. Give a "
            "SeatSystem with one delay or none (then that of its suspension is varied)."
        )
    delays = delay_values(parameters.get("delay", own))
    others = {
        name: parameter_values(model, name, values)
        for name, values in parameters.items()
        if name != "delay"
    }
    sizes = [axis.size for axis in others.values()]
    points = math.prod(sizes) * (delays.size if method == "poles" else 1)
    if points > MOST[method] or math.prod(sizes) * delays.size > MOST_POINTS:
        raise RequestError(
            f"The map asks for {points:.3g} solutions; with a delayed force and method {method!r} "
            f"at most {MOST[method]:.0e} are allowed. Take fewer points."
        )
    grids = np.meshgrid(*others.values(), indexing="ij")
    columns = {name: grid.ravel() for name, grid in zip(others, grids, strict=True)}
    place = list(parameters).index("delay") if "delay" in parameters else None

    def shaped(table: NDArray[Any]) -> NDArray[Any]:
        grid = table.reshape(*sizes, delays.size)
        return grid[..., 0] if place is None else np.moveaxis(grid, -1, place)

    names, text = tuple(parameters), "all poles have negative real parts"
    variables: dict[str, Variable] = {}
    if method == "crossings":
        stable = stable_over(model, columns, delays)
    else:
        real, stable = rightmost_over(model, columns, delays, progress)
        about = "largest real part of a pole"
        variables["max_real"] = (names, shaped(real), "1/s", about)
    variables["stable"] = (names, shaped(stable), "1", text)
    units = {name: model.parameters[name].unit for name in others} | {"delay": "s"}
    axes = others | {"delay": delays}
    coords = {name: ((name,), axes[name], {"units": units[name]}) for name in names}
    request = {"function": "stability_map", "method": method, "linearise": linearise}
    return labelled(variables, coords, model, request)


def delay_values(values: ArrayLike) -> Array:
    """Delays in s as a checked array, 0 .. 10."""
    try:
        array = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        raise RequestError("delay must be an array of numbers in s.") from None
    if array.ndim != 1 or array.size == 0:
        raise RequestError(f"delay has the shape {array.shape}; it must be a list of numbers in s.")
    for i, value in enumerate(array):
        number(value, f"delay[{i}]", "s", **DELAY, error=RequestError)
    return array


def stable_over(
    model: LinearModel, columns: Mapping[str, Array], delays: Array
) -> NDArray[np.bool_]:
    """Verdict at P points of named parameters and T delays of the delayed force, (P, T)."""
    return np.asarray(loop_crossings(loop_of(model, columns)).count(delays) == 0)


def rightmost_over(
    model: LinearModel,
    columns: Mapping[str, Array],
    delays: Array,
    progress: Progress | None,
) -> tuple[Array, NDArray[np.bool_]]:
    """Largest real part of a pole and the verdict there, (P, T), from the poles themselves."""
    count = next((column.size for column in columns.values()), 1)
    real, stable = np.empty((count, delays.size)), np.empty((count, delays.size), dtype=bool)
    for p in range(count):
        here = with_values(model, {name: column[p] for name, column in columns.items()})
        for t, delay in enumerate(delays):
            poles = poles_of(with_delay(here, float(delay)))
            real[p, t] = poles.real.max()
            stable[p, t] = on_left(real[p, t], np.abs(poles).max())
        if progress is not None:
            progress((p + 1) / count)
    return real, stable


def poles_of(model: LinearModel) -> ComplexArray:
    """The rightmost poles with delays, all poles without."""
    if model.delays:
        return rightmost_roots(model)[0]
    return np.linalg.eigvals(Pencil.of(model).state_matrix()).astype(complex)


def with_values(model: LinearModel, values: Mapping[str, float]) -> LinearModel:
    """The model with other values of named parameters; its poles are right, its drive is not."""
    n = model.size
    matrices = [model.passive_stiffness.copy(), model.passive_damping.copy(), model.mass.copy()]
    late = list(model.delayed)
    for name, value in values.items():
        term = model.parameters[name]
        change = (value - term.value) * np.outer(term.left, term.right)
        if term.delay == 0.0:
            matrices[term.order][:n, :n] += change
            continue
        extended = np.zeros((n + 1, n + 1))
        extended[:n, :n] = change
        both = [np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))]
        both[term.order] = extended
        late.append(DelayedForces(term.delay, True, *both))
    stiffness, damping, mass = matrices
    return replace(
        model,
        mass=mass,
        passive_stiffness=stiffness,
        passive_damping=damping,
        delayed=tuple(late),
    )
