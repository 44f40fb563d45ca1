"""What a measured (or simulated) record says about the person on the seat, and about the seat."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import seatdyn
from seatdyn.errors import MeasurementError, MeasurementWarning, RequestError, Status
from seatdyn.signals.estimators import (
    FEWEST_SEGMENTS,
    band_rms,
    clock_drift,
    delay,
    power_density,
    third_octaves,
    transfer_function,
)
from seatdyn.signals.measurement import Measurement, doubts, require_same_clock
from seatdyn.standards.exposure import (
    ACTION_VALUES,
    DAY,
    LIMIT_VALUES,
    WORKING_DAY,
    Task,
    comfort_reaction,
    daily_exposure,
    health_guidance,
    time_to_reach,
)
from seatdyn.standards.metrics import (
    AXIS_FACTORS,
    MTVV_TIME,
    SEAT_WEIGHTINGS,
    metrics,
    running_rms,
    total_value,
)
from seatdyn.standards.weighting import weighting
from seatdyn.units import number, suggestion

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

POINTS = {
    "seat_surface": "seat surface, between cushion and occupant",
    "seat_frame": "seat frame, below the cushion: the ratios to the floor are no SEAT factors",
}
RESOLUTION = 0.125  # Hz, of densities and transmissibility, where the record is long enough
COARSEST = 1.0  # Hz; a record too short for it gets neither
UPPERMOST = 80.0  # Hz, what a weighting for the whole body reaches
LOWEST_RATE = 2.0  # Hz; a record with less holds no vibration that a person would feel
LARGEST_DRIFT = 0.01  # s between the clocks of floor and seat
LARGEST_DELAY = 0.5  # s; no suspension answers later
MOST_CURVE_POINTS = 2000  # of a running r.m.s.
NOTE = (
    "An evaluation by formulas that these standards give, as far as they could be found; it is no "
    "certificate and does not replace the standards."
)


def assess(
    record: Measurement,
    seat: Mapping[str, str] | None = None,
    *,
    floor: Mapping[str, str] | None = None,
    floor_record: Measurement | None = None,
    exposure: float = WORKING_DAY,
    point: str = "seat_surface",
    weightings: Mapping[str, str] | None = None,
) -> xr.Dataset:
    """Weighted metrics, daily exposure and, with a floor channel, the seat's isolation.

    Parameters
    ----------
    record : measured with `read_measurement`, or a `Measurement` of simulated accelerations
    seat : channel of each axis, such as ``{"x": "seat x", "z": "seat z"}``; without it the only
        channel is axis z
    floor : channel of the same axes below the seat
    floor_record : where the floor channels are, if not in `record`
    exposure : time per day, s, for A(8) and the daily VDV; 8 h without it
    point : where the seat was measured: "seat_surface" or "seat_frame"
    weightings : of an axis, if not Wk for z and Wd for x and y

    Returns
    -------
    xarray.Dataset
        Over `axis`, of the weighted acceleration, its mean removed: `weighted_rms`, `peak`, `mtvv`
        in m/s2, `vdv`, `evdv` in m/s1.75, `crest_factor`, `mtvv_ratio`, `vdv_ratio`; with k of
        health `a8` in m/s2 and `daily_vdv` in m/s1.75; `time_to_action`, `time_to_limit` in s per
        day. `band_rms` (axis, band) and, unless the record is too short, `density` (axis,
        frequency) of the unweighted acceleration, `running_rms` (axis, time).

        With `floor`: `floor_weighted_rms`, `floor_vdv`, the SEAT factors `seat_rms` and `seat_vdv`,
        `floor_band_rms`, and `transmissibility` (H1, complex), `coherence`, `random_error`
        and the effective number of `averages`.

        Attributes: `status`, `point`, `warnings` and `reasons` (why more than the r.m.s. is
        needed), both JSON lists; `a8_verdict`, `vdv_verdict`, `guidance_rms`, `guidance_vdv`,
        `comfort`; what it was made from.

    Raises
    ------
    MeasurementError
        An unknown or constant channel, less than 2 samples per second, or floor and seat with
        different clocks.
    RequestError
        An unknown axis, point or weighting; an exposure outside 0 .. 24 h.

    Warns
    -----
    MeasurementWarning
        A channel that looks clipped or in the wrong unit, clocks that drift apart, a low rate, a
        short record, a floor that is the seat.

    Examples
    --------
    >>> import numpy as np, seatdyn as sd
    >>> t = np.arange(0.0, 60.0, 0.002)
    >>> floor = np.sin(2 * np.pi * 4.0 * t)
    >>> record = sd.Measurement({"floor": floor, "seat": 0.5 * floor}, rate=500.0)
    >>> result = sd.assess(record, {"z": "seat"}, floor={"z": "floor"}, exposure=4 * 3600.0)
    >>> print(f"{float(result.weighted_rms.sel(axis='z')):.3f}", result.attrs["a8_verdict"])
    0.342 below action value
    >>> print(f"{float(result.seat_rms.sel(axis='z')):.3f}")
    0.500
    """
    import xarray as xr

    channels = _channels(record, seat)
    if record.rate < LOWEST_RATE:
        raise MeasurementError(
            f"The record has {record.rate:.4g} samples per second; to be assessed it needs at "
            f"least {LOWEST_RATE:g}. If its time is in ms and does not say so, write the unit into "
            "the header, such as 'time [ms]'."
        )
    chosen = {**SEAT_WEIGHTINGS, **(weightings or {})}
    if point not in POINTS:
        raise RequestError(f"point = {point!r} is not known. {suggestion(str(point), POINTS)}")
    number(exposure, "exposure", "s", minimum=1.0, maximum=DAY, error=RequestError)
    found: list[str] = []
    parts = []
    for axis, name in channels.items():
        samples = record[name]
        found += doubts(samples, name, record.unit)
        parts.append(_of_channel(samples, record.rate, chosen[axis], axis, exposure))
    if record.rate < 2 * UPPERMOST:
        found.append(
            f"The record has {record.rate:.4g} samples per second: nothing above "
            f"{record.rate / 2:.4g} Hz is in it, and the weightings reach {UPPERMOST:g} Hz."
        )
    if record.duration < MTVV_TIME.value:
        found.append(
            f"The record lasts {record.duration:.3g} s, less than the {MTVV_TIME.value:g} s of "
            "the running r.m.s.: MTVV is too small."
        )
    if floor is not None:
        below = record if floor_record is None else floor_record
        require_same_clock(below, record)
        for part, (axis, name) in zip(parts, channels.items(), strict=True):
            if axis not in floor:
                raise RequestError(f"floor has no channel of axis {axis!r}; it has {list(floor)}.")
            samples = below[floor[axis]]
            found += doubts(samples, floor[axis], below.unit)
            if np.array_equal(samples, record[name]):
                found.append(
                    f"Floor {floor[axis]!r} and seat {name!r} are the same samples; choose two "
                    "channels, or SEAT is 1 whatever the seat."
                )
            found += _clock_doubts(samples, record[name], record.rate)
            part |= _isolation(samples, record[name], record.rate, chosen[axis], part)
    if any("density" not in part for part in parts):
        found.append(
            f"The record lasts {record.duration:.3g} s; that is too short for densities and "
            "transmissibilities."
        )
    for message in found:
        warnings.warn(message, MeasurementWarning, stacklevel=2)
    data = xr.concat([_dataset(part, RATIOS[point]) for part in parts], "axis").assign_coords(
        axis=list(channels)
    )
    attrs = {
        "status": Status.OK.value,
        "note": NOTE,
        "point": POINTS[point],
        "duration": record.duration,
        "rate": record.rate,
        "exposure": exposure,
        "source": record.source,
        "unit_of_source": record.unit,
        "weightings": json.dumps({axis: chosen[axis] for axis in channels}),
        "channels": json.dumps(channels),
        "floor_channels": json.dumps(dict(floor or {})),
        "warnings": json.dumps(found),
        "reasons": json.dumps({a: p["reasons"] for a, p in zip(channels, parts, strict=True)}),
        "seatdyn_version": seatdyn.__version__,
    }
    return data.assign_attrs(attrs | _verdicts(data, record.duration, exposure))


def _channels(record: Measurement, seat: Mapping[str, str] | None) -> dict[str, str]:
    if seat is None:
        if len(record.channels) != 1:
            raise RequestError(
                f"The record has {len(record.channels)} channels ({', '.join(record.channels)}); "
                "say which one is which axis, such as {'z': '...'}."
            )
        return {"z": next(iter(record.channels))}
    for axis in seat:
        if axis not in SEAT_WEIGHTINGS:
            raise RequestError(f"axis {axis!r} is not known; use x, y, z.")
    if not seat:
        raise RequestError("seat names no channel; give one such as {'z': '...'}.")
    return dict(seat)


def _of_channel(
    samples: Array, rate: float, name: str, axis: str, exposure: float
) -> dict[str, Any]:
    """Everything that one seat channel gives."""
    moving = samples - samples.mean()
    weighted = weighting(name).apply(moving, rate)
    found = metrics(weighted, rate)
    day = daily_exposure(
        [Task(axis, exposure, {axis: found.rms}, {axis: found.vdv}, found.duration)]
    )
    running = running_rms(weighted, rate)
    step = math.ceil(running.size / MOST_CURVE_POINTS)
    part: dict[str, Any] = {key: value for key, value in asdict(found).items() if key != "msdv"}
    part["weighted_rms"] = part.pop("rms")
    part |= {
        "mtvv_ratio": found.mtvv_ratio,
        "vdv_ratio": found.vdv_ratio,
        "reasons": found.reasons,
        "a8": day.a8[axis],
        "daily_vdv": day.vdv[axis],
        "time_to_action": time_to_reach(found.rms, axis, ACTION_VALUES["a8"].value),
        "time_to_limit": time_to_reach(found.rms, axis, LIMIT_VALUES["a8"].value),
        "band_rms": band_rms(moving, rate),
        "weighted_band_rms": band_rms(weighted, rate),
        # the largest value of every stretch, so that the curve keeps its top
        "running_rms": np.maximum.reduceat(running, np.arange(0, running.size, step)),
        "time": np.arange(0, running.size, step) / rate,
    }
    resolution = _resolution(found.duration)
    if resolution is not None:
        density = power_density(moving, rate, resolution=resolution)
        part |= {"frequency": density.frequency, "density": density.value}
    return part


def _isolation(
    floor: Array, seat: Array, rate: float, name: str, above: Mapping[str, Any]
) -> dict[str, Any]:
    """What a floor channel adds to that of the seat above it."""
    moving = floor - floor.mean()
    below = metrics(weighting(name).apply(moving, rate), rate)
    part: dict[str, Any] = {
        "floor_weighted_rms": below.rms,
        "floor_vdv": below.vdv,
        "seat_rms": above["weighted_rms"] / below.rms,
        "seat_vdv": above["vdv"] / below.vdv,
        "floor_band_rms": band_rms(moving, rate),
    }
    resolution = _resolution(below.duration)
    if resolution is not None:
        h1 = transfer_function(floor, seat, rate, resolution=resolution)
        part |= {
            "transmissibility": h1.value,
            "coherence": h1.coherence,
            "random_error": h1.random_error,
            "averages": h1.averages,
        }
    return part


def _resolution(duration: float) -> float | None:
    """As fine as `RESOLUTION` where twice the fewest segments leave it; None if too short."""
    resolution = max(RESOLUTION, 2 * FEWEST_SEGMENTS / duration)
    return resolution if resolution <= COARSEST else None


def _clock_doubts(floor: Array, seat: Array, rate: float) -> list[str]:
    """Whether what connects floor and seat changes its delay, or is too late to be a seat."""
    found = []
    late = delay(floor, seat, rate)
    if abs(late) > LARGEST_DELAY:
        found.append(
            f"The seat follows the floor {late:.3g} s later, longer than a suspension takes: the "
            "two were not started together. Cut them to the same stretch of time."
        )
    drift = clock_drift(floor, seat, rate)
    if abs(drift) > LARGEST_DRIFT:
        found.append(
            f"The delay from floor to seat changes by {1e3 * drift:.3g} ms during the record: "
            "their clocks drift apart. Transmissibility and coherence suffer; SEAT does not."
        )
    return found


UNITS = {
    "duration": "s",
    "crest_factor": "1",
    "vdv": "m/s1.75",
    "evdv": "m/s1.75",
    "mtvv_ratio": "1",
    "vdv_ratio": "1",
    "daily_vdv": "m/s1.75",
    "time_to_action": "s",
    "time_to_limit": "s",
    "floor_vdv": "m/s1.75",
    "seat_rms": "1",
    "seat_vdv": "1",
    "density": "(m/s2)2/Hz",
    "transmissibility": "1",
    "coherence": "1",
    "random_error": "1",
    "averages": "1",
}
OTHERS = "m/s2"
RATIOS = {"seat_surface": "SEAT factor", "seat_frame": "seat frame over floor"}
LONG_NAMES = {
    "a8": "A(8), k included",
    "daily_vdv": "daily VDV, k included",
    "time_to_action": "exposure per day that reaches the action value",
    "time_to_limit": "exposure per day that reaches the limit value",
}


def _dataset(part: Mapping[str, Any], ratio: str) -> xr.Dataset:
    """One axis as a Dataset with units."""
    import xarray as xr

    coords = {
        "band": ("band", third_octaves(), {"units": "Hz", "long_name": "third octave"}),
        "time": ("time", part["time"], {"units": "s"}),
    }
    if "frequency" in part:
        coords["frequency"] = ("frequency", part["frequency"], {"units": "Hz"})
    texts = LONG_NAMES | {"seat_rms": f"{ratio} (r.m.s.)", "seat_vdv": f"{ratio} (VDV)"}
    data = {}
    for name, value in part.items():
        if name in ("time", "frequency", "reasons", "duration"):
            continue
        dims = () if np.ndim(value) == 0 else ("band",) if "band" in name else ("frequency",)
        if name == "running_rms":
            dims = ("time",)
        text = texts.get(name, name.replace("_", " "))
        data[name] = (dims, value, {"units": UNITS.get(name, OTHERS), "long_name": text})
    return xr.Dataset(data, coords)


def _verdicts(data: xr.Dataset, duration: float, exposure: float) -> dict[str, Any]:
    """Judgements on all axes together."""
    rms = {str(axis): float(data.weighted_rms.sel(axis=axis)) for axis in data.axis.values}
    vdv = {axis: float(data.vdv.sel(axis=axis)) for axis in rms}
    day = daily_exposure([Task("record", exposure, rms, vdv, duration)])
    worst = max(AXIS_FACTORS["health"][axis].value * value for axis, value in rms.items())
    guidance = health_guidance(worst, exposure)
    overall = total_value(rms, "comfort seat")
    return {
        "worst_axis": day.largest()[0],
        "a8_verdict": day.verdict("a8"),
        "vdv_verdict": day.verdict("vdv"),
        "guidance_rms": guidance["rms"].zone,
        "guidance_vdv": guidance["vdv"].zone,
        "total_value": overall,
        "comfort": " / ".join(comfort_reaction(overall)),
    }
