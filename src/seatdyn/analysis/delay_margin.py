"""How much delay of one force a linear system bears."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.delay import roots_right_of
from seatdyn.analysis.delay_loop import Crossings, loop_crossings, loop_of
from seatdyn.analysis.linear import (
    Array,
    Linearisable,
    Linearise,
    as_linear_model,
    labelled,
)
from seatdyn.errors import RequestError
from seatdyn.model.system import LinearModel, SeatSystem, linear_model
from seatdyn.units import DELAY, number

if TYPE_CHECKING:
    import xarray as xr

JUST = 1e-7  # relative step off a switching delay where the poles are counted for a check
MOST_SWITCHES = 100_000


def delay_margin(
    system: Linearisable,
    *,
    of: str = "suspension",
    maximum: float = 0.1,
    linearise: Linearise = None,
) -> xr.Dataset:
    """Delay of one force at which the system loses stability, and all delays where it switches.

    Parameters
    ----------
    system, linearise : as in `poles`, elements with states included; its other forces must act at
        once. What delay it has itself plays no role
    of : what is delayed: "suspension", "feedback", or the name of an element. For a SeatedBody the
        feedback, for a LinearModel the forces that it holds as delayed
    maximum : largest delay of the list of switches, s, 0 .. 10

    Returns
    -------
    xarray.Dataset
        `delay_margin` in s: the smallest delay that destabilises; inf where no delay does, NaN
        where the system is unstable without. `frequency` in Hz of the pole that crosses. Over
        `switch`: `delay` in s (increasing, up to `maximum`), `switch_frequency` in Hz,
        `destabilising` (the pole pair goes to the right), `unstable_above`, the number of unstable
        poles beyond, and `stable_above`. Attributes `of`, `stable_without_delay`.

    Raises
    ------
    RequestError
        Other forces are delayed too, or several independent forces share the delay.

    Notes
    -----
    See the head of `delay_loop`. The result is held against the argument principle on both sides
    of the margin.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> round(1e3 * float(sd.delay_margin(system).delay_margin), 3)  # ms
    22.796
    """
    longest = number(maximum, "maximum", "s", **DELAY, error=RequestError)
    model = delayed_model(system, of, linearise)
    found = loop_crossings(loop_of(model))
    delay, row = _switches(found, longest)
    count = found.unstable[0] + np.cumsum(found.change[row])
    margin, rate = _margin(found)
    if np.isfinite(margin):
        _held_against_the_argument_principle(model, margin)
    dims = ("switch",)
    return labelled(
        {
            "delay_margin": ((), margin, "s", "delay that destabilises"),
            "frequency": ((), rate / (2 * np.pi), "Hz", "frequency of the pole that crosses"),
            "delay": (dims, delay, "s", "delay with a pole on the imaginary axis"),
            "switch_frequency": (dims, found.rate[row] / (2 * np.pi), "Hz", "its frequency"),
            "destabilising": (dims, found.change[row] > 0, "1", "goes to the right"),
            "unstable_above": (dims, count, "1", "unstable poles beyond"),
            "stable_above": (dims, count == 0, "1", "stable beyond"),
        },
        {"switch": np.arange(1, delay.size + 1)},
        model,
        {"function": "delay_margin", "of": of, "maximum": longest, "linearise": linearise},
        of=of,
        stable_without_delay=int(found.unstable[0] == 0),
    )


def delayed_model(system: Linearisable, of: str, linearise: Linearise = None) -> LinearModel:
    """Linear model in which only what `of` names is delayed, by one second."""
    if isinstance(system, LinearModel):
        model = as_linear_model(system, linearise, delays=True, memory=True)
    elif isinstance(system, SeatSystem):
        model = linear_model(system.delayed(1.0, of), linearise)
    else:
        as_linear_model(system, linearise, delays=True)
        model = linear_model(system.delayed(1.0), linearise)  # type: ignore[union-attr]
    if len(model.delays) > 1:
        raise RequestError(
            f"Beside {of} other forces of this system are delayed: "
            f"{sorted({*model.delays} - {1.0})} s. "
            "delay_margin and maps over delay vary one delay; set the others to 0, or follow the "
            "poles with `poles`."
        )
    return model


def _switches(found: Crossings, longest: float) -> tuple[Array, NDArray[np.int_]]:
    """All delays up to `longest` with a pole on the axis, sorted, and their crossings."""
    delays, rows = [np.zeros(0)], [np.zeros(0, dtype=int)]
    for row in range(found.rate.size):
        period = 2 * np.pi / found.rate[row]
        many = int((longest - found.first[row]) // period) + 1 if longest > found.first[row] else 0
        if many > MOST_SWITCHES:
            raise RequestError(
                f"maximum = {longest:g} s asks for more than {MOST_SWITCHES} switching delays; "
                "make it shorter."
            )
        delays.append(found.first[row] + period * np.arange(many))
        rows.append(np.full(many, row))
    delay, place = np.concatenate(delays), np.concatenate(rows)
    order = np.argsort(delay, kind="stable")
    return delay[order], place[order]


def _margin(found: Crossings) -> tuple[float, float]:
    """Smallest delay that destabilises and its rate; (inf, nan) or (nan, nan) without one."""
    if found.unstable[0]:
        return np.nan, np.nan
    if not np.any(found.change > 0):
        return np.inf, np.nan
    # a stable system has no pole to bring back: the first crossing goes to the right
    row = int(np.argmin(found.first))
    return float(found.first[row]), float(found.rate[row])


def _held_against_the_argument_principle(model: LinearModel, margin: float) -> None:
    """Count the unstable poles on both sides of the margin; they must be none and two."""
    counts = []
    for share in (1.0 - JUST, 1.0 + JUST):
        counts.append(roots_right_of(with_delay(model, margin * share), 0.0))
    if counts[0] != 0 or counts[1] < 1:
        raise RequestError(
            f"The delay margin {margin:.10g} s contradicts the number of unstable poles on its two "
            f"sides, {counts[0]} and {counts[1]}; the parameters are too far apart in size."
        )


def with_delay(model: LinearModel, delay: float) -> LinearModel:
    """The model with its delayed forces late by `delay` s, which may be 0."""
    if delay > 0.0:
        late = tuple(replace(group, delay=delay) for group in model.delayed)
        relaxing = tuple(replace(one, delay=delay) if one.delay else one for one in model.relaxing)
        return replace(model, delayed=late, relaxing=relaxing)
    return model.undelayed
