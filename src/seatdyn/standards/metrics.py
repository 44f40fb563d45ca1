"""What a weighted acceleration amounts to: r.m.s., running r.m.s., VDV, and when which is enough.

With a(t) the weighted acceleration over a time T (ISO 2631-1:1997, clause 6; ISO 8041-1:2017):

    r.m.s.        aw  = [1/T int a^2 dt]^(1/2)
    running       aw(t0) = [1/tau int_{t0-tau}^{t0} a^2 dt]^(1/2)                 linear
                  aw(t0) = [1/tau int_{-inf}^{t0} a^2 e^((t-t0)/tau) dt]^(1/2)    exponential
    MTVV          largest aw(t0), tau = 1 s
    VDV           [int a^4 dt]^(1/4), m/s^1.75;   estimate eVDV = 1.4 aw T^(1/4)
    MSDV          [int a^2 dt]^(1/2), m/s^1.5, of the Wf-weighted acceleration
    crest factor  largest |a| / aw
    total value   av = [sum (k a)^2]^(1/2)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import RequestError
from seatdyn.standards.source import Constant, Grade
from seatdyn.standards.weighting import checked_samples
from seatdyn.units import RATE, number, suggestion

Array = NDArray[np.float64]
Running = Literal["linear", "exponential"]

MTVV_TIME = Constant(1.0, "s", "ISO 2631-1:1997, 6.3.1", Grade.CHECKED)
EVDV_FACTOR = Constant(1.4, "1", "ISO 2631-1:1997, Annex B, B.3.2", Grade.FOUND)
CREST_LIMIT = Constant(9.0, "1", "ISO 2631-1:1997, 6.2.1", Grade.FOUND)
MTVV_LIMIT = Constant(1.5, "1", "ISO 2631-1:1997, 6.3.3", Grade.RECALLED)
VDV_LIMIT = Constant(1.75, "1", "ISO 2631-1:1997, 6.3.3", Grade.RECALLED)
SICKNESS = Constant(1 / 3, "% s1.5/m", "ISO 2631-1:1997, Annex D", Grade.RECALLED)

_HEALTH, _COMFORT = "ISO 2631-1:1997, 7.2.3", "ISO 2631-1:1997, 8.2.2 and 8.2.3"


def _factors(clause: str, grade: Grade, unit: str = "1", **axes: float) -> dict[str, Constant]:
    return {axis: Constant(k, unit, clause, grade) for axis, k in axes.items()}


# Weights of the axes in a total value, by purpose.
AXIS_FACTORS: dict[str, dict[str, Constant]] = {
    "health": _factors(_HEALTH, Grade.CHECKED, x=1.4, y=1.4, z=1.0),
    "comfort seat": _factors(_COMFORT, Grade.FOUND, x=1.0, y=1.0, z=1.0),
    "comfort backrest": _factors(_COMFORT, Grade.FOUND, x=0.8, y=0.5, z=0.4),
    "comfort feet": _factors(_COMFORT, Grade.FOUND, x=0.25, y=0.25, z=0.40),
    "comfort rotation": _factors(_COMFORT, Grade.RECALLED, "m/rad", x=0.63, y=0.40, z=0.20),
}
# Weighting of each axis on a seat.
SEAT_WEIGHTINGS = {"x": "Wd", "y": "Wd", "z": "Wk"}


def rms(weighted: ArrayLike) -> Array:
    """Root mean square along the last axis, in the unit of the samples."""
    a = checked_samples(weighted)
    return np.asarray(np.sqrt(np.mean(a * a, axis=-1)))


def running_rms(
    weighted: ArrayLike,
    rate: float,
    *,
    tau: float = MTVV_TIME.value,
    kind: Running = "linear",
) -> Array:
    """R.m.s. over the last `tau` seconds, at every sample; before the record there is nothing.

    Parameters
    ----------
    weighted : along the last axis
    rate : samples per second, Hz
    tau : integration time, s, at least one sample
    kind : "linear", every sample in the window alike, or "exponential", recent ones more

    Returns
    -------
    numpy.ndarray
        Of the shape and in the unit of `weighted`.
    """
    a = checked_samples(weighted)
    rate = number(rate, "rate", "Hz", **RATE, error=RequestError)
    tau = number(tau, "tau", "s", minimum=1 / rate, maximum=1e9, error=RequestError)
    square = a * a
    if kind == "exponential":
        from scipy.signal import lfilter

        kept = math.exp(-1 / (rate * tau))
        return np.asarray(np.sqrt(lfilter([1 - kept], [1.0, -kept], square, axis=-1)))
    if kind != "linear":
        raise RequestError(f"kind = {kind!r} is not allowed; use 'linear' or 'exponential'.")
    whole, part = divmod(rate * tau, 1.0)
    total = np.cumsum(square, axis=-1)
    # what was summed up to one window ago, between two samples where tau is no multiple of 1/rate
    before = (1 - part) * _delayed(total, int(whole)) + part * _delayed(total, int(whole) + 1)
    return np.asarray(np.sqrt(np.maximum(total - before, 0.0) / (rate * tau)))


def _delayed(values: Array, by: int) -> Array:
    """Values shifted to later samples, zeros before them."""
    shifted = np.zeros_like(values)
    if by < values.shape[-1]:
        shifted[..., by:] = values[..., : values.shape[-1] - by]
    return shifted


def mtvv(weighted: ArrayLike, rate: float, *, kind: Running = "linear") -> Array:
    """Maximum transient vibration value: largest running r.m.s. with tau = 1 s."""
    return np.asarray(np.max(running_rms(weighted, rate, kind=kind), axis=-1))


def vdv(weighted: ArrayLike, rate: float) -> Array:
    """Vibration dose value of the record, m/s^1.75."""
    a = checked_samples(weighted)
    rate = number(rate, "rate", "Hz", **RATE, error=RequestError)
    square = a * a  # a power takes ten times as long
    return np.asarray((np.sum(square * square, axis=-1) / rate) ** 0.25)


def combined_vdv(values: ArrayLike) -> float:
    """VDV of several parts of a day after one another, m/s^1.75: [sum VDV_i^4]^(1/4)."""
    return float(np.sum(checked_samples(values) ** 4) ** 0.25)


def estimated_vdv(weighted_rms: float, duration: float) -> float:
    """Return eVDV = 1.4 aw T^(1/4), m/s^1.75, for steady vibration with a low crest factor."""
    return float(EVDV_FACTOR.value * weighted_rms * duration**0.25)


def motion_sickness_dose(weighted: ArrayLike, rate: float) -> Array:
    """MSDV in m/s^1.5 of a vertical acceleration weighted by Wf."""
    a = checked_samples(weighted)
    rate = number(rate, "rate", "Hz", **RATE, error=RequestError)
    return np.asarray(np.sqrt(np.sum(a * a, axis=-1) / rate))


def vomiting_share(dose: float) -> float:
    """Share of unadapted adults of both sexes who vomit, %, from the MSDV in m/s^1.5."""
    return min(100.0, SICKNESS.value * dose)


def total_value(values: Mapping[str, float], purpose: str = "health") -> float:
    """Vector sum over the axes, [sum (k a)^2]^(1/2), in the unit of `values`.

    Parameters
    ----------
    values : weighted value of each axis measured, such as ``{"x": 0.2, "z": 0.5}``
    purpose : "health", "comfort seat", "comfort backrest", "comfort feet" or "comfort rotation"

    Raises
    ------
    RequestError
        An unknown purpose or axis.

    Examples
    --------
    >>> from seatdyn.standards.metrics import total_value
    >>> print(round(total_value({"x": 0.3, "y": 0.4, "z": 0.0}), 3))
    0.7
    """
    if purpose not in AXIS_FACTORS:
        raise RequestError(
            f"purpose = {purpose!r} is not known. {suggestion(str(purpose), AXIS_FACTORS)}"
        )
    factors = AXIS_FACTORS[purpose]
    for axis in values:
        if axis not in factors:
            raise RequestError(f"axis {axis!r} is not known; use {', '.join(factors)}.")
    return math.sqrt(sum((factors[axis].value * a) ** 2 for axis, a in values.items()))


@dataclass(frozen=True)
class Metrics:
    """One weighted acceleration in numbers; made by `metrics`.

    Parameters
    ----------
    duration : s
    rms : m/s2
    peak : largest absolute value, m/s2
    crest_factor : peak over r.m.s.
    mtvv : m/s2, linear running r.m.s. over 1 s
    vdv, evdv : m/s^1.75, over `duration`
    msdv : m/s^1.5; a motion sickness dose where the weighting was Wf
    """

    duration: float
    rms: float
    peak: float
    crest_factor: float
    mtvv: float
    vdv: float
    evdv: float
    msdv: float

    @property
    def mtvv_ratio(self) -> float:
        """MTVV / aw; above 1.5 the r.m.s. alone does not do."""
        return self.mtvv / self.rms if self.rms > 0.0 else math.nan

    @property
    def vdv_ratio(self) -> float:
        """VDV / (aw T^(1/4)); above 1.75 the r.m.s. alone does not do. Sine 1.107, Gauss 1.316."""
        return self.vdv / (self.rms * self.duration**0.25) if self.rms > 0.0 else math.nan

    @property
    def reasons(self) -> list[str]:
        """Why metrics beside the r.m.s. are needed; empty where it is enough."""
        found = []
        for name, value, limit in (
            ("crest factor", self.crest_factor, CREST_LIMIT),
            ("MTVV / r.m.s.", self.mtvv_ratio, MTVV_LIMIT),
            ("VDV / (r.m.s. T^1/4)", self.vdv_ratio, VDV_LIMIT),
        ):
            if value > limit.value:
                found.append(f"{name} = {value:.3g} exceeds {limit.value:g} ({limit.clause})")
        return found


def metrics(weighted: ArrayLike, rate: float) -> Metrics:
    """Every metric of one weighted acceleration.

    Parameters
    ----------
    weighted : weighted acceleration, m/s2, one channel
    rate : samples per second, 1e-3 .. 1e7 Hz

    Returns
    -------
    Metrics
        With `reasons`, why the r.m.s. alone may understate what it does to a person.

    Raises
    ------
    RequestError
        Not one channel, not finite, or a rate outside its range.

    Examples
    --------
    >>> import numpy as np, seatdyn as sd
    >>> t = np.arange(0.0, 100.0, 1e-3)
    >>> m = sd.metrics(np.sin(2 * np.pi * t), 1000.0)
    >>> print(f"{m.rms:.4f} {m.vdv:.4f} {m.vdv_ratio:.4f} {m.reasons}")
    0.7071 2.4746 1.1067 []
    """
    a = checked_samples(weighted)
    if a.ndim != 1:
        raise RequestError(f"samples has shape {a.shape}; give one channel at a time.")
    duration, value = a.size / number(rate, "rate", "Hz", **RATE, error=RequestError), float(rms(a))
    peak = float(np.max(np.abs(a)))
    # a record shorter than a second has no running value over one
    longest = float(mtvv(a, rate)) if rate * MTVV_TIME.value >= 1.0 else math.nan
    return Metrics(
        duration=duration,
        rms=value,
        peak=peak,
        crest_factor=peak / value if value > 0.0 else math.nan,
        mtvv=longest,
        vdv=float(vdv(a, rate)),
        evdv=estimated_vdv(value, duration),
        msdv=float(motion_sickness_dose(a, rate)),
    )
