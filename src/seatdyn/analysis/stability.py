"""Is it stable, and where: maps over parameters by two independent criteria.

"hurwitz" takes the characteristic polynomial from the matrices and runs Routh's array on it;
"poles" takes the eigenvalues of the companion matrix. They share no step after M, C and K.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.analysis.characteristic import (
    MAXIMUM_PARAMETERS,
    corner_polynomials,
    parameter_values,
    substituted,
)
from seatdyn.analysis.linear import (
    Array,
    Linearisable,
    Linearise,
    Variable,
    as_linear_model,
    companion,
    labelled,
    on_left,
    pole_at_zero,
    poles,
)
from seatdyn.errors import RequestError
from seatdyn.model.system import LinearModel

if TYPE_CHECKING:
    import xarray as xr

Method = Literal["hurwitz", "poles", "crossings"]
Progress = Callable[[float], None]
FEWEST_PARAMETERS = 2
MOST_POINTS = {"hurwitz": 20_000_000, "poles": 2_000_000}  # of a map; seconds to a minute
CHUNK = 4096  # points whose matrices are held at once: some ten MB for 3 masses, and in cache


def is_stable(
    system: Linearisable, *, method: Method = "poles", linearise: Linearise = None
) -> bool:
    """Whether every pole has a negative real part; on the imaginary axis is not stable.

    Parameters
    ----------
    system, linearise : as in `poles`
    method : "poles" (eigenvalues) or "hurwitz" (characteristic polynomial, Routh's array). The
        second loses accuracy from about ten masses on, as every polynomial of that degree does.
        With delayed forces or states of elements "poles" only.

    Raises
    ------
    RequestError
        Unknown method, or with "poles" a system that `poles` refuses.

    Examples
    --------
    >>> import seatdyn as sd
    >>> sd.is_stable(sd.load_body("ksiazek1997_back_on"), method="hurwitz")
    True
    """
    hurwitz = _checked(method) == "hurwitz"
    model = as_linear_model(system, linearise, delays=not hurwitz, memory=not hurwitz)
    if model.size == 0:
        return True  # an inert load on a driven seat has no pole
    if hurwitz:
        return bool(_hurwitz_at(model, {})[0])
    if model.delayed or model.relaxing:
        return bool(poles(model).attrs["stable"])
    real, radius = _rightmost(model, {}, slice(0, 1))
    return bool(on_left(real, radius)[0])


def stability_map(
    system: Linearisable,
    *,
    method: Method | None = None,
    linearise: Linearise = None,
    progress: Progress | None = None,
    **parameters: ArrayLike,
) -> xr.Dataset:
    """Verdict on a grid of two or three parameters.

    Parameters
    ----------
    system, linearise : as in `poles`
    method : "hurwitz" (fast) or "poles" (gives the largest real part as well); with a delayed
        force "crossings" (fast) or "poles". None takes the fast one
    progress : called with the fraction done
    **parameters : name -> values, in any order: `seat_mass` (1e-6 .. 1e6 kg), `damping` (0 ..
        1e9 N s/m) and `stiffness` (0 .. 1e12 N/m) of the suspension as a whole, and the feedback
        gains of the body by name (`k11` ..., within +-1e12); `delay` (0 .. 10 s) of what is delayed
        in the system, or of its suspension if nothing is

    Returns
    -------
    xarray.Dataset
        `stable` over the parameters, in the order given; with method "poles" also `max_real`, the
        largest real part of a pole in 1/s.

    Raises
    ------
    RequestError
        Fewer than two or more than three parameters, an unknown one (with a suggestion), a value
        out of its range, more than 2e7 points ("poles": 2e6, with delays 2e4), several delayed
        forces, or with "poles" a pole so fast that its rounding hides the verdict.

    Notes
    -----
    The characteristic polynomial is multi-affine in these parameters: it is formed at the corners
    of the box only and interpolated, exactly, at each point.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_on"), seat)
    >>> sd.stability_map(system, seat_mass=[25.0, 35.0], damping=[520.0]).stable.values.tolist()
    [[False], [True]]
    """
    if "delay" in parameters or as_linear_model(system, linearise, delays=True, memory=True).delays:
        from seatdyn.analysis.delay_map import delayed_map

        return delayed_map(system, parameters, method, linearise, progress)
    method = _checked(method or "hurwitz")
    model = as_linear_model(system, linearise)
    if not FEWEST_PARAMETERS <= len(parameters) <= MAXIMUM_PARAMETERS:
        raise RequestError(
            f"stability_map got {len(parameters)} parameters ({', '.join(parameters) or 'none'}); "
            "it needs two or three, such as seat_mass=[...], damping=[...]. For one parameter use "
            "critical_values."
        )
    axes = {name: parameter_values(model, name, v) for name, v in parameters.items()}
    sizes = tuple(axis.size for axis in axes.values())
    names = tuple(axes)
    if math.prod(sizes) > MOST_POINTS[method]:
        raise RequestError(
            f"The map has {' x '.join(map(str, sizes))} = {math.prod(sizes):.3g} points; with "
            f"method {method!r} at most {MOST_POINTS[method]:.0e} are allowed. Take fewer points, "
            "or find the edge itself with stability_boundary."
        )
    text = "all poles have negative real parts"
    variables: dict[str, Variable]
    if method == "hurwitz":
        stable = _hurwitz_map(model, axes, progress)
        variables = {"stable": (names, stable, "1", text)}
    else:
        grids = np.meshgrid(*axes.values(), indexing="ij")
        columns = {name: grid.ravel() for name, grid in zip(names, grids, strict=True)}
        real, radius = _rightmost_everywhere(model, columns, progress)
        variables = {
            "stable": (names, on_left(real, radius).reshape(sizes), "1", text),
            "max_real": (names, real.reshape(sizes), "1/s", "largest real part of a pole"),
        }
    coords = {
        name: ((name,), axis, {"units": model.parameters[name].unit}) for name, axis in axes.items()
    }
    request = {"function": "stability_map", "method": method, "linearise": linearise}
    return labelled(variables, coords, model, request)


def stability_points(
    system: Linearisable,
    *,
    method: Method = "hurwitz",
    linearise: Linearise = None,
    **parameters: ArrayLike,
) -> xr.Dataset:
    """Verdict at single points: as `stability_map`, from one to three columns of equal length.

    Returns
    -------
    xarray.Dataset
        Over `point`: the parameters, `stable`, and with method "poles" `max_real` in 1/s and
        `margin` = max_real over the largest |s|, dimensionless.

    Raises
    ------
    RequestError
        As `stability_map`, or columns of different lengths.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> stability_points(system, damping=[27.4, 27.5]).stable.values.tolist()
    [False, True]
    """
    _checked(method)
    model = as_linear_model(system, linearise)
    columns = {name: parameter_values(model, name, v) for name, v in parameters.items()}
    lengths = {column.size for column in columns.values()}
    if not 1 <= len(columns) <= MAXIMUM_PARAMETERS or len(lengths) != 1:
        raise RequestError(
            "stability_points needs one to three parameters with values of equal length; it got "
            + (", ".join(f"{name}: {c.size}" for name, c in columns.items()) or "none")
            + "."
        )
    dims = ("point",)
    variables: dict[str, Variable] = {
        name: (dims, column, model.parameters[name].unit, name) for name, column in columns.items()
    }
    text = "all poles have negative real parts"
    if method == "hurwitz":
        variables["stable"] = (dims, _hurwitz_at(model, columns), "1", text)
    else:
        real, radius = _rightmost_everywhere(model, columns, None)
        variables["stable"] = (dims, on_left(real, radius), "1", text)
        variables["max_real"] = (dims, real, "1/s", "largest real part of a pole")
        variables["margin"] = (dims, real / radius, "1", "largest real part over largest modulus")
    request = {"function": "stability_points", "method": method, "linearise": linearise}
    return labelled(variables, {}, model, request)


def _checked(method: Method) -> Method:
    if method not in ("hurwitz", "poles"):
        raise RequestError(f"method = {method!r} is not allowed; use 'hurwitz' or 'poles'.")
    return method


def _box(model: LinearModel, axes: Mapping[str, Array]) -> tuple[Array, list[Array]]:
    """Corner polynomials of a box, and the coordinates of all values in it, within -1 .. 1.

    On each axis the box goes from the value next to zero to the one farthest from it, so that
    small values keep their digits beside huge ones of either sign.
    """
    box: dict[str, tuple[float, float]] = {}
    coordinates: list[Array] = []
    for name, values in axes.items():
        near = values[np.argmin(np.abs(values))]
        far = values[np.argmax(np.abs(values - near))]
        box[name] = (float(near), float(far))
        coordinates.append((values - near) / ((far - near) or 1.0))
    missing = MAXIMUM_PARAMETERS - len(coordinates)
    like = coordinates[0] if coordinates else np.zeros(1)
    return corner_polynomials(model, box), coordinates + [np.zeros_like(like)] * missing


def _hurwitz_map(
    model: LinearModel, axes: Mapping[str, Array], progress: Progress | None
) -> NDArray[np.bool_]:
    from seatdyn.kernels.hurwitz import hurwitz_grid
    from seatdyn.kernels.jit import CompileNotice

    # the kernel is quickest along its last axis, so axes that are missing come first
    corners, coordinates = _box(model, axes)
    missing = MAXIMUM_PARAMETERS - len(axes)
    corners = np.ascontiguousarray(np.moveaxis(corners, range(len(axes)), range(missing, 3)))
    x, y, z = [np.zeros(1)] * missing + coordinates[: len(axes)]
    stable = np.empty((x.size, y.size, z.size), dtype=bool)
    with CompileNotice():
        hurwitz_grid(corners, x[:0], y, z, stable[:0])
    slabs = np.arange(y.size) if missing else np.arange(x.size)
    for i in slabs:
        if missing:
            hurwitz_grid(corners, x, y[i : i + 1], z, stable[:, i : i + 1])
        else:
            hurwitz_grid(corners, x[i : i + 1], y, z, stable[i : i + 1])
        if progress is not None:
            progress((i + 1) / slabs.size)
    return stable.reshape(tuple(axis.size for axis in axes.values()))


def _hurwitz_at(model: LinearModel, columns: Mapping[str, Array]) -> NDArray[np.bool_]:
    from seatdyn.kernels.hurwitz import hurwitz_points
    from seatdyn.kernels.jit import CompileNotice

    corners, coordinates = _box(model, columns)
    stable = np.empty(coordinates[0].size, dtype=bool)
    with CompileNotice():
        hurwitz_points(corners, np.column_stack(coordinates), stable)
    return stable


def _rightmost(
    model: LinearModel, columns: Mapping[str, Array], part: slice
) -> tuple[Array, Array]:
    """Largest real part and largest modulus of the poles at some points, (P,) each."""
    values = {name: column[part] for name, column in columns.items()}
    mass, damping, stiffness = substituted(model, values)
    found = np.atleast_2d(np.linalg.eigvals(companion(mass, damping, stiffness)))
    real = found.real.max(axis=-1)
    real = np.where(pole_at_zero(found, stiffness), np.maximum(real, 0.0), real)
    return real, np.abs(found).max(axis=-1)


def _rightmost_everywhere(
    model: LinearModel, columns: Mapping[str, Array], progress: Progress | None
) -> tuple[Array, Array]:
    """Compute `_rightmost` chunk by chunk, so that memory stays bounded."""
    size = next(iter(columns.values())).size
    real, radius = np.empty(size), np.empty(size)
    for start in range(0, size, CHUNK):
        part = slice(start, start + CHUNK)
        real[part], radius[part] = _rightmost(model, columns, part)
        if progress is not None:
            progress(min(1.0, (start + CHUNK) / size))
    return real, radius
