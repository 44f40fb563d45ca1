"""Daily exposure, the values of Directive 2002/44/EC, health guidance and comfort.

With aw the weighted r.m.s. and k = 1.4, 1.4, 1 for x, y, z (Directive 2002/44/EC, Annex, part B):

    A(8)  = k aw (T / 8 h)^(1/2)        tasks of one day: (sum A_i(8)^2)^(1/2), axis by axis
    VDV   = k VDV_measured (T / T_measured)^(1/4)         (sum VDV_i^4)^(1/4)

and the axis with the largest value counts. Axes are never added up here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from seatdyn.errors import RequestError
from seatdyn.standards.metrics import AXIS_FACTORS, combined_vdv, estimated_vdv
from seatdyn.standards.source import Constant, Grade
from seatdyn.units import number

HOUR = 3600.0  # s
DAY = 24 * HOUR
WORKING_DAY = 8 * HOUR
A8, VDV = "m/s2", "m/s1.75"

_DIRECTIVE = "Directive 2002/44/EC, Article 3(2)"
ACTION_VALUES = {
    "a8": Constant(0.5, A8, _DIRECTIVE, Grade.FOUND),
    "vdv": Constant(9.1, VDV, _DIRECTIVE, Grade.FOUND),
}
LIMIT_VALUES = {
    "a8": Constant(1.15, A8, _DIRECTIVE, Grade.FOUND),
    "vdv": Constant(21.0, VDV, _DIRECTIVE, Grade.FOUND),
}

_ANNEX_B = "ISO 2631-1:1997, Annex B, Figure B.1"
# caution zone of (B.1): from `low` to `high` up to 10 min, then falling with T^(-1/2)
ZONE_RMS = {
    "low": Constant(3.0, A8, _ANNEX_B, Grade.UNCERTAIN),
    "high": Constant(6.0, A8, _ANNEX_B, Grade.UNCERTAIN),
}
ZONE_FLAT_UNTIL = Constant(600.0, "s", _ANNEX_B, Grade.UNCERTAIN)
# caution zone of (B.2), as estimated vibration dose value
ZONE_VDV = {
    "low": Constant(8.5, VDV, "ISO 2631-1:1997, B.3.2", Grade.RECALLED),
    "high": Constant(17.0, VDV, "ISO 2631-1:1997, B.3.2", Grade.RECALLED),
}
ZONES_MEANT_FOR = (4 * HOUR, 8 * HOUR)  # of exposure a day
ZONE_TEXT = {
    "below": "below the caution zone: effects on health are not clearly documented",
    "caution": "in the caution zone: potential risks to health",
    "above": "above the caution zone: risks to health are likely",
}

_C23 = "ISO 2631-1:1997, C.2.3"
# likely reactions to a total value; the bands overlap on purpose
COMFORT = (
    (0.0, 0.315, "not uncomfortable"),
    (0.315, 0.63, "a little uncomfortable"),
    (0.5, 1.0, "fairly uncomfortable"),
    (0.8, 1.6, "uncomfortable"),
    (1.25, 2.5, "very uncomfortable"),
    (2.0, math.inf, "extremely uncomfortable"),
)
COMFORT_SOURCE = (_C23, Grade.CHECKED)


@dataclass(frozen=True)
class Task:
    """One kind of work of a day, as measured.

    Parameters
    ----------
    name : what is done
    exposure : time per day, s, 0 .. 86400
    rms : weighted r.m.s. of each axis measured, m/s2, without k: ``{"x": .., "y": .., "z": ..}``
    vdv : VDV of each axis measured, m/s^1.75, without k; may be left out
    measured : duration of the record that `vdv` is of, s

    Raises
    ------
    RequestError
        A number outside its range, an unknown axis, or a VDV without `measured`.
    """

    name: str
    exposure: float
    rms: Mapping[str, float]
    vdv: Mapping[str, float] = field(default_factory=dict)
    measured: float | None = None

    def __post_init__(self) -> None:
        """Check every number."""
        where = f"Task({self.name!r})"
        number(self.exposure, f"{where}.exposure", "s", minimum=0.0, maximum=DAY,
               hint="Give seconds per day.", error=RequestError)  # fmt: skip
        for values, name, unit in ((self.rms, "rms", A8), (self.vdv, "vdv", VDV)):
            for axis, value in values.items():
                if axis not in AXIS_FACTORS["health"]:
                    raise RequestError(f"{where}.{name}: axis {axis!r} is not known; use x, y, z.")
                number(value, f"{where}.{name}[{axis!r}]", unit, minimum=0.0, maximum=1e6,
                       error=RequestError)  # fmt: skip
        if self.vdv:
            if self.measured is None:
                raise RequestError(
                    f"{where}.vdv needs `measured`: the duration in s of the record that it is of."
                )
            number(self.measured, f"{where}.measured", "s", above=0.0, error=RequestError)


@dataclass(frozen=True)
class DailyExposure:
    """Exposure of one day, made by `daily_exposure`.

    Parameters
    ----------
    a8 : A(8) of each axis, k included, m/s2
    vdv : VDV of each axis, k included, m/s^1.75; empty where no task had one
    """

    a8: Mapping[str, float]
    vdv: Mapping[str, float]

    def largest(self, measure: str = "a8") -> tuple[str, float]:
        """Axis that counts and its value; `measure` is "a8" or "vdv"."""
        values = self.a8 if measure == "a8" else self.vdv
        if not values:
            raise RequestError(
                f"No task gave what {measure!r} needs; give the tasks a `{measure}`."
            )
        axis = max(values, key=values.__getitem__)
        return axis, values[axis]

    def verdict(self, measure: str = "a8") -> str:
        """Either "below action value", "above action value" or "above limit value"."""
        return against_directive(self.largest(measure)[1], measure)


def daily_exposure(tasks: Iterable[Task]) -> DailyExposure:
    """Exposure of a day made of tasks, Directive 2002/44/EC, Annex, part B.

    Parameters
    ----------
    tasks : what is done in a day; together at most 24 h

    Returns
    -------
    DailyExposure
        A(8) and VDV of each axis, k = 1.4, 1.4, 1 included.

    Raises
    ------
    RequestError
        No task, tasks of more than 24 h, or tasks measured in different axes.

    Examples
    --------
    >>> import seatdyn as sd
    >>> loading = sd.Task("loading", 3 * 3600.0, {"x": 0.3, "z": 0.8})
    >>> driving = sd.Task("driving", 4 * 3600.0, {"x": 0.5, "z": 0.6})
    >>> day = sd.daily_exposure([loading, driving])
    >>> axis, value = day.largest()
    >>> print(axis, round(value, 3), day.verdict())
    z 0.648 above action value
    """
    every = list(tasks)
    total = sum(task.exposure for task in every)
    if not every or total > DAY:
        raise RequestError(
            f"A day needs one task or more and has 24 h; {len(every)} tasks of together "
            f"{total / HOUR:.3g} h were given."
        )
    k = {axis: factor.value for axis, factor in AXIS_FACTORS["health"].items()}
    energy = {
        axis: sum(task.rms[axis] ** 2 * task.exposure for task in every)
        for axis in _axes(every, "rms")
    }
    doses = {
        axis: combined_vdv(
            [t.vdv[axis] * (t.exposure / (t.measured or math.nan)) ** 0.25 for t in every]
        )
        for axis in _axes(every, "vdv")
    }
    return DailyExposure(
        a8={axis: k[axis] * math.sqrt(energy[axis] / WORKING_DAY) for axis in energy},
        vdv={axis: k[axis] * doses[axis] for axis in doses},
    )


def _axes(tasks: list[Task], measure: str) -> list[str]:
    """Axes that every task has; part of a day would pass for all of it."""
    axes = {task.name: sorted(getattr(task, measure)) for task in tasks}
    first = next(iter(axes.values()))
    if any(sorted(getattr(task, measure)) != first for task in tasks):
        raise RequestError(
            f"The tasks have `{measure}` of different axes, {axes}; a sum over a day needs the "
            "same axes of all tasks. Add what is missing or leave the axis out."
        )
    return first


def against_directive(value: float, measure: str = "a8") -> str:
    """Where an A(8) ("a8", m/s2) or a VDV ("vdv", m/s^1.75) lies between the values."""
    if value > LIMIT_VALUES[measure].value:
        return "above limit value"
    return "above action value" if value > ACTION_VALUES[measure].value else "below action value"


def time_to_reach(
    value: float,
    axis: str,
    threshold: float,
    *,
    measure: str = "a8",
    measured: float | None = None,
) -> float:
    """Exposure per day after which a threshold is reached, s; may exceed a day.

    Parameters
    ----------
    value : weighted r.m.s. in m/s2 (measure "a8") or VDV in m/s^1.75 ("vdv"), without k
    axis : x, y or z
    threshold : A(8) or VDV to be reached, such as ``ACTION_VALUES["a8"].value``
    measured : duration of the record that a VDV is of, s

    Examples
    --------
    >>> from seatdyn.standards.exposure import time_to_reach
    >>> time_to_reach(1.0, "z", 0.5) / 3600.0
    2.0
    """
    if axis not in AXIS_FACTORS["health"]:
        raise RequestError(f"axis {axis!r} is not known; use x, y, z.")
    effective = AXIS_FACTORS["health"][axis].value * value
    if effective == 0.0:
        return math.inf
    if measure == "a8":
        return WORKING_DAY * (threshold / effective) ** 2
    if measured is None:
        raise RequestError("A VDV needs `measured`: the duration in s of the record that it is of.")
    return measured * (threshold / effective) ** 4


@dataclass(frozen=True)
class Guidance:
    """Health guidance caution zone for one exposure time, made by `health_guidance`.

    Parameters
    ----------
    low, high : ends of the zone, in the unit of `value`
    value : what is compared with them: k aw in m/s2, or eVDV in m/s^1.75
    zone : "below", "caution" or "above"
    """

    low: float
    high: float
    value: float
    zone: str


def health_guidance(weighted_rms: float, exposure: float) -> dict[str, Guidance]:
    """Caution zones of ISO 2631-1:1997, Annex B, by r.m.s. (B.1) and by dose (B.2).

    Parameters
    ----------
    weighted_rms : k aw of the worst axis, m/s2, >= 0
    exposure : s per day, > 0 .. 86400. The zones are meant for 4 h to 8 h.

    Returns
    -------
    dict
        "rms" and "vdv", each a `Guidance`. The ends of the first are recalled, not read.

    Examples
    --------
    >>> from seatdyn.standards.exposure import health_guidance
    >>> zones = health_guidance(0.6, 8 * 3600.0)
    >>> print(zones["rms"].zone, f"{zones['rms'].low:.2f} .. {zones['rms'].high:.2f} m/s2")
    caution 0.43 .. 0.87 m/s2
    """
    a = number(weighted_rms, "weighted_rms", A8, minimum=0.0, maximum=1e6, error=RequestError)
    t = number(exposure, "exposure", "s", minimum=1.0, maximum=DAY, error=RequestError)
    fall = math.sqrt(min(1.0, ZONE_FLAT_UNTIL.value / t))
    ends = {
        "rms": [ZONE_RMS[end].value * fall for end in ("low", "high")],
        "vdv": [ZONE_VDV[end].value for end in ("low", "high")],
    }
    values = {"rms": a, "vdv": estimated_vdv(a, t)}
    return {name: _guidance(ends[name], values[name]) for name in values}


def _guidance(ends: list[float], value: float) -> Guidance:
    low, high = ends
    zone = "below" if value < low else "caution" if value <= high else "above"
    return Guidance(low, high, value, zone)


def comfort_reaction(total_value: float) -> list[str]:
    """Likely reactions in public transport, one or two, ISO 2631-1:1997, C.2.3.

    Parameters
    ----------
    total_value : vibration total value of the comfort weighting, m/s2, >= 0

    Examples
    --------
    >>> from seatdyn.standards.exposure import comfort_reaction
    >>> comfort_reaction(0.9)
    ['fairly uncomfortable', 'uncomfortable']
    """
    a = number(total_value, "total_value", A8, minimum=0.0, maximum=1e6, error=RequestError)
    return [text for low, high, text in COMFORT if low <= a < high]
