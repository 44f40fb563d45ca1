"""Frequency response curves and parameter curves of the non-linear system, through folds."""

from __future__ import annotations

import json
import math
import reprlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import seatdyn
from seatdyn.analysis.continuation import Branch, Make, Point, trace
from seatdyn.analysis.random_linear import NOTE, output_coords
from seatdyn.analysis.transient import check_request
from seatdyn.errors import RequestError
from seatdyn.model.excitation import Sine
from seatdyn.model.system import SeatSystem
from seatdyn.units import ACCELERATION, FREQUENCY, Limits, number

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
Level = Literal["amplitude", "rms", "displacement"]
UNITS = {"amplitude": "m/s2", "rms": "m/s2", "displacement": "m"}


def response_curve(
    system: SeatSystem,
    frequency: tuple[float, float],
    level: ArrayLike,
    *,
    kind: Level = "amplitude",
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Steady amplitudes over the frequency at given levels, through folds, with stability.

    Each level is one branch of periodic motions: the one that the system takes from rest at the
    first frequency, followed by pseudo-arclength continuation until it leaves the range. Branches
    that are not connected with it (isolated ones) are not found.

    Parameters
    ----------
    system : SeatSystem, with or without delays and elements with states of their own
    frequency : first and last, Hz, 1e-4 .. 1e5; from high to low is allowed
    level : one or several, > 0
    kind : what `level` is, of the base: "amplitude" (peak acceleration, m/s2), "rms" (r.m.s.
        acceleration, m/s2) or "displacement" (peak, m)
    progress : called with the share of the levels done

    Returns
    -------
    xarray.Dataset
        Over level and point along the branch: frequency, floquet_max, stable; amplitude, maximum
        and minimum by output. Over level and event: event_kind (fold, period doubling,
        Neimark-Sacker, branch point; graze, where the motion begins or ceases to touch a break of
        a law, so that a multiplier leaps over the unit circle or the curve has a corner; break,
        where a branch ends and the curve goes on with what time integration reaches further on),
        event_frequency, event_amplitude by output. Shorter branches are filled with NaN.
        Attributes: status (of the worst level), level_status, ...

    Raises
    ------
    RequestError
        No SeatSystem, a frequency or level outside its range, an unknown kind.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), sd.QuadraticDamper(500.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> curve = sd.response_curve(system, (1.4, 1.7), [0.5])
    >>> curve.attrs["status"], bool(curve.stable.all())
    ('ok', True)
    """
    check_request(system, Sine(1.0, amplitude=1.0))
    if kind not in UNITS:
        raise RequestError(f"kind = {kind!r} is not allowed; use one of {', '.join(UNITS)}.")
    ends = _pair(frequency, "frequency", "Hz", FREQUENCY)
    levels = np.atleast_1d(np.asarray(level, dtype=float))
    if levels.ndim != 1 or levels.size == 0:
        raise RequestError(f"level = {reprlib.repr(level)} must be a number or a list of numbers.")
    for value in levels:
        most = ACCELERATION["maximum"]
        number(value, "level", UNITS[kind], above=0.0, maximum=most, error=RequestError)
    branches = []
    for k, value in enumerate(levels):
        branches.append(trace(_sines(system, float(value), kind), *ends))
        if progress is not None:
            progress((k + 1) / levels.size)
    data = _dataset(branches, "frequency", "Hz")
    coordinate = ("level", levels, {"units": UNITS[kind], "kind": kind})
    return data.assign_coords(level=coordinate).assign_attrs(
        system=repr(system), request=json.dumps({"frequency": ends, "kind": kind})
    )


def parameter_curve(
    make: Make, start: float, stop: float, *, name: str = "parameter", unit: str = "1"
) -> xr.Dataset:
    """Steady amplitudes over any parameter, through folds, with stability.

    Parameters
    ----------
    make : function of the parameter's value that gives (SeatSystem, periodic excitation)
    start, stop : range of the parameter
    name, unit : what it is called in the result

    Returns
    -------
    xarray.Dataset
        As of `response_curve`, with `name` in place of the frequency and one level.

    Examples
    --------
    >>> import seatdyn as sd
    >>> body, sine = sd.load_body("ksiazek1997_back_off"), sd.Sine(1.55, amplitude=0.8857)
    >>> def seat(beta):
    ...     parts = [sd.Spring(9950.0), sd.Damper(260.0), sd.QuadraticDamper(beta)]
    ...     return sd.SeatSystem(body, sd.Seat(35.0, parts)), sine
    >>> curve = sd.parameter_curve(seat, 100.0, 1000.0, name="beta1", unit="N s2/m2")
    >>> bool(curve.amplitude.sel(output="acc_seat").diff("point").max() < 0)
    True
    """
    if not callable(make):
        raise RequestError(f"make = {reprlib.repr(make)} is no function of the parameter.")
    ends = _pair((start, stop), "start, stop", "", Limits(minimum=-1e300, maximum=1e300))
    check_request(*make(ends[0]))
    data = _dataset([trace(make, *ends)], name, unit).isel(level=0)
    return data.assign_attrs(request=json.dumps({"name": name, "start": ends[0], "stop": ends[1]}))


def backbone(curves: xr.Dataset, output: str) -> xr.Dataset:
    """Peaks of frequency response curves: where each level is answered most, and by how much.

    Parameters
    ----------
    curves : result of `response_curve`
    output : name of an output, such as "seat-base"

    Returns
    -------
    xarray.Dataset
        frequency (Hz) and amplitude of the highest point of every level. With little damping they
        lie on the free oscillations of the system without damping.
    """
    import xarray as xr

    if output not in curves.output:
        from seatdyn.units import suggestion

        raise RequestError(
            f"No output {output!r}. {suggestion(output, list(curves.output.values))}"
        )
    amplitude = curves["amplitude"].sel(output=output)
    best = amplitude.fillna(-1.0).argmax("point")
    return xr.Dataset(
        {
            "frequency": curves["frequency"].isel(point=best).drop_vars("point", errors="ignore"),
            "amplitude": amplitude.isel(point=best).drop_vars("point", errors="ignore"),
        },
        attrs={"status": curves.attrs["status"], "output": output},
    )


def _sines(system: SeatSystem, level: float, kind: Level) -> Make:
    def make(f: float) -> tuple[SeatSystem, Sine]:
        if kind == "rms":
            return system, Sine(f, rms=level)
        factor = (2 * math.pi * f) ** 2 if kind == "displacement" else 1.0
        return system, Sine(f, amplitude=level * factor)

    return make


def _pair(values: Any, name: str, unit: str, limits: Limits) -> tuple[float, float]:
    """Two different numbers."""
    try:
        first, last = values
    except (TypeError, ValueError):
        raise RequestError(
            f"{name} = {reprlib.repr(values)} must be two numbers, first and last."
        ) from None
    first, last = (number(v, name, unit, error=RequestError, **limits) for v in (first, last))
    if first == last:
        raise RequestError(f"{name}: both ends are {first:g}; a curve needs a range.")
    return first, last


def _dataset(branches: Sequence[Branch], name: str, unit: str) -> xr.Dataset:
    """Branches as rows, the shorter ones filled with NaN."""
    import xarray as xr

    names = next((list(b.points[0].maximum) for b in branches if b.points), [])
    worst = next((b for b in branches if not b.status.valid), branches[0])
    longest = max(len(b.points) for b in branches)
    events = max((len(b.special) for b in branches), default=0)
    note, one = {"units": NOTE}, {"units": "1"}
    data = xr.Dataset(
        {
            name: (
                ("level", "point"),
                _filled(branches, longest, lambda p: p.value),
                {"units": unit},
            ),
            "floquet_max": (
                ("level", "point"),
                _filled(branches, longest, lambda p: float(np.abs(p.multipliers[0]))),
                one,
            ),
            **{
                key: (
                    ("level", "output", "point"),
                    np.array([_filled(branches, longest, get(output)) for output in names])
                    .reshape(len(names), len(branches), longest)
                    .swapaxes(0, 1),
                    note,
                )
                for key, get in _EXTREMA.items()
            },
        },
        coords=output_coords(names),
    )
    data["stable"] = data["floquet_max"] < 1.0
    data["stable"].attrs = one
    kinds = [[s.kind for s in b.special] + [""] * (events - len(b.special)) for b in branches]
    special = [Branch(points=[s.point for s in b.special]) for b in branches]
    data["event_kind"] = (
        ("level", "event"),
        np.array(kinds, dtype=object).reshape(len(branches), events),
    )
    data[f"event_{name}"] = (
        ("level", "event"),
        _filled(special, events, lambda p: p.value),
        {"units": unit},
    )
    data["event_amplitude"] = (
        ("level", "output", "event"),
        np.array([_filled(special, events, _EXTREMA["amplitude"](output)) for output in names])
        .reshape(len(names), len(branches), events)
        .swapaxes(0, 1),
        note,
    )
    data.attrs = {
        "status": str(worst.status),
        "message": worst.message or worst.status.message,
        "level_status": json.dumps([str(b.status) for b in branches]),
        "level_message": json.dumps([b.message for b in branches]),
        "parameter": name,
        "seatdyn_version": seatdyn.__version__,
    }
    return data


def _filled(branches: Sequence[Branch], width: int, get: Callable[[Point], float]) -> Array:
    """A number of every point, (branches, width), NaN beyond the end of a branch."""
    rows = np.full((len(branches), width), np.nan)
    for row, branch in zip(rows, branches, strict=True):
        row[: len(branch.points)] = [get(point) for point in branch.points]
    return rows


_EXTREMA: dict[str, Callable[[str], Callable[[Point], float]]] = {
    "amplitude": lambda output: lambda p: (p.maximum[output] - p.minimum[output]) / 2,
    "maximum": lambda output: lambda p: p.maximum[output],
    "minimum": lambda output: lambda p: p.minimum[output],
}


def folds(curves: xr.Dataset, level: int) -> Array:
    """Places of the folds of one level, in the unit of the parameter."""
    kinds = curves["event_kind"].isel(level=level).to_numpy()
    places = curves[f"event_{curves.attrs['parameter']}"].isel(level=level).to_numpy()
    return np.asarray(places[kinds == "fold"], dtype=float)
